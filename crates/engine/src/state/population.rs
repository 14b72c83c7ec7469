//! Which particles are there, where they come and go.
//!
//! A system with inlets or outlets has a list of all particles that ever are there. The world has those that
//! are there at present, in the order of this list, and nothing of the others: searches, laws and sums know
//! no particle that is absent. The index of a particle in the list, its *id*, is what files and events have;
//! the ids of those that are there are in the world ([`crate::state::world::World::ids`]).

use glam::DVec3;

use crate::model::System;

/// The particles of the list, and how many have come and gone.
#[derive(Debug, Clone)]
pub(crate) struct Population {
    /// Class and species by id.
    pub kinds: Vec<(u32, u32)>,
    /// Number of own events by id, of those that have left.
    pub counts: Vec<u32>,
    /// Numbers of entries and exits so far.
    pub entered: u64,
    /// See `entered`.
    pub left: u64,
    /// Number of exits up to the previous sample.
    pub left_before: u64,
}

/// A particle that comes in.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arrival {
    pub id: u32,
    pub class: u32,
    pub position: DVec3,
    pub velocity: DVec3,
}

impl Population {
    /// The particles of a system that has all its bodies; `None` without inlets and outlets.
    pub fn of(system: &System) -> Option<Box<Self>> {
        system.flow.as_ref()?;
        Some(Box::new(Self {
            kinds: system.bodies.iter().map(|body| (body.class, body.species)).collect(),
            counts: vec![0; system.bodies.len()],
            entered: 0,
            left: 0,
            left_before: 0,
        }))
    }

    /// Numbers of entries and exits so far.
    pub fn passages(&self) -> [u64; 2] {
        [self.entered, self.left]
    }

    /// The number of all particles.
    pub fn all(&self) -> usize {
        self.kinds.len()
    }
}

/// Values of the particles with these ids as those of all; `all` has the values of the others.
pub(crate) fn spread<T: Clone>(ids: &[u32], values: &[T], mut all: Vec<T>) -> Vec<T> {
    for (&id, value) in ids.iter().zip(values) {
        all[id as usize] = value.clone();
    }
    all
}
