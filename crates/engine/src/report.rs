//! The output of a simulation as plain data: events, frames, samples, counters and checkpoints.

use glam::DVec3;

use crate::{
    ledger::Ledger,
    measurements::StressTensor,
    model::{System, WallLaw},
};

/// The kind of an event in the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[repr(u8)]
pub enum EventKind {
    /// Two particles.
    #[default]
    Collision = 0,
    /// A particle and a wall.
    Wall = 1,
    /// A particle comes to rest: on a wall, at the end of a completed (Zeno) series of bounces; or at its
    /// position, slow and supported, by a settling scan.
    Rest = 2,
    /// A pendulum's string goes slack: bob and pendulum.
    Slack = 3,
    /// A slack string becomes taut, and the velocity along it is lost: bob and pendulum.
    Taut = 4,
    /// A persistent contact of two particles ends because its force would become attractive.
    Release = 5,
    /// Two particles stick together.
    Stick = 6,
    /// A persistent contact with a wall ends because its force would become attractive: particle and wall.
    /// Also of a grain that an oscillating wall carried.
    Lift = 7,
    /// End of a completed series of bounces of two particles.
    Settle = 8,
    /// The state was changed from outside: no particle, no partner.
    Change = 9,
    /// A stretch of sliding with friction on a wall ends: the grain rolls from now on, or has another event.
    Slide = 10,
}

impl EventKind {
    /// Every kind; the index of a kind is its discriminant.
    pub const ALL: [Self; 11] = [
        Self::Collision,
        Self::Wall,
        Self::Rest,
        Self::Slack,
        Self::Taut,
        Self::Release,
        Self::Stick,
        Self::Lift,
        Self::Settle,
        Self::Change,
        Self::Slide,
    ];

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Collision => "collision",
            Self::Wall => "wall",
            Self::Rest => "rest",
            Self::Slack => "slack",
            Self::Taut => "taut",
            Self::Release => "release",
            Self::Stick => "stick",
            Self::Lift => "lift",
            Self::Settle => "settle",
            Self::Change => "change",
            Self::Slide => "slide",
        }
    }
}

/// Value of [`EventRecord::j`] for an event without a partner.
pub const NO_PARTNER: u32 = u32::MAX;

/// One row of the event log.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EventRecord {
    /// Time of the event [time].
    pub time: f64,
    /// Kind of the event.
    pub kind: EventKind,
    /// Index of the particle.
    pub i: u32,
    /// Index of the partner (> `i`), of the wall or of the pendulum; [`NO_PARTNER`] for a particle that is
    /// put to rest and touches no wall.
    pub j: u32,
    /// v_n = (w_i − w_j)·n > 0 [length/time].
    pub approach_speed: f64,
    /// J = (1 + e) μ v_n [mass·length/time]; summed over the series for `Rest`.
    pub impulse: f64,
    /// ΔT = ½ μ v_n² (1 − e²), eq. (2.16), plus [`Self::tangential_loss`] [energy].
    pub energy_loss: f64,
    /// E'_c = J²/(2μ), eq. (2.31), plus that of the tangential impulse of a rough contact [energy].
    pub carnot_energy: f64,
    /// Contact normal: unit vector from i to j, or into the wall.
    pub normal: DVec3,
    /// Contact point [length], wrapped into the box along periodic axes.
    pub position: DVec3,
    /// Impulse on j, or on the wall, with its tangential component [mass·length/time].
    pub impulse_vector: DVec3,
    /// The part of `energy_loss` by the tangential impulse, of translation and rotation [energy].
    pub tangential_loss: f64,
}

