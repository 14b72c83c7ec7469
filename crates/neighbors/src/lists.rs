//! Neighbor lists: for every particle the particles within a range around it.

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    Axis, Crossing, Flight, Geometry, Offsets, Packed, Search, Shift,
    bins::{Bins, Point},
    memory::{prefetch_at, with_huge_pages},
    shell::{half_skin, words_per_list},
    walls::WallTable,
};

/// Pairs are listed at distances larger by this factor than needed, so that rounding of an exit time can
/// never bring two particles into contact before they are neighbors.
const MARGIN: f64 = 1.0 + 1e-9;
/// Bit of a header: the other bits are the index of a list in `Lists::overflow`.
const OVERFLOW: u32 = 1 << 31;
/// Inverse of the fraction of lists in `overflow` above which all lists are lengthened.
const OVERFLOW_PART: usize = 32;
/// Largest number of words of a list in the table.
const MAX_WORDS: usize = 64;
/// Lists with more entries than this are compared by sorting.
const MANY: usize = 256;
/// A new reference position is ahead of its particle by this fraction of half of the skin. The exit is then
/// later if mean free paths are longer than half of the skin, and hardly earlier if they are short.
const AHEAD: f64 = 0.5;
/// Number of steps of the iteration for the exit of a curved flight.
const STEPS: usize = 8;

/**
Neighbor lists.

The cell of a particle is a sphere around its *reference position*: its position when its list was made, or a
little ahead of that. The radius of the sphere is half of the skin. Two particles are in each other's lists if
their reference positions are closer than contact distance and skin: they cannot touch before one of them has
left its sphere. A crossing is the exit from the sphere. It moves the reference position to the particle, and
updates its own list and those of the partners lost and gained. All other lists remain.

All lists have the same number of words. A list that needs more, or contains an image far from the box, is
stored in `overflow`.
*/
#[derive(Debug, Clone)]
pub struct Lists {
    axes: [Axis; 3],
    lengths: [f64; 3],
    /// Half of the skin, and its square [length], [length²].
    half_skin: f64,
    half_skin2: f64,
    /// Margin for the rounding of coordinates [length].
    slack: f64,
    /// Contact distance if all radii are equal, otherwise the radii [length].
    reach: f64,
    radii: Vec<f64>,
    /// The reference positions.
    bins: Bins,
    /// Per particle a header (its number of entries, or the index of a list in `overflow`) and its entries.
    words: Vec<Packed>,
    /// Index in `words` of the first list, at the start of a cache line, and number of words per list.
    base: usize,
    stride: usize,
    overflow: Vec<Vec<(u32, Shift)>>,
    /// Indices in `overflow` that no list uses.
    free_overflow: Vec<u32>,
    offsets: Offsets,
    /// Candidates that the last crossing has added.
    added: Vec<(u32, Shift)>,
    /// Working space.
    found: Vec<(u32, Shift)>,
    walls: WallTable,
}

impl Lists {
    /// Largest number of particles that lists support.
    pub const MAX_PARTICLES: usize = Packed::MAX_PARTICLES;

    /// Index in `words` of the header of the list of i.
    #[inline]
    fn list_start(&self, i: u32) -> usize {
        self.base + i as usize * self.stride
    }

    /// Square of the distance of reference positions below which i and j are neighbors.
    #[inline]
    fn cutoff2(&self, i: u32, j: u32) -> f64 {
        let sigma =
            if self.radii.is_empty() { self.reach } else { self.radii[i as usize] + self.radii[j as usize] };
        let cutoff = (sigma + 2.0 * self.half_skin) * MARGIN + self.slack;
        cutoff * cutoff
    }

