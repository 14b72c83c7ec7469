//! Checkpoints: the exact state as plain data, and back.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    accumulators::Accumulators,
    error::EngineError,
    force::{Force, Total},
    ledger::Term,
    model::{Options, System},
    particles::{Support, World},
    report::Checkpoint,
    rest::state::SettlingState,
    simulation::{Simulation, actions},
    stall::Stall,
    state::{Pending, State},
    sum::Sum,
    valid,
};

/// Flags above the walls in [`Checkpoint::resting`]: the particle is asleep; it was last among grains.
const ASLEEP: u32 = 1 << 31;
const RECENTLY_HIT: u32 = 1 << 30;

/// The code of the walls that a particle rests on: up to three digits, each a wall's index plus one. It
/// shares an integer with the flags.
struct Digits {
    base: u64,
}

impl Digits {
    fn of(world: &World) -> Self {
        Self { base: world.walls.len() as u64 + 1 }
    }

    /// Whether three digits do not fit below the flags. Then each particle's code is a scalar of its own.
    fn are_wide(&self) -> bool {
        self.base.pow(3) > u64::from(RECENTLY_HIT)
    }

    fn encode(&self, support: Support) -> u64 {
        support.into_iter().flatten().fold(0, |code, wall| code * self.base + u64::from(wall) + 1)
    }

    /// The walls of a code; `None` if it is invalid.
    fn decode(&self, mut code: u64) -> Option<Support> {
        let mut support: Support = [None; 3];
        for place in &mut support {
            if code != 0 {
                *place = Some((code % self.base).checked_sub(1)? as u16);
                code /= self.base;
            }
        }
        support.reverse();
        support.sort_by_key(Option::is_none);
        (code == 0).then_some(support)
    }
}

/// Parts of the names of vectors.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Reads and writes the named scalars of a checkpoint in one and the same order, so that the two cannot
/// disagree.
struct Scalars<'a> {
    values: BTreeMap<&'a str, u64>,
    missing: Option<String>,
}

impl Scalars<'_> {
    fn take(&mut self, name: &str) -> u64 {
        self.values.remove(name).unwrap_or_else(|| {
            self.missing.get_or_insert_with(|| name.to_owned());
            0
        })
    }

    fn real(&mut self, name: &str) -> f64 {
        f64::from_bits(self.take(name))
    }

    fn sum(&mut self, name: &str) -> Sum {
        Sum { high: self.real(&format!("{name}.high")), low: self.real(&format!("{name}.low")) }
    }

    /// The numbers that end the names with this prefix.
    fn members(&mut self, prefix: &str) -> BTreeSet<u32> {
        let mut members = BTreeSet::new();
        self.values.retain(|name, _| {
            let number: Option<u32> = name.strip_prefix(prefix).and_then(|number| number.parse().ok());
            members.extend(number);
            number.is_none()
        });
        members
    }

    fn total(&mut self, name: &str) -> Total {
        AXES.map(|axis| self.sum(&format!("{name}.{axis}")))
    }
}

