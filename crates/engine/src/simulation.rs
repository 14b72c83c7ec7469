//! The simulation: a state, the engine compiled for what it needs, and the clock's epochs.

use std::collections::BTreeMap;

use haff_neighbors::{Geometry, Lists};

use crate::{
    accumulators::Accumulators,
    batch::Kernel,
    choice::Choice,
    clock::{ANCHOR_AGE, Clock, EPOCH, OLDEST_ANCHOR},
    drive,
    error::EngineError,
    event::Pause,
    event_loop::{Engine, Limit},
    ledger::Ledger,
    measure::{self, Species, Totals},
    model::{Boundary, Dimension, NeighborChoice, Options, System},
    overlap::{self, Overlap},
    particles::World,
    report::{Counters, Frame, Observer, Sample, Stop},
    rest::{
        standing::{SettlingScan, contacts_of_sleeping, scan},
        state::SettlingState,
        thresholds::Thresholds,
    },
    stall::Stall,
    state::State,
    timed::TimedAction,
    windows,
};

/// Largest number of particles: calendar entries keep two bits of an index for themselves.
const MAX_PARTICLES: usize = (1 << 30) - 2;
/// Largest number of walls.
const MAX_WALLS: usize = u16::MAX as usize;
/// The tick is changed at the end of an epoch when the system's time scale has changed by 2 to this power.
const RETUNE_BITS: u32 = 2;

/// How far one call of [`Simulation::advance`] may run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Until {
    /// Up to and with this time [time]; `f64::INFINITY` for no bound.
    pub time: f64,
    /// Up to this total of sphere–sphere collisions; `u64::MAX` for no bound.
    pub collisions: u64,
    /// At most this many calendar entries, so that the caller can look after signals and progress.
    pub entries: u64,
}

impl Default for Until {
    fn default() -> Self {
        Self { time: f64::INFINITY, collisions: u64::MAX, entries: u64::MAX }
    }
}

/// A running simulation.
pub struct Simulation {
    /// Without its bodies, which are in the state.
    system: System,
    species: Species,
    geometry: Geometry,
    pub(crate) state: State,
    engine: Box<dyn Engine>,
    choice: Choice,
    actions: Vec<Box<dyn TimedAction>>,
    /// Time of the last stop as it was asked for [time]; the tick is only the nearest.
    stopped_at: Option<f64>,
}

impl Simulation {
    /// Starts a simulation at time 0.
    ///
    /// The system must be valid: masses and radii positive, no overlaps, particles inside their walls, the
    /// velocities finite, gravity zero along periodic axes.
    pub fn new(system: System, options: Options) -> Result<Self, EngineError> {
        let mut world = World::new(&system, 0);
        let extent = world.extent(open_axes(&system));
        let exponent = Clock::exponent_for(extent, world.largest_speed(extent));
        // All anchors are at tick 0, whatever a tick is.
        world.clock = Clock::new(exponent);
        let totals = Totals::of(&world);
        let accumulators = Accumulators {
            initial_energy: [totals.kinetic, totals.potential],
            sampled_kinetic: totals.kinetic,
            sampled_collisions: u64::MAX,
            ..Accumulators::default()
        };
        let state = State {
            world,
            accumulators,
            pending: BTreeMap::new(),
            settling: SettlingState::default(),
            stall: Stall::default(),
        };
        let actions = actions(&system);
        Self::start(system, options, state, actions)
    }

    /// Builds the engine for a state.
    pub(crate) fn start(
        mut system: System,
        options: Options,
        state: State,
        actions: Vec<Box<dyn TimedAction>>,
    ) -> Result<Self, EngineError> {
        for (what, count, limit) in
            [("particles", system.bodies.len(), MAX_PARTICLES), ("walls", system.walls.len(), MAX_WALLS)]
        {
            if count > limit {
                return Err(EngineError::TooMany { what, count, limit });
            }
        }
        if options.neighbors == NeighborChoice::Lists && system.bodies.len() > Lists::MAX_PARTICLES {
            let (count, limit) = (system.bodies.len(), Lists::MAX_PARTICLES);
            return Err(EngineError::TooMany { what: "particles for neighbor lists", count, limit });
        }
        let kernel = Kernel::choose(options.simd).ok_or(EngineError::NoAvx2)?;
        let choice = Choice::new(options.neighbors, kernel, &system, &state.world);
        if options.neighbors == NeighborChoice::Windows
            && let Some(why) = windows::unsuitable(&system, &choice.summary)
        {
            return Err(EngineError::Unsuitable { choice: options.neighbors.name(), why });
        }
        let geometry = measure::geometry(&system, &state.world, choice.filled());
        let species = Species::new(&system);
        // The state has them now; a quarter of the memory of a large system.
        system.bodies = Vec::new();
        let engine = choice.compile(&system, &geometry);
        let mut simulation =
            Self { system, species, geometry, state, engine, choice, actions, stopped_at: None };
        simulation.rebuild();
        Ok(simulation)
    }

