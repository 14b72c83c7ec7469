//! States of a run: frames, samples of observables, counters, and how a run ends.

use glam::DVec3;

use crate::report::{ledger::Ledger, stress_tensor::StressTensor};

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
    /// Edge vectors of the box at this time \[length\]. Under shear that along the gradient has a component
    /// along the flow, at most half an edge.
    pub edges: [DVec3; 3],
    /// Angular velocities [1/time]; empty without spin.
    pub angular_velocity: Vec<DVec3>,
    /// Whether each particle is there; empty without inlets and outlets. Of one that is not, position and
    /// velocity are NaN.
    pub present: Vec<bool>,
    /// Position of a point of each piston \[length\], and its velocity [length/time]: of the walls that are
    /// pistons, in their order.
    pub pistons: Vec<[DVec3; 2]>,
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
    /// velocities v − V; NaN in the first sample, `None` with open axes. In a box that is compressed it is
    /// the mean of P, with the volume of each time.
    pub pressure: Option<f64>,
    /// Volume of the box now [length^d]; NaN with open axes.
    pub box_volume: f64,
    /// Volume of all particles over that of the box; NaN unless the box is compressed.
    pub packing_fraction: f64,
    /// Mean pressure tensor since the previous sample, if it is measured; NaN in the first sample.
    pub stress: Option<StressTensor>,
    /// Mean force of the particles on each wall since the previous sample [mass·length/time²], and the heat
    /// that it gives to them [energy/time]: energy in the frame of the wall, so without its work. Empty if
    /// they are not measured; NaN in the first sample.
    pub wall_force: Vec<DVec3>,
    /// See [`Self::wall_force`].
    pub wall_heat_flow: Vec<f64>,
    /// Collisions per time since the previous sample by pair of species [1/time], symmetric, pairs of the
    /// same species counted once; empty if they are not measured, NaN in the first sample.
    pub pair_collision_rate: Vec<f64>,
    /// N Δt over the number of flights that collisions have ended since the previous sample, by species
    /// \[time\]; NaN in the first sample and for a species without bodies of finite mass, ∞ without a
    /// collision.
    pub species_mean_free_time: Vec<f64>,
    /// Position of a point of each piston \[length\].
    pub piston_position: Vec<DVec3>,
    /// Velocity of each piston [length/time].
    pub piston_velocity: Vec<DVec3>,
    /// The numbers of all columns of probes, one after the other.
    pub probes: Vec<f64>,
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
    /// With inlets or outlets: number of bodies of finite mass that are there, and of those that have come in
    /// and have been taken out so far.
    pub particles: u64,
    /// See [`Self::particles`].
    pub particles_in: u64,
    /// See [`Self::particles`].
    pub particles_out: u64,
    /// Particles taken out per time since the previous sample [1/time]; NaN in the first sample.
    pub discharge_rate: f64,
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
    /// Those of all collisions that a body has at the very instant of its event before: of another contact,
    /// or of a kick. Their order matters, see docs/simultaneous.md.
    pub simultaneous: u64,
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

    /// Largest value of a counter: 146 years of 10⁹ events a second.
    pub const MOST: u64 = 1 << 62;

    /// Checks counters of a checkpoint, with the collisions and the ended flights at its last sample.
    ///
    /// # Errors
    /// The first counter that no run can have, and what is allowed.
    pub fn check(&self, sampled_collisions: u64, sampled_flights: u64) -> Result<(), String> {
        let all = [
            ("collisions", self.collisions),
            ("wall_collisions", self.wall_collisions),
            ("simultaneous", self.simultaneous),
            ("rests", self.rests),
            ("wakes", self.wakes),
            ("predictions", self.predictions),
            ("dropped", self.dropped),
            ("stale", self.stale),
            ("transfers", self.transfers),
            ("candidates", self.candidates),
            ("windows", self.windows),
        ];
        if let Some((name, count)) = all.into_iter().find(|(_, count)| *count > Self::MOST) {
            return Err(format!("{name} = {count} must be at most {}", Self::MOST));
        }
        let (collisions, fixed, flights) = (self.collisions, self.fixed_collisions, self.ended_flights());
        let so_far = "the collisions so far";
        if sampled_collisions != u64::MAX && sampled_collisions > collisions {
            return Err(format!(
                "sampled_collisions = {sampled_collisions} must be at most {collisions}, {so_far}"
            ));
        }
        if fixed > collisions {
            return Err(format!("fixed_collisions = {fixed} must be at most {collisions}, {so_far}"));
        }
        if sampled_flights > flights {
            let text = "those that collisions have ended";
            return Err(format!("sampled_flights = {sampled_flights} must be at most {flights}, {text}"));
        }
        Ok(())
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
