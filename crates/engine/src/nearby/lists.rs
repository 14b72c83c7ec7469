/*!
Neighbor lists in the coordinates of the [frame](super::frame).

A particle's place is a ball around its *center*. Two particles are in each other's list if their centers are closer than
contact distance and two ball radii: they cannot touch before one of them has left its ball. A transfer is this exit. It moves
the center to the particle, and puts right its own list and those of the partners lost and won; all others stand.

Who is near whom is decided by integer differences, so no periodic image is ever named, and nothing changes when a particle is
wrapped into the box.
*/

use haff_neighbors::{prefetch, roomy};
use rayon::prelude::*;

use super::frame::{Frame, Record};
use crate::machine::Features;

/// Lists are whole groups of so many words, which the filter looks at at a time.
pub(super) const LANES: usize = 8;
/// Pairs are listed this much further away than they need be, for all that single precision rounds [largest contact
/// distances].
const SLACK: f32 = 1e-3;
/// A first word with this bit is the index of a list in `Lists::spilled`.
const SPILLED: u32 = 1 << 31;
/// Lists grow when more than one in this many has spilled.
const SPILLED_PART: usize = 32;
/// Most bins along an axis that a search runs through.
const SPAN: usize = 8;
/// Points per bin, about.
const PER_BIN: f64 = 2.0;
/// No particle.
const NONE: u32 = u32::MAX;

/// A center, and the next of the same bin.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(16))]
struct Center {
    x: [i32; 3],
    next: u32,
}

/// Neighbor lists.
#[derive(Debug, Clone, Default)]
pub(super) struct Lists {
    /// Radius of the balls [largest contact distances], and its square.
    half: f32,
    half2: f32,
    unit: [f32; 3],
    centers: Vec<Center>,
    /// Bins per axis, their widths [largest contact distances], and the first center of each.
    n: [i64; 3],
    width: [f32; 3],
    head: Vec<u32>,
    /// The lists, of `stride` words each, filled up with [`Self::nobody`].
    words: Vec<u32>,
    stride: usize,
    spilled: Vec<Vec<u32>>,
    spare: Vec<u32>,
    found: Vec<u32>,
}

/// A bin along one axis.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    cell: usize,
    /// Square of its distance from the place that is searched from [largest contact distances].
    gap2: f32,
}

impl Lists {
    /// Lists of particles within balls of radius `half` [largest contact distances], all of which have just been put on record
    /// at the beginning of the frame's span.
    pub fn new<F: Features>(frame: &Frame, edges: [f64; 3], half: f64, records: &[Record]) -> Self {
        let count = records.len() - 1;
        let most = 1.0 + 2.0 * half;
        let used = || edges.iter().filter(|edge| **edge > 0.0);
        let volume: f64 = used().product();
        let ideal = libm::pow(PER_BIN * volume / count.max(1) as f64, 1.0 / used().count() as f64);
        let (mut n, mut width) = ([1; 3], [0.0; 3]);
        for axis in (0..3).filter(|&axis| edges[axis] > 0.0) {
            // No bin is met twice, and none too many.
            let w = ideal.min(0.49 * edges[axis] - most).max(most / 2.5);
            n[axis] = ((edges[axis] / w).ceil() as i64).clamp(1, 1 << 20);
            width[axis] = (edges[axis] / n[axis] as f64) as f32;
        }
        let mut lists = Self {
            half: half as f32,
            half2: (half * half) as f32,
            unit: frame.unit,
            centers: roomy(count),
            n,
            width,
            head: vec![NONE; n.iter().product::<i64>() as usize],
            words: Vec::new(),
            stride: 0,
            spilled: Vec::new(),
            spare: Vec::new(),
            found: Vec::new(),
        };
        for (i, record) in records[..count].iter().enumerate() {
            lists.centers.push(Center { x: record.x, next: NONE });
            lists.enter(i as u32);
        }
        let mut sample = Vec::new();
        let mut lengths: Vec<usize> = (0..count)
            .step_by((count / 1000).max(1))
            .map(|i| {
                lists.find::<F>(i as u32, records, &mut sample);
                sample.len()
            })
            .collect();
        lengths.sort_unstable();
        // A start on a lattice has no fluctuations yet.
        let mean = lengths.iter().sum::<usize>() as f64 / lengths.len().max(1) as f64;
        let most = lengths.get(lengths.len() * 99 / 100).copied().unwrap_or(0);
        lists.stride = (most + 1).max((mean + 2.0 * mean.sqrt()) as usize).next_multiple_of(LANES);
        lists.words = roomy(count * lists.stride);
        lists.words.resize(count * lists.stride, count as u32);
        let (mut words, stride) = (std::mem::take(&mut lists.words), lists.stride);
        let spilled: Vec<(u32, Vec<u32>)> = words
            .par_chunks_mut(stride)
            .enumerate()
            .map_init(Vec::new, |found, (i, words)| {
                lists.find::<F>(i as u32, records, found);
                if found.len() > words.len() {
                    return Some((i as u32, found.clone()));
                }
                words[..found.len()].copy_from_slice(found);
                None
            })
            .flatten()
            .collect();
        lists.words = words;
        for (i, list) in spilled {
            lists.spill(i, &list);
        }
        lists
    }

