//! A drive of another crate.

use glam::DVec3;
use haff_mechanics::random::{Draw, mix};
use haff_neighbors::Geometry;

use crate::{
    actions::timed::TimedAction,
    model::{
        action::NamedAction,
        particles::{DrivenParticles, Particles},
    },
    motion::view::View,
    numerics::error::EngineError,
    report::Observer,
    state::State,
};

use super::driven::{Driven, kick};

#[derive(Debug)]
pub(super) struct NamedDrive {
    /// Name in a checkpoint.
    key: String,
    action: &'static NamedAction,
    driven: Driven,
    /// Seed of its random numbers.
    seed: u64,
    /// Number of actions so far.
    done: u64,
}

impl NamedDrive {
    /// The drive with this index.
    pub fn new(index: usize, action: &'static NamedAction, driven: Driven, seed: u64) -> Self {
        let key = format!("drive.{index}.done");
        Self { key, action, driven, seed: mix(seed ^ mix(index as u64)), done: 0 }
    }

    /// The time of the last action, 0 before the first one, and of the next one [time].
    fn times(&self) -> [f64; 2] {
        let last = if self.done == 0 { 0.0 } else { self.action.get().time(self.done) };
        [last, self.action.get().time(self.done.saturating_add(1))]
    }
}

impl TimedAction for NamedDrive {
    fn next(&self, state: &State) -> i64 {
        let next = self.times()[1];
        if next < f64::INFINITY { state.world.clock.ticks(next) } else { i64::MAX }
    }

    fn apply(
        &mut self,
        state: &mut State,
        _geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        self.done += 1;
        let [time, next] = self.times();
        if next.is_nan() || next <= time {
            let why =
                format!("action {} is at {time}, and the next one at {next}: times must rise", self.done);
            return Err(EngineError::Plugin { name: self.action.name().to_owned(), why });
        }
        let view = View { world: &state.world, dimension: self.driven.dimension };
        let (seed, driven) = (mix(self.seed ^ self.done), &self.driven.particles);
        let mut acting = Acting { view, driven, seed, changes: Vec::new() };
        self.action.get().act(self.done, &mut acting);
        // In the order of indices, the last change of each.
        let mut changes = acting.changes;
        changes.sort_by_key(|&(i, _)| i);
        let mut changed = Vec::with_capacity(changes.len());
        for (k, &(i, velocity)) in changes.iter().enumerate() {
            if changes.get(k + 1).is_none_or(|&(other, _)| other != i) {
                let flow =
                    state.world.flow_velocity(state.world.state(i, state.world.now).0, state.world.now);
                kick(state, i, flow + velocity, None, observer)?;
                changed.push(i);
            }
        }
        Ok(changed)
    }

    fn save(&self, put: &mut dyn FnMut(&str, u64)) {
        put(&self.key, self.done);
    }

    fn load(&mut self, take: &mut dyn FnMut(&str) -> u64, time: f64) -> Result<(), EngineError> {
        self.done = take(&self.key);
        let [last, next] = self.times();
        if last * (1.0 - 1e-15) <= time && next * (1.0 + 1e-15) >= time {
            return Ok(());
        }
        let (key, done) = (&self.key, self.done);
        Err(EngineError::Checkpoint(format!(
            "{key} = {done} does not fit to the time {time}: action {done} is at {last}, the next one at {next}"
        )))
    }
}

/// The particles during an action.
struct Acting<'a> {
    view: View<'a>,
    driven: &'a [u32],
    seed: u64,
    changes: Vec<(u32, DVec3)>,
}

impl Particles for Acting<'_> {
    fn count(&self) -> u32 {
        self.view.count()
    }

    fn dimension(&self) -> usize {
        self.view.dimension()
    }

    fn time(&self) -> f64 {
        self.view.time()
    }

    fn position(&self, i: u32) -> DVec3 {
        self.view.position(i)
    }

    fn velocity(&self, i: u32) -> DVec3 {
        self.view.velocity(i)
    }

    fn mass(&self, i: u32) -> f64 {
        self.view.mass(i)
    }

    fn radius(&self, i: u32) -> f64 {
        self.view.radius(i)
    }
}

impl DrivenParticles for Acting<'_> {
    fn driven(&self) -> &[u32] {
        self.driven
    }

    fn normals(&self, i: u32) -> DVec3 {
        Draw::new(self.seed, i, 0).normals(self.view.dimension)
    }

    fn set_velocity(&mut self, i: u32, velocity: DVec3) {
        if self.driven.binary_search(&i).is_ok() {
            self.changes.push((i, velocity));
        }
    }
}