impl Simulation {
    /// The exact state now.
    pub fn checkpoint(&self) -> Checkpoint {
        let State { world, accumulators, pending, settling, stall } = &self.state;
        let mut scalars: Vec<(String, u64)> = Vec::new();
        let mut put = |name: &str, bits: u64| scalars.push((name.to_owned(), bits));
        put("clock.exponent", i64::from(world.clock.exponent) as u64);
        put("clock.base", world.clock.base.to_bits());
        put("clock.base_low", world.clock.base_low.to_bits());
        put("clock.now", world.now as u64);
        put("clock.time", self.time().to_bits());
        let terms = Term::ALL.into_iter().zip(accumulators.terms).map(|(term, sum)| (term.name(), sum));
        for (name, sum) in terms.chain([
            ("dissipated", accumulators.dissipated),
            ("carnot", accumulators.carnot),
            ("virial", accumulators.virial),
            ("loss_moment", accumulators.loss_moment),
        ]) {
            put(&format!("{name}.high"), sum.high.to_bits());
            put(&format!("{name}.low"), sum.low.to_bits());
        }
        for (name, total) in [
            ("impulse", &accumulators.impulse),
            ("force", &world.force.total),
            ("force_impulse", &world.force.impulse),
        ] {
            for (axis, sum) in AXES.into_iter().zip(total) {
                put(&format!("{name}.{axis}.high"), sum.high.to_bits());
                put(&format!("{name}.{axis}.low"), sum.low.to_bits());
            }
        }
        put("force_until", world.force.until.to_bits());
        put("sampled_at", accumulators.sampled_at.to_bits());
        put("sampled_collisions", accumulators.sampled_collisions);
        put("sampled_kinetic", accumulators.sampled_kinetic.to_bits());
        put("initial_kinetic", accumulators.initial_energy[0].to_bits());
        put("initial_potential", accumulators.initial_energy[1].to_bits());
        put("max_overlap", accumulators.max_overlap.to_bits());
        put("longest_flight", world.longest_flight.to_bits());
        let counters = accumulators.counters;
        for (name, count) in [
            ("collisions", counters.collisions),
            ("wall_collisions", counters.wall_collisions),
            ("rests", counters.rests),
            ("predictions", counters.predictions),
            ("dropped", counters.dropped),
            ("stale", counters.stale),
            ("transfers", counters.transfers),
            ("candidates", counters.candidates),
            ("windows", counters.windows),
            ("epochs", counters.epochs),
        ] {
            put(name, count);
        }
        put("stall.since", stall.since as u64);
        put("stall.events", stall.events);
        for i in &stall.particles {
            put(&format!("stall.particle.{i}"), 1);
        }
        for wall in &stall.walls {
            put(&format!("stall.wall.{wall}"), 1);
        }
        for (i, rest) in pending {
            put(&format!("rest.{i}.end"), rest.end as u64);
            put(&format!("rest.{i}.wall"), u64::from(rest.wall));
            put(&format!("rest.{i}.speed"), rest.speed.to_bits());
            put(&format!("rest.{i}.impulse"), rest.impulse.to_bits());
            put(&format!("rest.{i}.energy_loss"), rest.energy_loss.to_bits());
            put(&format!("rest.{i}.carnot_energy"), rest.carnot_energy.to_bits());
        }
        if world.thresholds.is_some() {
            put("wakes", counters.wakes);
            put("settling.next", settling.next as u64);
            put("settling.events", settling.events);
            put("settling.waited", settling.waited);
            put("settling.recent_contacts", settling.recent_contacts);
            put("settling.counted_since", settling.counted_since as u64);
        }
        self.save_actions(&mut put);
        let digits = Digits::of(world);
        if digits.are_wide() {
            for i in 0..world.particles.len() as u32 {
                if world.particles[i as usize].rests() {
                    put(&format!("support.{i}"), digits.encode(world.support(i)));
                }
            }
        }
        let resting = |i: u32| {
            let code = if digits.are_wide() { 0 } else { digits.encode(world.support(i)) as u32 };
            let flags =
                [(ASLEEP, world.is_asleep(i)), (RECENTLY_HIT, world.particles[i as usize].is_recently_hit())];
            flags.into_iter().filter(|(_, set)| *set).fold(code, |code, (flag, _)| code | flag)
        };
        Checkpoint {
            position: world.particles.iter().map(|particle| particle.position).collect(),
            velocity: world.particles.iter().map(|particle| particle.velocity).collect(),
            anchor: world.particles.iter().map(|particle| particle.time).collect(),
            image: world.images.clone(),
            count: world.particles.iter().map(|particle| particle.count).collect(),
            resting: (0..world.particles.len() as u32).map(resting).collect(),
            scalars,
        }
    }

