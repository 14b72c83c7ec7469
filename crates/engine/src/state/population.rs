//! Which particles are there, where they come and go.
//!
//! A system with inlets or outlets has a list of all particles that ever are there. The world has those that
//! are there at present, in the order of this list, and nothing of the others: searches, laws and sums know
//! no particle that is absent. The index of a particle in the list, its *id*, is what files and events have.

use std::sync::Arc;

use glam::DVec3;

use crate::model::System;

/// The particles of the list, and which of them are there.
#[derive(Debug, Clone)]
pub(crate) struct Population {
    /// Id of each particle of the world, ascending.
    pub ids: Arc<[u32]>,
    /// Class and species by id.
    pub kinds: Arc<[(u32, u32)]>,
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
    pub position: DVec3,
    pub velocity: DVec3,
}

impl Population {
    /// The particles of a system that has all its bodies, of which those with these ids are there; `None`
    /// without inlets and outlets.
    pub fn of(system: &System, ids: impl FnOnce(usize) -> Vec<u32>) -> Option<Box<Self>> {
        let flow = system.flow.as_deref()?;
        Some(Box::new(Self {
            ids: ids(flow.present).into(),
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

    /// Values of the particles that are there as those of all; `all` has the values of the others.
    pub fn spread<T: Clone>(&self, values: &[T], mut all: Vec<T>) -> Vec<T> {
        for (&id, value) in self.ids.iter().zip(values) {
            all[id as usize] = value.clone();
        }
        all
    }

    /// The number of all particles.
    pub fn all(&self) -> usize {
        self.kinds.len()
    }
}
