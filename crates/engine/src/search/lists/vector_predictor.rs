//! The predictor of lists as the queue calls it, with vector instructions if the processor has them.

use haff_neighbors::prefetch_at;

use crate::{
    model::features::Features,
    search::{queue::Predictor, search_event::SearchEvent},
    state::{State, world::World},
};

use super::{
    Entry,
    filter::Bounds,
    predictor::{FAR_AHEAD, ListPredictor, NEARLY_DUE, Waiting, Work},
};

/// A [`ListPredictor`] with its working space, which uses vector instructions if `VECTORS` is set.
pub(super) struct VectorPredictor<'a, F, const VECTORS: bool> {
    pub predictor: &'a mut ListPredictor<F>,
    pub bounds: &'a mut [Bounds; 2],
    pub work: &'a mut Work,
}

impl<F: Features, const VECTORS: bool> VectorPredictor<'_, F, VECTORS> {
    /// The next events of two particles, predicted at the world's present time.
    #[inline(always)]
    pub fn predict_both(&mut self, world: &World, pending: &Waiting, bodies: [u32; 2]) -> [Entry; 2] {
        if world.now > self.predictor.plan.frame.end {
            self.predictor.begin(world);
        }
        self.predictor.predict_both::<VECTORS>(world, pending, bodies, self.bounds, self.work)
    }
}

impl<F: Features, const VECTORS: bool> Predictor for VectorPredictor<'_, F, VECTORS> {
    type Features = F;
    type Kind = SearchEvent;

    #[inline(always)]
    fn predict(&mut self, state: &State, i: u32) -> Entry {
        if state.world.now > self.predictor.plan.frame.end {
            self.predictor.begin(&state.world);
        }
        #[cfg(target_arch = "x86_64")]
        if VECTORS {
            // SAFETY: with `VECTORS` set the caller guarantees the features of `predict_avx2`.
            return unsafe {
                self.predictor.predict_avx2(&state.world, &state.pending, i, &mut self.bounds[0], self.work)
            };
        }
        self.predictor.predict_portable(&state.world, &state.pending, i, &mut self.bounds[0], self.work)
    }

    /// Prefetches in two steps. For the event [`FAR_AHEAD`] entries after the next one: the anchors, compact
    /// particles and lists of its particles. For the event [`NEARLY_DUE`] entries after the next one: the
    /// anchors and compact particles of the members of these lists. The sentinel has no anchor, but a
    /// prefetch beyond the last anchor has no effect.
    #[inline(always)]
    fn prefetch<'a>(&self, upcoming: impl Fn(usize) -> Option<&'a Entry>, state: &State) {
        let ListPredictor { particles, lists, prefetches, .. } = &*self.predictor;
        if let Some(entry) = upcoming(FAR_AHEAD) {
            let partner = entry.target.partner().unwrap_or(entry.owner);
            for i in [entry.owner, partner] {
                prefetch_at(&state.world.particles, i as usize);
                prefetch_at(particles, i as usize);
                lists.prefetch(i);
            }
        }
        if !prefetches {
            return;
        }
        if let Some(entry) = upcoming(NEARLY_DUE)
            && state.world.particles[entry.owner as usize].count == entry.own_count
        {
            let neighbors = |i: u32| {
                for &j in lists.of(i) {
                    prefetch_at(particles, j as usize);
                    prefetch_at(&state.world.particles, j as usize);
                }
            };
            neighbors(entry.owner);
            if let Some(j) = entry.target.partner()
                && !upcoming(NEARLY_DUE + 1).is_some_and(|next| next.mirrors(entry))
            {
                neighbors(j);
            }
        }
    }
}

impl<F: Features> ListPredictor<F> {
    /// Not inlined where it is rare, which is where there are vectors, for shorter loops of events.
    #[cfg_attr(target_arch = "x86_64", inline(never))]
    #[cfg_attr(not(target_arch = "x86_64"), inline(always))]
    pub(super) fn predict_portable(
        &self,
        world: &World,
        pending: &Waiting,
        i: u32,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> Entry {
        self.predict::<false>(world, pending, i, bounds, work)
    }

    /// Not inlined: one copy of this code keeps the loop of events short.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    #[inline(never)]
    fn predict_avx2(
        &self,
        world: &World,
        pending: &Waiting,
        i: u32,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> Entry {
        self.predict::<true>(world, pending, i, bounds, work)
    }
}
