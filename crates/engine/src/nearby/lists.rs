/*!
Neighbor lists in the coordinates of the [frame](super::frame).

A particle's place is a ball around its *center*. Two particles are in each other's list if their centers are
closer than contact distance and two ball radii: they cannot touch before one of them has left its ball. A
transfer is this exit. It moves the center to the particle, and puts right its own list and those of the
partners lost and won; all others stand.

Neighbors are decided by integer differences, so lists contain no periodic images, and nothing changes when a
particle is wrapped into the box.
*/

use glam::DVec3;
use haff_neighbors::{Axis, Geometry, prefetch_at, with_huge_pages};
use rayon::prelude::*;

use super::{
    bins::Bins,
    plan::Plan,
    sets::{LANES, MOST, all, members, place_of},
};
use crate::{compact::CompactParticle, features::Features};

/// Pairs are listed this much further away than they need be, for all that single precision rounds [largest
/// contact distances].
const SLACK: f32 = 1e-3;
/// Lists grow when more than one in this many has spilled.
const SPILLED_PART: usize = 32;

/// A center, and how many stand in its particle's list.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(16))]
struct Center {
    x: [i32; 3],
    members: u32,
}

/// A wall at rest: its unit normal, and where it is along that [largest contact distances].
#[derive(Debug, Clone, Copy)]
struct Plane {
    normal: DVec3,
    place: f64,
}

/// The walls of a geometry. One that moves, or is inclined to a periodic axis, may be anywhere.
fn planes(geometry: &Geometry) -> Vec<Plane> {
    let periodic = DVec3::from_array(geometry.axes.map(|axis| f64::from(u8::from(axis == Axis::Periodic))));
    let plane = |plane: &haff_neighbors::Plane| {
        let anywhere = plane.moving || plane.normal * periodic != DVec3::ZERO;
        let place = if anywhere { f64::INFINITY } else { plane.point.dot(plane.normal) / geometry.reach };
        Plane { normal: plane.normal, place }
    };
    geometry.planes.iter().map(plane).collect()
}

/// Neighbor lists.
#[derive(Debug, Clone, Default)]
pub(super) struct Lists {
    /// Radius of the balls [largest contact distances], and its square.
    half: f32,
    half2: f32,
    unit: [f32; 3],
    /// The same for planes, beyond single precision.
    scale: [f64; 3],
    centers: Vec<Center>,
    bins: Bins,
    /// The lists, of `stride` words each, filled up with [`Self::sentinel`]. A longer one has the index of
    /// one in `spilled` as its first word.
    words: Vec<u32>,
    stride: usize,
    spilled: Vec<Vec<u32>>,
    spare: Vec<u32>,
    found: Vec<u32>,
    planes: Vec<Plane>,
    /// Whether a particle may touch a wall before it leaves its ball; empty without walls.
    near_wall: Vec<bool>,
}

impl Lists {
    /// Lists as planned, of particles that have all just been copied at the beginning of the frame's
    /// span.
    pub fn new<F: Features>(plan: &Plan, geometry: &Geometry, particles: &[CompactParticle]) -> Self {
        let &Plan { ref frame, half, edges, spacing, members } = plan;
        let count = particles.len() - 1;
        let mut lists = Self {
            half: half as f32,
            half2: (half * half) as f32,
            unit: frame.unit,
            scale: frame.per_length.map(|per_length| 1.0 / (per_length * geometry.reach)),
            centers: with_huge_pages(count),
            planes: planes(geometry),
            bins: Bins::new(edges, frame.unit, 1.0 + 2.0 * (half + f64::from(SLACK)), spacing, count),
            ..Self::default()
        };
        for (i, compact) in particles[..count].iter().enumerate() {
            lists.centers.push(Center { x: compact.x, members: 0 });
            lists.bins.enter::<false>(i as u32, compact.x);
        }
        if !lists.planes.is_empty() {
            lists.near_wall =
                particles[..count].iter().map(|compact| lists.is_near_plane(compact.x)).collect();
        }
        let mut sample = Vec::new();
        let mut lengths: Vec<usize> = (0..count)
            .step_by((count / 1000).max(1))
            .map(|i| lists.find::<F, false, false>(i as u32, particles, &mut sample))
            .collect();
        lengths.sort_unstable();
        // A start on a lattice has no fluctuations yet.
        let most = lengths.get(lengths.len() * 99 / 100).copied().unwrap_or(0);
        lists.stride = most.max((members + 1.5 * members.sqrt()) as usize).max(1).next_multiple_of(LANES);
        lists.words = with_huge_pages(count * lists.stride);
        lists.words.resize(count * lists.stride, count as u32);
        let (mut words, stride) = (std::mem::take(&mut lists.words), lists.stride);
        let built: Vec<(u32, Option<Vec<u32>>)> = words
            .par_chunks_mut(stride)
            .enumerate()
            .map_init(Vec::new, |found, (i, words)| {
                let length = lists.find::<F, false, false>(i as u32, particles, found);
                let list = &found[..length];
                if length > words.len() {
                    return (length as u32, Some(list.to_vec()));
                }
                words[..length].copy_from_slice(list);
                (length as u32, None)
            })
            .collect();
        lists.words = words;
        for (i, (length, list)) in built.into_iter().enumerate() {
            lists.centers[i].members = length;
            if let Some(list) = list {
                lists.spill(i as u32, &list);
            }
        }
        lists
    }