    /// Finds the neighbors of i from the reference positions.
    fn find(&self, i: u32, found: &mut Vec<(u32, Shift)>) {
        found.clear();
        let own = self.bins.points[i as usize];
        let margin = |sigma: f64| (sigma + 2.0 * self.half_skin) * MARGIN * MARGIN + 2.0 * self.slack;
        if self.radii.is_empty() {
            let cutoff2 = self.cutoff2(i, i);
            self.bins.near(
                own.position,
                |_| margin(self.reach),
                |j, other, d, offset| {
                    if distance2(&own, other, offset) < cutoff2 && j != i {
                        found.push((j, shift(&own, other, d)));
                    }
                },
            );
        } else {
            let range = |largest: f64| margin(self.radii[i as usize] + largest);
            self.bins.near(own.position, range, |j, other, d, offset| {
                if distance2(&own, other, offset) < self.cutoff2(i, j) && j != i {
                    found.push((j, shift(&own, other, d)));
                }
            });
        }
    }

    /// The list of i, in the table or in `overflow`.
    #[inline]
    fn visit(&self, i: u32, mut visit: impl FnMut(u32, Shift)) {
        match self.packed(i) {
            Some(list) => list.iter().for_each(|entry| visit(entry.id(), entry.shift())),
            None => self.overflow_list(i).iter().for_each(|&(j, shift)| visit(j, shift)),
        }
    }

    /// The list of i in `overflow`; empty if the list is in the table.
    fn overflow_list(&self, i: u32) -> &[(u32, Shift)] {
        let header = self.words[self.list_start(i)].word();
        if header & OVERFLOW == 0 { &[] } else { &self.overflow[(header & !OVERFLOW) as usize] }
    }

    /// Makes `list` the list of i.
    fn set(&mut self, i: u32, list: &[(u32, Shift)]) {
        let start = self.list_start(i);
        let header = self.words[start].word();
        if header & OVERFLOW != 0 {
            self.overflow[(header & !OVERFLOW) as usize].clear();
            self.free_overflow.push(header & !OVERFLOW);
        }
        let fits = write(&mut self.words[start..start + self.stride], list);
        if !fits {
            self.move_to_overflow(i, list.to_vec());
        }
    }

    /// Stores `list` as the list of i in `overflow` from now on.
    #[cold]
    fn move_to_overflow(&mut self, i: u32, list: Vec<(u32, Shift)>) {
        let free = self.free_overflow.pop().unwrap_or_else(|| {
            self.overflow.push(Vec::new());
            self.overflow.len() as u32 - 1
        });
        self.overflow[free as usize] = list;
        let start = self.list_start(i);
        self.words[start] = Packed::from_word(free | OVERFLOW);
    }

    /// Adds an entry to the list of i; true if the list has moved to `overflow` because of it.
    fn add(&mut self, i: u32, j: u32, shift: Shift) -> bool {
        let start = self.list_start(i);
        let header = self.words[start].word();
        if header & OVERFLOW != 0 {
            self.overflow[(header & !OVERFLOW) as usize].push((j, shift));
            return false;
        }
        match Packed::new(j, shift) {
            Some(entry) if (header as usize) < self.stride - 1 => {
                self.words[start + 1 + header as usize] = entry;
                self.words[start] = Packed::from_word(header + 1);
                false
            }
            _ => {
                let mut list = Vec::with_capacity(header as usize + 8);
                self.visit(i, |j, shift| list.push((j, shift)));
                list.push((j, shift));
                self.move_to_overflow(i, list);
                true
            }
        }
    }

    /// Removes an entry from the list of i.
    fn remove(&mut self, i: u32, j: u32, shift: Shift) {
        let start = self.list_start(i);
        let header = self.words[start].word();
        if header & OVERFLOW != 0 {
            let list = &mut self.overflow[(header & !OVERFLOW) as usize];
            if let Some(at) = list.iter().position(|entry| *entry == (j, shift)) {
                list.swap_remove(at);
            }
            return;
        }
        let Some(entry) = Packed::new(j, shift) else { return };
        let list = &mut self.words[start + 1..=start + header as usize];
        if let Some(at) = list.iter().position(|other| *other == entry) {
            list[at] = list[list.len() - 1];
            self.words[start] = Packed::from_word(header - 1);
        }
    }