    /// Whom the padding of lists names.
    fn nobody(&self) -> u32 {
        self.centers.len() as u32
    }

    /// The list of i, filled up to whole groups.
    #[inline(always)]
    pub fn of(&self, i: u32) -> &[u32] {
        let place = i as usize * self.stride;
        let words = &self.words[place..place + self.stride];
        if words[0] & SPILLED != 0 {
            return &self.spilled[(words[0] & !SPILLED) as usize];
        }
        let mut len = words.len();
        while len > LANES && words[len - LANES] == self.nobody() {
            len -= LANES;
        }
        &words[..len]
    }

    /// Asks for the list and the center of i.
    #[inline(always)]
    pub fn prefetch(&self, i: u32) {
        let place = i as usize * self.stride;
        prefetch(&self.words[place]);
        prefetch(&self.words[place + self.stride - 1]);
        prefetch(&self.centers[i as usize]);
    }

    /// Where a particle is relative to its center [largest contact distances].
    #[inline(always)]
    fn off_center(&self, i: u32, record: &Record, part: f32) -> [f32; 3] {
        let center = &self.centers[i as usize];
        let mut d = [0.0; 3];
        for axis in 0..3 {
            d[axis] = record.x[axis].wrapping_sub(center.x[axis]) as f32 * self.unit[axis] + record.v[axis] * part;
        }
        d
    }

    /// When particle i leaves its ball, counted from now; `None` if not `within` this time. Times are parts of a span.
    #[inline(always)]
    pub fn exit(&self, i: u32, record: &Record, part: f32, within: f32) -> Option<f32> {
        let (d, v) = (self.off_center(i, record, part), record.v);
        let mut end = [0.0; 3];
        for axis in 0..3 {
            end[axis] = d[axis] + v[axis] * within;
        }
        // A ball is convex: who is inside now and then is inside all the time.
        if dot(end, end) <= self.half2 {
            return None;
        }
        let (speed2, along) = (dot(v, v), dot(d, v));
        if speed2 == 0.0 {
            return None;
        }
        let gap = (self.half2 - dot(d, d)).max(0.0);
        let root = (along * along + speed2 * gap).sqrt();
        // No difference of numbers of one sign.
        let delay = if along > 0.0 { gap / (root + along) } else { (root - along) / speed2 };
        (delay < within).then_some(delay)
    }

    /// Moves the center of i to where it is at `part` of the span and `ahead` of that, and puts right all lists.
    pub fn transfer<F: Features>(&mut self, i: u32, records: &[Record], part: f32, ahead: f32) {
        let record = &records[i as usize];
        let speed = dot(record.v, record.v).sqrt();
        let ahead = if speed > 0.0 { ahead * self.half / speed } else { 0.0 };
        self.leave(i);
        for axis in 0..3 {
            let way = f64::from(record.v[axis] * (part + ahead)) / f64::from(self.unit[axis]);
            self.centers[i as usize].x[axis] = record.x[axis].wrapping_add(way as i64 as i32);
        }
        self.enter(i);
        let mut found = std::mem::take(&mut self.found);
        self.find::<F>(i, records, &mut found);
        self.replace(i, &found);
        self.found = found;
    }

