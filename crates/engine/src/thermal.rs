//! Thermal walls: particles leave with velocities drawn from a Maxwell distribution at the wall's
//! temperature.
//!
//! Relative to the wall, the normal component has the density p(v) = (m v/T) exp(−m v²/2T) of the flux, hence
//! is √(−2 T ln u/m) of a uniform number u, and each tangential component is Gaussian of variance T/m.
//! Detailed balance then holds, so that a gas in contact with such walls alone comes to equilibrium at T.

use glam::DVec3;
use haff_mechanics::{Impact, Restitution};

use crate::{
    error::EngineError,
    ledger::Term,
    random::Draw,
    report::{EventKind, Observer},
    resolve,
    state::State,
    wall_law::WallContact,
};

/// The law of a thermal wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalWall {
    /// Temperature T > 0 \[energy\].
    pub temperature: f64,
    /// Probability that a reflection is thermal; otherwise `restitution` applies.
    pub accommodation: f64,
    /// Law of the other reflections.
    pub restitution: Restitution,
}

impl ThermalWall {
    /// The velocity after the contact; `None` if this reflection is not thermal.
    pub(crate) fn velocity(&self, state: &State, contact: &WallContact) -> Option<DVec3> {
        let world = &state.world;
        let particle = &world.particles[contact.i as usize];
        let mut draw = Draw::new(world.seed, contact.i, u64::from(particle.count));
        if draw.uniform() >= self.accommodation {
            return None;
        }
        let n = contact.n;
        let spread = (self.temperature / world.class(contact.i).mass).sqrt();
        let normal = (2.0 * draw.exponential()).sqrt();
        let tangential = if world.dimension == 2 {
            DVec3::new(-n.y, n.x, 0.0) * draw.normal()
        } else {
            let (first, second) = n.any_orthonormal_pair();
            first * draw.normal() + second * draw.normal()
        };
        Some(contact.wall_velocity + (tangential - n * normal) * spread)
    }

    /// Resolves a thermal reflection with this `velocity` after it. What is not work of a moving wall is
    /// heat.
    pub(crate) fn reflect<const EVENTS: bool>(
        state: &mut State,
        contact: &WallContact,
        velocity: DVec3,
        observer: &mut dyn Observer,
    ) -> Result<(), EngineError> {
        let &WallContact { i, wall, time, position, n, wall_velocity, .. } = contact;
        let change = velocity - contact.velocity;
        let (before, after) = (contact.velocity - wall_velocity, velocity - wall_velocity);
        let class = *state.world.class(i);
        resolve::anchor(&mut state.world, i, position, velocity, time)?;
        let now = state.world.clock.time(time);
        let book = &mut state.book;
        book.counters.wall_collisions += 1;
        book.add_energy(Term::WallHeat, now, 0.5 * class.mass * change.dot(before + after));
        if wall_velocity != DVec3::ZERO {
            book.add_energy(Term::WallWork, now, class.mass * change.dot(wall_velocity));
        }
        book.add_impulse(change * class.mass);
        if EVENTS {
            // Along the normal; heat is no loss by restitution.
            let approach_speed = before.dot(n);
            let impulse = -class.mass * change.dot(n);
            let impact = Impact { approach_speed, impulse, ..Impact::default() };
            let place = state.world.wrap(position + n * class.radius).0;
            observer.event(&resolve::row(now, EventKind::Wall, [i, wall], &impact, n, place));
        }
        resolve::keep_support(state, i, time);
        Ok(())
    }
}
