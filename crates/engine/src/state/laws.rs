//! The laws of contacts, and what they depend on.

use crate::{
    model::{Restitution, System, WallLaw, thresholds::Thresholds},
    state::{contact_times::ContactTimes, particle::ClassData},
};

/// The laws of contacts of a system.
#[derive(Debug, Clone)]
pub(crate) struct Laws {
    /// By pair of groups.
    pub restitution: Vec<Restitution>,
    /// By group and wall.
    pub of_walls: Vec<WallLaw>,
    /// Whether any group passes through any wall.
    pub has_passages: bool,
    /// Number of groups.
    pub groups: usize,
    /// Contact duration of the TC model \[time\]; 0 without it.
    pub tc: f64,
    /// The last contacts of particles, if a law depends on them.
    pub contact_times: Option<ContactTimes>,
    /// The conditions under which grains are put to rest; `None` if they never are.
    pub thresholds: Option<Thresholds>,
    /// Whether penetrations are corrected: if gravity, or unequal sizes or masses, can press particles
    /// together. This depends on the scene, not on the features that an engine is compiled for, so that all
    /// engines agree.
    pub corrects_penetration: bool,
}

impl Laws {
    pub fn of(system: &System, thresholds: Option<Thresholds>) -> Self {
        Self {
            restitution: system.contacts.pair.clone(),
            of_walls: system.contacts.wall.clone(),
            has_passages: system.contacts.wall.contains(&WallLaw::Passes),
            groups: system.groups.len(),
            tc: system.contacts.tc,
            contact_times: ContactTimes::of(system),
            thresholds,
            corrects_penetration: false,
        }
    }

    /// The same laws, without times of particles.
    pub fn without_particles(&self) -> Self {
        Self {
            restitution: self.restitution.clone(),
            of_walls: self.of_walls.clone(),
            contact_times: self.contact_times.as_ref().map(|_| ContactTimes::without_particles()),
            ..*self
        }
    }

    /// Restitution law of a pair of classes.
    #[inline]
    pub fn restitution(&self, a: &ClassData, b: &ClassData) -> Restitution {
        self.restitution[a.group * self.groups + b.group]
    }
}
