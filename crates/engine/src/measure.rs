//! Measurements of a state: energies, temperatures, pressure, momenta, the hash. They move copies of the
//! particles to the present, and do not change the anchors.

use glam::DVec3;
use haff_neighbors::Geometry;
use rayon::prelude::*;
use xxhash_rust::xxh3::Xxh3;

use crate::{
    center::common_velocity,
    ledger::{Ledger, Term},
    model::{Boundary, Dimension, System},
    particles::World,
    report::{Frame, Sample},
    spin::rotations,
    state::State,
    sum::{Sum, Sums},
};

/// Particles per block of a parallel sum. Blocks do not depend on the number of threads, and their sums are
/// added in order, so that the result does not depend on it either.
const BLOCK: usize = 4096;

/// Sums `terms(i)` over i < `count`, in an order that does not depend on the number of threads.
pub(crate) fn total<const K: usize>(count: usize, terms: impl Fn(u32) -> [f64; K] + Sync) -> [f64; K] {
    let blocks: Vec<Sums<K>> = (0..count.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let mut sums = Sums::ZERO;
            for i in block * BLOCK..((block + 1) * BLOCK).min(count) {
                sums.add(terms(i as u32));
            }
            sums
        })
        .collect();
    let mut sums = Sums::ZERO;
    for block in &blocks {
        sums.merge(block);
    }
    sums.values()
}

/// Energies and momenta of the bodies of finite mass; under shear those of peculiar velocities.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Totals {
    pub bodies: f64,
    pub mass: f64,
    pub kinetic: f64,
    /// Energy and angular momentum of rotations.
    pub rotational: f64,
    pub spin: DVec3,
    pub potential: f64,
    pub momentum: DVec3,
    /// Angular momentum about the origin, from unwrapped positions.
    pub angular_momentum: DVec3,
    /// What walls have given to the grains that they carry: energy, and momentum.
    pub carried: (f64, DVec3),
}

impl Totals {
    pub fn of(world: &World) -> Self {
        let [bodies, mass, kinetic, potential, px, py, pz, hx, hy, hz] = total(world.particles.len(), |i| {
            let class = world.body(i);
            if class.inverse_mass == 0.0 {
                return [0.0; 10];
            }
            let (r, v) = world.peculiar(i, world.now);
            let p = class.mass * v;
            let h = r.cross(p);
            let potential = -class.mass * world.gravity.dot(r);
            [1.0, class.mass, 0.5 * p.dot(v), potential, p.x, p.y, p.z, h.x, h.y, h.z]
        });
        let (rotational, spin) = world.all_rotation();
        Self {
            bodies,
            mass,
            kinetic,
            rotational,
            spin,
            potential,
            momentum: DVec3::new(px, py, pz),
            angular_momentum: DVec3::new(hx, hy, hz),
            carried: world.all_carried(),
        }
    }

    /// Kinetic energy of translation and rotation.
    pub fn all_kinetic(&self) -> f64 {
        self.kinetic + self.rotational
    }

    /// The velocity that temperatures and pressures are relative to ([`crate::center`]).
    pub fn common_velocity(&self, world: &World) -> DVec3 {
        common_velocity(self.momentum, self.mass, world.conserved)
    }
}

/// The energy balance.
///
/// The loss of a completed series of bounces is added to the sums at the end of the series. Until then the
/// balance includes it as a separate energy.
pub(crate) fn ledger(state: &State, totals: &Totals) -> Ledger {
    let State { world, accumulators, pending, .. } = state;
    let bounces: f64 = pending.values().map(|series| series.energy_loss).sum();
    let [kinetic, potential] = accumulators.initial_energy;
    let dissipated = accumulators.dissipated() + world.friction_loss();
    let mut terms = accumulators.terms();
    terms[Term::WallWork as usize] += totals.carried.0;
    terms[Term::ShearWork as usize] += world.pending_shear_work();
    let supplied = Term::ALL.map(|term| -term.sign() * terms[term as usize]);
    let energies =
        [totals.kinetic, totals.rotational, totals.potential, -kinetic, -potential, dissipated, bounces];
    let energies = || energies.into_iter().chain(supplied);
    let scale = energies().fold(0.0, |scale: f64, energy| scale.max(energy.abs()));
    let balance: Sum = energies().collect();
    Ledger {
        kinetic: totals.kinetic,
        rotational: totals.rotational,
        potential: totals.potential,
        spring: 0.0,
        dissipated,
        carnot: accumulators.carnot(),
        terms,
        residual: if scale > 0.0 { balance.value() / scale } else { 0.0 },
    }
}

