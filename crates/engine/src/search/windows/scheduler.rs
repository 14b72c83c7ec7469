//! The scheduler for windows of time.

use glam::DVec3;
use haff_neighbors::Geometry;

use crate::{
    laws::event::{Collision, Impact, Pause},
    model::{Boundary, System, features::Features, thresholds::Thresholds},
    numerics::tuning::particles,
    report::Observer,
    search::{
        batch::Kernel,
        blocks,
        case::{Case, HAS_PISTONS, MAY_SETTLE, Reason},
        compact::NEAREST,
        event_loop::{Limit, Next, Scheduler},
        planes::Planes,
        summary::{LocalDensity, SystemSummary},
        windows::axes,
    },
    state::{State, world::World},
};

use super::{
    filter::{MAX_DISPLACEMENT, margin},
    moving::MovingFrame,
    steps::Steps,
    tune::{Tuner, Work},
    window_event::{Contact, WindowEvent},
    worker::Worker,
};

/// Largest rounding error of coordinates, as a fraction of the smallest contact distance.
pub(super) const MAX_ROUNDING: f64 = 0.02;

/// Windows are profitable with at most this many walls.
pub(super) const MAX_WALLS: usize = 16;

/// Windows are profitable if no particle is faster than the mean speed by more than this factor: the fastest
/// particle limits the length of windows.
pub(super) const MAX_SPEED_RATIO: f64 = 30.0;

/// Windows are profitable if the nearest image and the filter allow displacements of at least this many mean
/// distances between neighboring particles. With a smaller limit, windows would be short.
pub(super) const MIN_DISPLACEMENT: f64 = 0.5;

/// The same in a box that deforms, whose cells are slower (choice.md).
const MIN_DISPLACEMENT_IN_DEFORMING: f64 = 0.07;

/// Windows run a box that deforms if particles can move in them by at least this [largest contact distances].
const LEAST_DISPLACEMENT: f64 = 0.05;

/// Windows are profitable up to this ratio of the edges along the flow and along the gradient of a shear:
/// half of it is the largest tilt.
const LARGEST_RATIO: f64 = 12.0;

/// A window ends early after this many searches per particle, plus [`SEARCHES`]. Each event registers a
/// particle again along its new path, so that a few particles that collide very often would fill their cells
/// with repeated entries.
pub(super) const SEARCHES_PER_PARTICLE: u64 = 4;

/// See [`SEARCHES_PER_PARTICLE`].
pub(super) const SEARCHES: u64 = 1000;

/// The scheduler for one set of features.
pub(crate) struct Windows<F> {
    pub(super) kernel: Kernel,
    pub(super) geometry: Geometry,
    /// Smallest radius [length].
    pub(super) smallest_radius: f64,
    /// Largest contact distance of two particles [length].
    pub(super) largest_contact: f64,
    pub(super) worker: Worker<F>,
    pub(super) steps: Steps<F>,
    /// Contacts found by the batch phase.
    pub(super) found: Vec<WindowEvent>,
    /// Mean distance between neighboring particles at the local density [length].
    pub(super) spacing: f64,
    /// Mean length of a path in the window [spacings].
    pub(super) path: f64,
    /// Width that the cells were made for [spacings].
    pub(super) width: f64,
    pub(super) tuner: Tuner,
    /// Total number of searches after which the present window ends early.
    pub(super) search_limit: u64,
    /// Number of windows since the slots were filled from the anchors.
    pub(super) fill_age: u64,
    /// Number of windows after which the slots are filled again.
    pub(super) fill_interval: u64,
    /// Work up to the last update of the tuner.
    pub(super) tuned_work: Work,
    /// The part of the work since then that was spent on opening windows.
    pub(super) opening_work: Work,
    /// Work that has been added to the counters of the state.
    pub(super) counted: Work,
}

/// Whether windows can run a case.
///
/// # Errors
/// Why they cannot.
pub(crate) fn can_run(case: &Case) -> Result<(), Reason> {
    let &Case { system, summary, world, .. } = case;
    let axes = system.dimension.count();
    if Thresholds::of(system).is_some() {
        return Err(Reason::new(MAY_SETTLE));
    }
    if system.piston_count() > 0 {
        return Err(Reason::new(HAS_PISTONS));
    }
    if system.domain.gravity != DVec3::ZERO && !summary.movable {
        return Err(Reason::new("there are gravity and bodies of infinite mass, which do not fall"));
    }
    can_run_deformation(system, summary)?;
    for axis in 0..axes {
        let edge = system.domain.size[axis];
        match system.domain.boundary[axis] {
            Boundary::Open => return Err(Reason::new("an axis is open")),
            Boundary::Periodic if NEAREST * edge < 1.25 * summary.contact => {
                return Err(Reason::new(format!(
                    "a periodic edge of {edge} is shorter than 2.8 of the largest contact distance, {}",
                    summary.contact
                )));
            }
            Boundary::Periodic | Boundary::Wall => {}
        }
        let periodic = system.domain.boundary[axis] == Boundary::Periodic;
        if axes::rounding(edge, periodic, summary.least) > MAX_ROUNDING {
            return Err(Reason::new(format!(
                "an edge of {edge} is too long for the least radius, {}",
                summary.least
            )));
        }
    }
    if world.supported.resting != 0 {
        return Err(Reason::of_state("grains rest on walls"));
    }
    Ok(())
}

