//! The action of all inlets and outlets.
//!
//! Outlets are searched at intervals: a quarter of the time in which the fastest particle, as it then is,
//! crosses the thinnest of them, unless an outlet states its own. What has been taken out goes to the first
//! refilling inlet for its species, which puts it back at once if there is room, and otherwise at a later
//! search. Inlets with a rate let one particle in at each time of a Poisson process, if there is room; if
//! not, it comes at a later one.

use std::{collections::VecDeque, sync::Arc};

use haff_neighbors::Geometry;

use crate::{
    actions::timed::TimedAction,
    model::{
        System,
        flow::{Flow, Inlet, Outlet, Supply},
    },
    numerics::{
        clock::HORIZON,
        error::EngineError,
        random::{Draw, mix},
    },
    report::{Observer, with_ids},
    state::{State, population::Arrival},
};

use super::{arrive::arrive, leave, replace::replace};

/// Part of the thickness of an outlet that the fastest particle moves between two searches.
const STEP: f64 = 0.25;
/// Distinguishes the random numbers of inlets from those of drives.
const INLETS: u64 = 0x696e_6c65_7473;

/// An inlet at work.
#[derive(Debug)]
struct Source {
    inlet: Inlet,
    /// Numbers of times drawn and of entries so far.
    drawn: u64,
    entered: u64,
    /// The next time, of an inlet with a rate [time].
    next: f64,
    /// Particles that it will put back, by id.
    waiting: VecDeque<u32>,
}

/// The action of all inlets and outlets.
#[derive(Debug)]
pub(crate) struct Passage {
    sources: Vec<Source>,
    outlets: Vec<Outlet>,
    seed: u64,
    dimension: usize,
    /// The least speed for which the time between two searches is chosen: that of walls and new particles
    /// [length/time].
    floor: f64,
    /// Time of the next search of outlets [time].
    search: f64,
}

impl Source {
    /// Mean time between two entries; infinite for an inlet that refills.
    fn mean(&self) -> f64 {
        match self.inlet.supply {
            Supply::Rate { rate, .. } => 1.0 / rate,
            Supply::Refill { .. } => f64::INFINITY,
        }
    }

    /// Whether particles will still come in at stated times.
    fn is_flowing(&self) -> bool {
        matches!(self.inlet.supply, Supply::Rate { count, .. } if self.entered < u64::from(count))
    }

    /// Whether it puts back particles of a species.
    fn refills(&self, kind: u32) -> bool {
        match &self.inlet.supply {
            Supply::Rate { .. } => false,
            Supply::Refill { species, count } => {
                species.contains(&kind) && self.entered + (self.waiting.len() as u64) < *count
            }
        }
    }
}

impl Passage {
    /// The action of a system with inlets or outlets.
    pub fn new(system: &System, flow: &Flow) -> Self {
        let source = |inlet: &Inlet| Source {
            inlet: inlet.clone(),
            drawn: 0,
            entered: 0,
            next: 0.0,
            waiting: VecDeque::new(),
        };
        let lightest = system.classes.iter().map(|class| class.mass).fold(f64::INFINITY, f64::min);
        let speed = |inlet: &Inlet| inlet.velocity.length() + (2.0 * inlet.temperature / lightest).sqrt();
        let of_walls = system.walls.iter().map(|wall| wall.motion.max_speed());
        let mut action = Self {
            sources: flow.inlets.iter().map(source).collect(),
            outlets: flow.outlets.clone(),
            seed: mix(system.seed ^ INLETS),
            dimension: system.dimension.count(),
            floor: flow.inlets.iter().map(speed).chain(of_walls).fold(0.0, f64::max),
            search: if flow.outlets.is_empty() { f64::INFINITY } else { 0.0 },
        };
        for k in 0..action.sources.len() {
            action.draw_time(k);
        }
        action
    }