/// One row of observables at the present. Starts the next interval of pressure and rates. The flights up to
/// now must have been taken ([`crate::flights::take`]).
pub(crate) fn sample(system: &System, species_table: &Species, state: &mut State, time: f64) -> Sample {
    let totals = Totals::of(&state.world);
    let ledger = ledger(state, &totals);
    let State { world, accumulators, .. } = state;
    let d = system.dimension.count() as f64;
    let common = totals.common_velocity(world);

    // Over all species: Σ m|v − V|², and the sum of the squares of these terms.
    let [second, fourth] = total(world.particles.len(), |i| {
        let class = world.body(i);
        if class.inverse_mass == 0.0 {
            return [0.0; 2];
        }
        let (_, v) = world.peculiar(i, world.now);
        // m|v − V|² instead of |v − V|²: this gives the same a₂ for one mass, and zero a₂ for a mixture in
        // equilibrium.
        let square = class.mass * (v - common).length_squared();
        [square, square * square]
    });
    let (rotational_temperature, species_rotational_temperature) = rotational(system, species_table, world);
    // Per species: number of bodies, Σ m|v − V|². For a single species these sums are known already.
    let species_count = system.species.len() as u32;
    let species: Vec<[f64; 2]> = if species_count == 1 {
        vec![[totals.bodies, second]]
    } else {
        let of_one = |species: u32| {
            total(world.particles.len(), |i| {
                let class = world.body(i);
                if species_table.of(world, i) != species || class.inverse_mass == 0.0 {
                    return [0.0; 2];
                }
                let (_, v) = world.peculiar(i, world.now);
                [1.0, class.mass * (v - common).length_squared()]
            })
        };
        (0..species_count).map(of_one).collect()
    };
    let bodies = totals.bodies;
    let temperature = if bodies > 0.0 { second / (d * bodies) } else { f64::NAN };

    let span = time - accumulators.sampled_at;
    let first = accumulators.sampled_collisions == u64::MAX;
    let counted = accumulators.counters.collisions - if first { 0 } else { accumulators.sampled_collisions };
    let center = accumulators.center.take(time);
    let flights = accumulators.counters.ended_flights() - accumulators.sampled_flights;
    let open = (0..d as usize).any(|axis| system.domain.boundary[axis] == Boundary::Open);
    let pressure = (!open).then(|| {
        if first || span <= 0.0 {
            return f64::NAN;
        }
        let volume: f64 = (0..d as usize).map(|axis| system.domain.size[axis]).product();
        let thermal = accumulators.twice_kinetic(totals.kinetic, time) - center.trace();
        (thermal + accumulators.virial()) / (d * volume * span)
    });
    let periodic = world.periodicity.is_periodic.contains(&true);
    let gravity_impulse = world.force.impulse_until(time);
    let impulse = accumulators.impulse() + totals.carried.1;
    let rate = if first || span <= 0.0 { f64::NAN } else { counted as f64 / span };
    let mut sample = Sample {
        time,
        stress: None,
        wall_force: Vec::new(),
        wall_heat_flow: Vec::new(),
        step: accumulators.counters.collisions + accumulators.counters.wall_collisions,
        ledger,
        temperature,
        species_temperature: species
            .iter()
            .map(|&[bodies, sum]| if bodies > 0.0 { sum / (d * bodies) } else { f64::NAN })
            .collect(),
        rotational_temperature,
        species_rotational_temperature,
        sonine_a2: d * (fourth * bodies) / ((d + 2.0) * second * second) - 1.0,
        pressure,
        momentum: totals.momentum,
        external_impulse: impulse + gravity_impulse,
        angular_momentum: (!periodic).then_some(totals.angular_momentum + totals.spin),
        collisions: accumulators.counters.collisions,
        wall_collisions: accumulators.counters.wall_collisions,
        collision_rate: rate,
        mean_free_time: if first || span <= 0.0 { f64::NAN } else { bodies * span / flights as f64 },
    };
    accumulators.start_interval(time);
    world.complete_walls(time, &mut sample);
    sample
}

