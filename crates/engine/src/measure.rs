//! What is measured of a state: energies, temperatures, pressure, momenta, overlaps, the hash. Measuring streams copies
//! of the particles to the present and leaves their anchors alone.

use glam::DVec3;
use haff_neighbors::{Cells, Geometry, Search};
use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3;

use crate::{
    book::Book,
    machine::State,
    model::{Boundary, Dimension, System},
    particles::World,
    report::{Frame, Ledger, Sample},
    sum::Sum,
};

/// Particles per block of a parallel sum. Blocks do not depend on the number of threads, and their sums are
/// added in order.
const BLOCK: usize = 4096;

/// Sums `terms(i)` over all particles, in an order that no thread count changes.
fn total<const K: usize>(count: usize, terms: impl Fn(u32) -> [f64; K] + Sync) -> [f64; K] {
    let blocks: Vec<[Sum; K]> = (0..count.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let mut sums = [Sum::default(); K];
            for i in block * BLOCK..((block + 1) * BLOCK).min(count) {
                for (sum, term) in sums.iter_mut().zip(terms(i as u32)) {
                    sum.add(term);
                }
            }
            sums
        })
        .collect();
    let mut sums = [Sum::default(); K];
    for block in blocks {
        for (sum, part) in sums.iter_mut().zip(block) {
            sum.add(part.high);
            sum.add(part.low);
        }
    }
    sums.map(|sum| sum.value())
}

/// Energies and momenta of the bodies of finite mass.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Totals {
    pub bodies: f64,
    pub mass: f64,
    pub kinetic: f64,
    pub potential: f64,
    pub momentum: DVec3,
    /// About the origin, from unwrapped positions.
    pub angular_momentum: DVec3,
}

impl Totals {
    pub fn of(world: &World) -> Self {
        let [bodies, mass, kinetic, potential, px, py, pz, hx, hy, hz] = total(world.particles.len(), |i| {
            let class = world.class(i);
            if class.inverse_mass == 0.0 {
                return [0.0; 10];
            }
            let (r, v) = world.state(i, world.now);
            let p = class.mass * v;
            let h = r.cross(p);
            let potential = -class.mass * world.gravity.dot(r);
            [1.0, class.mass, 0.5 * p.dot(v), potential, p.x, p.y, p.z, h.x, h.y, h.z]
        });
        Self {
            bodies,
            mass,
            kinetic,
            potential,
            momentum: DVec3::new(px, py, pz),
            angular_momentum: DVec3::new(hx, hy, hz),
        }
    }

    /// Velocity of the centre of mass.
    pub fn drift(&self) -> DVec3 {
        if self.mass > 0.0 { self.momentum / self.mass } else { DVec3::ZERO }
    }
}

/// The balance of energies, T + V = T₀ + V₀ − Σ ΔT + W.
pub(crate) fn ledger(totals: &Totals, book: &Book) -> Ledger {
    let [kinetic, potential] = book.initial_energy;
    let (dissipated, work) = (book.dissipated.value(), book.wall_work.value());
    let terms = [totals.kinetic, totals.potential, -kinetic, -potential, dissipated, -work];
    let scale = terms.iter().fold(0.0, |scale: f64, term| scale.max(term.abs()));
    let balance: Sum = terms.into_iter().collect();
    Ledger {
        kinetic: totals.kinetic,
        potential: totals.potential,
        dissipated,
        carnot: book.carnot.value(),
        wall_work: work,
        residual: if scale > 0.0 { balance.value() / scale } else { 0.0 },
    }
}

