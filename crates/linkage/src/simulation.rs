//! A run: from event to event, with frames, samples and the ledger.

use std::collections::BTreeSet;

use glam::DVec3;
use haff_engine::{
    Counters, EngineError, Frame, Instant, Ledger, Observer, Sample, Stop, Sum, System, Term, Until,
    common_velocity,
};
use xxhash_rust::xxh3::Xxh3;

use crate::{
    check,
    error::LinkageError,
    mechanism::Link,
    model::{Joints, Tether},
    motion::{Monitored, Motion, Numeric},
    predict::Key,
    predictions::Predictions,
    world::World,
};

/// Events without any progress of time after which a run ends with an error.
const COLLAPSE: u64 = 100_000;

/// A running simulation of particles with joints.
#[derive(Debug, Clone)]
pub struct Simulation {
    pub(crate) world: World,
    pub(crate) predictions: Predictions,
    /// Time of the last progress, and number of events since.
    pub(crate) stall: (Instant, u64),
    pub(crate) stopped_at: Option<f64>,
}

/// The two parts of a [`Ledger`]'s potential energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Potential {
    /// Of gravity \[energy\], zero at the origin.
    pub gravity: f64,
    /// Of all springs \[energy\], zero without force.
    pub spring: f64,
}

impl Simulation {
    /// Starts a simulation at time 0.
    ///
    /// The system must be valid as for [`haff_engine::Simulation::new`]. Bobs and ends of rods whose distance
    /// is correct to 10⁻⁹ are moved to the exact distance.
    ///
    /// # Errors
    /// Joints that contradict each other or the system: see [`LinkageError`].
    pub fn new(system: System, joints: Joints) -> Result<Self, LinkageError> {
        check::check_elements(&system, &joints)?;
        let (system, joints) = check::with_exact_lengths(system, joints)?;
        let mut world = World::new(system, joints);
        for p in 0..world.taut.len() {
            let pendulum = &world.joints.pendulums[p];
            world.taut[p] = pendulum.tether == Tether::Rod || !pendulum.slack;
        }
        let (gravity, spring) = world.potential(Instant::ZERO);
        world.accumulators.initial_potential = gravity + spring;
        world.accumulators.initial_kinetic = kinetic(&world, Instant::ZERO);
        world.accumulators.sampled_collisions = u64::MAX;
        for body in 0..world.count() {
            if world.immovable(body) {
                world.start_immovable_flight(body);
            }
        }
        let bodies: Vec<usize> = (0..world.count()).filter(|&body| !world.immovable(body)).collect();
        // Strings that are not taut at the start have been slack before: they are not reported.
        world.regroup(bodies, &BTreeSet::new(), &[], &mut haff_engine::Silent)?;
        Ok(Self::of(world))
    }

    /// A simulation of a world with flights, without predictions.
    pub(crate) fn without_predictions(world: World) -> Self {
        Self { stall: (world.now, 0), world, predictions: Predictions::default(), stopped_at: None }
    }

    /// A simulation of a world with flights.
    pub(crate) fn of(world: World) -> Self {
        let mut simulation = Self::without_predictions(world);
        let all: Vec<usize> = (0..simulation.world.count()).collect();
        simulation.predict(&all);
        simulation
    }

    /// Predicts these bodies again.
    fn predict(&mut self, bodies: &[usize]) {
        for flight in std::mem::take(&mut self.world.ended) {
            self.predictions.remove_flight(flight);
        }
        for link in std::mem::take(&mut self.world.settled) {
            self.predictions.remove(&Key::Settle(link));
        }
        for key in self.world.keys_of(bodies) {
            self.update_prediction(key, Instant::ZERO);
        }
    }

    /// Makes one prediction, searched from `from` on.
    fn update_prediction(&mut self, key: Key, from: Instant) {
        self.world.accumulators.counters.predictions += 1;
        let prediction = self.world.predict(key, from);
        if prediction.at == Instant::NEVER {
            self.predictions.remove(&key);
        } else {
            self.predictions.insert(key, prediction);
        }
    }

    /// Runs events until the first of the bounds, or until no further event exists. An entry is an event, or
    /// a part of a search.
    ///
    /// # Errors
    /// [`LinkageError::Collapse`] and [`LinkageError::Singular`].
    pub fn advance(&mut self, until: Until, observer: &mut dyn Observer) -> Result<Stop, LinkageError> {
        self.stopped_at = None;
        let target = Instant::at(until.time);
        let mut entries = until.entries;
        loop {
            if self.world.accumulators.counters.collisions >= until.collisions {
                return Ok(Stop::Collisions);
            }
            let Some((key, prediction)) = self.predictions.first() else {
                if until.time == f64::INFINITY {
                    return Ok(Stop::Rest);
                }
                return Ok(self.stop_at(target));
            };
            if prediction.at > target {
                return Ok(self.stop_at(target));
            }
            if entries == 0 {
                return Ok(Stop::Slice);
            }
            entries -= 1;
            self.world.now = self.world.now.max(prediction.at);
            if !prediction.happens {
                self.update_prediction(key, prediction.at);
                continue;
            }
            self.check_progress(key)?;
            let changed = self.resolve(key, observer)?;
            self.predict(&changed);
        }
    }

