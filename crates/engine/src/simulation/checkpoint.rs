//! Checkpoints: conversion of the exact state to plain data, and back.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use glam::DVec3;

use crate::{
    measure::{measurements, sample::Species},
    model::{Options, System},
    numerics::{
        error::EngineError,
        scalars::{ScalarReader, ScalarWriter},
        words::Words,
    },
    report::{BlockCounts, Checkpoint},
    simulation::{Simulation, run::actions, valid},
    state::{
        Pending, State,
        accumulators::Accumulators,
        center::Center,
        flight_sums::{FlightSums, Summed},
        force::Force,
        particle::Support,
        population::{Population, spread},
        settling::SettlingState,
        slide::Slide,
        stall::Stall,
        world::World,
    },
};

/// Flags above the code of the walls in [`Checkpoint::resting`]: the particle is asleep; it was recently hit.
const ASLEEP: u32 = 1 << 31;
const RECENTLY_HIT: u32 = 1 << 30;

/// The code of the walls that support a particle: up to three digits, each the index of a wall plus one. The
/// code and the flags share an integer.
struct Digits {
    base: u64,
}

impl Digits {
    fn of(world: &World) -> Self {
        Self { base: world.boundary.walls.len() as u64 + 1 }
    }

    /// Whether three digits do not fit below the flags. The code of each particle is then a separate scalar.
    fn are_wide(&self) -> bool {
        self.base.pow(3) > u64::from(RECENTLY_HIT)
    }

    fn encode(&self, support: Support) -> u64 {
        support.into_iter().flatten().fold(0, |code, wall| code * self.base + u64::from(wall) + 1)
    }

    /// The walls of a code; `None` if it is invalid.
    fn decode(&self, mut code: u64) -> Option<Support> {
        let mut support: Support = [None; 3];
        for slot in &mut support {
            if code != 0 {
                *slot = Some((code % self.base).checked_sub(1)? as u16);
                code /= self.base;
            }
        }
        support.reverse();
        support.sort_by_key(Option::is_none);
        (code == 0).then_some(support)
    }
}

/// Names of the numbers of entries and exits, and of exits up to the last sample.
const PASSAGES: [&str; 3] = ["flow.entered", "flow.left", "flow.left_before"];

/// Names of the sums of a box that is compressed.
const COMPRESSED: [&str; 2] = ["compressed.virial", "compressed.thermal"];