    /// Makes `new`, a header and entries, the list of i. Updates the lists of the partners lost and gained.
    fn replace_packed(&mut self, i: u32, new: &[Packed; MAX_WORDS]) {
        let start = self.list_start(i);
        let mut old = [Packed::default(); MAX_WORDS];
        let (old, new) = (&mut old[..self.stride], &new[..self.stride]);
        old.copy_from_slice(&self.words[start..start + self.stride]);
        self.words[start..start + self.stride].copy_from_slice(new);
        let (old, new) = (&old[1..=old[0].word() as usize], &new[1..=new[0].word() as usize]);
        for entry in old.iter().filter(|entry| !contains(new, **entry)) {
            self.remove(entry.id(), i, entry.shift().map(|s| -s));
        }
        self.added.clear();
        let mut overflow = false;
        for entry in new.iter().filter(|entry| !contains(old, **entry)) {
            self.added.push((entry.id(), entry.shift()));
            overflow |= self.add(entry.id(), i, entry.shift().map(|s| -s));
        }
        if overflow {
            self.grow();
        }
    }

    /// [`Self::replace_packed`] for lists of any length.
    #[cold]
    fn replace(&mut self, i: u32, new: &mut [(u32, Shift)]) {
        let mut old = Vec::new();
        self.visit(i, |j, shift| old.push((j, shift)));
        difference(&mut old, new, |(j, shift)| {
            self.remove(j, i, shift.map(|s| -s));
        });
        let mut added = std::mem::take(&mut self.added);
        added.clear();
        difference(new, &mut old, |entry| added.push(entry));
        for &(j, shift) in &added {
            self.add(j, i, shift.map(|s| -s));
        }
        self.added = added;
        self.set(i, new);
        self.grow();
    }

    /// Lengthens all lists if many have overflowed, and moves those that fit back from `overflow`.
    fn grow(&mut self) {
        let count = self.bins.points.len();
        let overflow = self.overflow.len() - self.free_overflow.len();
        if overflow <= count / OVERFLOW_PART + 8 || self.stride >= MAX_WORDS {
            return;
        }
        let old = (std::mem::take(&mut self.words), self.base, self.stride);
        self.allocate(count, self.stride + 8);
        for i in 0..count {
            let (from, to) = (old.1 + i * old.2, self.list_start(i as u32));
            self.words[to..to + old.2].copy_from_slice(&old.0[from..from + old.2]);
        }
        for i in 0..count as u32 {
            let list = self.overflow_list(i);
            if !list.is_empty() {
                let list = list.to_vec();
                self.set(i, &list);
            }
        }
    }

    /// Allocates the table of lists, `stride` words each.
    fn allocate(&mut self, count: usize, stride: usize) {
        const LINE: usize = 16; // words
        self.stride = stride;
        self.words = with_huge_pages(count * stride + LINE);
        self.words.resize(count * stride + LINE, Packed::default());
        self.base = self.words.as_ptr().align_offset(64).min(LINE);
    }
}

/// Square of the distance from a reference position to an image of another. The bits are the same for both
/// orders, because negation is exact.
#[inline(always)]
fn distance2(own: &Point, other: &Point, offset: [f64; 3]) -> f64 {
    let r = [0, 1, 2].map(|axis| other.position[axis] - own.position[axis] + offset[axis]);
    r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
}

/// Shift between the anchor coordinates of two particles for image d of the other's reference position.
#[inline]
fn shift(own: &Point, other: &Point, d: Shift) -> Shift {
    [0, 1, 2].map(|axis| d[axis] + own.image[axis] - other.image[axis])
}

/// Writes a list into its words. False if it does not fit; the caller then sets the header to the index of an
/// overflow list.
fn write(words: &mut [Packed], list: &[(u32, Shift)]) -> bool {
    if list.len() >= words.len() {
        return false;
    }
    for (word, &(j, shift)) in words[1..].iter_mut().zip(list) {
        match Packed::new(j, shift) {
            Some(entry) => *word = entry,
            None => return false,
        }
    }
    words[0] = Packed::from_word(list.len() as u32);
    true
}

