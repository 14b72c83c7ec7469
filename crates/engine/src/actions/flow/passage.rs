//! The action of all inlets and outlets.
//!
//! Outlets are searched at intervals: a quarter of the time in which the fastest particle, as it then is,
//! crosses the thinnest of them, unless an outlet states its own. What has been taken out goes to the first
//! refilling inlet for its species, which puts it back at once if there is room, and otherwise at a later
//! search. Inlets with a rate let one particle in at each time of a Poisson process, if there is room; if
//! not, it comes at a later one.

use std::{collections::VecDeque, sync::Arc};

use haff_mechanics::random::{Draw, mix};
use haff_neighbors::Geometry;

use crate::{
    actions::timed::TimedAction,
    model::{
        System,
        flow::{Flow, Inlet, Outlet, Supply},
    },
    numerics::{clock::HORIZON, error::EngineError},
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
    /// Number of all particles that ever are there.
    all: u64,
}

impl Source {
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
            all: flow.all(),
        };
        for k in 0..action.sources.len() {
            action.draw_time(k);
        }
        action
    }

    /// Sets the next time of an inlet.
    fn draw_time(&mut self, k: usize) {
        // The complement of the seed: the seed itself is used for places and velocities.
        let seed = !self.seed;
        let source = &mut self.sources[k];
        source.next = match source.inlet.supply {
            Supply::Rate { rate, .. } if source.is_flowing() => {
                source.next + Draw::new(seed, k as u32, source.drawn).exponential() / rate
            }
            _ => f64::INFINITY,
        };
    }

    /// The indices of the particles that are in an outlet.
    fn found(&self, state: &State) -> Vec<u32> {
        let world = &state.world;
        let is_out = |&i: &u32| {
            let position = world.boundary.periodicity.wrap(world.state(i, world.now).0).0;
            world.body(i).inverse_mass != 0.0
                && self.outlets.iter().any(|outlet| outlet.place.contains(position))
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
    fn enter(&self, state: &State, k: usize, id: u32, with: &[Arrival]) -> Option<Arrival> {
        let source = &self.sources[k];
        let (class, _) = *state.population.as_ref()?.kinds.get(id as usize)?;
        // Only in a damaged checkpoint.
        let is_there = state.world.ids.as_ref().is_some_and(|ids| ids.binary_search(&id).is_ok());
        if is_there || with.iter().any(|other| other.id == id) {
            return None;
        }
        let mut draw = Draw::new(self.seed, k as u32, source.drawn);
        arrive(&state.world, &source.inlet, (id, class), with, &mut draw)
    }

    /// The particles that come in now, by their ids. `is_search`: those that wait are tried, too.
    fn arrivals(&mut self, state: &State, is_search: bool) -> Vec<Arrival> {
        let now = state.world.now;
        let mut arrivals: Vec<Arrival> = Vec::new();
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
        let removed = if is_search { self.found(state) } else { Vec::new() };
        if !removed.is_empty() {
            with_ids(state.world.ids.clone(), observer, |observer| {
                removed.iter().try_for_each(|&i| leave::leave(state, i, observer))
            })?;
            for &i in &removed {
                let id = state.world.id(i);
                let species = state.population.as_ref().map(|population| population.kinds[id as usize].1);
                let refills = |source: &&mut Source| species.is_some_and(|species| source.refills(species));
                if let Some(source) = self.sources.iter_mut().find(refills) {
                    source.waiting.push_back(id);
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
            if source.entered.checked_add(waiting).is_none_or(|sum| sum > most) || waiting > self.all {
                let (entered, all) = (source.entered, self.all);
                return fault(format!(
                    "inlet.{k}: {entered} entries, at most {most}, and {waiting} of {all} particles wait"
                ));
            }
            source.waiting = (0..waiting).map(|n| take(&format!("inlet.{k}.waiting.{n}")) as u32).collect();
        }
        Ok(())
    }
}
