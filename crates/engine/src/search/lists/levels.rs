/*!
Bins of reference positions, one set for each range of sizes.

With one set, a single large particle would require wide bins, and the search of a small particle would visit
thousands of small ones. Particles whose radii differ by up to [`SIZE_STEP`] share bins. A search visits
those of every range, each as far as particles of that range can touch.
*/

use haff_neighbors::Array;

use crate::search::{blocks::Grid, compact::CompactParticle};

use super::{
    bins::{Bins, Layout},
    sets::LANES,
};

/// Particles whose radii differ by at most this factor share bins.
const SIZE_STEP: f64 = 2.0;
/// Largest number of ranges.
const MOST: usize = 32;

/// Bins of all reference positions.
#[derive(Debug, Clone, Default)]
pub(super) struct Levels {
    /// Those of the largest particles, and often of all.
    first: Bins,
    /// Those of smaller ones.
    others: Vec<Bins>,
    /// Largest radius in each of these [largest contact distances]. It can be more than 0.5: the largest
    /// contact distance is that of the two largest particles.
    radii: Vec<f32>,
    /// Index of the bins of each particle; empty if there is only the first.
    level: Array<u8>,
}

impl Levels {
    /// Bins for particles, the last of which is the sentinel, with the reference positions of their
    /// coordinates. `UNIFORM`: all have the contact distance 1.
    pub fn new<const UNIFORM: bool>(layout: &Layout, particles: &Array<CompactParticle>) -> Self {
        let &Layout { edges, skin, spacing, .. } = layout;
        let particles = particles.part(0..particles.len() - 1);
        let count = particles.len();
        if UNIFORM {
            let mut first = Bins::new(layout, 1.0 + skin, spacing, count);
            for (i, compact) in particles.iter().enumerate() {
                first.insert::<false>(i as u32, compact.x);
            }
            return Self { first, radii: vec![0.5], ..Self::default() };
        }
        let largest = particles.iter().map(|compact| compact.radius).fold(0.0, f32::max);
        let range = |radius: f32| {
            let step = libm::log2(f64::from(largest / radius)) / libm::log2(SIZE_STEP);
            (step as usize).min(MOST - 1)
        };
        let mut of_range = [None; MOST];
        let mut counts = [0; MOST];
        let mut radii = [0.0_f32; MOST];
        for compact in particles {
            let range = range(compact.radius);
            counts[range] += 1;
            radii[range] = radii[range].max(compact.radius);
        }
        let used: Vec<usize> = (0..MOST).filter(|&range| counts[range] > 0).collect();
        for (level, &range) in used.iter().enumerate() {
            of_range[range] = Some(level as u8);
        }
        let axes = edges.iter().filter(|edge| **edge > 0.0).count();
        let bins = |&range: &usize| {
            let reach = 2.0 * f64::from(radii[range]) + skin;
            let share = count as f64 / f64::from(counts[range]);
            let spacing = spacing * libm::pow(share, 1.0 / axes.max(1) as f64);
            Bins::new(layout, reach, spacing, counts[range] as usize)
        };
        let mut bins: Vec<Bins> = used.iter().map(bins).collect();
        let first = if bins.is_empty() { Bins::new(layout, 1.0 + skin, spacing, 0) } else { bins.remove(0) };
        let mut levels = Self { first, others: bins, ..Self::default() };
        levels.radii = used.iter().map(|&range| radii[range]).collect();
        if !levels.others.is_empty() {
            let level = |compact: &CompactParticle| of_range[range(compact.radius)].unwrap_or(0);
            levels.level = particles.iter().map(level).collect();
        }
        for (i, compact) in particles.iter().enumerate() {
            levels.insert::<false>(i as u32, compact.x);
        }
        levels
    }

    /// The largest radius [largest contact distances].
    pub fn largest_radius(&self) -> f32 {
        self.radii.first().copied().unwrap_or(0.5)
    }

