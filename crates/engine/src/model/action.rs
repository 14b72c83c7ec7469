//! Drives that another crate adds.

use std::fmt;

use haff_mechanics::{Named, NamedOnce};

use super::particles::DrivenParticles;

/// What a drive does at stated times.
///
/// All may depend on their arguments and on the parameters of the drive alone: a resumed run asks again, and
/// has to get the same.
pub trait Action: fmt::Debug + Send + Sync {
    /// The time of an action \[time\]. Actions are counted from 1; their times are above 0 and rise, and are
    /// infinite after the last one.
    fn time(&self, number: u64) -> f64;

    /// Acts on the particles at its time.
    fn act(&self, number: u64, particles: &mut dyn DrivenParticles);

    /// Whether the action keeps the momentum of the particles. Temperature and pressure are then those
    /// relative to their center of mass, where nothing else changes the momentum.
    fn keeps_momentum(&self) -> bool {
        false
    }
}

/// An action with the name and the parameters by which scenes have it.
pub type NamedAction = Named<dyn Action>;

static ACTIONS: NamedOnce<dyn Action> = NamedOnce::new();

/// The action with this name and these parameters, as text; `action` if it is new.
pub fn named_action(name: &str, parameters: &str, action: Box<dyn Action>) -> &'static NamedAction {
    ACTIONS.of(name, parameters, action)
}
