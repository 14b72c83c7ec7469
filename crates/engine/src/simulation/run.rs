//! A run: the state, its engine and the epochs of the clock.

use std::{collections::BTreeMap, sync::Arc};

use glam::DVec3;
use haff_neighbors::Geometry;

use crate::{
    actions::{
        drive,
        flow::passage::Passage,
        settling::scan::{SettlingScan, contacts_of_asleep, scan},
        timed::TimedAction,
    },
    laws::event::Pause,
    measure::{Measurement, measurements, observe, sample::Species, take_flights, totals::Totals},
    model::{Boundary, Dimension, Options, System, thresholds::Thresholds},
    numerics::{clock::EPOCH, error::EngineError},
    report::{BlockCounts, Counters, Observer, Stop, with_ids},
    search::{
        batch::Kernel,
        event_loop::{Engine, Limit},
        matrix::Search,
        sharing::Sharing,
    },
    simulation::{choice::Choice, clustering::suitable_contact_duration},
    state::{
        State, accumulators::Accumulators, flight_sums::Summed, population::Population,
        settling::SettlingState, stall::Stall, world::World,
    },
    support::geometry::{geometry, present_system},
};

/// Largest number of particles: a calendar entry stores a tag in two of the 32 bits of an index.
pub(super) const MAX_PARTICLES: usize = (1 << 30) - 2;

/// Largest number of walls.
pub(super) const MAX_WALLS: usize = u16::MAX as usize;

/// The tick is changed at the end of an epoch if the system's time scale has changed by 2 to this power.
pub(super) const RETUNE_BITS: u32 = 2;

/// The bounds of one call of [`Simulation::advance`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Until {
    /// Up to and including this time [time]; `f64::INFINITY` for no bound.
    pub time: f64,
    /// Up to this total of sphere–sphere collisions; `u64::MAX` for no bound.
    pub collisions: u64,
    /// At most this many calendar entries, so that the caller can handle signals and report progress.
    pub entries: u64,
}

impl Default for Until {
    fn default() -> Self {
        Self { time: f64::INFINITY, collisions: u64::MAX, entries: u64::MAX }
    }
}

/// A running simulation.
pub struct Simulation {
    /// The system without its bodies, which are in the state.
    pub(crate) system: System,
    pub(crate) species: Species,
    pub(super) geometry: Geometry,
    pub(crate) state: State,
    pub(super) engine: Box<dyn Engine>,
    pub(super) choice: Choice,
    pub(super) sharing: Sharing,
    pub(super) actions: Vec<Box<dyn TimedAction>>,
    pub(crate) measurements: Vec<Box<dyn Measurement>>,
    pub(crate) options: Options,
    /// Until when searches may be used in a box that deforms \[ticks\].
    pub(super) horizon: i64,
    /// The requested time of the last stop [time]; the present tick is only the nearest one.
    pub(super) stop_time: Option<f64>,
    /// A contact duration that suits the system, for the error of a collapse [time].
    pub(super) contact_duration: Option<f64>,
    /// See [`Self::wait`].
    waits: bool,
}

impl Simulation {
    /// Starts a simulation at time 0.
    ///
    /// The system must be valid: masses and radii are positive, nothing overlaps, particles are inside their
    /// walls, velocities are finite, and gravity is zero along periodic axes.
    pub fn new(system: System, options: Options) -> Result<Self, EngineError> {
        let population = Population::of(&system);
        let ids = system.flow.as_ref().map(|flow| (0..flow.present as u32).collect::<Arc<[u32]>>());
        let species = Species::new(&system);
        let system = match &ids {
            Some(ids) => system.with_bodies(ids),
            None => system,
        };
        let mut world = World::new(&system, 0);
        world.ids = ids;
        let extent = world.extent(open_axes(&system));
        let exponent = world.exponent_for(extent, world.largest_speed(extent));
        // All anchors are at tick 0, which is time 0 for any length of a tick.
        world.clock = world.clock.with_exponent(exponent);
        world.set_scale(extent, 0.0);
        let totals = Totals::of(&world);
        let accumulators = Accumulators::new(&world, [totals.all_kinetic(), totals.potential]);
        let state = State {
            world,
            accumulators,
            pending: BTreeMap::new(),
            settling: SettlingState::default(),
            blocks: BlockCounts::default(),
            stall: Stall::default(),
            population,
        };
        let actions = actions(&system);
        let measurements = measurements(&system, &state);
        Self::start((system, species), options, state, actions, measurements)
    }