    fn stop_at(&mut self, target: Instant) -> Stop {
        self.world.now = target.max(self.world.now);
        self.stopped_at = Some(target.time());
        if self.is_at_rest() { Stop::Rest } else { Stop::Time }
    }

    /// Whether nothing moves and no event is predicted.
    fn is_at_rest(&self) -> bool {
        self.predictions.is_empty()
            && self.world.flights.iter().all(|flight| match &flight.motion {
                Motion::Still(_) => true,
                Motion::Ballistic { velocity, acceleration, .. } => {
                    *velocity == DVec3::ZERO && *acceleration == DVec3::ZERO
                }
                _ => false,
            })
    }

    /// An error if the number of events without progress of time exceeds the limit.
    fn check_progress(&mut self, key: Key) -> Result<(), LinkageError> {
        let now = self.world.now;
        let resolution =
            4.0 * f64::EPSILON * now.time() + 1e-15 * self.world.length / self.world.speed.max(1e-300);
        if now.since(self.stall.0) > resolution {
            self.stall = (now, 0);
        }
        self.stall.1 += 1;
        if self.stall.1 < COLLAPSE {
            return Ok(());
        }
        let particle = match key {
            Key::Pair(i, _) | Key::Wall(i, _) => i,
            Key::Taut(p) => self.world.joints.pendulums[p].bob,
            Key::Monitored(body, _) | Key::Renew(body) => body,
            Key::Settle(link) => self.world.particles_of(link).first().copied().unwrap_or(0),
        };
        Err(LinkageError::Collapse { time: now.time(), events: COLLAPSE, particle })
    }

    /// Resolves an event; returns the bodies that have new flights.
    fn resolve(&mut self, key: Key, observer: &mut dyn Observer) -> Result<Vec<usize>, LinkageError> {
        let world = &mut self.world;
        match key {
            Key::Pair(..) | Key::Wall(..) | Key::Taut(_) => {
                let most = COLLAPSE - self.stall.1;
                let (changed, impacts) = world.resolve_impacts(key, most, observer)?;
                self.stall.1 += impacts - 1;
                Ok(changed)
            }
            Key::Monitored(flight_key, index) => {
                let Some(flight) = world.flights.get(flight_key) else { return Ok(Vec::new()) };
                let link = match World::monitored(flight, index) {
                    Some(Monitored::Row(row)) => Some(flight.mechanism.rows[row].link),
                    Some(Monitored::Coil(_)) | None => None,
                };
                let bodies = world.end_flights(&[flight_key], observer);
                if world.released.0 != world.now {
                    world.released = (world.now, BTreeSet::new());
                }
                if let Some(link) = link {
                    world.report_end(link, observer);
                    world.released.1.insert(link);
                }
                let released = world.released.1.clone();
                world.regroup(bodies, &released, &[], observer)
            }
            Key::Renew(flight_key) => {
                let Some(flight) = world.flights.get(flight_key) else { return Ok(Vec::new()) };
                let Motion::Numeric(Numeric { next: hint, .. }) = flight.motion else {
                    return Ok(Vec::new());
                };
                let links: Vec<Link> = flight.mechanism.rows.iter().map(|row| row.link).collect();
                let pending = std::mem::take(&mut world.pending);
                let bodies = world.end_flights(&[flight_key], observer);
                world.pending = pending;
                world.pressed.clear();
                let mechanism = world.mechanism(&bodies, &links, world.now);
                let states = world.anchors(&bodies);
                world.start_flight_on_constraints(bodies.clone(), mechanism, states, hint)?;
                Ok(bodies)
            }
            Key::Settle(link) => {
                world.settle(link, observer);
                self.predictions.remove(&key);
                Ok(Vec::new())
            }
        }
    }

    /// Present simulated time [time].
    pub fn time(&self) -> f64 {
        self.stopped_at.unwrap_or_else(|| self.world.now.time())
    }

    /// All particles now, in the order of the system.
    pub fn frame(&self) -> Frame {
        let states = (0..self.world.count()).map(|i| self.world.state(i, self.world.now));
        let (position, velocity) = states.unzip();
        Frame {
            time: self.time(),
            step: self.step(),
            position,
            velocity,
            image: vec![[0; 3]; self.world.count()],
            edges: [0, 1, 2].map(|axis| DVec3::AXES[axis] * self.system().domain.size[axis]),
            ..Frame::default()
        }
    }