    /// See [`Bins::reserve`].
    pub fn reserve(&mut self, aliases: usize) {
        self.first.reserve(aliases);
        self.others.iter_mut().for_each(|bins| bins.reserve(aliases));
    }

    /// See [`Bins::alias`].
    ///
    /// # Safety
    ///
    /// As for [`Array::alias`]: no thread changes bins that another one uses.
    pub unsafe fn alias(&mut self) -> Self {
        // SAFETY: guaranteed by the caller.
        unsafe {
            Self {
                first: self.first.alias(),
                others: self.others.iter_mut().map(|bins| bins.alias()).collect(),
                radii: self.radii.clone(),
                level: self.level.alias(),
            }
        }
    }

    /// See [`Bins::take_back`].
    pub fn take_back(&mut self, alias: &mut Self) {
        self.first.take_back(&mut alias.first);
        for (bins, alias) in self.others.iter_mut().zip(&mut alias.others) {
            bins.take_back(alias);
        }
    }

    /// Width of the widest bins [largest contact distances].
    pub fn widest(&self, unit: [f32; 3]) -> f32 {
        self.others.iter().map(|bins| bins.widest(unit)).fold(self.first.widest(unit), f32::max)
    }

    /// See [`Bins::grid`]: that of the largest particles. `None` if a bin holds several places of the box.
    pub fn grid(&self, unit: [f32; 3]) -> Option<Grid> {
        let is_folded = self.others.iter().any(|bins| bins.grid(unit).is_none());
        if is_folded { None } else { self.first.grid(unit) }
    }

    #[inline(always)]
    fn bins(&mut self, i: u32) -> &mut Bins {
        if self.others.is_empty() {
            return &mut self.first;
        }
        match usize::from(self.level[i as usize]) {
            0 => &mut self.first,
            level => &mut self.others[level - 1],
        }
    }

    /// See [`Bins::insert`].
    #[inline(always)]
    pub fn insert<const VECTORS: bool>(&mut self, i: u32, x: [i32; 3]) -> bool {
        self.bins(i).insert::<VECTORS>(i, x)
    }

    /// See [`Bins::remove`].
    #[inline(always)]
    pub fn remove<const VECTORS: bool>(&mut self, i: u32, x: [i32; 3]) {
        self.bins(i).remove::<VECTORS>(i, x);
    }

    /// Finds the ids of all reference positions that are closer to `x` than the contact of particle i, whose
    /// radius this is, with the largest particle of a range, and the skin [largest contact distances]. Writes
    /// them to the start of `found`, whose length stays a multiple of [`LANES`], and returns their number.
    #[inline(always)]
    pub fn near<const VECTORS: bool, const UNIFORM: bool, const TILTED: bool>(
        &self,
        i: u32,
        x: [i32; 3],
        radius: f32,
        skin: f32,
        found: &mut Vec<u32>,
    ) -> usize {
        if UNIFORM || self.others.is_empty() {
            let reach = if UNIFORM { 1.0 } else { radius + self.radii[0] } + skin;
            return self.first.near::<VECTORS, TILTED>(x, reach * reach, found);
        }
        self.near_in_all(i, x, radius, skin, found)
    }

    #[cold]
    #[inline(never)]
    fn near_in_all(&self, i: u32, x: [i32; 3], radius: f32, skin: f32, found: &mut Vec<u32>) -> usize {
        let own = usize::from(self.level[i as usize]);
        let mut all = Vec::new();
        for (level, bins) in std::iter::once(&self.first).chain(&self.others).enumerate() {
            let reach = radius + self.radii[level] + skin;
            if level <= own {
                let count = bins.near::<false, true>(x, reach * reach, found);
                all.extend_from_slice(&found[..count]);
            } else {
                bins.add_near(x, reach, &mut all);
            }
        }
        let count = all.len();
        found.clear();
        found.append(&mut all);
        found.resize(count.next_multiple_of(LANES), 0);
        count
    }
}
