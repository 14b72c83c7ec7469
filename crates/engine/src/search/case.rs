//! What a search is asked to run, and why it cannot.

use std::borrow::Cow;

use super::summary::{LocalDensity, SystemSummary};
use crate::{model::System, state::world::World};

/// Why windows cannot run systems whose grains may come to rest.
pub(crate) const MAY_SETTLE: &str = "grains may come to rest on each other (contact.rest_speed)";

/// Why neither windows nor lists run systems with pistons.
pub(crate) const HAS_PISTONS: &str = "there is a piston: its impacts change when all particles touch it, which only cells and all pairs follow";

/// A system and a state of it.
#[derive(Clone, Copy)]
pub(crate) struct Case<'a> {
    pub system: &'a System,
    pub summary: &'a SystemSummary,
    pub density: &'a LocalDensity,
    pub world: &'a World,
}

/// Why a search cannot run a case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Reason {
    /// As a clause.
    pub text: Cow<'static, str>,
    /// Whether another state of the same system may be possible: then cells run this one.
    pub passes: bool,
}

impl Reason {
    /// A reason in the system.
    pub fn new(text: impl Into<Cow<'static, str>>) -> Self {
        Self { text: text.into(), passes: false }
    }

    /// A reason in the state.
    pub fn of_state(text: &'static str) -> Self {
        Self { text: text.into(), passes: true }
    }
}