    fn step(&self) -> u64 {
        let counters = &self.world.accumulators.counters;
        counters.collisions + counters.wall_collisions
    }

    /// Energies of gravity and springs now.
    pub fn potential(&self) -> Potential {
        let (gravity, spring) = self.world.potential(self.world.now);
        Potential { gravity, spring }
    }

    /// Energies and their balance now; the potential is that of gravity and of the springs.
    pub fn ledger(&self) -> Ledger {
        let world = &self.world;
        let now = world.now;
        let kinetic = kinetic(world, now);
        let (gravity, spring) = world.potential(now);
        let mut work = world.accumulators.work;
        for flight in world.flights.iter() {
            work.add(flight.motion.work(now.since(flight.start)));
        }
        let dissipated = world.accumulators.dissipated.value();
        let pending = world.pending.values().map(|rest| rest.energy_loss).collect::<Sum>().value();
        let terms = [
            kinetic,
            gravity,
            spring,
            -world.accumulators.initial_kinetic,
            -world.accumulators.initial_potential,
            dissipated,
            pending,
            -work.value(),
        ];
        let scale = terms.iter().fold(0.0, |scale: f64, term| scale.max(term.abs()));
        let balance: Sum = terms.into_iter().collect();
        Ledger {
            kinetic,
            rotational: 0.0,
            pistons: 0.0,
            potential: gravity + spring,
            spring,
            dissipated,
            carnot: world.accumulators.carnot.value(),
            terms: Term::ALL.map(|term| if term == Term::WallWork { work.value() } else { 0.0 }),
            residual: if scale > 0.0 { balance.value() / scale } else { 0.0 },
        }
    }

    /// External impulse (of walls, pivots, fixed points and bodies, gravity) since the start, and its moment
    /// about the origin [mass·length/time], [mass·length²/time]: the changes of momentum and angular momentum
    /// by (2.25) and (2.26).
    pub fn external_impulse(&self) -> (DVec3, DVec3) {
        let world = &self.world;
        let mut accumulators = world.accumulators;
        for flight in world.flights.iter() {
            let states = flight.states(world.now);
            for (k, &body) in flight.bodies.iter().enumerate() {
                if !world.immovable(body) {
                    let (momentum, moment) = world.momentum_change(body, world.anchor[body], states[k]);
                    accumulators.add_momentum(momentum, moment);
                }
            }
        }
        (accumulators.impulse(), accumulators.moment())
    }

    /// One row of observables; rates are since the previous call. There is no pressure: a linkage is in open
    /// space.
    pub fn sample(&mut self) -> Sample {
        let time = self.time();
        let ledger = self.ledger();
        let (external_impulse, _) = self.external_impulse();
        let world = &mut self.world;
        let now = world.now;
        let movable: Vec<usize> = (0..world.count()).filter(|&i| world.mass[i].is_finite()).collect();
        let states: Vec<(DVec3, DVec3)> = movable.iter().map(|&i| world.state(i, now)).collect();
        let mut momentum = [Sum::default(); 3];
        let mut moment = [Sum::default(); 3];
        let mut mass = 0.0;
        for (&i, (x, v)) in movable.iter().zip(&states) {
            let p = *v * world.mass[i];
            let h = x.cross(p);
            (0..3).for_each(|axis| {
                momentum[axis].add(p[axis]);
                moment[axis].add(h[axis]);
            });
            mass += world.mass[i];
        }
        let momentum = DVec3::from_array(momentum.map(|sum| sum.value()));
        let common = common_velocity(momentum, mass, world.joints.conserved_momentum(&world.system));
        let d = world.system.dimension.count() as f64;
        let temperature_of = |of: &dyn Fn(usize) -> bool| {
            let mut sum = Sum::default();
            let mut count = 0.0;
            for (&i, (_, v)) in movable.iter().zip(&states).filter(|(i, _)| of(**i)) {
                sum.add(world.mass[i] * (*v - common).length_squared());
                count += 1.0;
            }
            if count > 0.0 { sum.value() / (d * count) } else { f64::NAN }
        };
        let species_temperature = (0..world.system.species.len())
            .map(|species| temperature_of(&|i| world.system.bodies[i].species as usize == species))
            .collect();
        let temperature = temperature_of(&|_| true);
        let (mut second, mut fourth) = (0.0, 0.0);
        for (&i, (_, v)) in movable.iter().zip(&states) {
            let square = world.mass[i] * (*v - common).length_squared();
            second += square;
            fourth += square * square;
        }
        let n = movable.len() as f64;
        let collisions = world.accumulators.counters.collisions;
        let first = world.accumulators.sampled_collisions == u64::MAX;
        let elapsed = time - world.accumulators.sampled_at;
        let new = collisions.wrapping_sub(world.accumulators.sampled_collisions) as f64;
        let flights = world.accumulators.counters.ended_flights();
        let ended = (flights - world.accumulators.sampled_flights) as f64;
        world.accumulators.sampled_at = time;
        world.accumulators.sampled_collisions = collisions;
        world.accumulators.sampled_flights = flights;
        Sample {
            time,
            // A box of linkages keeps its size.
            box_volume: f64::NAN,
            packing_fraction: f64::NAN,
            stress: None,
            pair_collision_rate: Vec::new(),
            species_mean_free_time: Vec::new(),
            wall_force: Vec::new(),
            wall_heat_flow: Vec::new(),
            probes: Vec::new(),
            step: collisions + world.accumulators.counters.wall_collisions,
            ledger,
            temperature,
            species_temperature,
            rotational_temperature: 0.0,
            species_rotational_temperature: Vec::new(),
            sonine_a2: if second > 0.0 {
                d * (fourth / n) / ((d + 2.0) * (second / n).powi(2)) - 1.0
            } else {
                f64::NAN
            },
            pressure: None,
            momentum,
            external_impulse,
            angular_momentum: Some(DVec3::from_array(moment.map(|sum| sum.value()))),
            collisions,
            wall_collisions: world.accumulators.counters.wall_collisions,
            collision_rate: if first { f64::NAN } else { new / elapsed },
            mean_free_time: if first { f64::NAN } else { n * elapsed / ended },
            ..Sample::default()
        }
    }