    /// The sentinel that fills lists up.
    fn sentinel(&self) -> u32 {
        self.centers.len() as u32
    }

    /// The list of i, filled up to whole groups.
    #[inline(always)]
    pub fn of(&self, i: u32) -> &[u32] {
        let (place, members) = (i as usize * self.stride, self.centers[i as usize].members as usize);
        if members > self.stride {
            return &self.spilled[self.words[place] as usize];
        }
        &self.words[place..place + members.next_multiple_of(LANES)]
    }

    /// Whether particle i may touch a wall before it leaves its ball, where there are walls.
    #[inline(always)]
    pub fn is_near_wall(&self, i: u32) -> bool {
        self.near_wall[i as usize]
    }

    /// Whether the ball around a center reaches a wall, with the largest particle at its edge.
    fn is_near_plane(&self, center: [i32; 3]) -> bool {
        let place = |axis: usize| f64::from(center[axis] as u32) * self.scale[axis];
        let center = DVec3::new(place(0), place(1), place(2));
        let reach = f64::from(self.half + 0.5 + SLACK);
        self.planes.iter().any(|plane| center.dot(plane.normal) - plane.place <= reach)
    }

    /// Prefetches the list and the center of i.
    #[inline(always)]
    pub fn prefetch(&self, i: u32) {
        let place = i as usize * self.stride;
        prefetch_at(&self.words, place);
        prefetch_at(&self.words, place + self.stride - 1);
        prefetch_at(&self.centers, i as usize);
    }

    /// Where a particle is relative to its center [largest contact distances].
    #[inline(always)]
    fn off_center(&self, i: u32, compact: &CompactParticle, part: f32) -> [f32; 3] {
        let center = &self.centers[i as usize];
        let mut d = [0.0; 3];
        for axis in 0..3 {
            d[axis] = compact.x[axis].wrapping_sub(center.x[axis]) as f32 * self.unit[axis]
                + compact.v[axis] * part;
        }
        d
    }

    /// When particle i leaves its ball, counted from now; `None` if not `within` this time. Times are parts
    /// of a span.
    #[inline(always)]
    pub fn exit(&self, i: u32, compact: &CompactParticle, part: f32, within: f32) -> Option<f32> {
        let (d, v) = (self.off_center(i, compact, part), compact.v);
        let mut end = [0.0; 3];
        for axis in 0..3 {
            end[axis] = d[axis] + v[axis] * within;
        }
        // A ball is convex: who is inside now and then is inside all the time.
        if dot(end, end) <= self.half2 { None } else { self.leave_ball(d, v).filter(|delay| *delay < within) }
    }

    /// When a flight from d leaves the ball; `None` if it stands.
    #[inline(never)]
    fn leave_ball(&self, d: [f32; 3], v: [f32; 3]) -> Option<f32> {
        let (speed2, along) = (dot(v, v), dot(d, v));
        if speed2 == 0.0 {
            return None;
        }
        let gap = (self.half2 - dot(d, d)).max(0.0);
        let root = (along * along + speed2 * gap).sqrt();
        // No difference of numbers of one sign.
        Some(if along > 0.0 { gap / (root + along) } else { (root - along) / speed2 })
    }

