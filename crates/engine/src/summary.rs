//! What kind of particles there are, and how crowded they stand: what engines are chosen and laid out by.

use std::f64::consts::PI;

use rayon::prelude::*;

use crate::{
    measure::total,
    model::{Boundary, Dimension, System},
    particles::World,
};

/// Edge of the cells that particles are counted in [mean diameters].
const EDGE: f64 = 3.0;
/// Particles whose surroundings are counted, about; all of them if there are fewer.
const SAMPLE: usize = 1 << 16;
/// A gas whose particles see more than this many times the mean density is no longer uniform.
const CLUSTERED: f64 = 1.5;

/// Counts that never change.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SystemSummary {
    /// Particles.
    pub count: usize,
    /// Least, largest and mean radius [length].
    pub least: f64,
    pub largest: f64,
    pub mean: f64,
    /// Volume of all particles, in two dimensions area [length^d].
    pub occupied: f64,
    /// Axes along which there is motion.
    pub dimension: i32,
    /// Whether all masses are finite.
    pub movable: bool,
    /// Whether all particles have the same radius and the same finite mass.
    pub uniform: bool,
}

impl SystemSummary {
    pub fn of(system: &System, world: &World) -> Self {
        let dimension = system.dimension.count() as i32;
        let ball = if system.dimension == Dimension::Two { PI } else { PI * 4.0 / 3.0 };
        let count = world.particles.len();
        let mut of_class = vec![0_u64; world.classes.len()];
        for particle in &world.particles {
            of_class[particle.class()] += 1;
        }
        let classes = || world.classes.iter().zip(&of_class).filter(|(_, count)| **count > 0);
        let sum = |term: &dyn Fn(f64) -> f64| {
            classes().map(|(class, &count)| count as f64 * term(class.radius)).sum::<f64>()
        };
        let movable = world.classes.iter().all(|class| class.inverse_mass != 0.0);
        let first = world.classes.first().map(|class| (class.radius, class.mass));
        Self {
            count,
            least: classes().fold(f64::INFINITY, |least, (class, _)| least.min(class.radius)),
            largest: classes().fold(0.0, |largest, (class, _)| class.radius.max(largest)),
            mean: sum(&|radius| radius) / count.max(1) as f64,
            occupied: sum(&|radius| ball * radius.powi(dimension)),
            dimension,
            movable,
            uniform: movable && world.classes.iter().all(|class| Some((class.radius, class.mass)) == first),
        }
    }

    /// Distance of neighboring particles at a packing fraction, as on a cubic lattice [length].
    pub fn spacing(&self, packing: f64) -> f64 {
        libm::pow(self.occupied / (self.count.max(1) as f64 * packing), 1.0 / f64::from(self.dimension))
    }
}

/// How crowded particles stand at one time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalDensity {
    /// Packing fraction around the average particle; in a uniform gas, that of the box.
    pub packing: f64,
    /// Mean of the speeds, and the largest [length/time].
    mean_speed: f64,
    largest_speed: f64,
}

impl LocalDensity {
    /// Measures the present state.
    pub fn of(system: &System, summary: &SystemSummary, world: &World) -> Self {
        let states = |i: u32| world.state(i, world.now);
        let [speeds] = total(summary.count, |i| [states(i).1.length()]);
        let largest_speed =
            (0..summary.count as u32).into_par_iter().map(|i| states(i).1.length()).reduce(|| 0.0, f64::max);
        // Not the root mean square: one very fast particle would make that as large as the others' number
        // allows.
        let mean_speed = speeds / summary.count.max(1) as f64;
        let packing = packing(system, summary, |i| states(i).0.to_array());
        Self { packing, mean_speed, largest_speed }
    }

    /// Whether no particle is faster than the mean by more than this factor.
    pub fn is_even(&self, outlier: f64) -> bool {
        self.largest_speed <= outlier * self.mean_speed
    }
}

/// Packing fraction around the average particle, in cells a few diameters wide; not less than that of the
/// box. `position` is that of a particle.
fn packing(system: &System, summary: &SystemSummary, position: impl Fn(u32) -> [f64; 3] + Sync) -> f64 {
    let volume = summary.occupied / summary.count.max(1) as f64;
    let diameter = 2.0 * libm::pow(volume * 3.0 / (4.0 * PI), 1.0 / 3.0).max(summary.mean);
    let (mut width, mut closed) = ([f64::INFINITY; 3], [true; 3]);
    let mut whole = 1.0;
    for axis in 0..summary.dimension as usize {
        let size = system.domain.size[axis];
        closed[axis] = system.domain.boundary[axis] != Boundary::Open;
        width[axis] = EDGE * diameter;
        if closed[axis] {
            width[axis] = size / (size / width[axis]).floor().max(1.0);
            whole *= size;
        }
    }
    let cell = width.iter().filter(|width| width.is_finite()).product::<f64>();
    let uniform = if closed == [true; 3] { summary.occupied / whole } else { 0.0 };
    // Of many particles those in a part of the cells, as a hash tells.
    let parts = (summary.count / SAMPLE).max(1) as u64;
    let key = |i: u32| {
        let mut key = 0_u64;
        let x = position(i);
        for axis in 0..3 {
            let (size, periodic) =
                (system.domain.size[axis], system.domain.boundary[axis] == Boundary::Periodic);
            let x = if periodic { x[axis] - (x[axis] / size).floor() * size } else { x[axis] };
            let cell = (x / width[axis]).floor() as i64 as u64;
            key = (key ^ cell).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29);
        }
        key
    };
    let mut keys: Vec<u64> =
        (0..summary.count as u32).into_par_iter().map(key).filter(|key| (key >> 7) % parts == 0).collect();
    keys.par_sort_unstable();
    let seen: u64 = keys.chunk_by(|a, b| a == b).map(|cell| (cell.len() * (cell.len() - 1)) as u64).sum();
    let local = seen as f64 / keys.len().max(1) as f64 * volume / cell;
    if local > CLUSTERED * uniform { local } else { uniform }
}