/// A column of the event log: a field of [`EventRecord`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventColumn {
    /// [`EventRecord::time`].
    Time,
    /// [`EventRecord::kind`].
    Kind,
    /// [`EventRecord::i`].
    I,
    /// [`EventRecord::j`].
    J,
    /// [`EventRecord::approach_speed`].
    ApproachSpeed,
    /// [`EventRecord::impulse`].
    Impulse,
    /// [`EventRecord::energy_loss`].
    EnergyLoss,
    /// [`EventRecord::carnot_energy`].
    CarnotEnergy,
    /// [`EventRecord::normal`].
    Normal,
    /// [`EventRecord::position`].
    Position,
    /// [`EventRecord::impulse_vector`].
    ImpulseVector,
    /// [`EventRecord::tangential_loss`].
    TangentialLoss,
}

impl EventColumn {
    /// Every column, in the order of files.
    pub const ALL: [Self; 12] = [
        Self::Time,
        Self::Kind,
        Self::I,
        Self::J,
        Self::ApproachSpeed,
        Self::Impulse,
        Self::EnergyLoss,
        Self::CarnotEnergy,
        Self::Normal,
        Self::Position,
        Self::ImpulseVector,
        Self::TangentialLoss,
    ];

    /// Whether a complete log of this system has the column: the impulse is along the normal, and nothing is
    /// lost by a tangential one, unless contacts are rough or walls thermal.
    pub fn exists(self, system: &System) -> bool {
        let is_rough = system.spin.is_some();
        match self {
            Self::ImpulseVector => is_rough || system.contacts.wall.iter().any(WallLaw::is_thermal),
            Self::TangentialLoss => is_rough,
            _ => true,
        }
    }

    /// The name in scenes and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Kind => "kind",
            Self::I => "i",
            Self::J => "j",
            Self::ApproachSpeed => "approach_speed",
            Self::Impulse => "impulse",
            Self::EnergyLoss => "energy_loss",
            Self::CarnotEnergy => "carnot_energy",
            Self::Normal => "normal",
            Self::Position => "position",
            Self::ImpulseVector => "impulse_vector",
            Self::TangentialLoss => "tangential_loss",
        }
    }
}

/// Receives events as they are resolved. Observers cannot change the simulation.
pub trait Observer {
    /// Whether the observer needs events. Called once per call of `Simulation::advance`.
    fn wants_events(&self) -> bool {
        false
    }
    /// Receives one event. Events are in the order of time.
    fn event(&mut self, _event: &EventRecord) {}
    /// Receives the changes of velocities of one event or kick, if the observer wants events.
    fn exchange(&mut self, _exchange: &Exchange) {}
    /// Receives a row of a profile, at the end of its interval.
    fn profile(&mut self, _row: ProfileRow) {}
}

/// The velocities that one event changes: an impact, or the kick of a drive. What gravity and the end of a
/// series of bounces change is not included.
#[derive(Debug, Clone, Copy)]
pub struct Exchange<'a> {
    /// Time of the event \[time\].
    pub time: f64,
    /// The particles of finite mass whose velocities change: one or two.
    pub changes: &'a [VelocityChange],
    /// Where the momentum of the first change comes from.
    pub partner: Partner,
}

/// A change of velocity.
#[derive(Debug, Clone, Copy)]
pub struct VelocityChange {
    /// Index of the particle.
    pub i: u32,
    /// Its mass [mass].
    pub mass: f64,
    /// Velocity before [length/time], under shear the peculiar one.
    pub before: DVec3,
    /// Velocity after [length/time].
    pub after: DVec3,
}

/// The other side of an [`Exchange`].
#[derive(Debug, Clone, Copy)]
pub enum Partner {
    /// Another particle, or a body of infinite mass.
    Particle {
        /// Center of the first particle \[length\].
        position: DVec3,
        /// Vector from there to the center of the other one.
        branch: DVec3,
    },
    /// A wall.
    Wall(u32),
    /// A drive.
    Drive,
}