    /// Sets the next time of an inlet.
    fn draw_time(&mut self, k: usize) {
        let seed = !self.seed;
        let source = &mut self.sources[k];
        source.next = if source.is_flowing() {
            source.next + source.mean() * Draw::new(seed, k as u32, source.drawn).exponential()
        } else {
            f64::INFINITY
        };
    }

    /// The ids of those that are in an outlet, by their indices.
    fn found(&self, state: &State) -> Vec<u32> {
        let world = &state.world;
        let is_out = |&i: &u32| {
            let position = || world.boundary.periodicity.wrap(world.state(i, world.now).0).0;
            world.body(i).inverse_mass != 0.0
                && self.outlets.iter().any(|outlet| outlet.place.contains(position()))
        };
        (0..world.particles.len() as u32).filter(is_out).collect()
    }

    /// Time from a search of outlets to the next one [time].
    fn interval(&self, state: &State) -> f64 {
        let world = &state.world;
        let speeds = (0..world.particles.len() as u32).map(|i| world.state(i, world.now).1.length());
        let speed = speeds.fold(self.floor, f64::max);
        let gravity = world.gravity.length();
        let of = |outlet: &Outlet| {
            // v t + g t²/2 is a part of the thickness.
            let path = STEP * outlet.place.thickness(self.dimension);
            let chosen = 2.0 * path / (speed + (speed * speed + 2.0 * gravity * path).sqrt());
            outlet.interval.unwrap_or(chosen)
        };
        self.outlets.iter().map(of).fold(f64::INFINITY, f64::min)
    }

    /// A particle that one of the inlets lets in now, if there is room.
    fn enter(&self, state: &State, k: usize, id: u32, with: &[(Arrival, u32)]) -> Option<(Arrival, u32)> {
        let source = &self.sources[k];
        let population = state.population.as_ref()?;
        let (class, _) = *population.kinds.get(id as usize)?;
        if population.ids.binary_search(&id).is_ok() || with.iter().any(|(other, _)| other.id == id) {
            return None;
        }
        let mut draw = Draw::new(self.seed, k as u32, source.drawn);
        Some((arrive(&state.world, &source.inlet, (id, class), with, &mut draw)?, class))
    }

    /// The particles that come in now. `is_search`: those that wait are tried, too.
    fn arrivals(&mut self, state: &State, is_search: bool) -> Vec<Arrival> {
        let now = state.world.now;
        let mut arrivals: Vec<(Arrival, u32)> = Vec::new();
        for k in 0..self.sources.len() {
            if self.sources[k].is_flowing() && state.world.clock.ticks(self.sources[k].next) <= now {
                if let Supply::Rate { first, .. } = self.sources[k].inlet.supply {
                    let id = first + self.sources[k].entered as u32;
                    if let Some(arrival) = self.enter(state, k, id, &arrivals) {
                        self.sources[k].entered += 1;
                        arrivals.push(arrival);
                    }
                }
                self.sources[k].drawn += 1;
                self.draw_time(k);
            }
            while is_search && let Some(&id) = self.sources[k].waiting.front() {
                let arrival = self.enter(state, k, id, &arrivals);
                self.sources[k].drawn += 1;
                let Some(arrival) = arrival else { break };
                self.sources[k].entered += 1;
                self.sources[k].waiting.pop_front();
                arrivals.push(arrival);
            }
        }
        let mut arrivals: Vec<Arrival> = arrivals.into_iter().map(|(arrival, _)| arrival).collect();
        arrivals.sort_by_key(|arrival| arrival.id);
        arrivals
    }
}

impl TimedAction for Passage {
    fn next(&self, state: &State) -> i64 {
        let next = self.sources.iter().map(|source| source.next).fold(self.search, f64::min);
        if next == f64::INFINITY { i64::MAX } else { state.world.clock.ticks(next) }
    }

    fn brings(&self) -> bool {
        self.sources.iter().any(|source| source.is_flowing() || !source.waiting.is_empty())
    }