    /// Index of the bin of a center.
    #[inline(always)]
    fn bin(&self, x: [i32; 3]) -> usize {
        let mut cell = [0; 3];
        for axis in 0..3 {
            cell[axis] = ((i64::from(x[axis] as u32) * self.n[axis]) >> 32) as usize;
        }
        self.index(cell)
    }

    #[inline(always)]
    fn index(&self, cell: [usize; 3]) -> usize {
        (cell[2] * self.n[1] as usize + cell[1]) * self.n[0] as usize + cell[0]
    }

    /// Enters the center of i into its bin.
    fn enter(&mut self, i: u32) {
        let bin = self.bin(self.centers[i as usize].x);
        self.centers[i as usize].next = self.head[bin];
        self.head[bin] = i;
    }

    /// Takes the center of i out of its bin.
    fn leave(&mut self, i: u32) {
        let Center { x, next } = self.centers[i as usize];
        let bin = self.bin(x);
        let mut at = self.head[bin];
        if at == i {
            self.head[bin] = next;
            return;
        }
        while at != NONE {
            let center = &mut self.centers[at as usize];
            if center.next == i {
                center.next = next;
                return;
            }
            at = center.next;
        }
    }

    /// Looks for the neighbors of i among the centers.
    #[inline(always)]
    fn find<F: Features>(&self, i: u32, records: &[Record], found: &mut Vec<u32>) {
        found.clear();
        let own = &self.centers[i as usize];
        let skin = 2.0 * self.half + SLACK;
        let reach = if F::UNIFORM { 1.0 } else { records[i as usize].radius + 0.5 } + skin;
        let reach2 = reach * reach;
        let mut bins = [[Bin::default(); SPAN]; 3];
        let mut count = [1; 3];
        for axis in 0..3 {
            let (n, width) = (self.n[axis], self.width[axis]);
            if width == 0.0 {
                continue;
            }
            let place = i64::from(own.x[axis] as u32) * n;
            let home = place >> 32;
            // In bins, from the home bin's lower face.
            let inside = (place as u32) as f32 * 2.0_f32.powi(-32);
            let range = reach / width;
            let low = (inside - range).floor() as i64;
            let high = (inside + range).floor() as i64;
            count[axis] = ((high - low + 1) as usize).min(SPAN);
            for (k, bin) in bins[axis][..count[axis]].iter_mut().enumerate() {
                let step = low + k as i64;
                let gap = (step as f32 - inside).max(inside - (step + 1) as f32).max(0.0) * width;
                let cell = home + step;
                let cell = if cell < 0 { cell + n } else { cell };
                let cell = if cell >= n { cell - n } else { cell };
                *bin = Bin { cell: cell as usize, gap2: gap * gap };
            }
        }
        for z in &bins[2][..count[2]] {
            for y in &bins[1][..count[1]] {
                let left2 = reach2 - z.gap2 - y.gap2;
                let row = self.index([0, y.cell, z.cell]);
                for x in &bins[0][..count[0]] {
                    if x.gap2 > left2 {
                        continue;
                    }
                    let mut j = self.head[row + x.cell];
                    while j != NONE {
                        let other = &self.centers[j as usize];
                        let mut d = [0.0; 3];
                        for axis in 0..3 {
                            d[axis] = other.x[axis].wrapping_sub(own.x[axis]) as f32 * self.unit[axis];
                        }
                        let near2 = if F::UNIFORM {
                            reach2
                        } else {
                            let reach = (records[i as usize].radius + records[j as usize].radius) + skin;
                            reach * reach
                        };
                        if dot(d, d) < near2 && j != i {
                            found.push(j);
                        }
                        j = other.next;
                    }
                }
            }
        }
    }

    /// Makes `new` the list of i, and puts right the lists of the partners lost and won.
    fn replace(&mut self, i: u32, new: &[u32]) {
        let nobody = self.nobody();
        let mut old = [nobody; 64];
        let list = self.of(i);
        if list.len() > old.len() || new.len() > self.stride {
            self.replace_long(i, new);
            return;
        }
        let length = list.len();
        old[..length].copy_from_slice(list);
        let old = &old[..length];
        for &j in old {
            if !contains(new, j) && j != nobody {
                self.remove(j, i);
            }
        }
        let mut spilled = false;
        for &j in new {
            if !contains(old, j) {
                spilled |= self.add(j, i);
            }
        }
        self.set(i, new);
        if spilled {
            self.grow();
        }
    }