impl Simulation {
    /// The exact present state.
    pub fn checkpoint(&self) -> Checkpoint {
        let State { world, accumulators, pending, settling, stall, population, blocks: _ } = &self.state;
        let mut scalars = ScalarWriter::default();
        scalars.put("clock.exponent", i64::from(world.clock.exponent) as u64);
        scalars.real("clock.base", world.clock.base);
        scalars.real("clock.base_low", world.clock.base_low);
        scalars.real("clock.earliest", world.clock.earliest);
        scalars.put("clock.now", world.now as u64);
        scalars.real("clock.time", self.time());
        scalars.real("clock.extent", world.resolution.extent);
        scalars.real("clock.fastest", world.resolution.fastest);
        for (name, sum) in accumulators.clone().sums_mut() {
            scalars.exact_sum(name, sum);
        }
        for (name, total) in [("force", &world.force.total), ("force_impulse", &world.force.impulse)] {
            scalars.total(name, total);
        }
        scalars.real("force_until", world.force.until);
        scalars.real("sampled_at", accumulators.sampled_at);
        scalars.put("sampled_collisions", accumulators.sampled_collisions);
        scalars.put("sampled_flights", accumulators.sampled_flights);
        accumulators.center.save(&mut scalars);
        if self.system.domain.compression.is_some() {
            for (name, sum) in COMPRESSED.into_iter().zip(accumulators.compressed) {
                scalars.real(name, sum);
            }
        }
        if let Some(flights) = &accumulators.flights {
            flights.save(&mut scalars);
        }
        scalars.real("initial_kinetic", accumulators.initial_energy[0]);
        scalars.real("initial_potential", accumulators.initial_energy[1]);
        scalars.real("max_overlap", accumulators.max_overlap);
        scalars.real("longest_flight", world.resolution.longest_flight);
        let counters = accumulators.counters;
        for (name, count) in [
            ("collisions", counters.collisions),
            ("fixed_collisions", counters.fixed_collisions),
            ("wall_collisions", counters.wall_collisions),
            ("simultaneous", counters.simultaneous),
            ("rests", counters.rests),
            ("predictions", counters.predictions),
            ("dropped", counters.dropped),
            ("stale", counters.stale),
            ("transfers", counters.transfers),
            ("candidates", counters.candidates),
            ("windows", counters.windows),
            ("epochs", counters.epochs),
        ] {
            scalars.put(name, count);
        }
        scalars.put("stall.since", stall.since as u64);
        scalars.put("stall.events", stall.events);
        for i in &stall.particles {
            scalars.put(&format!("stall.particle.{i}"), 1);
        }
        for wall in &stall.walls {
            scalars.put(&format!("stall.wall.{wall}"), 1);
        }
        for (i, rest) in pending {
            scalars.put(&format!("rest.{i}.end"), rest.end as u64);
            scalars.put(&format!("rest.{i}.wall"), u64::from(rest.wall));
            scalars.real(&format!("rest.{i}.speed"), rest.speed);
            scalars.real(&format!("rest.{i}.impulse"), rest.impulse);
            scalars.real(&format!("rest.{i}.energy_loss"), rest.energy_loss);
            scalars.real(&format!("rest.{i}.carnot_energy"), rest.carnot_energy);
            if world.spin.is_some() {
                put_vector(&mut scalars, &format!("rest.{i}.tangential"), rest.tangential);
                scalars.real(&format!("rest.{i}.tangential_loss"), rest.tangential_loss);
            }
        }
        for (i, slide) in world.spin.iter().flat_map(|spins| &spins.slides) {
            let name = |part: &str| format!("slide.{i}.{part}");
            scalars.put(&name("wall"), u64::from(slide.wall));
            scalars.put(&name("since"), slide.since as u64);
            scalars.put(&name("end"), slide.end.unwrap_or(i64::MAX) as u64);
            scalars.put(&name("rolls"), u64::from(slide.rolls));
            scalars.real(&name("lost"), slide.lost);
            for (part, vector) in slide.vectors() {
                put_vector(&mut scalars, &name(part), vector);
            }
        }
        if world.laws.thresholds.is_some() {
            scalars.put("wakes", counters.wakes);
            scalars.put("settling.next", settling.next as u64);
            scalars.put("settling.events", settling.events);
            scalars.put("settling.waited", settling.waited);
            scalars.put("settling.recent_contacts", settling.recent_contacts);
            scalars.put("settling.counted_since", settling.counted_since as u64);
        }
        if let Some(population) = population {
            let numbers = [population.entered, population.left, population.left_before];
            PASSAGES.into_iter().zip(numbers).for_each(|(name, number)| scalars.put(name, number));
        }
        world.save_pistons(&mut scalars);
        self.save_actions(&mut |name, bits| scalars.put(name, bits));
        let digits = Digits::of(world);
        if digits.are_wide() {
            for i in 0..world.particles.len() as u32 {
                if world.particles[i as usize].rests() {
                    scalars.put(&format!("support.{i}"), digits.encode(world.support(i)));
                }
            }
        }
        let resting = |i: u32| {
            let code = if digits.are_wide() { 0 } else { digits.encode(world.support(i)) as u32 };
            let flags =
                [(ASLEEP, world.is_asleep(i)), (RECENTLY_HIT, world.particles[i as usize].is_recently_hit())];
            flags.into_iter().filter(|(_, set)| *set).fold(code, |code, (flag, _)| code | flag)
        };
        let checkpoint = Checkpoint {
            position: world.particles.iter().map(|particle| particle.position).collect(),
            velocity: world.particles.iter().map(|particle| particle.velocity).collect(),
            anchor: world.particles.iter().map(|particle| particle.time).collect(),
            image: world.images.to_vec(),
            angular_velocity: world.spin.as_ref().map_or(Vec::new(), |spins| spins.angular_velocity.to_vec()),
            count: world.particles.iter().map(|particle| particle.count).collect(),
            resting: (0..world.particles.len() as u32).map(resting).collect(),
            scalars: scalars.scalars,
            measured: self.save_measurements(),
        };
        match (&world.ids, population) {
            (Some(ids), Some(population)) => whole(checkpoint, ids, population, world.spin.is_some()),
            _ => checkpoint,
        }
    }