/// Whether a list has this entry. There is no early exit, so that the compiler compares whole vectors.
#[inline]
fn contains(list: &[Packed], entry: Packed) -> bool {
    list.iter().fold(false, |found, other| found | (other.word() == entry.word()))
}

/// Calls `visit` for every entry of `list` that is not in `other`. The call can reorder both.
fn difference(list: &mut [(u32, Shift)], other: &mut [(u32, Shift)], mut visit: impl FnMut((u32, Shift))) {
    if list.len().max(other.len()) <= MANY {
        list.iter().filter(|entry| !other.contains(entry)).for_each(|entry| visit(*entry));
    } else {
        other.sort_unstable();
        list.iter().filter(|entry| other.binary_search(entry).is_err()).for_each(|entry| visit(*entry));
    }
}

impl Search for Lists {
    fn new(geometry: &Geometry, positions: &[DVec3]) -> Self {
        let half_skin = half_skin(geometry, positions.len());
        let extent = geometry.lengths().into_iter().fold(0.0, f64::max);
        let mut lists = Self {
            axes: geometry.axes,
            lengths: geometry.lengths(),
            half_skin,
            half_skin2: half_skin * half_skin,
            slack: 16.0 * f64::EPSILON * extent,
            reach: geometry.reach,
            radii: geometry.radii.clone(),
            bins: Bins::new(geometry, positions, 2.0 * half_skin),
            words: Vec::new(),
            base: 0,
            stride: 0,
            overflow: Vec::new(),
            free_overflow: Vec::new(),
            offsets: Offsets::new(geometry.size),
            added: Vec::new(),
            found: Vec::new(),
            walls: WallTable::default(),
        };
        if let Some(level) = lists.bins.levels.last() {
            // Twice half of the skin, because a reference position can be beyond a wall that its particle
            // cannot pass.
            lists.walls = WallTable::new(geometry, level.n, level.width, geometry.radius + 2.0 * half_skin);
        }
        let count = positions.len();
        let mut sample = Vec::new();
        let lengths: Vec<usize> = (0..count)
            .step_by((count / 1000).max(1))
            .map(|i| {
                lists.find(i as u32, &mut sample);
                sample.len()
            })
            .collect();
        lists.allocate(count, words_per_list(lengths).min(MAX_WORDS));
        let (base, stride) = (lists.base, lists.stride);
        let mut words = std::mem::take(&mut lists.words);
        let overflow: Vec<(u32, Vec<(u32, Shift)>)> = words[base..base + count * stride]
            .par_chunks_mut(stride)
            .enumerate()
            .map_init(Vec::new, |found, (i, words)| {
                lists.find(i as u32, found);
                (!write(words, found)).then(|| (i as u32, found.clone()))
            })
            .flatten()
            .collect();
        lists.words = words;
        for (i, list) in overflow {
            lists.move_to_overflow(i, list);
        }
        lists
    }