    /// Moves the center of i to where it is at `part` of the span and `ahead` of that, and puts right all
    /// lists.
    #[inline(always)]
    pub fn transfer<F: Features, const VECTORS: bool>(
        &mut self,
        i: u32,
        particles: &[CompactParticle],
        part: f32,
        ahead: f32,
    ) {
        let compact = &particles[i as usize];
        let speed = dot(compact.v, compact.v).sqrt();
        let ahead = if speed > 0.0 { ahead * self.half / speed } else { 0.0 };
        self.bins.leave::<VECTORS>(i, self.centers[i as usize].x);
        let mut place = [0; 3];
        for axis in 0..3 {
            let way = f64::from(compact.v[axis] * (part + ahead)) / f64::from(self.unit[axis]);
            place[axis] = compact.x[axis].wrapping_add(way as i64 as i32);
        }
        self.centers[i as usize].x = place;
        if !self.planes.is_empty() {
            self.near_wall[i as usize] = self.is_near_plane(place);
        }
        let mut found = std::mem::take(&mut self.found);
        let length = self.find::<F, VECTORS, true>(i, particles, &mut found);
        self.bins.enter::<VECTORS>(i, place);
        self.replace::<VECTORS>(i, &found, length);
        self.found = found;
    }

    /// Looks for the neighbors of i among the centers, of which its own is not one if it is `OUT`. They are
    /// the first in `found`, which is longer by whole groups; returns their number.
    #[inline(always)]
    fn find<F: Features, const VECTORS: bool, const OUT: bool>(
        &self,
        i: u32,
        particles: &[CompactParticle],
        found: &mut Vec<u32>,
    ) -> usize {
        let place = self.centers[i as usize].x;
        let skin = 2.0 * self.half + SLACK;
        let reach = if F::UNIFORM { 1.0 } else { particles[i as usize].radius + 0.5 } + skin;
        let count = self.bins.near::<VECTORS>(place, reach * reach, found);
        if F::UNIFORM && OUT {
            return count;
        }
        let mut kept = 0;
        for k in 0..count {
            let j = found[k];
            let near = F::UNIFORM || {
                let reach = (particles[i as usize].radius + particles[j as usize].radius) + skin;
                let mut d = [0.0; 3];
                for axis in 0..3 {
                    d[axis] =
                        self.centers[j as usize].x[axis].wrapping_sub(place[axis]) as f32 * self.unit[axis];
                }
                dot(d, d) < reach * reach
            };
            found[kept] = j;
            kept += usize::from(near && j != i);
        }
        kept
    }

    /// Makes the first `length` of `new` the list of i, and puts right the lists of the partners lost and
    /// won.
    #[inline(always)]
    fn replace<const VECTORS: bool>(&mut self, i: u32, new: &[u32], length: usize) {
        let before = self.centers[i as usize].members as usize;
        if before.max(length) > self.stride || self.stride > MOST {
            self.replace_long(i, &new[..length]);
            return;
        }
        let place = i as usize * self.stride;
        let mut old = [0; MOST];
        old[..self.stride].copy_from_slice(&self.words[place..place + self.stride]);
        let mut lost = all(before) & !members::<VECTORS>(&old, before, &new[..length]);
        let mut won = all(length) & !members::<VECTORS>(new, length, &old[..before]);
        while lost != 0 {
            self.remove::<VECTORS>(old[lost.trailing_zeros() as usize], i);
            lost &= lost - 1;
        }
        let mut spilled = false;
        while won != 0 {
            spilled |= self.add(new[won.trailing_zeros() as usize], i);
            won &= won - 1;
        }
        let sentinel = self.sentinel();
        let (own, rest) = self.words[place..place + self.stride].split_at_mut(length);
        own.copy_from_slice(&new[..length]);
        rest.fill(sentinel);
        self.centers[i as usize].members = length as u32;
        if spilled {
            self.grow();
        }
    }

    /// The same for lists of any length.
    #[cold]
    fn replace_long(&mut self, i: u32, new: &[u32]) {
        let old = self.of(i)[..self.centers[i as usize].members as usize].to_vec();
        for j in old.iter().filter(|j| !new.contains(j)) {
            self.remove::<false>(*j, i);
        }
        for j in new.iter().filter(|j| !old.contains(j)) {
            self.add(*j, i);
        }
        self.set(i, new);
        self.grow();
    }