    /// Resumes a checkpoint of the same system. The trajectory has the same bits as without the interruption.
    pub fn restore(system: System, options: Options, checkpoint: &Checkpoint) -> Result<Self, EngineError> {
        let count = system.bodies.len();
        let lengths = [
            checkpoint.position.len(),
            checkpoint.velocity.len(),
            checkpoint.anchor.len(),
            checkpoint.image.len(),
            checkpoint.count.len(),
            checkpoint.resting.len(),
        ];
        let spins = if system.spin.is_some() { count } else { 0 };
        if lengths.iter().any(|&length| length != count) || checkpoint.angular_velocity.len() != spins {
            return Err(EngineError::Checkpoint(format!(
                "the scene has {count} particles, it has {lengths:?}"
            )));
        }
        let species = Species::new(&system);
        let mut population = Population::of(&system);
        let gathered;
        let (system, checkpoint, ids) = match &mut population {
            Some(population) => {
                let ids = present(checkpoint);
                population.counts.clone_from(&checkpoint.count);
                gathered = gather(checkpoint, &ids);
                (system.with_bodies(&ids), &gathered, Some(ids))
            }
            None => (system, checkpoint, None),
        };
        let count = system.bodies.len();
        let mut scalars = ScalarReader::new(&checkpoint.scalars).map_err(EngineError::Checkpoint)?;
        let exponent = valid::exponent(scalars.take("clock.exponent"))?;
        let mut world = World::new(&system, exponent);
        world.ids = ids;
        world.clock.base = scalars.real("clock.base");
        world.clock.base_low = scalars.real("clock.base_low");
        world.clock.earliest = scalars.real("clock.earliest");
        world.now = scalars.take("clock.now") as i64;
        let time = scalars.real("clock.time");
        let (extent, fastest) = (scalars.real("clock.extent"), scalars.real("clock.fastest"));
        world.set_fastest(extent, fastest);
        let epochs = scalars.take("epochs");
        valid::clock(&world.clock, world.now, time, epochs)?;
        valid::particles(&system, &world, checkpoint)?;
        for i in 0..count {
            let particle = &mut world.particles[i];
            particle.position = checkpoint.position[i];
            particle.velocity = checkpoint.velocity[i];
            particle.time = checkpoint.anchor[i];
            particle.count = checkpoint.count[i];
        }
        world.images.copy_from_slice(&checkpoint.image);
        if let Some(spins) = &mut world.spin {
            spins.angular_velocity.copy_from_slice(&checkpoint.angular_velocity);
        }
        let digits = Digits::of(&world);
        for (i, &code) in checkpoint.resting.iter().enumerate() {
            let name = format!("support.{i}");
            let wide = if digits.are_wide() { scalars.take_if_present(&name) } else { None };
            if code == 0 && wide.is_none() {
                continue;
            }
            let (asleep, recently_hit) = (code & ASLEEP != 0, code & RECENTLY_HIT != 0);
            let walls = wide.unwrap_or(u64::from(code & !(ASLEEP | RECENTLY_HIT)));
            let Some(support) = digits.decode(walls) else {
                let (most, name) =
                    (world.boundary.walls.len(), if wide.is_some() { "support" } else { "resting" });
                return Err(EngineError::Checkpoint(format!(
                    "{name}[{i}] = {walls} must be up to three numbers of the scene's {most} walls"
                )));
            };
            if asleep && world.laws.thresholds.is_some() {
                world.restore_asleep(i as u32, true);
            }
            world.particles[i].set_recently_hit(recently_hit);
            if walls != 0 {
                world.replace_support(i as u32, support);
            }
            valid::support(&world, i as u32, u64::from(code), asleep, recently_hit)?;
        }
        let mut accumulators = Accumulators::default();
        for (name, sum) in accumulators.sums_mut() {
            *sum = scalars.exact_sum(name);
        }
        world.force = Force {
            total: scalars.total("force"),
            impulse: scalars.total("force_impulse"),
            until: scalars.real("force_until"),
            rates: world.force.rates,
        };
        accumulators.sampled_at = scalars.real("sampled_at");
        accumulators.sampled_collisions = scalars.take("sampled_collisions");
        accumulators.sampled_flights = scalars.take("sampled_flights");
        if system.domain.compression.is_some() {
            accumulators.compressed = COMPRESSED.map(|name| scalars.real(name));
        }
        accumulators.center = Center::of(&world, 0.0);
        accumulators.center.load(&mut scalars);
        if world.flights != Summed::Nothing {
            accumulators.flights = Some(Box::new(FlightSums::load(&mut scalars)));
        }
        accumulators.initial_energy = [scalars.real("initial_kinetic"), scalars.real("initial_potential")];
        accumulators.max_overlap = scalars.real("max_overlap");
        world.resolution.longest_flight = scalars.real("longest_flight");
        let counters = &mut accumulators.counters;
        counters.collisions = scalars.take("collisions");
        counters.fixed_collisions = scalars.take("fixed_collisions");
        counters.wall_collisions = scalars.take("wall_collisions");
        // Files of earlier versions lack it.
        counters.simultaneous = scalars.take_if_present("simultaneous").unwrap_or(0);
        counters.rests = scalars.take("rests");
        counters.dropped = scalars.take("dropped");
        counters.stale = scalars.take("stale");
        counters.transfers = scalars.take("transfers");
        counters.epochs = epochs;
        let mut settling = SettlingState::default();
        if world.laws.thresholds.is_some() {
            accumulators.counters.wakes = scalars.take("wakes");
            settling.next = scalars.take("settling.next") as i64;
            settling.events = scalars.take("settling.events");
            settling.waited = scalars.take("settling.waited");
            settling.recent_contacts = scalars.take("settling.recent_contacts");
            settling.counted_since = scalars.take("settling.counted_since") as i64;
        }
        let predictions = scalars.take("predictions");
        let candidates = scalars.take("candidates");
        let windows = scalars.take("windows");
        let mut pending = BTreeMap::new();
        for i in scalars.numbers::<u32>("rest.", ".end") {
            let rest = Pending {
                end: scalars.take(&format!("rest.{i}.end")) as i64,
                wall: scalars.take(&format!("rest.{i}.wall")) as u32,
                speed: scalars.real(&format!("rest.{i}.speed")),
                impulse: scalars.real(&format!("rest.{i}.impulse")),
                energy_loss: scalars.real(&format!("rest.{i}.energy_loss")),
                carnot_energy: scalars.real(&format!("rest.{i}.carnot_energy")),
                tangential: vector(&mut scalars, &format!("rest.{i}.tangential"), world.spin.is_some()),
                tangential_loss: if world.spin.is_some() {
                    scalars.real(&format!("rest.{i}.tangential_loss"))
                } else {
                    0.0
                },
            };
            pending.insert(i, rest);
        }
        for i in scalars.numbers::<u32>("slide.", ".wall") {
            let name = |part: &str| format!("slide.{i}.{part}");
            let end = scalars.take(&name("end")) as i64;
            let mut slide = Slide {
                wall: scalars.take(&name("wall")) as u32,
                since: scalars.take(&name("since")) as i64,
                end: (end != i64::MAX).then_some(end),
                rolls: scalars.take(&name("rolls")) != 0,
                lost: scalars.real(&name("lost")),
                ..Slide::default()
            };
            for (part, value) in slide.vectors_mut() {
                *value = vector(&mut scalars, &name(part), true);
            }
            valid::slide(&world, i, &slide)?;
            if let Some(spins) = &mut world.spin {
                spins.slides.insert(i, slide);
            }
        }
        let stall = Stall {
            since: scalars.take("stall.since") as i64,
            events: scalars.take("stall.events"),
            particles: members(&mut scalars, "stall.particle."),
            walls: members(&mut scalars, "stall.wall."),
        };
        if let Some(population) = &mut population {
            let [entered, left, left_before] = PASSAGES.map(|name| scalars.take(name));
            valid::passages(&system, count, [entered, left, left_before])?;
            (population.entered, population.left, population.left_before) = (entered, left, left_before);
        }
        world.load_pistons(&mut scalars);
        valid::pistons(&world)?;
        let mut actions = actions(&system);
        for action in &mut actions {
            action.load(&mut |name| scalars.take(name), time)?;
        }
        scalars.finish().map_err(EngineError::Checkpoint)?;
        for (&i, rest) in &pending {
            valid::pending(&world, i, rest)?;
        }
        (
            accumulators.counters.predictions,
            accumulators.counters.candidates,
            accumulators.counters.windows,
        ) = (predictions, candidates, windows);
        valid::accumulators(&mut accumulators, &world.clock, time)?;
        let mut state = State {
            world,
            accumulators,
            pending,
            stall,
            settling,
            blocks: BlockCounts::default(),
            population,
        };
        valid::whole(&system, &state, time)?;
        let mut measurements = measurements(&system, &state);
        let mut words = Words::new(&checkpoint.measured);
        let now = state.world.now;
        if let Some(times) = &mut state.world.laws.contact_times {
            times.load(&mut words, now)?;
        }
        if let Some(sums) = &mut state.world.boundary.wall_sums {
            sums.load(&mut words, time)?;
        }
        for measurement in &mut measurements {
            measurement.load(&mut words, time)?;
        }
        words.finish()?;
        let mut simulation = Self::start((system, species), options, state, actions, measurements)?;
        simulation.find_contacts_of_asleep();
        // The predictions after a resumption are not part of the run: their counters are restored.
        let counters = &mut simulation.state.accumulators.counters;
        (counters.predictions, counters.candidates, counters.windows) = (predictions, candidates, windows);
        simulation.set_stop_time(time);
        Ok(simulation)
    }
}