/// One row of a profile, with values by cell of its [`Grid`](crate::Grid): means over the interval that ends
/// at its time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ProfileRow {
    /// Index of the profile.
    pub profile: usize,
    /// End of the interval \[time\].
    pub time: f64,
    /// Collisions + wall collisions so far.
    pub step: u64,
    /// Number density [1/length^d].
    pub density: Vec<f64>,
    /// Mass density [mass/length^d].
    pub mass_density: Vec<f64>,
    /// Momentum by mass [length/time]; NaN in an empty cell.
    pub velocity: Vec<DVec3>,
    /// Σ m|v − u|²/(d N), with the velocity u of the cell \[energy\]; NaN in an empty cell.
    pub temperature: Vec<f64>,
    /// Pressure tensor relative to u, d·d numbers a cell [energy/length^d].
    pub pressure: Vec<f64>,
}

/// An observer that ignores all events.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {}

/// All particles at one time, in scene order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Simulated time [time].
    pub time: f64,
    /// Collisions + wall collisions so far.
    pub step: u64,
    /// Positions of the centers [length], wrapped into [0, L) along periodic axes.
    pub position: Vec<DVec3>,
    /// Velocities [length/time].
    pub velocity: Vec<DVec3>,
    /// Box images: unwrapped position = position + Σ image · edge vector.
    pub image: Vec<[i32; 3]>,
    /// Edge vectors of the box \[length\]. Under shear that along the gradient has a component along the
    /// flow, at most half an edge.
    pub edges: [DVec3; 3],
    /// Angular velocities [1/time]; empty without spin.
    pub angular_velocity: Vec<DVec3>,
}

/// One row of the observables.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sample {
    /// Simulated time [time].
    pub time: f64,
    /// Collisions + wall collisions so far.
    pub step: u64,
    /// Energies.
    pub ledger: Ledger,
    /// T = Σ m|v − V|²/(dN) over bodies of finite mass, with the velocity V of their center of mass along the
    /// axes on which momentum is conserved ([`crate::conserved_momentum`]), and 0 along the others.
    pub temperature: f64,
    /// The same per species, with the common V; NaN for a species without bodies of finite mass.
    pub species_temperature: Vec<f64>,
    /// `T_rot` = Σ I ω²/(r N) over bodies of finite mass, with r = 3 axes of rotation, 1 in two dimensions
    /// [energy].
    pub rotational_temperature: f64,
    /// The same per species; empty without spin.
    pub species_rotational_temperature: Vec<f64>,
    /// a₂ = d⟨v⁴⟩/((d + 2)⟨v²⟩²) − 1, with v − V for v; NaN without motion.
    pub sonine_a2: f64,
    /// Mean pressure since the previous sample, kinetic and collisional [energy/length^d], with the
    /// velocities v − V; NaN in the first sample, `None` with open axes.
    pub pressure: Option<f64>,
    /// Mean pressure tensor since the previous sample, if it is measured; NaN in the first sample.
    pub stress: Option<StressTensor>,
    /// Mean force of the particles on each wall since the previous sample [mass·length/time²], and the heat
    /// that it gives to them [energy/time]: energy in the frame of the wall, so without its work. Empty if
    /// they are not measured; NaN in the first sample.
    pub wall_force: Vec<DVec3>,
    /// See [`Self::wall_force`].
    pub wall_heat_flow: Vec<f64>,
    /// Σ m v of the bodies of finite mass [mass·length/time].
    pub momentum: DVec3,
    /// Impulse on the particles by walls, bodies of infinite mass and gravity so far [mass·length/time].
    pub external_impulse: DVec3,
    /// Σ (m r × v + I ω) about the origin; `None` with periodic axes.
    pub angular_momentum: Option<DVec3>,
    /// Sphere–sphere collisions so far.
    pub collisions: u64,
    /// Sphere–wall collisions so far.
    pub wall_collisions: u64,
    /// Sphere–sphere collisions per time since the previous sample [1/time]; NaN in the first sample.
    pub collision_rate: f64,
    /// N Δt over the number of flights that collisions have ended since the previous sample \[time\], with N
    /// bodies of finite mass: each collision ends two, one with a body of infinite mass ends one. NaN in the
    /// first sample, ∞ without a collision.
    pub mean_free_time: f64,
}

