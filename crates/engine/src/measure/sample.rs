//! One row of observables.

use crate::{
    measure::totals::{Totals, ledger},
    model::{Boundary, System, spin::rotations},
    numerics::total::total,
    report::Sample,
    state::{State, world::World},
};

/// The species of every particle.
#[derive(Debug)]
pub(crate) enum Species {
    /// By class: all particles of a class have one species. This holds for all systems made from scene files.
    OfClass(Vec<u32>),
    /// By particle.
    OfRow(Vec<u32>),
}

impl Species {
    /// The species of the bodies of a system.
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
            Self::OfRow(species) => species[world.id(i) as usize],
        }
    }
}

/// One row of observables at the present. Starts the next interval of pressure and rates. The flights up to
/// now must have been taken ([`crate::motion::flights::take`]).
pub(crate) fn sample(system: &System, species_table: &Species, state: &mut State, time: f64) -> Sample {
    let totals = Totals::of(&state.world);
    let ledger = ledger(state, &totals);
    let State { world, accumulators, population, .. } = state;
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
    let volume = if open { f64::NAN } else { system.domain.volume(system.dimension, time) };
    let thermal = accumulators.twice_kinetic(totals.kinetic, time) - center.trace();
    if system.domain.compression.is_some() {
        accumulators.compressed[0] += accumulators.virial();
        accumulators.compressed[1] += thermal;
    }
    let pressure = (!open).then(|| {
        if first || span <= 0.0 {
            return f64::NAN;
        }
        let volume = system.domain.mean_volume(system.dimension, [accumulators.sampled_at, time]);
        (thermal + accumulators.virial()) / (d * volume * span)
    });
    let periodic = world.boundary.periodicity.is_periodic.contains(&true);
    let gravity_impulse = world.force.impulse_until(time);
    let impulse = accumulators.impulse() + totals.carried.1 + totals.drag.1;
    let pistons = world.states_of_pistons();
    let rate = if first || span <= 0.0 { f64::NAN } else { counted as f64 / span };
    let mut sample = Sample {
        time,
        box_volume: volume,
        packing_fraction: if system.domain.compression.is_some() {
            packing_fraction(system, world, time)
        } else {
            f64::NAN
        },
        stress: None,
        wall_force: Vec::new(),
        wall_heat_flow: Vec::new(),
        pair_collision_rate: Vec::new(),
        species_mean_free_time: Vec::new(),
        piston_position: pistons.iter().map(|[position, _]| *position).collect(),
        piston_velocity: pistons.iter().map(|[_, velocity]| *velocity).collect(),
        probes: Vec::new(),
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
        particles: 0,
        particles_in: 0,
        particles_out: 0,
        discharge_rate: f64::NAN,
        mean_free_time: if first || span <= 0.0 { f64::NAN } else { bodies * span / flights as f64 },
    };
    if let Some(population) = population {
        sample.particles = world.movable as u64;
        [sample.particles_in, sample.particles_out] = population.passages();
        let left = population.left - std::mem::replace(&mut population.left_before, population.left);
        sample.discharge_rate = if first || span <= 0.0 { f64::NAN } else { left as f64 / span };
    }
    accumulators.start_interval(time);
    world.complete_walls(time, &mut sample);
    sample
}

/// The part of the box that the particles fill at `time`.
pub(crate) fn packing_fraction(system: &System, world: &World, time: f64) -> f64 {
    let [filled] = total(world.particles.len(), |i| [system.dimension.volume(world.body(i).radius)]);
    filled / system.domain.volume(system.dimension, time)
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