    /// Has the engine search and predict everything afresh.
    fn rebuild(&mut self) {
        self.engine.rebuild(&mut self.state, &self.geometry);
        self.choice.after(self.state.accumulators.counters.collisions);
    }

    /// Looks whether another engine serves the present state better. No choice changes the trajectory.
    #[cold]
    fn reconsider(&mut self) {
        self.choice.after(self.state.accumulators.counters.collisions);
        if self.choice.reconsider(&self.system, &self.state.world) {
            self.geometry = measure::geometry(&self.system, &self.state.world, self.choice.filled());
            self.engine = self.choice.compile(&self.system, &self.geometry);
            self.rebuild();
        }
    }

    /// Runs events until the first of the bounds, or until nothing will move any more.
    pub fn advance(&mut self, until: Until, observer: &mut dyn Observer) -> Result<Stop, EngineError> {
        self.stopped_at = None;
        if self.rests() {
            return Ok(Stop::Rest);
        }
        let mut entries = until.entries;
        loop {
            let target = self.state.world.clock.ticks(until.time);
            let action = self.actions.iter().map(|action| action.next(&self.state)).min().unwrap_or(i64::MAX);
            let slice = entries.min(self.choice.patience);
            let mut limit = Limit {
                // Events at the very end of an epoch belong to the next.
                ticks: target.min(EPOCH - 1).min(action),
                collisions: until.collisions.min(self.choice.review),
                entries: slice,
            };
            let pause = self.engine.advance(&mut self.state, &mut limit, observer).inspect_err(|error| {
                if let EngineError::Overlap { depth, .. } = error {
                    self.state.accumulators.max_overlap = self.state.accumulators.max_overlap.max(*depth);
                }
            })?;
            entries -= slice - limit.entries;
            self.choice.patience -= slice - limit.entries;
            match pause {
                Pause::Rest if self.is_driven() => {}
                Pause::Rest => return Ok(Stop::Rest),
                Pause::Jam => {
                    let changed = scan(&mut self.state, &self.geometry, true, observer);
                    if self.take_over(&changed, until, &mut entries) {
                        return Ok(Stop::Rest);
                    }
                }
                Pause::Time if limit.ticks == action => {
                    let mut changed = Vec::new();
                    for due in &mut self.actions {
                        if due.next(&self.state) == action {
                            changed.extend(due.apply(&mut self.state, &self.geometry, observer)?);
                        }
                    }
                    changed.sort_unstable();
                    changed.dedup();
                    if self.take_over(&changed, until, &mut entries) {
                        return Ok(Stop::Rest);
                    }
                }
                Pause::Time => {
                    if until.time == f64::INFINITY && self.engine.is_idle() && !self.is_driven() {
                        return Ok(Stop::Rest);
                    }
                    if target < EPOCH {
                        self.stopped_at = Some(until.time);
                        return Ok(Stop::Time);
                    }
                    self.next_epoch();
                    // A long flight without events must not keep the caller waiting: an epoch counts as an
                    // entry for each particle.
                    entries = entries.saturating_sub(1 + self.particles() as u64);
                }
                Pause::Collisions => {
                    if self.state.accumulators.counters.collisions >= until.collisions {
                        return Ok(Stop::Collisions);
                    }
                    self.reconsider();
                }
                Pause::Entries if self.choice.patience == 0 => self.reconsider(),
                Pause::Unsupported => self.reconsider(),
                Pause::Entries => return Ok(Stop::Slice),
            }
            if entries == 0 {
                return Ok(Stop::Slice);
            }
        }
    }