    #[inline]
    fn candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        _now: i64,
        _position: P,
        visit: V,
    ) {
        self.visit(i, visit);
    }

    #[inline]
    fn new_candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        _i: u32,
        _code: u8,
        _now: i64,
        _position: P,
        mut visit: V,
    ) {
        self.added.iter().for_each(|&(j, shift)| visit(j, shift));
    }

    #[inline(always)]
    fn packed(&self, i: u32) -> Option<&[Packed]> {
        let start = self.list_start(i);
        let header = self.words[start].word();
        (header & OVERFLOW == 0).then(|| &self.words[start + 1..=start + header as usize])
    }

    #[inline(always)]
    fn prefetch(&self, i: u32) {
        let start = self.list_start(i);
        prefetch_at(&self.words, start);
        prefetch_at(&self.words, start + self.stride / 2);
        prefetch_at(&self.words, start + self.stride - 1);
        prefetch_at(&self.bins.points, i as usize);
    }

    #[inline(always)]
    fn offsets(&self) -> Option<&Offsets> {
        Some(&self.offsets)
    }

    #[inline(always)]
    fn walls(&self, i: u32) -> &[u16] {
        if self.walls.is_empty() {
            return &[];
        }
        let level = &self.bins.levels[self.bins.levels.len() - 1];
        self.walls.of(self.bins.bin(level, self.bins.points[i as usize].position))
    }

    #[inline(always)]
    fn next_crossing(&self, i: u32, flight: &Flight, within: f64) -> Option<Crossing> {
        let reference = &self.bins.points[i as usize];
        let image = DVec3::from_array(reference.image.map(f64::from)) * DVec3::from_array(self.lengths);
        let d = flight.position - (DVec3::from_array(reference.position) + image);
        let v = flight.velocity;
        let delay = if flight.acceleration == DVec3::ZERO {
            // A sphere is convex: a straight flight between two points inside stays inside.
            if (d + v * within).length_squared() <= self.half_skin2 && d.length_squared() <= self.half_skin2 {
                return None;
            }
            straight_exit(d, v, self.half_skin2)?
        } else {
            curved_exit(d, v, flight.acceleration, self.half_skin, within)
        };
        (delay <= within).then_some(Crossing { delay, code: 0 })
    }

    fn cross(&mut self, i: u32, _code: u8, flight: &Flight) {
        let mut found = std::mem::take(&mut self.found);
        self.bins.set(i, flight.position + flight.velocity.normalize_or_zero() * (AHEAD * self.half_skin));
        self.find(i, &mut found);
        let mut new = [Packed::default(); MAX_WORDS];
        if self.packed(i).is_some() && write(&mut new[..self.stride], &found) {
            self.replace_packed(i, &new);
        } else {
            self.replace(i, &mut found);
        }
        self.found = found;
    }

    fn rewrap(&mut self, i: u32, wraps: [i32; 3]) {
        let image = &mut self.bins.points[i as usize].image;
        for axis in 0..3 {
            if self.axes[axis] == Axis::Periodic {
                image[axis] -= wraps[axis];
            }
        }
        let mut list = Vec::new();
        self.visit(i, |j, shift| list.push((j, shift)));
        for (j, shift) in &mut list {
            let reverse = shift.map(|s| -s);
            self.remove(*j, i, reverse);
            self.add(*j, i, [reverse[0] + wraps[0], reverse[1] + wraps[1], reverse[2] + wraps[2]]);
            *shift = [shift[0] - wraps[0], shift[1] - wraps[1], shift[2] - wraps[2]];
        }
        self.set(i, &list);
    }
}

/// Time at which a straight flight from d leaves the sphere of radius² `half_skin2` around the origin; `None`
/// at rest.
#[inline]
fn straight_exit(d: DVec3, v: DVec3, half_skin2: f64) -> Option<f64> {
    let (speed2, along) = (v.length_squared(), d.dot(v));
    if speed2 == 0.0 {
        return None;
    }
    let gap = (half_skin2 - d.length_squared()).max(0.0);
    let root = (along * along + speed2 * gap).sqrt();
    // No difference of numbers of the same sign, so that no digits cancel.
    Some(if along > 0.0 { gap / (root + along) } else { (root - along) / speed2 })
}

/// A lower bound, close to the exit itself, of the time at which an accelerated flight from d leaves the
/// sphere of radius `half_skin`.
///
/// Every step advances by the least time in which the speed and the acceleration can cover the distance to
/// the surface.
fn curved_exit(d: DVec3, v: DVec3, a: DVec3, half_skin: f64, within: f64) -> f64 {
    let acceleration = a.length();
    let mut time = 0.0;
    for _ in 0..STEPS {
        let position = haff_mechanics::free_flight(d, v, a, time);
        let speed = haff_mechanics::free_flight_velocity(v, a, time).length();
        let gap = half_skin - position.length();
        if gap <= 1e-3 * half_skin || time > within {
            break;
        }
        // Root of gap = speed t + a t²/2.
        time += 2.0 * gap / (speed + (speed * speed + 2.0 * acceleration * gap).sqrt());
    }
    time
}
