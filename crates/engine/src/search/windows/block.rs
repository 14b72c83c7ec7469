//! One block: takes the events of a round, or leaves them over.

use glam::DVec3;

use crate::{
    laws::{resolve, wall_impact},
    model::features::Features,
    search::{
        blocks::{Block, Bounds, Ownership, Part, Place, RoundView, Step, wrap_place},
        compact::CompactParticle,
    },
    state::world::World,
};

use super::{
    axes::Axes,
    cells::path_span,
    tune::Work,
    window_event::{Contact, WindowEvent},
    worker::Worker,
};

/// What a thread has for one block.
pub(super) struct WindowBlock<F> {
    pub worker: Worker<F>,
    pub part: Part<WindowEvent>,
    /// Whether the longest displacement of all particles has been noted since the start of the window.
    pub has_noted: bool,
}

/// The place of a particle in its window after a fraction of it [cells].
#[inline(always)]
pub(super) fn place<F: Features>(axes: &Axes, particle: &CompactParticle, fraction: f32) -> [f32; 3] {
    let grid = axes.grid_coordinates(particle.x);
    let mut x = [grid[0], grid[1], grid[2]];
    let path = if F::DEFORMS { axes.tilt.path(particle.v, fraction) } else { particle.v };
    for k in 0..3 {
        x[k] += if F::DEFORMS { path[k] } else { path[k] * fraction } * axes.cells[k];
    }
    wrap_place(&axes.grid(), &mut x);
    x
}

impl<F> WindowBlock<F> {
    /// A block with this worker, and with a world without particles.
    pub fn new(worker: Worker<F>, world: &World, ownership: Ownership) -> Self {
        Self { worker, part: Part::new(world, ownership), has_noted: false }
    }

    /// Removes all that a step has left in the block.
    pub fn clear(&mut self) {
        self.part.clear();
        self.worker.scratch.work = Work::default();
        self.worker.later.clear();
    }
}

impl<F: Features> Block for WindowBlock<F> {
    const UNIFORM: bool = F::UNIFORM;
    type Event = WindowEvent;

    fn part(&mut self) -> &mut Part<WindowEvent> {
        &mut self.part
    }

    fn begin_round(&mut self, bounds: Bounds) {
        self.worker.space.cells.own(bounds);
    }

    fn is_full(&self) -> bool {
        self.worker.space.cells.is_full()
    }

    #[inline(always)]
    fn take<const EVENTS: bool, const VECTORS: bool>(&mut self, round: &RoundView) {
        let (from, to) = (round.step.from, round.step.to);
        self.worker.horizon = to;
        self.worker.queue.open(from, to, &self.part.known);
        while let Some(event) = self.worker.queue.pop_until(to) {
            let bounds = self.part.front.bounds;
            self.worker.prefetch(&self.part.state.world, |cells| cells.are_within(&bounds));
            let is_endless = self.part.times.len() > round.step.most;
            if is_endless || !self.take_event::<EVENTS, VECTORS>(round, event) {
                self.part.is_failed = true;
                return;
            }
        }
    }
}