/// Counts of the run so far: first physical events, then operations of the engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Sphere–sphere collisions.
    pub collisions: u64,
    /// Those of them in which one of the two has infinite mass.
    pub fixed_collisions: u64,
    /// Sphere–wall collisions.
    pub wall_collisions: u64,
    /// Completed series of bounces, and particles put to rest.
    pub rests: u64,
    /// Particles at rest that woke.
    pub wakes: u64,
    /// Pair predictions.
    pub predictions: u64,
    /// Predicted events that were dropped because their own particle had another event before.
    pub dropped: u64,
    /// Predicted events that were predicted again because the partner had another event before.
    pub stale: u64,
    /// Cell crossings or list updates of the partner search.
    pub transfers: u64,
    /// Pairs tested by a filter before prediction; it rejects most of them.
    pub candidates: u64,
    /// Windows of time.
    pub windows: u64,
    /// Completed epochs of the clock.
    pub epochs: u64,
}

impl Counters {
    /// Flights of bodies of finite mass that collisions of particles have ended.
    #[must_use]
    pub fn ended_flights(&self) -> u64 {
        self.collisions.saturating_mul(2).saturating_sub(self.fixed_collisions)
    }
}

/// How several threads have taken events since the start of the simulation or its continuation. Unlike
/// [`Counters`] it depends on the number of threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BlockCounts {
    /// Largest number of blocks into which space was cut.
    pub blocks: u64,
    /// Events that blocks have taken in the first round of a step.
    pub first: u64,
    /// Events that blocks have taken in further rounds, at the faces of those of the first one.
    pub further: u64,
    /// Events of the last round, in which a single block takes what is left.
    pub last: u64,
    /// Steps of windows.
    pub steps: u64,
    /// Steps that were undone, and their events taken one after the other.
    pub undone: u64,
    /// The sum, over the rounds, of the events of the block with most of them. The other events of the run
    /// are taken one after the other.
    pub critical_path: u64,
}

impl BlockCounts {
    /// Number of events that blocks have taken.
    pub fn events(&self) -> u64 {
        self.first + self.further + self.last
    }

    /// Adds the counts of a step.
    pub(crate) fn add(&mut self, other: &Self) {
        self.blocks = self.blocks.max(other.blocks);
        self.first += other.first;
        self.further += other.further;
        self.last += other.last;
        self.steps += other.steps;
        self.undone += other.undone;
        self.critical_path += other.critical_path;
    }
}

/// The reason why `Simulation::advance` has returned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// All events up to the requested time have been resolved; it is the present time.
    Time,
    /// The requested number of collisions is reached.
    Collisions,
    /// The requested number of calendar entries is used up.
    Slice,
    /// Nothing moves and nothing will; or no time was given and no event is due at any time.
    Rest,
}

/// The exact state, sufficient for a bitwise identical continuation with the same [`crate::System`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Checkpoint {
    /// Anchor positions [length].
    pub position: Vec<DVec3>,
    /// Velocities [length/time].
    pub velocity: Vec<DVec3>,
    /// Anchor times [ticks since the epoch's start].
    pub anchor: Vec<i64>,
    /// Box images of the anchors.
    pub image: Vec<[i32; 3]>,
    /// Numbers of own events.
    pub count: Vec<u32>,
    /// Angular velocities [1/time], of a grain that slides when its slide began; empty without spin.
    pub angular_velocity: Vec<DVec3>,
    /// The walls that support a particle, as digits that are their indices plus one, and two flags: asleep
    /// and recently hit. 0 for a particle in free flight.
    pub resting: Vec<u32>,
    /// Scalars as (name, bits): clock, sums, counters. Names are stable; an unknown name is an error.
    pub scalars: Vec<(String, u64)>,
    /// Ticks of the last contacts, if a law depends on them, and data of the measurements, as bits of numbers
    /// in their order.
    pub measured: Vec<u64>,
}