/// The time of the anchor of a particle that is not there.
const ABSENT: i64 = i64::MIN;

/// The checkpoint of the particles that are there as one of all.
fn whole(checkpoint: Checkpoint, ids: &[u32], population: &Population, has_spins: bool) -> Checkpoint {
    let all = population.all();
    let spins = if has_spins { all } else { 0 };
    Checkpoint {
        position: spread(ids, &checkpoint.position, vec![DVec3::ZERO; all]),
        velocity: spread(ids, &checkpoint.velocity, vec![DVec3::ZERO; all]),
        anchor: spread(ids, &checkpoint.anchor, vec![ABSENT; all]),
        image: spread(ids, &checkpoint.image, vec![[0; 3]; all]),
        count: spread(ids, &checkpoint.count, population.counts.clone()),
        angular_velocity: spread(ids, &checkpoint.angular_velocity, vec![DVec3::ZERO; spins]),
        resting: spread(ids, &checkpoint.resting, vec![0; all]),
        ..checkpoint
    }
}

/// The particles of a checkpoint that are there.
fn present(checkpoint: &Checkpoint) -> Arc<[u32]> {
    let anchors = (0..).zip(&checkpoint.anchor);
    anchors.filter(|(_, anchor)| **anchor != ABSENT).map(|(id, _)| id).collect()
}

