//! The exact state as plain data, in the engine's own type, so that the same code records both.

use haff_engine::{Checkpoint, Instant, ScalarReader, ScalarWriter, System};

use crate::{
    error::LinkageError,
    mechanism::Link,
    model::Joints,
    simulation::Simulation,
    valid,
    world::{Burst, Pending, World},
};

/// Version of the scalars below.
const VERSION: u64 = 5;

impl Simulation {
    /// The exact state: anchors of all particles, and everything else as named scalars. A simulation
    /// [restored](Self::restore) from it continues with the same bits.
    pub fn checkpoint(&self) -> Checkpoint {
        let world = &self.world;
        let n = world.count();
        let mut scalars = ScalarWriter::default();
        scalars.put("linkage.version", VERSION);
        scalars.pair("now", world.now.high, world.now.low);
        scalars.real("clock.time", self.time());
        // Endless events at one time then give the error at the same event after a resumption.
        scalars.pair("stall.since", self.stall.0.high, self.stall.0.low);
        scalars.put("stall.events", self.stall.1);
        let accumulators = &world.accumulators;
        scalars.real("initial_kinetic", accumulators.initial_kinetic);
        scalars.real("initial_potential", accumulators.initial_potential);
        scalars.real("max_overlap", accumulators.max_overlap);
        scalars.real("sampled_at", accumulators.sampled_at);
        scalars.put("sampled_collisions", accumulators.sampled_collisions);
        scalars.put("sampled_flights", accumulators.sampled_flights);
        scalars.put("collisions", accumulators.counters.collisions);
        scalars.put("fixed_collisions", accumulators.counters.fixed_collisions);
        scalars.put("wall_collisions", accumulators.counters.wall_collisions);
        scalars.put("simultaneous", accumulators.counters.simultaneous);
        scalars.put("rests", accumulators.counters.rests);
        scalars.put("predictions", accumulators.counters.predictions);
        scalars.sum("dissipated", &accumulators.dissipated);
        scalars.sum("carnot", &accumulators.carnot);
        scalars.sum("work", &accumulators.work);
        scalars.total("impulse", &accumulators.impulse);
        scalars.total("moment", &accumulators.moment);
        for i in 0..n {
            scalars.put(&format!("body.{i}"), world.body[i] as u64);
            scalars.put(&format!("clings.{i}"), u64::from(world.sticks_to_wall[i]));
            scalars.vector(&format!("offset.{i}"), world.offset[i]);
            scalars.real(&format!("excess.{i}"), world.excess[i]);
        }
        for flight in world.flights.iter() {
            let flight_key = flight.bodies[0];
            scalars.pair(&format!("flight.{flight_key}.start"), flight.start.high, flight.start.low);
            scalars.real(&format!("flight.{flight_key}.hint"), flight.hint);
            for (k, &body) in flight.bodies.iter().enumerate() {
                scalars.put(&format!("flight.{flight_key}.body.{k}"), body as u64);
            }
            for (k, row) in flight.mechanism.rows.iter().enumerate() {
                scalars.put(&format!("flight.{flight_key}.row.{k}"), encode(row.link));
            }
        }
        for (p, &taut) in world.taut.iter().enumerate() {
            scalars.put(&format!("taut.{p}"), u64::from(taut));
        }
        for (link, axis) in &world.closed {
            scalars.vector(&format!("closed.{}", encode(*link)), *axis);
        }
        for (link, rest) in &world.pending {
            let name = format!("rest.{}", encode(*link));
            scalars.pair(&format!("{name}.end"), rest.end.high, rest.end.low);
            scalars.real(&format!("{name}.speed"), rest.speed);
            scalars.real(&format!("{name}.impulse"), rest.impulse);
            scalars.real(&format!("{name}.energy_loss"), rest.energy_loss);
            scalars.real(&format!("{name}.carnot_energy"), rest.carnot_energy);
        }
        scalars.pair("released.at", world.released.0.high, world.released.0.low);
        for link in &world.released.1 {
            scalars.put(&format!("released.{}.link", encode(*link)), 1);
        }
        for (link, burst) in &world.bursts {
            let name = format!("burst.{}", encode(*link));
            scalars.pair(&format!("{name}.at"), burst.at.high, burst.at.low);
            scalars.real(&format!("{name}.speed"), burst.speed);
            scalars.put(&format!("{name}.impacts"), burst.impacts);
        }
        Checkpoint {
            position: world.anchor.iter().map(|(x, _)| *x).collect(),
            velocity: world.anchor.iter().map(|(_, v)| *v).collect(),
            anchor: vec![0; n],
            image: vec![[0; 3]; n],
            count: vec![0; n],
            resting: vec![0; n],
            scalars: scalars.scalars,
            ..Checkpoint::default()
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
        let mut scalars = ScalarReader::new(&checkpoint.scalars).map_err(LinkageError::Checkpoint)?;
        if scalars.take("linkage.version") != VERSION {
            return Err(LinkageError::Checkpoint(
                "it was written by another version, or belongs to a scene without joints".into(),
            ));
        }
        world.anchor = checkpoint.position.iter().copied().zip(checkpoint.velocity.iter().copied()).collect();
        world.now = instant(&mut scalars, "now");
        let time = scalars.real("clock.time");
        read_accumulators(&mut scalars, &mut world);
        for i in 0..n {
            world.body[i] = scalars.index(&format!("body.{i}"), n);
            world.sticks_to_wall[i] = flag(&mut scalars, &format!("clings.{i}"));
            world.offset[i] = scalars.vector(&format!("offset.{i}"));
            world.excess[i] = scalars.real(&format!("excess.{i}"));
        }
        world.body_mass = (0..n).map(|body| world.mass_of(body)).collect();
        for p in 0..world.taut.len() {
            world.taut[p] = flag(&mut scalars, &format!("taut.{p}"));
        }
        for code in scalars.numbers::<u64>("closed.", ".x") {
            let axis = scalars.vector(&format!("closed.{code}"));
            world.closed.insert(link(&mut scalars, code, &world), axis);
        }
        for code in scalars.numbers::<u64>("rest.", ".speed") {
            let name = format!("rest.{code}");
            let rest = Pending {
                end: instant(&mut scalars, &format!("{name}.end")),
                speed: scalars.real(&format!("{name}.speed")),
                impulse: scalars.real(&format!("{name}.impulse")),
                energy_loss: scalars.real(&format!("{name}.energy_loss")),
                carnot_energy: scalars.real(&format!("{name}.carnot_energy")),
            };
            world.pending.insert(link(&mut scalars, code, &world), rest);
        }
        world.released.0 = instant(&mut scalars, "released.at");
        for code in scalars.numbers::<u64>("released.", ".link") {
            flag(&mut scalars, &format!("released.{code}.link"));
            let link = link(&mut scalars, code, &world);
            world.released.1.insert(link);
        }
        for code in scalars.numbers::<u64>("burst.", ".speed") {
            let name = format!("burst.{code}");
            let burst = Burst {
                at: instant(&mut scalars, &format!("{name}.at")),
                speed: scalars.real(&format!("{name}.speed")),
                impacts: scalars.take(&format!("{name}.impacts")),
            };
            world.bursts.insert(link(&mut scalars, code, &world), burst);
        }
        let mut flights = Vec::new();
        let flight_keys = scalars.numbers::<u64>("flight.", ".hint");
        for flight_key in &flight_keys {
            let name = format!("flight.{flight_key}");
            let start = instant(&mut scalars, &format!("{name}.start"));
            let hint = scalars.real(&format!("{name}.hint"));
            let mut bodies = Vec::new();
            while scalars.contains(&format!("{name}.body.{}", bodies.len())) {
                bodies.push(scalars.index(&format!("{name}.body.{}", bodies.len()), n));
            }
            let mut links = Vec::new();
            while scalars.contains(&format!("{name}.row.{}", links.len())) {
                let code = scalars.take(&format!("{name}.row.{}", links.len()));
                links.push(link(&mut scalars, code, &world));
            }
            flights.push((start, hint, bodies, links));
        }
        let stall = (instant(&mut scalars, "stall.since"), scalars.take("stall.events"));
        scalars.finish().map_err(LinkageError::Checkpoint)?;
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

fn instant(scalars: &mut ScalarReader, name: &str) -> Instant {
    let (high, low) = scalars.pair(name);
    Instant { high, low }
}

fn flag(scalars: &mut ScalarReader, name: &str) -> bool {
    scalars.index(name, 2) == 1
}

/// The link of a number.
fn link(scalars: &mut ScalarReader, code: u64, world: &World) -> Link {
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
    scalars.fail(|| format!("link {code} must be one of the scene"));
    Link::Impact
}

fn read_accumulators(scalars: &mut ScalarReader, world: &mut World) {
    let accumulators = &mut world.accumulators;
    accumulators.initial_kinetic = scalars.real("initial_kinetic");
    accumulators.initial_potential = scalars.real("initial_potential");
    accumulators.max_overlap = scalars.real("max_overlap");
    accumulators.sampled_at = scalars.real("sampled_at");
    accumulators.sampled_collisions = scalars.take("sampled_collisions");
    accumulators.sampled_flights = scalars.take("sampled_flights");
    accumulators.counters.collisions = scalars.take("collisions");
    accumulators.counters.fixed_collisions = scalars.take("fixed_collisions");
    accumulators.counters.wall_collisions = scalars.take("wall_collisions");
    // Files of earlier versions lack it.
    accumulators.counters.simultaneous = scalars.take_if_present("simultaneous").unwrap_or(0);
    accumulators.counters.rests = scalars.take("rests");
    accumulators.counters.predictions = scalars.take("predictions");
    accumulators.dissipated = scalars.sum("dissipated");
    accumulators.carnot = scalars.sum("carnot");
    accumulators.work = scalars.sum("work");
    accumulators.impulse = scalars.total("impulse");
    accumulators.moment = scalars.total("moment");
}