    /// The same for lists of any length.
    #[cold]
    fn replace_long(&mut self, i: u32, new: &[u32]) {
        let nobody = self.nobody();
        let old: Vec<u32> = self.of(i).iter().copied().filter(|&j| j != nobody).collect();
        for j in old.iter().filter(|j| !contains(new, **j)) {
            self.remove(*j, i);
        }
        for j in new.iter().filter(|j| !contains(&old, **j)) {
            self.add(*j, i);
        }
        self.set(i, new);
        self.grow();
    }

    /// Makes `list` the list of i.
    fn set(&mut self, i: u32, list: &[u32]) {
        let (nobody, place) = (self.nobody(), i as usize * self.stride);
        let words = &mut self.words[place..place + self.stride];
        if words[0] & SPILLED != 0 {
            self.spare.push(words[0] & !SPILLED);
        }
        if list.len() <= words.len() {
            let (own, rest) = words.split_at_mut(list.len());
            own.copy_from_slice(list);
            rest.fill(nobody);
        } else {
            words.fill(nobody);
            self.spill(i, list);
        }
    }

    /// Keeps the list of i, which is not spilled, elsewhere from now on.
    #[cold]
    fn spill(&mut self, i: u32, list: &[u32]) {
        let nobody = self.nobody();
        let free = self.spare.pop().unwrap_or_else(|| {
            self.spilled.push(Vec::new());
            self.spilled.len() as u32 - 1
        });
        let spilled = &mut self.spilled[free as usize];
        spilled.clear();
        spilled.extend_from_slice(list);
        spilled.resize(list.len().next_multiple_of(LANES), nobody);
        self.words[i as usize * self.stride] = free | SPILLED;
    }

    /// Adds j to the list of i; true if the list has spilled because of it.
    fn add(&mut self, i: u32, j: u32) -> bool {
        let (nobody, place) = (self.nobody(), i as usize * self.stride);
        let words = &mut self.words[place..place + self.stride];
        if words[0] & SPILLED != 0 {
            let list = &mut self.spilled[(words[0] & !SPILLED) as usize];
            let length = occupied(list, nobody);
            if length == list.len() {
                list.resize(length + LANES, nobody);
            }
            list[length] = j;
            return false;
        }
        let length = occupied(words, nobody);
        if let Some(word) = words.get_mut(length) {
            *word = j;
            return false;
        }
        let mut list = words.to_vec();
        list.push(j);
        self.spill(i, &list);
        true
    }

    /// Takes j out of the list of i.
    fn remove(&mut self, i: u32, j: u32) {
        let (nobody, place) = (self.nobody(), i as usize * self.stride);
        let mut list = &mut self.words[place..place + self.stride];
        if list[0] & SPILLED != 0 {
            list = &mut self.spilled[(list[0] & !SPILLED) as usize];
        }
        let length = occupied(list, nobody);
        if let Some(at) = list.iter().position(|&other| other == j) {
            list[at] = list[length - 1];
            list[length - 1] = nobody;
        }
    }

    /// Gives every list more room if many have spilled.
    fn grow(&mut self) {
        let count = self.centers.len();
        if self.spilled.len() - self.spare.len() <= count / SPILLED_PART + 8 {
            return;
        }
        let (old, before) = (std::mem::take(&mut self.words), self.stride);
        self.stride += LANES;
        self.words = roomy(count * self.stride);
        for list in old.chunks_exact(before) {
            self.words.extend_from_slice(list);
            self.words.resize(self.words.len() + LANES, count as u32);
        }
        for i in 0..count as u32 {
            if self.words[i as usize * self.stride] & SPILLED != 0 {
                let mut list = self.of(i).to_vec();
                list.truncate(occupied(&list, count as u32));
                self.set(i, &list);
            }
        }
    }
}

/// Length of a list without its padding.
#[inline(always)]
fn occupied(list: &[u32], nobody: u32) -> usize {
    list.iter().map(|&j| u32::from(j != nobody)).sum::<u32>() as usize
}

/// Whether a list names j; without an early end, so that whole vectors are compared.
#[inline(always)]
fn contains(list: &[u32], j: u32) -> bool {
    list.iter().fold(false, |found, &other| found | (other == j))
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