/// One row of observables at the present; starts the next interval of the pressure.
pub(crate) fn sample(system: &System, state: &mut State, time: f64) -> Sample {
    let State { world, book, .. } = state;
    let totals = Totals::of(world);
    let d = system.dimension.count() as f64;
    let drift = totals.drift();

    // Per species: bodies, Σ m|v − V|²; over all: the same and its second moment.
    let species: Vec<[f64; 2]> = (0..system.species.len() as u32)
        .map(|species| {
            total(world.particles.len(), |i| {
                let class = world.class(i);
                if system.bodies[i as usize].species != species || class.inverse_mass == 0.0 {
                    return [0.0; 2];
                }
                let (_, v) = world.state(i, world.now);
                [1.0, class.mass * (v - drift).length_squared()]
            })
        })
        .collect();
    let [second, fourth] = total(world.particles.len(), |i| {
        let class = world.class(i);
        if class.inverse_mass == 0.0 {
            return [0.0; 2];
        }
        let (_, v) = world.state(i, world.now);
        // m|v − V|² instead of |v − V|²: the same number for one mass, and zero a₂ for a mixture in equilibrium.
        let square = class.mass * (v - drift).length_squared();
        [square, square * square]
    });
    let bodies = totals.bodies;
    let temperature = if bodies > 0.0 { second / (d * bodies) } else { f64::NAN };

    let span = time - book.sampled_at;
    let first = book.sampled_collisions == u64::MAX;
    let counted = book.counters.collisions - if first { 0 } else { book.sampled_collisions };
    let open = (0..d as usize).any(|axis| system.domain.boundary[axis] == Boundary::Open);
    let pressure = (!open).then(|| {
        if first || span <= 0.0 {
            return f64::NAN;
        }
        let volume: f64 = (0..d as usize).map(|axis| system.domain.size[axis]).product();
        // ∫ T dt: between events the kinetic energy is constant, so it is the final one plus what each event took,
        // for the time before it; with gravity the ends are averaged instead.
        let mean_kinetic = if world.gravity == DVec3::ZERO {
            totals.kinetic + book.loss_moment.value() / span
        } else {
            0.5 * (totals.kinetic + book.sampled_kinetic)
        };
        let thermal = mean_kinetic - 0.5 * totals.mass * drift.length_squared();
        (2.0 * thermal + book.virial.value() / span) / (d * volume)
    });
    let periodic = world.periodic.contains(&true);
    let gravity_impulse = world.impulse_of_force(time);
    let impulse = DVec3::from_array([0, 1, 2].map(|axis| book.impulse[axis].value()));
    let rate = if first || span <= 0.0 { f64::NAN } else { counted as f64 / span };
    let sample = Sample {
        time,
        step: book.counters.collisions + book.counters.wall_collisions,
        ledger: ledger(&totals, book),
        temperature,
        species_temperature: species
            .iter()
            .map(|&[bodies, sum]| if bodies > 0.0 { sum / (d * bodies) } else { f64::NAN })
            .collect(),
        sonine_a2: d * (fourth * bodies) / ((d + 2.0) * second * second) - 1.0,
        pressure,
        momentum: totals.momentum,
        external_impulse: impulse + gravity_impulse,
        angular_momentum: (!periodic).then_some(totals.angular_momentum),
        collisions: book.counters.collisions,
        wall_collisions: book.counters.wall_collisions,
        collision_rate: rate,
        mean_free_time: bodies / (2.0 * rate),
    };
    book.virial = Sum::default();
    book.loss_moment = Sum::default();
    book.sampled_at = time;
    book.sampled_collisions = book.counters.collisions;
    book.sampled_kinetic = totals.kinetic;
    sample
}

/// All particles at the present, wrapped into the box.
pub(crate) fn frame(state: &State, time: f64) -> Frame {
    let world = &state.world;
    let rows: Vec<(DVec3, DVec3, [i32; 3])> = (0..world.particles.len() as u32)
        .into_par_iter()
        .map(|i| {
            let (position, velocity) = world.state(i, world.now);
            let (position, wraps) = world.wrap(position);
            let image = world.images[i as usize];
            (position, velocity, [image[0] + wraps[0], image[1] + wraps[1], image[2] + wraps[2]])
        })
        .collect();
    let mut frame = Frame {
        time,
        step: state.book.counters.collisions + state.book.counters.wall_collisions,
        position: Vec::with_capacity(rows.len()),
        velocity: Vec::with_capacity(rows.len()),
        image: Vec::with_capacity(rows.len()),
    };
    for (position, velocity, image) in rows {
        frame.position.push(position);
        frame.velocity.push(velocity);
        frame.image.push(image);
    }
    frame
}