/// The rotational temperature of all particles, and of each species.
fn rotational(system: &System, species_table: &Species, world: &World) -> (f64, Vec<f64>) {
    if world.spin.is_none() {
        return (0.0, Vec::new());
    }
    let axes = rotations(system.dimension.count()) as f64;
    let temperature = |chosen: &(dyn Fn(u32) -> bool + Sync)| {
        let [bodies, energy] = total(world.particles.len(), |i| {
            if world.body(i).inverse_mass == 0.0 || !chosen(i) {
                return [0.0; 2];
            }
            [1.0, world.rotation(i, world.now).0]
        });
        if bodies > 0.0 { 2.0 * energy / (axes * bodies) } else { f64::NAN }
    };
    let of_one = |species: u32| temperature(&|i| species_table.of(world, i) == species);
    (temperature(&|_| true), (0..system.species.len() as u32).map(of_one).collect())
}

/// Present position, velocity and image of a particle, wrapped into the box.
pub(crate) fn present(world: &World, i: usize) -> (DVec3, DVec3, [i32; 3]) {
    let (position, mut velocity) = world.state(i as u32, world.now);
    let (position, wraps, change) = world.wrap(position, world.now);
    if world.shear.is_some() {
        velocity += change;
    }
    let image = world.images[i];
    (position, velocity, [image[0] + wraps[0], image[1] + wraps[1], image[2] + wraps[2]])
}

/// The present state of all particles, wrapped into the box.
pub(crate) fn frame(state: &State, time: f64) -> Frame {
    let world = &state.world;
    let count = world.particles.len();
    let mut frame = Frame {
        time,
        step: state.accumulators.counters.collisions + state.accumulators.counters.wall_collisions,
        position: vec![DVec3::ZERO; count],
        velocity: vec![DVec3::ZERO; count],
        image: vec![[0; 3]; count],
        edges: world.edges(world.now),
        angular_velocity: if world.spin.is_some() {
            (0..count as u32).map(|i| world.angular_velocity(i, world.now)).collect()
        } else {
            Vec::new()
        },
    };
    let Frame { position, velocity, image, .. } = &mut frame;
    (position, velocity, image).into_par_iter().enumerate().with_min_len(BLOCK).for_each(
        |(i, (position, velocity, image))| {
            (*position, *velocity, *image) = present(world, i);
            *image = world.image_in_box(*image, world.now);
        },
    );
    frame
}

/// The species of every particle.
#[derive(Debug)]
pub(crate) enum Species {
    /// By class: all particles of a class have one species. This holds for all systems made from scene files.
    OfClass(Vec<u32>),
    /// By particle.
    OfRow(Vec<u32>),
}

impl Species {
    pub fn new(system: &System) -> Self {
        let mut of_class = vec![None; system.classes.len()];
        for body in &system.bodies {
            if *of_class[body.class as usize].get_or_insert(body.species) != body.species {
                return Self::OfRow(system.bodies.iter().map(|body| body.species).collect());
            }
        }
        Self::OfClass(of_class.into_iter().map(Option::unwrap_or_default).collect())
    }