    /// Has the scheduler predict what an action has changed. Whether nothing moves or will move any more.
    ///
    /// All particles are predicted at once where most have changed.
    fn take_over(&mut self, changed: &[u32], until: Until, entries: &mut u64) -> bool {
        let idle = self.engine.is_idle();
        if 2 * changed.len() > self.particles() {
            for &i in changed {
                self.state.world.wrap_anchor(i);
            }
            self.engine.rebuild(&mut self.state, &self.geometry);
        } else {
            self.engine.reschedule(&mut self.state, changed);
        }
        *entries = entries.saturating_sub(1);
        if self.is_driven() {
            return false;
        }
        let ended = !changed.is_empty() && self.state.is_at_rest();
        ended || (until.time == f64::INFINITY && idle && self.engine.is_idle())
    }

    /// Whether drives may set particles in motion that are at rest.
    fn is_driven(&self) -> bool {
        !self.system.drives.is_empty()
    }

    /// Whether nothing moves, nor will.
    fn rests(&self) -> bool {
        self.state.is_at_rest() && !self.is_driven()
    }

    /// Writes what the timed actions of a resumed run need.
    pub(crate) fn save_actions(&self, put: &mut dyn FnMut(&str, u64)) {
        self.actions.iter().for_each(|action| action.save(put));
    }

    /// Finds the contacts of the particles at rest in a state.
    pub(crate) fn find_contacts_of_sleeping(&mut self) {
        self.state.settling.near = contacts_of_sleeping(&self.state.world, &self.geometry);
    }

    /// Re-bases the clock by one epoch; chooses a new tick if the system has become much slower or faster.
    fn next_epoch(&mut self) {
        let world = &mut self.state.world;
        world.now = EPOCH;
        let extent = world.extent(open_axes(&self.system));
        let exponent = Clock::exponent_for(extent, world.largest_speed(extent));
        let old = world.clock;
        let retune = exponent.abs_diff(old.exponent) >= RETUNE_BITS;
        for i in 0..world.particles.len() as u32 {
            let age = EPOCH - world.particles[i as usize].time;
            if !retune && age <= OLDEST_ANCHOR {
                world.particles[i as usize].time -= EPOCH;
                continue;
            }
            // The anchor moves along its own flight, to the last new tick before where it was, but no further
            // back than `ANCHOR_AGE`: what has happened to it lately (the TC model asks) stays as long ago as
            // it was.
            let clock = if retune { old.with_exponent(exponent) } else { old };
            let ticks = (age as f64 * (old.tick / clock.tick)).min(ANCHOR_AGE as f64).floor();
            let ahead = age as f64 * old.tick - ticks * clock.tick;
            let a = world.acceleration(i);
            let particle = &mut world.particles[i as usize];
            particle.position = haff_mechanics::free_flight(particle.position, particle.velocity, a, ahead);
            particle.velocity = haff_mechanics::free_flight_velocity(particle.velocity, a, ahead);
            particle.time = -(ticks as i64);
            world.wrap_anchor(i);
        }
        let due = self.state.pending.values_mut().map(|rest| &mut rest.end);
        for time in due.chain([&mut self.state.settling.next, &mut self.state.settling.counted_since]) {
            *time = time.saturating_sub(EPOCH);
            if retune {
                let scale = (i64::from(old.exponent) - i64::from(exponent)) as i32;
                *time = (*time as f64 * libm::ldexp(1.0, scale)).round_ties_even() as i64;
            }
        }
        world.clock.next_epoch();
        if retune {
            world.clock = world.clock.with_exponent(exponent);
        }
        world.now = 0;
        self.state.stall = Stall::default();
        self.state.accumulators.counters.epochs += 1;
        let clock = &self.state.world.clock;
        tracing::info!(
            epoch = self.state.accumulators.counters.epochs,
            time = clock.time(0),
            tick = clock.tick,
            retune,
            "epoch"
        );
        self.rebuild();
    }

    /// Present simulated time [time].
    pub fn time(&self) -> f64 {
        self.stopped_at.unwrap_or_else(|| self.state.world.clock.time(self.state.world.now))
    }

    /// Sets the time of the present as it was asked for.
    pub(crate) fn stand_at(&mut self, time: f64) {
        self.stopped_at = Some(time);
    }