    /// Builds the engine for a state. `species` are those of all particles that ever are there.
    pub(crate) fn start(
        (mut system, species): (System, Species),
        options: Options,
        state: State,
        actions: Vec<Box<dyn TimedAction>>,
        measurements: Vec<Box<dyn Measurement>>,
    ) -> Result<Self, EngineError> {
        for (what, count, limit) in
            [("particles", system.bodies.len(), MAX_PARTICLES), ("walls", system.walls.len(), MAX_WALLS)]
        {
            if count > limit {
                return Err(EngineError::TooMany { what, count, limit });
            }
        }
        let kernel = Kernel::choose(options.simd).ok_or(EngineError::NoAvx2)?;
        let present = present_system(&system, &state.world);
        let has_passed = state.population.as_ref().is_some_and(|population| population.passages() != [0; 2]);
        let choose = if has_passed { Choice::of_passing } else { Choice::new };
        let choice = choose(options, kernel, &present, &state.world)?;
        choice.log(&present, &state.world);
        let geometry = geometry(&present, &state.world, choice.filled());
        let engine = choice.compile(&present, &geometry);
        drop(present);
        let contact_duration = suitable_contact_duration(&system);
        // The state has a copy of the bodies; they are a quarter of the memory of a large system.
        system.bodies = Vec::new();
        if let Some(spin) = &mut system.spin {
            spin.angular_velocity = Vec::new();
        }
        let mut simulation = Self {
            system,
            species,
            geometry,
            state,
            engine,
            choice,
            sharing: Sharing::default(),
            actions,
            measurements,
            options,
            horizon: i64::MAX,
            stop_time: None,
            waits: false,
            contact_duration,
        };
        simulation.rebuild();
        Ok(simulation)
    }

    /// Has the engine predict all particles from the state.
    pub(super) fn predict_all(&mut self) {
        self.horizon = i64::MAX;
        if self.state.world.boundary.deformation.is_some() {
            let world = &mut self.state.world;
            let horizon = world.begin_horizon();
            // Cells and windows follow a shear for ever.
            let follows = world.shear().is_some() && self.choice.search() != Search::Lists;
            self.horizon = if follows { i64::MAX } else { horizon };
            let edges = self.state.world.periodicity(self.state.world.now).size;
            for axis in (0..3).filter(|&axis| self.system.domain.boundary[axis] == Boundary::Periodic) {
                self.geometry.size[axis] = edges[axis];
            }
            self.geometry.deforming = self.state.world.moving_images();
        }
        self.horizon =
            self.horizon.min(self.horizon_of_walls()).min(self.state.world.clock.horizon_of_drag());
        self.engine.rebuild(&mut self.state, &self.geometry);
    }

    /// Rebuilds the engine's search and all its predictions from the state.
    pub(super) fn rebuild(&mut self) {
        self.predict_all();
        self.choice.after(self.state.accumulators.counters.collisions);
    }

    /// Changes the engine if another one is better for the present state. No choice changes the trajectory.
    #[cold]
    pub(super) fn reconsider(&mut self) {
        self.state.accumulators.sums_mut().for_each(|(_, sum)| sum.normalize());
        for sum in self.state.accumulators.flights.iter_mut().flat_map(|flights| &mut flights.sums) {
            sum.normalize();
        }
        self.choice.after(self.state.accumulators.counters.collisions);
        let system = present_system(&self.system, &self.state.world);
        let changed = self.choice.reconsider(&system, &self.state.world);
        drop(system);
        if changed {
            self.compile();
        }
    }

    /// Makes the engine that has been chosen for the present state.
    pub(super) fn compile(&mut self) {
        let system = present_system(&self.system, &self.state.world);
        self.geometry = geometry(&system, &self.state.world, self.choice.filled());
        self.engine = self.choice.compile(&system, &self.geometry);
        drop(system);
        self.rebuild();
    }

