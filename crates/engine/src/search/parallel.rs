//! Loops on all threads, or on the present one if it works alone (`sharing`). Their bodies are behind
//! pointers, so that the machinery of a loop is compiled once for the types of its data, not for each search
//! and each combination of features: a body is a task, or a particle where each takes a microsecond.

use rayon::prelude::*;

use crate::search::sharing::least_items;

/// The body of a loop with results. Its first argument is the working space of its task.
type Body<'a, S, T, R> = &'a (dyn Fn(&mut S, T) -> R + Sync);
/// The body of a loop over parts of an array. The index is that of the first element.
type OfPart<'a, T> = &'a (dyn Fn(usize, &mut [T]) + Sync);
/// That of a loop over parts of two arrays.
type OfBoth<'a, A, B> = &'a (dyn Fn(usize, &mut [A], &mut [B]) + Sync);

/// Calls `body` with all indices below `count`, each as a task of its own.
pub(crate) fn for_each(count: usize, body: &(dyn Fn(usize) + Sync)) {
    let items = least_items();
    (0..count).into_par_iter().with_min_len(items).with_max_len(items).for_each(body);
}

/// The results for all items, in their order.
pub(crate) fn map<T: Send, S, R: Send>(
    items: Vec<T>,
    space: &(dyn Fn() -> S + Sync),
    body: Body<S, T, R>,
) -> Vec<R> {
    items.into_par_iter().with_min_len(least_items()).map_init(space, body).collect()
}

/// The results for the particles `first` to `end` − 1, in this order.
pub(crate) fn map_particles<S, R: Send>(
    [first, end]: [u32; 2],
    space: &(dyn Fn() -> S + Sync),
    body: Body<S, u32, R>,
    results: &mut Vec<R>,
) {
    (first..end).into_par_iter().with_min_len(least_items()).map_init(space, body).collect_into_vec(results);
}

/// The results for parts of this size, in their order.
pub(crate) fn map_parts<T: Sync, R: Send>(
    data: &[T],
    size: usize,
    body: &(dyn Fn(&[T]) -> R + Sync),
) -> Vec<R> {
    data.par_chunks(size).with_min_len(least_items()).map(body).collect()
}

/// The results for parts of this size, in their order, which are changed. The index is that of the part.
pub(crate) fn map_parts_mut<T: Send, S, R: Send>(
    data: &mut [T],
    size: usize,
    space: &(dyn Fn() -> S + Sync),
    body: &(dyn Fn(&mut S, usize, &mut [T]) -> R + Sync),
) -> Vec<R> {
    let parts = data.par_chunks_mut(size).with_min_len(least_items()).enumerate();
    parts.map_init(space, |space, (k, part)| body(space, k, part)).collect()
}

/// Changes parts of this size.
pub(crate) fn change_parts<T: Send>(data: &mut [T], size: usize, body: OfPart<T>) {
    let parts = data.par_chunks_mut(size).with_min_len(least_items());
    parts.enumerate().for_each(|(k, part)| body(k * size, part));
}

/// Changes parts of this size of two arrays.
pub(crate) fn change_both<A: Send, B: Send>(a: &mut [A], b: &mut [B], size: usize, body: OfBoth<A, B>) {
    let parts = a.par_chunks_mut(size).zip(b.par_chunks_mut(size)).with_min_len(least_items());
    parts.enumerate().for_each(|(k, (a, b))| body(k * size, a, b));
}
