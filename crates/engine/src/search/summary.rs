//! Properties of the particles and their local density, by which engines are chosen and configured.

use std::f64::consts::PI;

use rayon::prelude::*;

use crate::{
    model::{Boundary, Dimension, System},
    numerics::total::total,
    state::world::World,
    support::geometry::largest_contact,
};

/// Edge of the cells in which particles are counted [mean diameters].
const EDGE: f64 = 3.0;
/// Approximate number of particles that are counted; all of them if there are fewer.
const SAMPLE: usize = 1 << 16;
/// A gas is clustered if the packing fraction around the average particle exceeds that of the box by this
/// factor.
const CLUSTERED: f64 = 1.5;

/// Properties of a system that do not change during a run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SystemSummary {
    /// Number of particles.
    pub count: usize,
    /// Smallest radius [length].
    pub least: f64,
    /// Largest radius [length].
    pub largest: f64,
    /// Largest contact distance of two particles \[length\]: less than twice the largest radius if only one
    /// particle has that.
    pub contact: f64,
    /// Mean radius [length].
    pub mean: f64,
    /// Volume of all particles, in two dimensions area [length^d].
    pub occupied: f64,
    /// Number of dimensions, 2 or 3.
    pub dimension: i32,
    /// Whether all masses are finite.
    pub movable: bool,
    /// Whether all particles have the same radius and the same finite mass.
    pub uniform: bool,
}

impl SystemSummary {
    pub fn of(system: &System, world: &World) -> Self {
        let dimension = system.dimension.count() as i32;
        let unit_volume = if system.dimension == Dimension::Two { PI } else { PI * 4.0 / 3.0 };
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
            contact: largest_contact(
                classes().map(|(class, &count)| (class.radius, class.inverse_mass != 0.0, count)),
            ),
            mean: sum(&|radius| radius) / count.max(1) as f64,
            occupied: sum(&|radius| unit_volume * radius.powi(dimension)),
            dimension,
            movable,
            uniform: movable && world.classes.iter().all(|class| Some((class.radius, class.mass)) == first),
        }
    }

    /// Distance between neighboring particles at this packing fraction, as on a cubic lattice [length].
    pub fn spacing(&self, packing: f64) -> f64 {
        libm::pow(self.occupied / (self.count.max(1) as f64 * packing), 1.0 / f64::from(self.dimension))
    }
}

/// Local density and speeds at one time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalDensity {
    /// Packing fraction around the average particle; in a uniform gas, that of the box.
    pub packing: f64,
    /// Mean speed [length/time].
    mean_speed: f64,
    /// Largest speed [length/time].
    largest_speed: f64,
}

impl LocalDensity {
    /// Measures the present state.
    pub fn of(system: &System, summary: &SystemSummary, world: &World) -> Self {
        let states = |i: u32| world.peculiar(i, world.now);
        let [speeds] = total(summary.count, |i| [states(i).1.length()]);
        let largest_speed =
            (0..summary.count as u32).into_par_iter().map(|i| states(i).1.length()).reduce(|| 0.0, f64::max);
        // The mean, because a single very fast particle increases the root mean square by far more.
        let mean_speed = speeds / summary.count.max(1) as f64;
        let packing = packing(system, summary, |i| states(i).0.to_array());
        Self { packing, mean_speed, largest_speed }
    }

    /// Whether no speed exceeds the mean speed by more than this factor.
    pub fn speeds_are_within(&self, factor: f64) -> bool {
        self.largest_speed <= factor * self.mean_speed
    }
}

/// Packing fraction around the average particle, from counts in cells that are a few diameters wide; at least
/// that of the box. `position` returns the position of a particle.
fn packing(system: &System, summary: &SystemSummary, position: impl Fn(u32) -> [f64; 3] + Sync) -> f64 {
    let volume = summary.occupied / summary.count.max(1) as f64;
    let diameter = 2.0 * libm::pow(volume * 3.0 / (4.0 * PI), 1.0 / 3.0).max(summary.mean);
    let (mut width, mut closed) = ([f64::INFINITY; 3], [true; 3]);
    let mut box_volume = 1.0;
    for axis in 0..summary.dimension as usize {
        let size = system.domain.size[axis];
        closed[axis] = system.domain.boundary[axis] != Boundary::Open;
        width[axis] = EDGE * diameter;
        if closed[axis] {
            width[axis] = size / (size / width[axis]).floor().max(1.0);
            box_volume *= size;
        }
    }
    let cell = width.iter().filter(|width| width.is_finite()).product::<f64>();
    let uniform = if closed == [true; 3] { summary.occupied / box_volume } else { 0.0 };
    // Of many particles, only those in a random part of the cells are counted. A hash of the cell selects
    // them.
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
    let pairs: u64 = keys.chunk_by(|a, b| a == b).map(|cell| (cell.len() * (cell.len() - 1)) as u64).sum();
    let local = pairs as f64 / keys.len().max(1) as f64 * volume / cell;
    if local > CLUSTERED * uniform { local } else { uniform }
}