/// The checkpoint of the particles with these ids, of which [`whole`] was made.
fn gather(checkpoint: &Checkpoint, ids: &[u32]) -> Checkpoint {
    fn those<T: Clone>(values: &[T], ids: &[u32]) -> Vec<T> {
        ids.iter().filter_map(|&id| values.get(id as usize).cloned()).collect()
    }
    Checkpoint {
        position: those(&checkpoint.position, ids),
        velocity: those(&checkpoint.velocity, ids),
        anchor: those(&checkpoint.anchor, ids),
        image: those(&checkpoint.image, ids),
        count: those(&checkpoint.count, ids),
        angular_velocity: those(&checkpoint.angular_velocity, ids),
        resting: those(&checkpoint.resting, ids),
        scalars: checkpoint.scalars.clone(),
        measured: checkpoint.measured.clone(),
    }
}

fn put_vector(scalars: &mut ScalarWriter, name: &str, vector: DVec3) {
    for (axis, component) in ["x", "y", "z"].into_iter().zip(vector.to_array()) {
        scalars.real(&format!("{name}.{axis}"), component);
    }
}

/// Takes the components of a vector; zero if the scene has none.
fn vector(scalars: &mut ScalarReader, name: &str, exists: bool) -> DVec3 {
    if !exists {
        return DVec3::ZERO;
    }
    DVec3::from_array(["x", "y", "z"].map(|axis| scalars.real(&format!("{name}.{axis}"))))
}

/// Takes all scalars whose name is this prefix and a number. Returns the numbers.
fn members(scalars: &mut ScalarReader, prefix: &str) -> BTreeSet<u32> {
    let numbers = scalars.numbers(prefix, "");
    for number in &numbers {
        scalars.take(&format!("{prefix}{number}"));
    }
    numbers.into_iter().collect()
}