    pub fn of(&self, world: &World, i: u32) -> u32 {
        match self {
            Self::OfClass(species) => species[world.system_class(i)],
            Self::OfRow(species) => species[i as usize],
        }
    }
}

/// A 128-bit hash of every particle's position, velocity and image at the present, and of its spin.
pub(crate) fn hash(world: &World) -> u128 {
    let mut hasher = Xxh3::new();
    // In blocks: hashing a few bytes per call is slow, and a frame would be a copy of all particles.
    let mut block = Vec::with_capacity(60 * BLOCK);
    for start in (0..world.particles.len()).step_by(BLOCK) {
        block.clear();
        for i in start..(start + BLOCK).min(world.particles.len()) {
            let (position, velocity, image) = present(world, i);
            for value in position.to_array().into_iter().chain(velocity.to_array()) {
                block.extend(value.to_le_bytes());
            }
            block.extend(image.into_iter().flat_map(i32::to_le_bytes));
            if world.spin.is_some() {
                let spin = world.angular_velocity(i as u32, world.now);
                block.extend(spin.to_array().into_iter().flat_map(f64::to_le_bytes));
            }
        }
        hasher.update(&block);
    }
    hasher.digest128()
}

/// Least and largest present coordinate of all particles along an axis [length].
fn extent(world: &World, axis: usize) -> (f64, f64) {
    (0..world.particles.len() as u32)
        .into_par_iter()
        .map(|i| world.state(i, world.now).0[axis])
        .fold(|| (f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
        .reduce(|| (f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// The input of partner searches: the geometry of a state. `filled` is the volume that all particles would
/// occupy at the local density of the average particle [length^d].
pub(crate) fn geometry(system: &System, world: &World, filled: f64) -> Geometry {
    use haff_neighbors::{Axis, Plane};
    let mut axes = system.domain.boundary.map(|boundary| match boundary {
        Boundary::Periodic => Axis::Periodic,
        Boundary::Wall => Axis::Bounded,
        Boundary::Open => Axis::Open,
    });
    if system.dimension == Dimension::Two {
        axes[2] = Axis::Flat;
    }
    let classes = world.particles.iter().map(|particle| &world.classes[particle.class()]);
    let radii = |finite: bool| {
        let chosen = classes.clone().filter(|class| (class.inverse_mass != 0.0) == finite);
        chosen.map(|class| class.radius).fold(0.0, f64::max)
    };
    let (movable, fixed) = (radii(true), radii(false));
    // The largest radius of the others, if only one particle has that radius.
    let are_largest = classes.clone().filter(|class| class.inverse_mass != 0.0 && class.radius == movable);
    let smaller = classes.clone().filter(|class| class.inverse_mass != 0.0 && class.radius < movable);
    let second = if are_largest.take(2).count() == 2 {
        movable
    } else {
        smaller.map(|class| class.radius).fold(0.0, f64::max)
    };
    let radius = classes.clone().map(|class| class.radius);
    let uniform = radius.clone().all(|radius| radius == movable);
    let mut size = system.domain.size;
    for axis in 0..3 {
        if axes[axis] == Axis::Open {
            // An open axis has no size; the present extent of the particles is used.
            let (low, high) = extent(world, axis);
            size[axis] = (high - low).max(0.0) + 2.0 * movable.max(fixed);
        }
    }
    let volume: f64 = (0..3).filter(|&axis| axes[axis] != Axis::Flat).map(|axis| size[axis]).product();
    Geometry {
        size,
        axes,
        // Two bodies of infinite mass never touch.
        reach: movable + second.max(fixed),
        crowding: (volume / filled).max(1.0),
        radius: movable,
        radii: if uniform { Vec::new() } else { radius.collect() },
        planes: system
            .walls
            .iter()
            .map(|wall| Plane {
                point: wall.point,
                normal: wall.normal,
                sweep: wall.motion.sweep(wall.normal),
            })
            .collect(),
        sliding: world.sliding_images(),
    }
}
