//! The exact state as plain data, in the engine's own type, so that the same code records both.

use std::collections::BTreeMap;

use glam::DVec3;
use haff_engine::{Checkpoint, System};

use crate::{
    error::LinkageError,
    instant::Instant,
    mechanism::Link,
    model::Joints,
    simulation::Simulation,
    sum::Sum,
    valid,
    world::{Pending, World},
};

/// Version of the scalars below.
const VERSION: u64 = 3;

impl Simulation {
    /// The exact state: anchors of all particles, and everything else as named scalars. A simulation
    /// [restored](Self::restore) from it continues with the same bits.
    pub fn checkpoint(&self) -> Checkpoint {
        let world = &self.world;
        let n = world.count();
        let mut scalars: Vec<(String, u64)> = Vec::new();
        let mut put = |name: String, bits: u64| scalars.push((name, bits));
        put("linkage.version".into(), VERSION);
        put("now.high".into(), world.now.high.to_bits());
        put("now.low".into(), world.now.low.to_bits());
        put("clock.time".into(), self.time().to_bits());
        // An impact that does not end is then given up at the same event after a resume.
        put("stall.since.high".into(), self.stall.0.high.to_bits());
        put("stall.since.low".into(), self.stall.0.low.to_bits());
        put("stall.events".into(), self.stall.1);
        let accumulators = &world.accumulators;
        put("initial_kinetic".into(), accumulators.initial_kinetic.to_bits());
        put("initial_potential".into(), accumulators.initial_potential.to_bits());
        put("max_overlap".into(), accumulators.max_overlap.to_bits());
        put("sampled_at".into(), accumulators.sampled_at.to_bits());
        put("sampled_collisions".into(), accumulators.sampled_collisions);
        put("collisions".into(), accumulators.counters.collisions);
        put("wall_collisions".into(), accumulators.counters.wall_collisions);
        put("rests".into(), accumulators.counters.rests);
        put("predictions".into(), accumulators.counters.predictions);
        let mut sum = |name: &str, sum: &Sum| {
            scalars.push((format!("{name}.high"), sum.high.to_bits()));
            scalars.push((format!("{name}.low"), sum.low.to_bits()));
        };
        sum("dissipated", &accumulators.dissipated);
        sum("carnot", &accumulators.carnot);
        sum("work", &accumulators.work);
        for axis in 0..3 {
            sum(&format!("impulse.{axis}"), &accumulators.impulse[axis]);
            sum(&format!("moment.{axis}"), &accumulators.moment[axis]);
        }
        let mut put = |name: String, bits: u64| scalars.push((name, bits));
        for i in 0..n {
            put(format!("body.{i}"), world.body[i] as u64);
            put(format!("clings.{i}"), u64::from(world.sticks_to_wall[i]));
            for (axis, x) in ["x", "y", "z"].into_iter().zip(world.offset[i].to_array()) {
                put(format!("offset.{i}.{axis}"), x.to_bits());
            }
        }
        for (flight_key, flight) in &world.flights {
            put(format!("flight.{flight_key}.start.high"), flight.start.high.to_bits());
            put(format!("flight.{flight_key}.start.low"), flight.start.low.to_bits());
            put(format!("flight.{flight_key}.hint"), flight.hint.to_bits());
            for (k, &body) in flight.bodies.iter().enumerate() {
                put(format!("flight.{flight_key}.body.{k}"), body as u64);
            }
            for (k, row) in flight.mechanism.rows.iter().enumerate() {
                put(format!("flight.{flight_key}.row.{k}"), encode(row.link));
            }
        }
        for (p, &taut) in world.taut.iter().enumerate() {
            put(format!("taut.{p}"), u64::from(taut));
        }
        for (link, axis) in &world.closed {
            for (name, x) in ["x", "y", "z"].into_iter().zip(axis.to_array()) {
                put(format!("closed.{}.{name}", encode(*link)), x.to_bits());
            }
        }
        for (link, rest) in &world.pending {
            let name = format!("rest.{}", encode(*link));
            put(format!("{name}.end.high"), rest.end.high.to_bits());
            put(format!("{name}.end.low"), rest.end.low.to_bits());
            put(format!("{name}.speed"), rest.speed.to_bits());
            put(format!("{name}.impulse"), rest.impulse.to_bits());
            put(format!("{name}.energy_loss"), rest.energy_loss.to_bits());
            put(format!("{name}.carnot_energy"), rest.carnot_energy.to_bits());
        }
        Checkpoint {
            position: world.anchor.iter().map(|(x, _)| *x).collect(),
            velocity: world.anchor.iter().map(|(_, v)| *v).collect(),
            anchor: vec![0; n],
            image: vec![[0; 3]; n],
            count: vec![0; n],
            resting: vec![0; n],
            scalars,
        }
    }

