//! The part of a block that does not depend on the search.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::{
    laws::contact::note_tie,
    model::features::Features,
    report::BlockCounts,
    search::entry::Entry,
    state::{
        State, accumulators::Accumulators, particle::Particle, settling::SettlingState, stall::Stall,
        world::World,
    },
};

use super::{
    Grid, Step,
    cut::Round,
    front::{Depth, Front},
    ownership::Ownership,
    rows::Rows,
};

/// Particles, sums and rows of a block, and its events.
pub(crate) struct Part<E> {
    /// For assertions.
    pub ownership: Ownership,
    pub state: State,
    /// The front of the present round.
    pub front: Front,
    /// Events known at the start of the round.
    pub known: Vec<E>,
    /// Events that are left to the next round.
    pub left: Vec<E>,
    /// Particles before their first event in a step.
    saved: Saved,
    /// Changes of the images of particles in a step.
    pub wraps: Vec<(u32, [i32; 3])>,
    pub rows: Rows,
    /// Times of the events \[ticks\], those of a round in order.
    pub times: Vec<i64>,
    /// Where the times of the present round begin.
    pub first_time: usize,
    /// Whether the step must be undone, and whether because of an event that an earlier front has not
    /// expected.
    pub is_failed: bool,
    pub is_unexpected: bool,
}

/// Particles with their indices: apart from each other, because a particle fills a cache line.
#[derive(Default)]
struct Saved {
    indices: Vec<u32>,
    particles: Vec<Particle>,
    /// Their angular velocities, if there is spin.
    spins: Vec<DVec3>,
    /// The times of their last contacts \[ticks\], if laws depend on them.
    contacts: Vec<i64>,
}

/// The place of a particle at an event.
pub(crate) struct Place {
    pub body: u32,
    /// Its index in the memory of the search.
    pub slot: usize,
    /// Grid coordinates [cells].
    pub x: [f32; 3],
    pub depth: Depth,
}

/// What a block uses in a round besides its own data.
pub(crate) struct RoundView<'a> {
    pub step: &'a Step,
    pub earlier: &'a [Round],
}

impl RoundView<'_> {
    /// Whether the fronts of all earlier rounds expect an event at these places.
    ///
    /// If its particles have had no event in the step, each round has left their events over, and so marked a
    /// source there, half a contact distance from them at most. A partner is one contact distance further.
    #[inline(always)]
    pub fn is_expected<const K: usize>(&self, world: &World, places: &[Place; K], time: f32) -> bool {
        if self.earlier.is_empty() {
            return true;
        }
        let mut has_turned = !self.step.metric.has_wide_sources();
        for place in places {
            has_turned |= world.particles[place.body as usize].time > self.step.from;
        }
        !has_turned || self.are_expected(places, time)
    }

    #[inline(never)]
    fn are_expected(&self, places: &[Place], time: f32) -> bool {
        self.earlier.iter().all(|round| places.iter().all(|place| round.expects(place.x, time)))
    }
}

/// Takes grid coordinates that are less than a period outside of the grid back into it [cells].
#[inline(always)]
pub(crate) fn wrap_place(grid: &Grid, x: &mut [f32; 3]) {
    for k in 0..3 {
        let n = grid.n[k] as f32;
        if grid.wraps[k] {
            if x[k] < 0.0 {
                x[k] += n;
            }
            if x[k] >= n {
                x[k] -= n;
            }
        }
    }
}

impl<E> Part<E> {
    /// A part with a world without particles.
    pub fn new(world: &World, ownership: Ownership) -> Self {
        Self {
            ownership,
            front: Front::default(),
            state: State {
                population: None,
                world: world.without_particles(),
                accumulators: Accumulators::default(),
                pending: BTreeMap::new(),
                stall: Stall::default(),
                settling: SettlingState::default(),
                blocks: BlockCounts::default(),
            },
            known: Vec::new(),
            left: Vec::new(),
            saved: Saved::default(),
            wraps: Vec::new(),
            rows: Rows::default(),
            times: Vec::new(),
            first_time: 0,
            is_failed: false,
            is_unexpected: false,
        }
    }

    /// Begins a step: the part has the particles of this state.
    ///
    /// # Safety
    ///
    /// That of [`World::share_particles`].
    pub unsafe fn begin_step(&mut self, state: &mut State) {
        // SAFETY: guaranteed by the caller.
        unsafe { self.state.world.share_particles(&mut state.world) };
        self.state.world.now = state.world.now;
        self.state.accumulators.sampled_at = state.accumulators.sampled_at;
        if let Some(flights) = &state.accumulators.flights {
            self.state.accumulators.flights.get_or_insert_default().until = flights.until;
        }
    }