impl<F: Features> WindowBlock<F> {
    /// Takes an event or leaves it over. Returns false if the step must be undone.
    #[inline(always)]
    fn take_event<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        round: &RoundView,
        event: WindowEvent,
    ) -> bool {
        match event.0.target.kind() {
            Contact::Collision(j) => self.take_collision::<EVENTS, VECTORS>(round, event, j),
            Contact::Wall(wall) => self.take_wall_collision::<EVENTS, VECTORS>(round, event, wall),
        }
    }

    #[inline(always)]
    fn take_collision<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        round: &RoundView,
        event: WindowEvent,
        j: u32,
    ) -> bool {
        let entry = event.0;
        let i = entry.owner;
        let (world, step) = (&self.part.state.world, round.step);
        self.part.ownership.read(i);
        let (a, b) = (&world.particles[i as usize], &world.particles[j as usize]);
        // In this order: the partner of a particle with another path can be in another block.
        if a.count != entry.own_count {
            self.part.state.accumulators.counters.dropped += 1;
            return true;
        }
        self.part.ownership.read(j);
        if b.count != entry.partner_count {
            self.part.state.accumulators.counters.dropped += 1;
            return true;
        }
        let time = step.fraction(entry.time);
        let places = [self.place(step, i, time), self.place(step, j, time)];
        if !self.is_known(round, &places, time) {
            return self.part.leave(step, event, &places, time);
        }
        let mut rough = None;
        let Ok(impact) = resolve::collide::<F>(world, [i, j], entry.time, &mut rough) else { return false };
        for (k, (_, position, velocity)) in impact.after().into_iter().enumerate() {
            // In the order of the indices.
            let k = if i < j { k } else { 1 - k };
            let velocity = self.part.state.world.anchor_velocity::<F>(velocity, entry.time);
            match self.stays(round, &places[k], (position, velocity), entry.time) {
                Stays::Inside => {}
                Stays::Outside => return self.part.leave(step, event, &places, time),
                Stays::TooFast => return false,
            }
        }
        if !round.is_expected(&self.part.state.world, &places, time) {
            return self.part.reject();
        }
        for place in &places {
            self.part.save(step, place.body);
            self.worker.space.particles[place.slot].note_path();
        }
        self.part.start_event::<F, _, EVENTS>(&entry);
        resolve::apply::<F, EVENTS>(&mut self.part.state, &impact, &rough, entry.time, &mut self.part.rows);
        self.part.wrap(i);
        self.part.wrap(j);
        if self.has_resting() {
            return false;
        }
        let world = &self.part.state.world;
        let movable = |body: u32| F::UNIFORM || world.class(body).inverse_mass != 0.0;
        match (movable(i), movable(j)) {
            (true, true) => self.worker.predict_again::<2, VECTORS>(world, [i.min(j), i.max(j)]),
            (true, false) => self.worker.predict_one::<VECTORS>(world, i),
            (false, _) => self.worker.predict_one::<VECTORS>(world, j),
        }
    }

    #[inline(never)]
    fn take_wall_collision<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        round: &RoundView,
        event: WindowEvent,
        wall: u32,
    ) -> bool {
        let entry = event.0;
        let i = entry.owner;
        let (world, step) = (&self.part.state.world, round.step);
        if world.particles[i as usize].count != entry.own_count {
            self.part.state.accumulators.counters.dropped += 1;
            return true;
        }
        let time = step.fraction(entry.time);
        let places = [self.place(step, i, time)];
        if !self.is_known(round, &places, time) {
            return self.part.leave(step, event, &places, time);
        }
        let mut rough = None;
        let Ok((contact, outcome)) =
            wall_impact::collide_with_wall::<F>(world, i, wall, entry.time, &mut rough)
        else {
            return false;
        };
        let after =
            (contact.position, self.part.state.world.anchor_velocity::<F>(outcome.velocity(), entry.time));
        match self.stays(round, &places[0], after, entry.time) {
            Stays::Inside => {}
            Stays::Outside => return self.part.leave(step, event, &places, time),
            Stays::TooFast => return false,
        }
        if !round.is_expected(&self.part.state.world, &places, time) {
            return self.part.reject();
        }
        self.part.save(step, i);
        self.worker.space.particles[places[0].slot].note_path();
        self.part.start_event::<F, _, EVENTS>(&entry);
        wall_impact::apply_wall::<F, EVENTS>(
            &mut self.part.state,
            &contact,
            &outcome,
            &rough,
            &mut self.part.rows,
        );
        self.part.wrap(i);
        !self.has_resting() && self.worker.predict_one::<VECTORS>(&self.part.state.world, i)
    }

    /// The place of a particle after a fraction of the window.
    #[inline(always)]
    fn place(&self, step: &Step, body: u32, time: f32) -> Place {
        let slot = self.worker.slot_of[body as usize] as usize;
        let space = &self.worker.space;
        let x = place::<F>(&space.cells.axes, &space.particles[slot], time);
        Place { body, slot, x, depth: step.metric.depth(&self.part.front.bounds, x) }
    }

    /// Whether nothing unknown can have changed an event, and its particles are registered in no cells but
    /// those of this block.
    #[inline(always)]
    fn is_known<const K: usize>(&self, round: &RoundView, places: &[Place; K], time: f32) -> bool {
        if self.part.front.bounds.is_whole {
            return true;
        }
        // A loop instead of `Iterator::all`, which can remain a call compiled for the baseline instruction
        // set.
        for place in places {
            let is_clear = self.part.front.is_clear(place.depth, place.x, time);
            if !is_clear || !self.is_registered_inside(round, place) {
                return false;
            }
        }
        true
    }

    /// Whether a particle is registered in cells of this block only.
    #[inline(always)]
    fn is_registered_inside(&self, round: &RoundView, place: &Place) -> bool {
        let (space, step) = (&self.worker.space, round.step);
        let compact = &space.particles[place.slot];
        let axes = &space.cells.axes;
        let extent = space.extent(compact.radius);
        // Of a particle with an event in this window, only the last of its paths is stored. It is registered
        // along the earlier ones up to the end of the window: from an event at a place b, up to a
        // displacement of the window away from b, and the present place is up to another one away from b.
        // After a step that was undone, it is registered along paths that it does not take.
        let has_turned =
            self.part.state.world.particles[place.body as usize].time > step.begin || compact.longest() > 0.0;
        let displacement = if !self.has_noted {
            step.metric.speed
        } else if has_turned {
            let mut last = *compact;
            last.note_path();
            last.longest().sqrt() * if F::DEFORMS { axes.tilt.speed() } else { 1.0 }
        } else {
            let v = if F::DEFORMS { axes.tilt.chord(compact.v, 0.0) } else { compact.v };
            return self.contains(path_span(axes, compact.x, v, 1.0, extent));
        };
        let extent = if F::DEFORMS { axes.widened(extent) } else { extent };
        place.depth.of_cells >= 2.0 * displacement + extent
    }

    /// Whether these cells, the first one and their number along each axis, are in this block.
    fn contains(&self, (low, count): ([i32; 4], [i32; 3])) -> bool {
        let mut is_inside = true;
        for k in 0..3 {
            is_inside &= self.part.front.bounds.contains_cells(k, low[k], count[k]);
        }
        is_inside
    }

    /// Whether the cells along a new path, and those that a search around it reads, are in this block.
    #[inline(always)]
    fn stays(
        &self,
        round: &RoundView,
        place: &Place,
        (position, velocity): (DVec3, DVec3),
        ticks: i64,
    ) -> Stays {
        let step = round.step;
        let metric = &step.metric;
        let world = &self.part.state.world;
        if !F::UNIFORM && world.class(place.body).inverse_mass == 0.0 {
            return Stays::Inside;
        }
        let elapsed = (ticks - step.begin) as f64 * world.clock.tick;
        let (p, u) = self.worker.grid_flight(position, velocity, elapsed);
        let space = &self.worker.space;
        let axes = &space.cells.axes;
        let limit = f64::from(if F::DEFORMS { metric.speed / axes.tilt.speed() } else { metric.speed });
        if u[0] * u[0] + u[1] * u[1] + u[2] * u[2] > limit * limit {
            return Stays::TooFast;
        }
        let reach = space.particles[place.slot].radius + space.common_radius;
        let widened = if F::DEFORMS { axes.widened(reach) } else { reach };
        if place.depth.of_cells >= metric.speed + widened {
            return Stays::Inside;
        }
        let (mut start, mut v) = ([0; 3], [0.0; 3]);
        for k in 0..3 {
            start[k] = axes.coordinate(k, p[k]);
            v[k] = u[k] as f32;
        }
        let from = step.fraction(ticks);
        let v = if F::DEFORMS { axes.tilt.chord(v, from) } else { v };
        if self.contains(path_span(axes, start, v, 1.0 - from, reach)) {
            Stays::Inside
        } else {
            Stays::Outside
        }
    }

    /// Whether a wall supports a particle: windows do not support this.
    #[inline(always)]
    fn has_resting(&self) -> bool {
        F::GRAVITY && (self.part.state.world.supported.resting != 0 || !self.part.state.pending.is_empty())
    }
}

/// Where a new path leads.
enum Stays {
    Inside,
    Outside,
    /// The particle is faster than the front.
    TooFast,
}
