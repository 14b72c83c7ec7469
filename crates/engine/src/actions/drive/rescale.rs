//! A thermostat that rescales velocities to a temperature at regular times.

use glam::DVec3;
use haff_neighbors::Geometry;

use crate::{
    actions::timed::TimedAction,
    model::spin::rotations,
    numerics::{error::EngineError, total::total},
    report::Observer,
    state::State,
};

use super::{
    driven::{Driven, kick},
    times::Regular,
};

#[derive(Debug)]
pub(super) struct Rescale {
    times: Regular,
    driven: Driven,
    temperature: f64,
}

impl Rescale {
    pub fn new(times: Regular, driven: Driven, temperature: f64) -> Self {
        Self { times, driven, temperature }
    }
}

impl TimedAction for Rescale {
    fn next(&self, state: &State) -> i64 {
        self.times.next(state)
    }

    fn apply(
        &mut self,
        state: &mut State,
        _geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        self.times.advance();
        let factor = rescale(&self.driven, self.temperature, state, observer)?;
        Ok(if factor.is_some() { self.driven.particles.clone() } else { Vec::new() })
    }

    fn save(&self, put: &mut dyn FnMut(&str, u64)) {
        self.times.save(put);
    }

    fn load(&mut self, take: &mut dyn FnMut(&str) -> u64, time: f64) -> Result<(), EngineError> {
        self.times.load(take, time)
    }
}

/// Rescales the velocities of some particles, relative to their center of mass, so that they have a
/// temperature; by a rotational drive the angular velocities, too. Returns the factor; `None`, with nothing
/// changed, if they have no relative motion.
pub(super) fn rescale(
    driven: &Driven,
    temperature: f64,
    state: &mut State,
    observer: &mut dyn Observer,
) -> Result<Option<f64>, EngineError> {
    let world = &state.world;
    let particles = &driven.particles;
    let velocity = |k: u32| world.peculiar(particles[k as usize], world.now).1;
    let mass = |k: u32| world.class(particles[k as usize]).mass;
    let [m, px, py, pz] = total(particles.len(), |k| {
        let p = mass(k) * velocity(k);
        [mass(k), p.x, p.y, p.z]
    });
    let drift = DVec3::new(px, py, pz) / m;
    let [twice_thermal] = total(particles.len(), |k| [mass(k) * (velocity(k) - drift).length_squared()]);
    let wanted = (driven.dimension * particles.len()) as f64 * temperature;
    let factor = (wanted / twice_thermal).sqrt();
    // Particles without relative motion have no velocity to scale.
    if !(factor.is_finite() && twice_thermal > 0.0) {
        return Ok(None);
    }
    let turns = spin_factor(driven, temperature, state);
    for &i in particles {
        let spin = turns.map(|factor| state.world.angular_velocity(i, state.world.now) * factor);
        let (position, velocity) = state.world.peculiar(i, state.world.now);
        let flow = state.world.flow_velocity(position, state.world.now);
        kick(state, i, flow + drift + (velocity - drift) * factor, spin, observer)?;
    }
    Ok(Some(factor))
}

/// The factor by which a rotational drive multiplies angular velocities, so that those of the driven
/// particles have the temperature, too. `None` if it does not, or if nothing turns.
fn spin_factor(driven: &Driven, temperature: f64, state: &State) -> Option<f64> {
    if !driven.rotational {
        return None;
    }
    let (world, particles) = (&state.world, &driven.particles);
    let [energy] = total(particles.len(), |k| [world.rotation(particles[k as usize], world.now).0]);
    let wanted = 0.5 * (rotations(driven.dimension) * particles.len()) as f64 * temperature;
    let factor = (wanted / energy).sqrt();
    factor.is_finite().then_some(factor)
}