/// A 128-bit hash of every particle's position, velocity and image.
pub(crate) fn hash(frame: &Frame) -> u128 {
    let mut hasher = Xxh3::new();
    for i in 0..frame.position.len() {
        for value in frame.position[i].to_array().into_iter().chain(frame.velocity[i].to_array()) {
            hasher.update(&value.to_le_bytes());
        }
        for value in frame.image[i] {
            hasher.update(&value.to_le_bytes());
        }
    }
    hasher.digest128()
}

/// The deepest overlap of all close pairs and of particles with walls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// Overlap in contact distances (σ of the pair; the radius at a wall); 0 if nothing overlaps.
    pub depth: f64,
    /// The particle, and its partner's row or, at a wall, `None`.
    pub pair: Option<(u32, Option<u32>)>,
}

/// Finds the deepest overlap now, with a grid of its own, independent of what the engine tracks.
pub(crate) fn overlap(world: &World, geometry: &Geometry, frame: &Frame) -> Overlap {
    let grid = Cells::new(geometry, &frame.position);
    let none = Overlap { depth: 0.0, pair: None };
    let deeper = |a: Overlap, b: Overlap| if b.depth > a.depth { b } else { a };
    // Blocks in order: of equal depths the first pair is named, on any number of threads.
    let blocks: Vec<Overlap> = (0..frame.position.len().div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let mut deepest = none;
            for i in (block * BLOCK..((block + 1) * BLOCK).min(frame.position.len())).map(|i| i as u32) {
                let (from, class) = (frame.position[i as usize], world.class(i));
                grid.candidates(
                    i,
                    |j| frame.position[j as usize],
                    |j, shift| {
                        let partner = world.class(j);
                        if j < i || class.inverse_mass + partner.inverse_mass == 0.0 {
                            return;
                        }
                        let sigma = class.radius + partner.radius;
                        let shift = DVec3::from_array(shift.map(f64::from)) * world.size;
                        let distance = (frame.position[j as usize] - from + shift).length();
                        deepest = deeper(
                            deepest,
                            Overlap { depth: 1.0 - distance / sigma, pair: Some((i, Some(j))) },
                        );
                    },
                );
                if class.inverse_mass == 0.0 {
                    continue;
                }
                for &wall in grid.walls(i) {
                    let (gap, _) =
                        world.wall_approach(wall.into(), class.radius, from, DVec3::ZERO, world.now);
                    deepest = deeper(deepest, Overlap { depth: -gap / class.radius, pair: Some((i, None)) });
                }
            }
            deepest
        })
        .collect();
    blocks.into_iter().fold(none, deeper)
}

/// What the searches know of a system.
pub(crate) fn geometry(system: &System) -> Geometry {
    use haff_neighbors::{Axis, Plane};
    let mut axes = system.domain.boundary.map(|boundary| match boundary {
        Boundary::Periodic => Axis::Periodic,
        Boundary::Wall => Axis::Bounded,
        Boundary::Open => Axis::Open,
    });
    if system.dimension == Dimension::Two {
        axes[2] = Axis::Flat;
    }
    let radii = |finite: bool| {
        let chosen = system.bodies.iter().map(|body| system.classes[body.class as usize]);
        chosen.filter(|class| class.mass.is_finite() == finite).map(|class| class.radius).fold(0.0, f64::max)
    };
    let (movable, fixed) = (radii(true), radii(false));
    let radius = system.bodies.iter().map(|body| system.classes[body.class as usize].radius);
    let uniform = radius.clone().all(|radius| radius == movable);
    Geometry {
        size: system.domain.size,
        axes,
        // Two bodies of infinite mass never touch.
        reach: movable + movable.max(fixed),
        radius: movable,
        radii: if uniform { Vec::new() } else { radius.collect() },
        planes: system
            .walls
            .iter()
            .map(|wall| Plane {
                point: wall.point,
                normal: wall.normal,
                moving: wall.velocity != DVec3::ZERO,
            })
            .collect(),
    }
}