/// Whether windows can run a box that deforms: edges must be long enough for images that move. Otherwise
/// particles could hardly move in a window.
fn can_run_deformation(system: &System, summary: &SystemSummary) -> Result<(), Reason> {
    let Some(frame) = MovingFrame::of(system) else { return Ok(()) };
    let edges = frame.axes.ordered(system.domain.size);
    let boundary = frame.axes.order.map(|axis| system.domain.boundary[axis]);
    let axes = || (0..system.dimension.count()).map(|axis| (axis, edges[axis], boundary[axis]));
    let rounding = axes()
        .map(|(_, edge, kind)| axes::rounding(edge, kind == Boundary::Periodic, summary.least))
        .fold(0.0, f64::max);
    let rounding = rounding * (1.0 + frame.largest_tilt_at_end());
    let contact = summary.contact * f64::from(margin(MAX_DISPLACEMENT, rounding));
    let is_short = |&(axis, edge, kind): &(usize, f64, Boundary)| {
        kind == Boundary::Periodic
            && frame.longest_displacement(axis, edge, contact) < LEAST_DISPLACEMENT * summary.contact
    };
    match axes().find(is_short) {
        Some((_, edge, _)) => {
            Err(Reason::new(format!("an edge of {edge} is too short for images that are displaced")))
        }
        None => Ok(()),
    }
}

/// Whether blocks share the events of windows.
///
/// # Errors
/// Why one thread takes all events.
pub(crate) fn can_share(world: &World) -> Result<(), &'static str> {
    blocks::can_share(world)
}

/// Whether windows are likely to be the fastest scheduler for a state that they support and that is not
/// dense.
pub(crate) fn is_profitable(system: &System, summary: &SystemSummary, density: &LocalDensity) -> bool {
    let spacing = summary.spacing(density.packing);
    let displacement = MIN_DISPLACEMENT * spacing;
    let is_periodic = |axis: usize| system.domain.boundary[axis] == Boundary::Periodic;
    let axes = 0..system.dimension.count();
    let (least, allows_displacement) = if let Some(frame) = MovingFrame::of(system) {
        let edges = frame.axes.ordered(system.domain.size);
        let allows = |axis: usize| {
            !is_periodic(frame.axes.order[axis])
                || frame.longest_displacement(axis, edges[axis], summary.contact)
                    >= MIN_DISPLACEMENT_IN_DEFORMING * spacing
        };
        let is_long = system.domain.shear.is_some() && edges[0] > LARGEST_RATIO * edges[1];
        (particles::WINDOWS_IN_DEFORMING, axes.clone().all(allows) && !is_long)
    } else {
        let allows = |axis: usize| {
            !is_periodic(axis) || 0.5 * (NEAREST * system.domain.size[axis] - summary.contact) >= displacement
        };
        (particles::WINDOWS, axes.clone().all(allows))
    };
    summary.count >= least
        && system.walls.len() <= MAX_WALLS
        && density.speeds_are_within(MAX_SPEED_RATIO)
        && MAX_DISPLACEMENT * 2.0 * summary.least >= displacement
        && allows_displacement
}

impl<F: Features> Windows<F> {
    pub fn new(
        geometry: &Geometry,
        kernel: Kernel,
        system: &System,
        summary: &SystemSummary,
        density: &LocalDensity,
        blocks: Option<u16>,
    ) -> Self {
        let count = summary.count;
        let moving = MovingFrame::of(system);
        let mut worker = Worker::new(system.domain.gravity, count);
        worker.moving = moving;
        Self {
            kernel,
            geometry: match &moving {
                Some(frame) => frame.ordered(geometry),
                None => geometry.clone(),
            },
            smallest_radius: summary.least,
            largest_contact: summary.contact,
            worker,
            steps: Steps::new(blocks),
            found: Vec::new(),
            spacing: summary.spacing(density.packing),
            path: 0.0,
            width: 0.0,
            tuner: Tuner::new(density.packing, system.dimension.count(), count),
            search_limit: 0,
            fill_age: 0,
            fill_interval: 0,
            tuned_work: Work::default(),
            opening_work: Work::default(),
            counted: Work::default(),
        }
    }

    /// Number of entries that opening a window counts as: opening takes time, and the caller checks for
    /// signals whenever the limit of entries is used up.
    pub(super) fn entries_of_opening(&self) -> u64 {
        1 + self.worker.space.particles.len() as u64 / 16
    }

    /// Whether the window has to end early because of too many searches.
    ///
    /// Tested only after invalidated events and after events that change a single particle: a few particles
    /// that collide very often cause many of these. For other events the test costs nothing.
    #[inline(always)]
    pub(super) fn exceeds_search_limit(&self) -> bool {
        self.worker.scratch.work.searches > self.search_limit
    }