    /// Determines the deepest overlap now and keeps the largest for [`Self::max_overlap`]. An error, if one
    /// is more than rounding (see [`haff_engine::allowed_overlap`]).
    pub fn measure_overlap(&mut self) -> Result<(), LinkageError> {
        let (deepest, beyond) = self.world.overlaps();
        self.world.accumulators.max_overlap = self.world.accumulators.max_overlap.max(deepest);
        match beyond.and_then(|overlap| Some((overlap.depth, overlap.pair?))) {
            Some((depth, (i, partner))) => {
                Err(LinkageError::Overlap(EngineError::Overlap { time: self.time(), i, partner, depth }))
            }
            None => Ok(()),
        }
    }

    /// Largest overlap that [`Self::measure_overlap`] has found so far [contact distances]; particles on one
    /// rod or stuck together are not counted.
    pub fn max_overlap(&self) -> f64 {
        self.world.accumulators.max_overlap
    }

    /// Counts of events since the start.
    pub fn counters(&self) -> Counters {
        self.world.accumulators.counters
    }

    /// Hash of every particle's position and velocity now, as 32 hexadecimal digits.
    pub fn state_hash(&self) -> String {
        let mut hasher = Xxh3::new();
        for i in 0..self.world.count() {
            let (x, v) = self.world.state(i, self.world.now);
            for number in x.to_array().into_iter().chain(v.to_array()) {
                // −0 and 0 are the same coordinate.
                hasher.update(&(number + 0.0).to_bits().to_le_bytes());
            }
        }
        format!("{:032x}", hasher.digest128())
    }

    /// Number of particles.
    pub fn particles(&self) -> usize {
        self.world.count()
    }

    /// The system that is simulated, at its start.
    pub fn system(&self) -> &System {
        &self.world.system
    }

    /// The joints of its particles.
    pub fn joints(&self) -> &Joints {
        &self.world.joints
    }

    /// Whether the string or rod of a pendulum is taut now.
    pub fn is_taut(&self, pendulum: usize) -> bool {
        self.world.taut.get(pendulum).copied().unwrap_or(false)
    }

    /// Whether two particles are in persistent contact, or stuck together, now.
    pub fn in_contact(&self, i: usize, j: usize) -> bool {
        let (i, j) = (i.min(j), i.max(j));
        self.world.closed.contains_key(&Link::Pair(i, j))
            || (j < self.world.count() && self.world.body[i] == self.world.body[j])
    }

    /// The kind of a particle's flight: `free flight`, `pendulum`, `circle`, `rod`, `normal modes`, `rest` or
    /// `numerical`.
    pub fn flight_of(&self, particle: usize) -> Option<&'static str> {
        let body = *self.world.body.get(particle)?;
        Some(self.world.flights.get(self.world.flight_key[body])?.motion.name())
    }
}

/// Kinetic energy of the particles of finite mass at an instant.
fn kinetic(world: &World, at: Instant) -> f64 {
    (0..world.count())
        .filter(|&i| world.mass[i].is_finite())
        .map(|i| 0.5 * world.mass[i] * world.state(i, at).1.length_squared())
        .collect::<Sum>()
        .value()
}
