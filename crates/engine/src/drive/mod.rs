/*!
Drives: actions that add energy to the particles, or remove it, at stated times.

A new drive is one more variant of [`DriveKind`] and a [`TimedAction`] in a file of its own.
*/

mod andersen;
mod rescale;
mod times;
mod white_noise;

use glam::DVec3;

use crate::{
    error::EngineError,
    flights,
    ledger::Term,
    model::System,
    report::{Exchange, Observer, Partner, VelocityChange},
    series,
    state::State,
    timed::TimedAction,
};
use andersen::Andersen;
use rescale::Rescale;
use times::{Poisson, Regular};
use white_noise::{IntervalNoise, Kicks, PoissonNoise};

/// A drive that acts on some species.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// How it acts.
    pub kind: DriveKind,
    /// Species that it acts on, as indices into [`System::species`]. It never acts on bodies of infinite
    /// mass.
    pub species: Vec<u32>,
}

/// How a drive acts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DriveKind {
    /// At regular times, all velocities relative to the center of mass of the driven particles are multiplied
    /// by one factor, so that their temperature becomes a given one; on all axes, also where the temperature
    /// of samples contains the motion of the center of mass.
    Rescale {
        /// Temperature after each action \[energy\].
        temperature: f64,
        /// Time between actions \[time\].
        interval: f64,
    },
    /// At the times of a Poisson process, each particle gets a velocity from a Maxwell distribution.
    Andersen {
        /// Temperature of the distribution \[energy\].
        temperature: f64,
        /// Mean number of kicks per particle and time [1/time].
        rate: f64,
    },
    /// Random changes of velocity: the variance of each component grows by `strength` in a unit of time.
    WhiteNoise {
        /// ξ₀² [length²/time³].
        strength: f64,
        /// When the kicks are.
        kicks: KickTimes,
    },
}

/// Times of the kicks of white noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum KickTimes {
    /// For each particle the times of a Poisson process.
    Poisson {
        /// Mean number of kicks per particle and time [1/time].
        rate: f64,
    },
    /// All particles at once. Their momentum is kept.
    Regular {
        /// Time between kicks \[time\].
        interval: f64,
    },
}

/// The actions of all drives of a system. The system must still have its bodies.
pub(crate) fn actions(system: &System) -> Vec<Box<dyn TimedAction>> {
    let action = |(index, drive): (usize, &Drive)| -> Box<dyn TimedAction> {
        let driven = Driven::new(system, drive);
        let poisson = |rate: f64| Poisson::new(index, driven.particles.len(), rate, system.seed);
        match drive.kind {
            DriveKind::Rescale { temperature, interval } => {
                Box::new(Rescale::new(Regular::new(index, interval), driven, temperature))
            }
            DriveKind::Andersen { temperature, rate } => {
                Box::new(Andersen::new(poisson(rate), driven, temperature, system.seed))
            }
            DriveKind::WhiteNoise { strength, kicks: KickTimes::Poisson { rate } } => {
                let times = poisson(rate);
                Box::new(PoissonNoise { times, kicks: Kicks::new(driven, strength / rate, system.seed) })
            }
            DriveKind::WhiteNoise { strength, kicks: KickTimes::Regular { interval } } => {
                let kicks = Kicks::new(driven, strength * interval, system.seed);
                Box::new(IntervalNoise { times: Regular::new(index, interval), kicks })
            }
        }
    };
    system.drives.iter().enumerate().map(action).collect()
}

/// The particles that a drive acts on.
#[derive(Debug)]
struct Driven {
    particles: Vec<u32>,
    dimension: usize,
}

impl Driven {
    fn new(system: &System, drive: &Drive) -> Self {
        let is_driven = |&i: &u32| {
            let body = &system.bodies[i as usize];
            drive.species.contains(&body.species) && system.classes[body.class as usize].mass.is_finite()
        };
        let particles = (0..system.bodies.len() as u32).filter(is_driven).collect();
        Self { particles, dimension: system.dimension.count() }
    }
}

/// Gives particle i a new velocity at the present, and adds the work and the impulse to the accumulators. The
/// energy is that of the peculiar velocity.
fn kick(state: &mut State, i: u32, velocity: DVec3, observer: &mut dyn Observer) -> Result<(), EngineError> {
    let now = state.world.now;
    if observer.wants_events() {
        series::end_of_bounces_early::<true>(state, i, now, observer);
    } else {
        series::end_of_bounces_early::<false>(state, i, now, observer);
    }
    let time = state.world.clock.time(now);
    if !velocity.is_finite() {
        return Err(EngineError::Overflow { time, i, velocity: velocity.to_array() });
    }
    let (position, before) = state.world.state(i, now);
    let mass = state.world.class(i).mass;
    flights::end(state, i, now);
    state.world.particles[i as usize].set_anchor(position, velocity, now);
    let change = velocity - before;
    let flow = state.world.flow_velocity(position);
    let (before, velocity) = (before - flow, velocity - flow);
    state.accumulators.add_energy(Term::DriveWork, time, 0.5 * mass * change.dot(velocity + before));
    state.accumulators.add_impulse(change * mass);
    state.accumulators.center.change(change * mass, time);
    if let Some(shear) = &state.world.shear {
        state.world.force.change(shear.force(change * mass), time);
    }
    if observer.wants_events() {
        let changes = [VelocityChange { i, mass, before, after: velocity }];
        observer.exchange(&Exchange { time, changes: &changes, partner: Partner::Drive });
    }
    series::keep_support(state, i, now);
    Ok(())
}