    /// Ends the window early, and opens the next one at the present.
    #[cold]
    pub(super) fn reopen(&mut self, world: &World, limit: &mut Limit) {
        limit.entries = limit.entries.saturating_sub(self.entries_of_opening());
        self.start_from_anchors(world);
        self.open(world);
    }
}

impl<F: Features> Scheduler for Windows<F> {
    type Features = F;
    type Event = Impact;

    fn kernel(&self) -> Kernel {
        self.kernel
    }

    fn rebuild(&mut self, state: &mut State, _geometry: &Geometry) {
        self.worker.space.planes = Planes::new(&state.world);
        self.start_from_anchors(&state.world);
        self.open(&state.world);
    }

    #[inline(always)]
    fn next<const VECTORS: bool>(&mut self, state: &mut State, limit: &mut Limit) -> Next<Impact> {
        loop {
            let Some(WindowEvent(entry)) = self.worker.queue.pop_until(limit.ticks.min(self.worker.horizon))
            else {
                if limit.ticks <= self.worker.horizon {
                    return Next::Nothing;
                }
                if self.worker.horizon < self.worker.space.end {
                    return Next::Step;
                }
                limit.entries = limit.entries.saturating_sub(self.entries_of_opening());
                self.next_window(state);
                if limit.entries == 0 {
                    return Next::Interrupted;
                }
                continue;
            };
            self.worker.prefetch(&state.world, |_| true);
            let world = &state.world;
            let i = entry.owner;
            let (is_valid, event) = match entry.target.kind() {
                Contact::Collision(j) => (
                    world.particles[j as usize].count == entry.partner_count,
                    Impact::Pair(Collision([i, j])),
                ),
                Contact::Wall(wall) => (true, Impact::Wall { i, wall }),
            };
            if is_valid && world.particles[i as usize].count == entry.own_count {
                return Next::Event(entry.time, event);
            }
            state.accumulators.counters.dropped += 1;
            if self.exceeds_search_limit() {
                self.reopen(&state.world, limit);
                if limit.entries == 0 {
                    return Next::Interrupted;
                }
            }
        }
    }

    #[inline(always)]
    fn update<const VECTORS: bool>(
        &mut self,
        state: &mut State,
        event: Impact,
        _woken: &[u32],
        limit: &mut Limit,
    ) -> Option<Pause> {
        let changed = match event {
            Impact::Pair(Collision([i, j])) => {
                state.world.wrap_anchor(i);
                state.world.wrap_anchor(j);
                let world = &state.world;
                // A collision does not change a body of infinite mass: its entries in the queue stay valid.
                let movable = |body: u32| F::UNIFORM || world.class(body).inverse_mass != 0.0;
                match (movable(i), movable(j)) {
                    (true, true) => {
                        if !self.worker.predict_again::<2, VECTORS>(world, [i.min(j), i.max(j)]) {
                            self.reopen(world, limit);
                        }
                        return None;
                    }
                    (true, false) => i,
                    (false, _) => j,
                }
            }
            Impact::Wall { i, .. } => {
                state.world.wrap_anchor(i);
                if F::GRAVITY && state.world.supported.resting != 0 {
                    return Some(Pause::Unsupported);
                }
                i
            }
        };
        // Inlined where the loop is the fastest: not inlined, it took 0.3 % more instructions.
        let is_slow = if F::UNIFORM {
            self.worker.predict_again::<1, VECTORS>(&state.world, [changed])
        } else {
            self.worker.predict_one::<VECTORS>(&state.world, changed)
        };
        if !is_slow || self.exceeds_search_limit() {
            self.reopen(&state.world, limit);
        }
        None
    }

    fn reschedule(&mut self, state: &mut State, bodies: &[u32]) {
        for &body in bodies {
            state.world.wrap_anchor(body);
        }
        // Each particle that is predicted again is registered once more, so that for many particles a new
        // window costs less.
        let few = bodies.len() as u64 <= SEARCHES;
        let is_predicted =
            few && bodies.iter().all(|&body| self.worker.predict_one::<false>(&state.world, body));
        if !is_predicted || self.exceeds_search_limit() {
            self.start_from_anchors(&state.world);
            self.open(&state.world);
        } else {
            self.test_speeds(bodies);
        }
    }

    fn take_steps(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
        events: bool,
    ) {
        blocks::take_steps(self, state, limit, observer, events);
    }

    fn serial_reason(&self, state: &State) -> Option<&'static str> {
        Windows::serial_reason(self, &state.world)
    }

    fn is_idle(&self) -> bool {
        // In a closed box there is always a next contact, unless nothing moves; the simulation tests that.
        false
    }

    fn count_work(&mut self, state: &mut State) {
        let work = self.worker.scratch.work.since(&self.counted);
        self.counted = self.worker.scratch.work;
        let counters = &mut state.accumulators.counters;
        counters.predictions += work.predictions;
        counters.candidates += work.candidates;
        counters.windows += work.windows;
    }
}