    /// Runs events until the first of the bounds, or until nothing moves and no event is due.
    pub fn advance(&mut self, until: Until, observer: &mut dyn Observer) -> Result<Stop, EngineError> {
        self.stop_time = None;
        if self.is_finished() {
            return Ok(Stop::Rest);
        }
        let mut entries = until.entries;
        let _scope = self.sharing.enter();
        loop {
            let target = self.state.world.clock.ticks(until.time);
            let due = self.next_due();
            let (started, part) = self.sharing.start(self.engine.serial_reason(&self.state).is_none());
            let slice = entries.min(self.choice.entries_left).min(part);
            let events = self.events();
            let mut limit = Limit {
                // Events at the last tick of an epoch belong to the next epoch.
                ticks: target.min(EPOCH - 1).min(due).min(self.horizon),
                collisions: until.collisions.min(self.choice.review),
                entries: slice,
            };
            let (engine, state) = (&mut self.engine, &mut self.state);
            let ids = state.world.ids.clone();
            let run = |observer: &mut dyn Observer| engine.advance(state, &mut limit, observer);
            let measurements = &mut self.measurements;
            let paused = with_ids(ids, observer, |observer| observe(measurements, observer, run));
            if self.sharing.end(&started, self.events() - events) {
                self.engine.use_more_threads(&self.state);
            }
            entries -= slice - limit.entries;
            self.choice.entries_left -= slice - limit.entries;
            let pause = match paused {
                Ok(pause) => pause,
                Err(EngineError::LongTick { speed }) => {
                    // Before the event, which is then predicted again.
                    self.start_epoch(self.state.world.now, speed);
                    entries = entries.saturating_sub(1 + self.particles() as u64);
                    if entries == 0 {
                        return Ok(Stop::Slice);
                    }
                    continue;
                }
                Err(error) => return Err(self.complete_error(error)),
            };
            match pause {
                Pause::Rest if self.is_driven() => {}
                Pause::Rest => return Ok(self.rest(observer)),
                Pause::Jam => {
                    let changed = scan(&mut self.state, &self.geometry, true, observer);
                    if self.reschedule_changed(&changed, until, &mut entries) {
                        return Ok(self.rest(observer));
                    }
                }
                Pause::Time if limit.ticks == due => {
                    let before = self.passages();
                    let changed = self.act(due, observer)?.unwrap_or_else(|| {
                        self.measure(due, observer);
                        Vec::new()
                    });
                    if before != self.passages() {
                        self.repopulate()?;
                        entries = entries.saturating_sub(1 + self.particles() as u64);
                        if self.is_finished() {
                            return Ok(self.rest(observer));
                        }
                    } else if self.reschedule_changed(&changed, until, &mut entries) {
                        return Ok(self.rest(observer));
                    }
                }
                Pause::Time if limit.ticks == self.horizon => {
                    let idle = || self.engine.is_idle() && !self.stretches();
                    if until.time == f64::INFINITY && !self.is_driven() && (self.is_frozen() || idle()) {
                        return Ok(self.rest(observer));
                    }
                    if self.state.world.is_damped() {
                        self.start_epoch(self.horizon, 0.0);
                    } else {
                        self.renew()?;
                    }
                    entries = entries.saturating_sub(1 + self.particles() as u64);
                }
                Pause::Time => {
                    let idle = self.engine.is_idle() && !self.stretches();
                    if until.time == f64::INFINITY && idle && !self.is_driven() {
                        return Ok(Stop::Rest);
                    }
                    if target < EPOCH {
                        self.stop_time = Some(until.time);
                        return Ok(Stop::Time);
                    }
                    self.start_epoch(EPOCH, 0.0);
                    // An epoch counts as one entry per particle: a long flight without events must return
                    // to the caller, too.
                    entries = entries.saturating_sub(1 + self.particles() as u64);
                }
                Pause::Collisions => {
                    if self.state.accumulators.counters.collisions >= until.collisions {
                        return Ok(Stop::Collisions);
                    }
                    self.reconsider();
                }
                Pause::Entries if self.choice.entries_left == 0 => self.reconsider(),
                Pause::Unsupported => self.reconsider(),
                Pause::Entries => {}
            }
            if entries == 0 {
                return Ok(Stop::Slice);
            }
        }
    }

    /// Adds to an error of the engine what the simulation has to say.
    pub(super) fn complete_error(&mut self, error: EngineError) -> EngineError {
        let mut error = self.with_ids(error);
        if let EngineError::Overlap { depth, .. } = &error {
            self.state.accumulators.max_overlap = self.state.accumulators.max_overlap.max(*depth);
        }
        if let EngineError::Collapse { contact_duration, .. } = &mut error {
            *contact_duration = self.contact_duration.unwrap_or(0.0);
        }
        error
    }

    /// Number of collisions and wall collisions so far.
    pub(super) fn events(&self) -> u64 {
        let Counters { collisions, wall_collisions, .. } = self.state.accumulators.counters;
        collisions + wall_collisions
    }

    /// The time of the next action or measurement \[ticks\].
    pub(super) fn next_due(&self) -> i64 {
        let actions = self.actions.iter().map(|action| action.next(&self.state));
        let measurements = self.measurements.iter().map(|measurement| measurement.next(&self.state));
        actions.chain(measurements).min().unwrap_or(i64::MAX)
    }