    /// Makes `list` the list of i.
    fn set(&mut self, i: u32, list: &[u32]) {
        let (sentinel, place) = (self.sentinel(), i as usize * self.stride);
        if self.centers[i as usize].members as usize > self.stride {
            self.spare.push(self.words[place]);
        }
        self.centers[i as usize].members = list.len() as u32;
        if list.len() > self.stride {
            self.spill(i, list);
        } else {
            let (own, rest) = self.words[place..place + self.stride].split_at_mut(list.len());
            own.copy_from_slice(list);
            rest.fill(sentinel);
        }
    }

    /// Keeps the list of i, which is too long for its place, elsewhere from now on.
    #[cold]
    fn spill(&mut self, i: u32, list: &[u32]) {
        let sentinel = self.sentinel();
        let free = self.spare.pop().unwrap_or_else(|| {
            self.spilled.push(Vec::new());
            self.spilled.len() as u32 - 1
        });
        let spilled = &mut self.spilled[free as usize];
        spilled.clear();
        spilled.extend_from_slice(list);
        spilled.resize(list.len().next_multiple_of(LANES), sentinel);
        self.words[i as usize * self.stride] = free;
    }

    /// Adds j to the list of i; true if the list has spilled because of it.
    #[inline]
    fn add(&mut self, i: u32, j: u32) -> bool {
        let place = i as usize * self.stride;
        let center = &mut self.centers[i as usize];
        let length = center.members as usize;
        center.members += 1;
        if length < self.stride {
            self.words[place + length] = j;
            return false;
        }
        self.add_to_spilled(i, j, length)
    }

    #[cold]
    fn add_to_spilled(&mut self, i: u32, j: u32, length: usize) -> bool {
        let (sentinel, place) = (self.sentinel(), i as usize * self.stride);
        if length == self.stride {
            let mut list = self.words[place..place + length].to_vec();
            list.push(j);
            self.spill(i, &list);
            return true;
        }
        let list = &mut self.spilled[self.words[place] as usize];
        if length == list.len() {
            list.resize(length + LANES, sentinel);
        }
        list[length] = j;
        false
    }

    /// Takes j out of the list of i.
    #[inline(always)]
    fn remove<const VECTORS: bool>(&mut self, i: u32, j: u32) {
        let (sentinel, place) = (self.sentinel(), i as usize * self.stride);
        let length = self.centers[i as usize].members as usize;
        if length > self.stride {
            self.remove_from_spilled(i, j);
            return;
        }
        let list = &mut self.words[place..place + self.stride];
        if let Some(at) = place_of::<VECTORS>(list, j) {
            list[at] = list[length - 1];
            list[length - 1] = sentinel;
            self.centers[i as usize].members -= 1;
        }
    }

    #[cold]
    fn remove_from_spilled(&mut self, i: u32, j: u32) {
        let mut list = self.of(i)[..self.centers[i as usize].members as usize].to_vec();
        if let Some(at) = list.iter().position(|&other| other == j) {
            list.swap_remove(at);
            self.set(i, &list);
        }
    }

    /// Gives every list more room if many have spilled.
    fn grow(&mut self) {
        let count = self.centers.len();
        if self.spilled.len() - self.spare.len() <= count / SPILLED_PART + 8 {
            return;
        }
        let lists: Vec<(u32, Vec<u32>)> = (0..count as u32)
            .filter(|&i| self.centers[i as usize].members as usize > self.stride)
            .map(|i| (i, self.of(i)[..self.centers[i as usize].members as usize].to_vec()))
            .collect();
        let before = self.stride;
        self.stride += LANES;
        // In place, from the last: both would be a quarter of all memory.
        self.words.reserve_exact(count * LANES);
        self.words.resize(count * self.stride, count as u32);
        for i in (0..count).rev() {
            let to = i * self.stride;
            self.words.copy_within(i * before..(i + 1) * before, to);
            self.words[to + before..to + self.stride].fill(count as u32);
        }
        (self.spilled, self.spare) = (Vec::new(), Vec::new());
        for (i, list) in lists {
            self.centers[i as usize].members = 0;
            self.set(i, &list);
        }
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