    /// All particles now, in the order of the system.
    pub fn frame(&self) -> Frame {
        measure::frame(&self.state, self.time())
    }

    /// One row of observables; the pressure and the rates are those since the previous call.
    pub fn sample(&mut self) -> Sample {
        let time = self.time();
        measure::sample(&self.system, &self.species, &mut self.state, time)
    }

    /// Energies and their balance now.
    pub fn ledger(&self) -> Ledger {
        measure::ledger(&Totals::of(&self.state.world), &self.state.accumulators, &self.state.pending)
    }

    /// What has been done so far.
    pub fn counters(&self) -> Counters {
        self.state.accumulators.counters
    }

    /// Finds the deepest overlap now over all close pairs and walls, and keeps the largest for
    /// [`Self::max_overlap`]. An error, if it is more than rounding (see
    /// [`allowed_overlap`](crate::allowed_overlap)).
    pub fn measure_overlap(&mut self) -> Result<Overlap, EngineError> {
        let found = overlap::deepest(&self.state.world, &self.geometry);
        self.state.accumulators.max_overlap = self.state.accumulators.max_overlap.max(found.deepest.depth);
        match found.beyond.pair {
            Some((i, partner)) => {
                Err(EngineError::Overlap { time: self.time(), i, partner, depth: found.beyond.depth })
            }
            None => Ok(found.deepest),
        }
    }

    /// Largest overlap that [`Self::measure_overlap`] has found so far [contact distances].
    pub fn max_overlap(&self) -> f64 {
        self.state.accumulators.max_overlap
    }

    /// Hash of every particle's position, velocity and image now, as 32 hexadecimal digits.
    pub fn state_hash(&self) -> String {
        format!("{:032x}", measure::hash(&self.state.world))
    }

    /// Number of particles.
    pub fn particles(&self) -> usize {
        self.state.world.particles.len()
    }

    /// The system that is simulated, without its bodies: where they are now tells [`Self::frame`].
    pub fn system(&self) -> &System {
        &self.system
    }

    /// The partner search in use.
    pub fn neighbors(&self) -> NeighborChoice {
        self.choice.neighbors
    }

    /// Reverses every velocity: an elastic system without driven bodies retraces its path. Anchors are set to
    /// now.
    pub fn reverse(&mut self) {
        let world = &mut self.state.world;
        for i in 0..world.particles.len() as u32 {
            let (position, velocity) = world.state(i, world.now);
            world.particles[i as usize].set_anchor(position, -velocity, world.now);
            world.wrap_anchor(i);
        }
        self.rebuild();
    }

    /// Checks what must always hold and what the engine itself does not look at: finite velocities, no
    /// overlap beyond `tolerance` [contact distances], a closed ledger.
    pub fn validate(&mut self, tolerance: f64) -> Result<(), EngineError> {
        let time = self.time();
        let frame = self.frame();
        if let Some(i) = frame.velocity.iter().position(|velocity| !velocity.is_finite()) {
            return Err(EngineError::Overflow { time, i: i as u32, velocity: frame.velocity[i].to_array() });
        }
        let overlap = self.measure_overlap()?;
        if overlap.depth > tolerance {
            let (i, partner) = overlap.pair.unwrap_or_default();
            let partner = partner.map_or("a wall".to_owned(), |j| format!("particle {j}"));
            let what =
                format!("particle {i} overlaps with {partner} by {:e} contact distances", overlap.depth);
            return Err(EngineError::Inconsistent { time, what });
        }
        let residual = self.ledger().residual;
        if residual.abs() > 1e-9 {
            return Err(EngineError::Inconsistent { time, what: format!("ledger residual {residual:e}") });
        }
        Ok(())
    }
}

/// The timed actions of a system, which still has its bodies.
pub(crate) fn actions(system: &System) -> Vec<Box<dyn TimedAction>> {
    let mut actions = drive::actions(system);
    if Thresholds::of(system).is_some() {
        actions.push(Box::new(SettlingScan));
    }
    actions
}

/// Axes along which the system has no size of its own.
pub(crate) fn open_axes(system: &System) -> [bool; 3] {
    let mut open = system.domain.boundary.map(|boundary| boundary == Boundary::Open);
    open[2] |= system.dimension == Dimension::Two;
    open
}