    /// Applies the actions that are due at this time. Returns the particles that have changed, or `None` if
    /// no action is due.
    pub(super) fn act(
        &mut self,
        due: i64,
        observer: &mut dyn Observer,
    ) -> Result<Option<Vec<u32>>, EngineError> {
        let Self { actions, state, geometry, measurements, .. } = self;
        let mut all = None;
        for action in actions {
            if action.next(state) == due {
                let apply = |observer: &mut dyn Observer| action.apply(state, geometry, observer);
                let changed = observe(measurements, observer, apply)?;
                all.get_or_insert_with(Vec::new).extend(changed);
            }
        }
        if let Some(changed) = &mut all {
            changed.sort_unstable();
            changed.dedup();
        }
        Ok(all)
    }

    /// Ends a run in which nothing moves any more: measurements of the present are taken first.
    pub(super) fn rest(&mut self, observer: &mut dyn Observer) -> Stop {
        self.measure(self.state.world.now, observer);
        Stop::Rest
    }

    /// Takes the states of the measurements that are due at this time. All actions and events of this time
    /// are done.
    pub(super) fn measure(&mut self, due: i64, observer: &mut dyn Observer) {
        let Self { state, measurements, .. } = self;
        if state.world.flights == Summed::Tensor
            && measurements.iter().any(|measurement| measurement.next(state) == due)
        {
            take_flights(measurements, state);
        }
        for measurement in measurements {
            if measurement.next(state) == due {
                measurement.take(state, observer);
            }
        }
    }

    /// Predicts the particles that an action has changed. Returns whether nothing moves and no event is due.
    ///
    /// If most particles have changed, the engine is rebuilt instead.
    pub(super) fn reschedule_changed(&mut self, changed: &[u32], until: Until, entries: &mut u64) -> bool {
        let idle = self.engine.is_idle();
        let world = &self.state.world;
        let too_fast = changed
            .iter()
            .map(|&i| world.particles[i as usize].velocity)
            .filter(|&velocity| !world.is_resolved(velocity))
            .map(DVec3::length)
            .reduce(f64::max);
        if let Some(speed) = too_fast {
            self.start_epoch(world.now, speed);
        } else if 2 * changed.len() > self.particles() {
            for &i in changed {
                self.state.world.wrap_anchor(i);
            }
            // Positions are those of before.
            if !self.engine.predict_again(&mut self.state) {
                self.predict_all();
            }
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

    /// The instructions of predictions.
    pub(crate) fn kernel(&self) -> Kernel {
        self.choice.kernel
    }

    /// Whether time passes where nothing moves, because the caller will change the state.
    pub fn wait(&mut self, waits: bool) {
        self.waits = waits;
    }

    /// Whether there are drives, particles still to come in, or a caller that will change the state: they can
    /// set particles at rest in motion.
    pub(super) fn is_driven(&self) -> bool {
        self.waits || !self.system.drives.is_empty() || self.actions.iter().any(|action| action.brings())
    }

    /// Whether nothing moves and nothing will.
    pub(super) fn is_finished(&self) -> bool {
        self.state.is_at_rest() && !self.is_driven()
    }

    /// Saves the state of the timed actions for a resumed run.
    pub(crate) fn save_actions(&self, put: &mut dyn FnMut(&str, u64)) {
        self.actions.iter().for_each(|action| action.save(put));
    }

    /// Saves the times of contacts and the data of the measurements for a resumed run.
    pub(crate) fn save_measurements(&self) -> Vec<u64> {
        let mut words = Vec::new();
        if let Some(times) = &self.state.world.laws.contact_times {
            times.save(&mut words);
        }
        if let Some(sums) = &self.state.world.boundary.wall_sums {
            sums.save(&mut words);
        }
        self.measurements.iter().for_each(|measurement| measurement.save(&mut words));
        words
    }

    /// Finds the contacts of all particles at rest, which a checkpoint does not contain.
    pub(crate) fn find_contacts_of_asleep(&mut self) {
        self.state.settling.contacts = contacts_of_asleep(&self.state.world, &self.geometry);
    }
}

/// The timed actions of a system. The system must still have its bodies.
pub(crate) fn actions(system: &System) -> Vec<Box<dyn TimedAction>> {
    let mut actions = drive::actions(system);
    if Thresholds::of(system).is_some() {
        actions.push(Box::new(SettlingScan));
    }
    // The last one: the others have the geometry of the particles before.
    if let Some(flow) = &system.flow {
        actions.push(Box::new(Passage::new(system, flow)));
    }
    actions
}

/// Axes along which the domain has no size: open axes, and z in two dimensions.
pub(crate) fn open_axes(system: &System) -> [bool; 3] {
    let mut open = system.domain.boundary.map(|boundary| boundary == Boundary::Open);
    open[2] |= system.dimension == Dimension::Two;
    open
}