    /// Continues from a checkpoint of the same system and joints.
    ///
    /// # Errors
    /// [`LinkageError::Checkpoint`] if it belongs to another system, and the errors of [`Self::new`].
    pub fn restore(system: System, joints: Joints, checkpoint: &Checkpoint) -> Result<Self, LinkageError> {
        crate::check::check_elements(&system, &joints)?;
        let (system, joints) = crate::check::with_exact_lengths(system, joints)?;
        let mut world = World::new(system, joints);
        let n = world.count();
        valid::arrays(checkpoint, n)?;
        let mut scalars = Scalars {
            values: checkpoint.scalars.iter().map(|(name, bits)| (name.clone(), *bits)).collect(),
            wrong: None,
        };
        if scalars.values.len() != checkpoint.scalars.len() {
            return Err(LinkageError::Checkpoint("a scalar occurs twice".into()));
        }
        if scalars.take("linkage.version") != VERSION {
            return Err(LinkageError::Checkpoint(
                "it was written by another version, or belongs to a scene without joints".into(),
            ));
        }
        world.anchor = checkpoint.position.iter().copied().zip(checkpoint.velocity.iter().copied()).collect();
        world.now = scalars.instant("now");
        let time = scalars.real("clock.time");
        scalars.accumulators(&mut world);
        for i in 0..n {
            world.body[i] = scalars.index(&format!("body.{i}"), n);
            world.sticks_to_wall[i] = scalars.flag(&format!("clings.{i}"));
            world.offset[i] = scalars.vector(&format!("offset.{i}"));
        }
        world.body_mass = (0..n).map(|body| world.mass_of(body)).collect();
        for p in 0..world.taut.len() {
            world.taut[p] = scalars.flag(&format!("taut.{p}"));
        }
        for code in scalars.codes("closed.", ".x") {
            let axis = scalars.vector(&format!("closed.{code}"));
            world.closed.insert(scalars.link(code, &world), axis);
        }
        for code in scalars.codes("rest.", ".speed") {
            let name = format!("rest.{code}");
            let rest = Pending {
                end: scalars.instant(&format!("{name}.end")),
                speed: scalars.real(&format!("{name}.speed")),
                impulse: scalars.real(&format!("{name}.impulse")),
                energy_loss: scalars.real(&format!("{name}.energy_loss")),
                carnot_energy: scalars.real(&format!("{name}.carnot_energy")),
            };
            world.pending.insert(scalars.link(code, &world), rest);
        }
        let mut flights = Vec::new();
        let flight_keys = scalars.codes("flight.", ".hint");
        for flight_key in &flight_keys {
            let name = format!("flight.{flight_key}");
            let start = scalars.instant(&format!("{name}.start"));
            let hint = scalars.real(&format!("{name}.hint"));
            let mut bodies = Vec::new();
            while scalars.values.contains_key(&format!("{name}.body.{}", bodies.len())) {
                bodies.push(scalars.index(&format!("{name}.body.{}", bodies.len()), n));
            }
            let mut links = Vec::new();
            while scalars.values.contains_key(&format!("{name}.row.{}", links.len())) {
                let code = scalars.take(&format!("{name}.row.{}", links.len()));
                links.push(scalars.link(code, &world));
            }
            flights.push((start, hint, bodies, links));
        }
        let stall = (scalars.instant("stall.since"), scalars.take("stall.events"));
        scalars.finish()?;
        valid::state(&world, time)?;
        valid::stall(stall, world.now)?;
        for (flight_key, (start, hint, bodies, links)) in flight_keys.into_iter().zip(&flights) {
            valid::flight(&world, flight_key, [*start, world.now], *hint, bodies, links)?;
        }
        valid::bodies_in_flight(&world, flights.iter().flat_map(|(_, _, bodies, _)| bodies))?;
        // Immovable bodies first: rows of the others may end on them.
        flights.sort_by_key(|(_, _, bodies, _)| !bodies.iter().any(|&body| world.immovable(body)));
        let now = world.now;
        for (start, hint, bodies, links) in flights {
            world.now = start;
            if let [body] = bodies[..]
                && world.immovable(body)
            {
                world.start_immovable_flight(body);
                continue;
            }
            let mechanism = world.mechanism(&bodies, &links, start);
            let states = world.anchors(&bodies);
            let flight_key = bodies[0];
            world.start_flight(bodies, mechanism, &states, hint).map_err(|_| {
                LinkageError::Checkpoint(format!(
                    "flight.{flight_key}: the motion is singular from its start on"
                ))
            })?;
        }
        world.now = now;
        let world = valid::whole(world)?;
        let predictions = world.accumulators.counters.predictions;
        let mut simulation = Self::of(world);
        // Predictions made here are not counted in the run.
        simulation.world.accumulators.counters.predictions = predictions;
        simulation.stopped_at = Some(time);
        simulation.stall = stall;
        Ok(simulation)
    }
}