    /// Removes all that a step has left in the part.
    pub fn clear(&mut self) {
        self.state.accumulators = Accumulators::default();
        self.state.pending.clear();
        if let Some(sums) = &mut self.state.world.boundary.wall_sums {
            sums.clear();
        }
        self.state.world.supported.resting = 0;
        self.state.world.resolution.longest_flight = 0.0;
        self.left.clear();
        self.saved.indices.clear();
        self.saved.particles.clear();
        self.saved.spins.clear();
        self.saved.contacts.clear();
        self.wraps.clear();
        self.rows.clear();
        self.times.clear();
        self.first_time = 0;
        (self.is_failed, self.is_unexpected) = (false, false);
    }

    /// Restores the particles and images that the part has changed in a step, and calls `restored` for each
    /// particle.
    pub fn undo(&mut self, state: &mut State, mut restored: impl FnMut(&World, u32)) {
        if let Some(spins) = &mut state.world.spin {
            for (&i, spin) in self.saved.indices.iter().zip(self.saved.spins.drain(..)).rev() {
                spins.angular_velocity[i as usize] = spin;
            }
        }
        if let Some(times) = &mut state.world.laws.contact_times {
            for (&i, contact) in self.saved.indices.iter().zip(self.saved.contacts.drain(..)).rev() {
                times.set(i, contact);
            }
        }
        for (i, particle) in self.saved.indices.drain(..).zip(self.saved.particles.drain(..)).rev() {
            state.world.particles[i as usize] = particle;
            restored(&state.world, i);
        }
        for (i, wraps) in self.wraps.drain(..) {
            for (image, turns) in state.world.images[i as usize].iter_mut().zip(wraps) {
                *image -= turns;
            }
        }
    }

    /// Begins an event, which is a contact.
    #[inline(always)]
    pub fn start_event<F: Features, K, const EVENTS: bool>(&mut self, entry: &Entry<K>) {
        self.state.world.now = entry.time;
        let bodies = [entry.owner, entry.target.partner().unwrap_or(entry.owner)];
        note_tie(&mut self.state, &bodies, entry.time);
        if EVENTS {
            let world = &self.state.world;
            let is_movable = |body: &u32| F::UNIFORM || world.class(*body).inverse_mass != 0.0;
            let changed = [Some(entry.owner), entry.target.partner()].map(|body| body.filter(is_movable));
            self.rows.begin_event(entry.time, entry.rank(), changed);
        }
        self.times.push(entry.time);
    }

    /// Wraps the anchor of a particle into the box.
    #[inline(always)]
    pub fn wrap(&mut self, i: u32) {
        let wraps = self.state.world.wrap_anchor(i);
        if wraps != [0; 3] {
            self.wraps.push((i, wraps));
        }
    }

    /// Saves a particle before its first event in a step, which it is about to have.
    #[inline(always)]
    pub fn save(&mut self, step: &Step, i: u32) {
        self.ownership.change(i);
        let particle = self.state.world.particles[i as usize];
        if particle.time <= step.from {
            self.saved.indices.push(i);
            self.saved.particles.push(particle);
            if let Some(spins) = &self.state.world.spin {
                self.saved.spins.push(spins.angular_velocity[i as usize]);
            }
            if let Some(times) = &self.state.world.laws.contact_times {
                self.saved.contacts.push(times.get(i));
            }
        }
    }

    /// Leaves an event to the next round. Returns true: the step goes on.
    #[cold]
    #[inline(never)]
    pub fn leave(&mut self, step: &Step, event: E, places: &[Place], time: f32) -> bool {
        self.left.push(event);
        // One source for both particles of a pair: each is half a contact distance from it. In the order of
        // the indices, so that it is the same for both entries of a pair.
        let (first, last) = (&places[0], &places[places.len() - 1]);
        let (first, last) = if first.body <= last.body { (first, last) } else { (last, first) };
        self.front.add(step.metric.middle(first.x, last.x), time, step.fraction(step.to));
        true
    }

    /// Notes that an event is where an earlier front has not expected it. Returns false: the step must be
    /// undone.
    #[cold]
    pub fn reject(&mut self) -> bool {
        self.is_unexpected = true;
        false
    }
}