    fn apply(
        &mut self,
        state: &mut State,
        _geometry: &Geometry,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        let now = state.world.now;
        let is_search = self.search < f64::INFINITY && state.world.clock.ticks(self.search) <= now;
        let mut removed = Vec::new();
        if is_search {
            removed = self.found(state);
            with_ids(state.world.ids.clone(), observer, |observer| {
                removed.iter().try_for_each(|&i| leave::leave(state, i, observer))
            })?;
        }
        if !removed.is_empty() {
            if let Some(population) = &state.population {
                for &i in &removed {
                    let id = population.ids[i as usize];
                    let species = population.kinds[id as usize].1;
                    if let Some(source) = self.sources.iter_mut().find(|source| source.refills(species)) {
                        source.waiting.push_back(id);
                    }
                }
            }
            replace(state, &removed, &[]);
        }
        let arrivals = self.arrivals(state, is_search);
        if !arrivals.is_empty() {
            replace(state, &[], &arrivals);
            if let Some(ids) = state.world.ids.clone() {
                let entered = arrivals.iter().filter_map(|arrival| ids.binary_search(&arrival.id).ok());
                with_ids(Some(Arc::clone(&ids)), observer, |observer| {
                    entered.for_each(|i| leave::exchange(state, i as u32, 1.0, observer));
                });
            }
        }
        if is_search {
            let clock = &state.world.clock;
            let time = clock.shown(now);
            // Later, however times are rounded, and within the horizon.
            let least = 4.0 * (clock.tick + f64::EPSILON * time);
            self.search = time + self.interval(state).clamp(least, HORIZON * clock.tick);
        }
        Ok(Vec::new())
    }

    fn save(&self, put: &mut dyn FnMut(&str, u64)) {
        put("flow.search", self.search.to_bits());
        for (k, source) in self.sources.iter().enumerate() {
            put(&format!("inlet.{k}.drawn"), source.drawn);
            put(&format!("inlet.{k}.entered"), source.entered);
            put(&format!("inlet.{k}.next"), source.next.to_bits());
            put(&format!("inlet.{k}.waiting"), source.waiting.len() as u64);
            for (n, &id) in source.waiting.iter().enumerate() {
                put(&format!("inlet.{k}.waiting.{n}"), u64::from(id));
            }
        }
    }

    fn load(&mut self, take: &mut dyn FnMut(&str) -> u64, time: f64) -> Result<(), EngineError> {
        let fault = |what: String| Err(EngineError::Checkpoint(what));
        self.search = f64::from_bits(take("flow.search"));
        if !self.outlets.is_empty() && (self.search.is_nan() || self.search < time * (1.0 - 1e-15)) {
            return fault(format!("flow.search = {} must not be before the time {time}", self.search));
        }
        for (k, source) in self.sources.iter_mut().enumerate() {
            source.drawn = take(&format!("inlet.{k}.drawn"));
            source.entered = take(&format!("inlet.{k}.entered"));
            source.next = f64::from_bits(take(&format!("inlet.{k}.next")));
            if source.is_flowing() && (source.next.is_nan() || source.next < time * (1.0 - 1e-15)) {
                return fault(format!("inlet.{k}.next = {} must not be before the time {time}", source.next));
            }
            let most = match source.inlet.supply {
                Supply::Rate { count, .. } => u64::from(count),
                Supply::Refill { count, .. } => count,
            };
            let waiting = take(&format!("inlet.{k}.waiting"));
            if source.entered > most || source.entered.saturating_add(waiting) > most {
                let entered = source.entered;
                return fault(format!(
                    "inlet.{k}: {entered} entries and {waiting} waiting, of at most {most}"
                ));
            }
            source.waiting =
                (0..waiting.min(1 << 32)).map(|n| take(&format!("inlet.{k}.waiting.{n}")) as u32).collect();
        }
        Ok(())
    }
}