    /// Goes on from a checkpoint of the same system, bit by bit as if it had never stopped.
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
        if lengths.iter().any(|&length| length != count) {
            return Err(EngineError::Checkpoint(format!(
                "the scene has {count} particles, it has {lengths:?}"
            )));
        }
        let mut scalars = Scalars {
            values: checkpoint.scalars.iter().map(|(name, bits)| (name.as_str(), *bits)).collect(),
            missing: None,
        };
        if scalars.values.len() != checkpoint.scalars.len() {
            return Err(EngineError::Checkpoint("a scalar stands there twice".to_owned()));
        }
        let exponent = valid::exponent(scalars.take("clock.exponent"))?;
        let mut world = World::new(&system, exponent);
        world.clock.base = scalars.real("clock.base");
        world.clock.base_low = scalars.real("clock.base_low");
        world.now = scalars.take("clock.now") as i64;
        let time = scalars.real("clock.time");
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
        world.images.clone_from(&checkpoint.image);
        let digits = Digits::of(&world);
        for (i, &code) in checkpoint.resting.iter().enumerate() {
            let name = format!("support.{i}");
            let wide = if digits.are_wide() { scalars.values.remove(name.as_str()) } else { None };
            if code == 0 && wide.is_none() {
                continue;
            }
            let (asleep, recently_hit) = (code & ASLEEP != 0, code & RECENTLY_HIT != 0);
            let walls = wide.unwrap_or(u64::from(code & !(ASLEEP | RECENTLY_HIT)));
            let Some(support) = digits.decode(walls) else {
                let (most, name) = (world.walls.len(), if wide.is_some() { "support" } else { "resting" });
                return Err(EngineError::Checkpoint(format!(
                    "{name}[{i}] = {walls} must be up to three numbers of the scene's {most} walls"
                )));
            };
            if asleep && world.thresholds.is_some() {
                world.restore_asleep(i as u32, true);
            }
            world.particles[i].set_recently_hit(recently_hit);
            if walls != 0 {
                world.replace_support(i as u32, support);
            }
            valid::support(&world, i as u32, u64::from(code), asleep, recently_hit)?;
        }
        let mut accumulators = Accumulators {
            dissipated: scalars.sum("dissipated"),
            carnot: scalars.sum("carnot"),
            terms: Term::ALL.map(|term| scalars.sum(term.name())),
            impulse: scalars.total("impulse"),
            virial: scalars.sum("virial"),
            loss_moment: scalars.sum("loss_moment"),
            ..Accumulators::default()
        };
        world.force = Force {
            total: scalars.total("force"),
            impulse: scalars.total("force_impulse"),
            until: scalars.real("force_until"),
        };
        accumulators.sampled_at = scalars.real("sampled_at");
        accumulators.sampled_collisions = scalars.take("sampled_collisions");
        accumulators.sampled_kinetic = scalars.real("sampled_kinetic");
        accumulators.initial_energy = [scalars.real("initial_kinetic"), scalars.real("initial_potential")];
        accumulators.max_overlap = scalars.real("max_overlap");
        world.longest_flight = scalars.real("longest_flight");
        let counters = &mut accumulators.counters;
        counters.collisions = scalars.take("collisions");
        counters.wall_collisions = scalars.take("wall_collisions");
        counters.rests = scalars.take("rests");
        counters.dropped = scalars.take("dropped");
        counters.stale = scalars.take("stale");
        counters.transfers = scalars.take("transfers");
        counters.epochs = epochs;
        let mut settling = SettlingState::default();
        if world.thresholds.is_some() {
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
        let resting: Vec<u32> = scalars
            .values
            .keys()
            .filter_map(|name| name.strip_prefix("rest.")?.strip_suffix(".end")?.parse().ok())
            .collect();
        let mut pending = BTreeMap::new();
        for i in resting {
            let rest = Pending {
                end: scalars.take(&format!("rest.{i}.end")) as i64,
                wall: scalars.take(&format!("rest.{i}.wall")) as u32,
                speed: scalars.real(&format!("rest.{i}.speed")),
                impulse: scalars.real(&format!("rest.{i}.impulse")),
                energy_loss: scalars.real(&format!("rest.{i}.energy_loss")),
                carnot_energy: scalars.real(&format!("rest.{i}.carnot_energy")),
            };
            pending.insert(i, rest);
        }
        let stall = Stall {
            since: scalars.take("stall.since") as i64,
            events: scalars.take("stall.events"),
            particles: scalars.members("stall.particle."),
            walls: scalars.members("stall.wall."),
        };
        let mut actions = actions(&system);
        for action in &mut actions {
            action.load(&mut |name| scalars.take(name), time)?;
        }
        if let Some(name) = scalars.missing {
            return Err(EngineError::Checkpoint(format!("it lacks {name}")));
        }
        if let Some(name) = scalars.values.keys().next() {
            return Err(EngineError::Checkpoint(format!(
                "{name} is unknown; it was written by another version"
            )));
        }
        for (&i, rest) in &pending {
            valid::pending(&world, i, rest)?;
        }
        (
            accumulators.counters.predictions,
            accumulators.counters.candidates,
            accumulators.counters.windows,
        ) = (predictions, candidates, windows);
        valid::accumulators(&accumulators, &world.clock, time)?;
        let state = State { world, accumulators, pending, stall, settling };
        valid::whole(&system, &state, time)?;
        let mut simulation = Self::start(system, options, state, actions)?;
        simulation.find_contacts_of_sleeping();
        // Predicting everything afresh is no part of the run.
        let counters = &mut simulation.state.accumulators.counters;
        (counters.predictions, counters.candidates, counters.windows) = (predictions, candidates, windows);
        simulation.stand_at(time);
        Ok(simulation)
    }
}