/// A link as a number.
fn encode(link: Link) -> u64 {
    let pair = |kind: u64, i: usize, j: usize| kind << 60 | (i as u64) << 30 | j as u64;
    match link {
        Link::Tether(p) => pair(0, p, 0),
        Link::Rod(r) => pair(1, r, 0),
        Link::Pair(i, j) => pair(2, i, j),
        Link::Wall(i, w) => pair(3, i, w),
        Link::Impact => pair(4, 0, 0),
    }
}

/// Named numbers, removed one by one.
struct Scalars {
    values: BTreeMap<String, u64>,
    /// The error of the first value that is missing or out of range.
    wrong: Option<String>,
}

impl Scalars {
    fn take(&mut self, name: &str) -> u64 {
        self.values.remove(name).unwrap_or_else(|| {
            self.wrong.get_or_insert_with(|| format!("it lacks {name}"));
            0
        })
    }

    fn real(&mut self, name: &str) -> f64 {
        f64::from_bits(self.take(name))
    }

    fn instant(&mut self, name: &str) -> Instant {
        Instant { high: self.real(&format!("{name}.high")), low: self.real(&format!("{name}.low")) }
    }

    fn sum(&mut self, name: &str) -> Sum {
        Sum { high: self.real(&format!("{name}.high")), low: self.real(&format!("{name}.low")) }
    }

    fn vector(&mut self, name: &str) -> DVec3 {
        DVec3::new(
            self.real(&format!("{name}.x")),
            self.real(&format!("{name}.y")),
            self.real(&format!("{name}.z")),
        )
    }

    fn index(&mut self, name: &str, below: usize) -> usize {
        let index = self.take(name) as usize;
        if index >= below {
            self.wrong.get_or_insert_with(|| format!("{name} = {index} must be less than {below}"));
            return 0;
        }
        index
    }

    fn flag(&mut self, name: &str) -> bool {
        self.index(name, 2) == 1
    }

    /// The numbers in names of this form.
    fn codes(&self, prefix: &str, suffix: &str) -> Vec<u64> {
        let mut codes: Vec<u64> = self
            .values
            .keys()
            .filter_map(|name| name.strip_prefix(prefix)?.strip_suffix(suffix)?.parse().ok())
            .collect();
        codes.sort_unstable();
        codes
    }

    /// The link of a number.
    fn link(&mut self, code: u64, world: &World) -> Link {
        let part = |shift: u32| ((code >> shift) & ((1 << 30) - 1)) as usize;
        let (i, j) = (part(30), part(0));
        let link = match code >> 60 {
            0 => Link::Tether(i),
            1 => Link::Rod(i),
            2 => Link::Pair(i, j),
            3 => Link::Wall(i, j),
            _ => Link::Impact,
        };
        let fits = match link {
            Link::Tether(p) => p < world.joints.pendulums.len(),
            Link::Rod(r) => r < world.joints.rods.len(),
            Link::Pair(i, j) => i < j && j < world.count(),
            Link::Wall(i, w) => i < world.count() && w < world.system.walls.len(),
            Link::Impact => false,
        };
        // Each link has exactly one code.
        if fits && encode(link) == code {
            return link;
        }
        self.wrong.get_or_insert_with(|| format!("link {code} must be one of the scene"));
        Link::Impact
    }

    fn accumulators(&mut self, world: &mut World) {
        let accumulators = &mut world.accumulators;
        accumulators.initial_kinetic = self.real("initial_kinetic");
        accumulators.initial_potential = self.real("initial_potential");
        accumulators.max_overlap = self.real("max_overlap");
        accumulators.sampled_at = self.real("sampled_at");
        accumulators.sampled_collisions = self.take("sampled_collisions");
        accumulators.counters.collisions = self.take("collisions");
        accumulators.counters.wall_collisions = self.take("wall_collisions");
        accumulators.counters.rests = self.take("rests");
        accumulators.counters.predictions = self.take("predictions");
        accumulators.dissipated = self.sum("dissipated");
        accumulators.carnot = self.sum("carnot");
        accumulators.work = self.sum("work");
        for axis in 0..3 {
            accumulators.impulse[axis] = self.sum(&format!("impulse.{axis}"));
            accumulators.moment[axis] = self.sum(&format!("moment.{axis}"));
        }
    }

    /// Succeeds if no value was missing, and none is left.
    fn finish(self) -> Result<(), LinkageError> {
        if let Some(wrong) = self.wrong {
            return Err(LinkageError::Checkpoint(wrong));
        }
        match self.values.keys().next() {
            Some(name) => {
                Err(LinkageError::Checkpoint(format!("{name} is unknown; another version wrote it")))
            }
            None => Ok(()),
        }
    }
}
