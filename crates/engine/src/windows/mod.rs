/*!
The engine of time windows: no crossings, and memory is streamed.

Time is cut into windows. At the start of one, every particle is registered in the cells along its path through it
([`cells`]), and pairs that may touch before its end are found cell by cell ([`filter`]) and predicted from their anchors
([`exact`]). Contacts within the window, all of them, go to the calendar. Events run in order; particles that have had one
are registered along their new paths and predicted anew, up to the window's end. A stale event needs no successor: whatever
else its particles may meet is in the calendar already.
*/

mod cells;
mod exact;
mod filter;

use std::marker::PhantomData;

use haff_calendar::{Calendar, Ladder};
use haff_neighbors::{Axis, Geometry};
use rayon::prelude::*;

use crate::{
    batch::Kernel,
    entry::{Entry, Kind, Target},
    error::EngineError,
    machine::{Engine, Features, Limit, State},
    particles::World,
    report::{Observer, Stop},
    resolve,
};
use cells::Cells;
use filter::{MARGIN, Probe, Record, Scratch};

/// Windows after which the streamed copies are made from the anchors again.
const RESYNC: u32 = 16;
/// Slots that the batch phase searches for at a time.
const BLOCK: usize = 32;

/// The engine for one set of features.
pub(crate) struct Windows<F> {
    kernel: Kernel,
    geometry: Geometry,
    cells: Cells,
    records: Vec<Record>,
    /// Slot of every particle.
    slot_of: Vec<u32>,
    calendar: Ladder<Entry>,
    /// The window [ticks].
    begin: i64,
    end: i64,
    /// Its length [time].
    step: f64,
    /// Largest radius, widened [length].
    radius: f32,
    windows_since: u32,
    scratch: Scratch,
    /// Exact predictions so far.
    exact: u64,
    features: PhantomData<F>,
}

impl<F: Features> Windows<F> {
    pub fn new(geometry: &Geometry, kernel: Kernel, particles: usize) -> Self {
        Self {
            kernel,
            geometry: geometry.clone(),
            cells: Cells::default(),
            records: Vec::new(),
            slot_of: vec![0; particles],
            calendar: Ladder::with_capacity(particles),
            begin: 0,
            end: 0,
            step: 0.0,
            radius: geometry.radius as f32 * MARGIN,
            windows_since: 0,
            scratch: Scratch::new(),
            exact: 0,
            features: PhantomData,
        }
    }

    /// Starts a window at the present, from the anchors.
    fn start_afresh(&mut self, state: &State) {
        let world = &state.world;
        let count = world.particles.len();
        let volume: f64 =
            (0..3).filter(|&a| self.geometry.axes[a] != Axis::Flat).map(|a| world.size[a]).product();
        let spacing = (volume / count as f64).cbrt();
        let env = |name: &str, default: f64| {
            std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
        };
        let width = env("HAFF_W", 1.3) * spacing;
        let square: f64 = world.particles.iter().map(|particle| particle.velocity.length_squared()).sum();
        let speed = (square / count as f64).sqrt();
        // A path of this many spacings.
        let step = env("HAFF_H", 0.4) * spacing / speed.max(f64::MIN_POSITIVE);
        let ticks = (step * world.clock.per_time) as i64;
        self.begin = world.now;
        self.end = self.begin + ticks;
        self.step = ticks as f64 * world.clock.tick;
        if self.records.is_empty() {
            self.cells = Cells::new(&self.geometry, width);
        }
        let (axes, step) = (self.cells.axes, self.step);
        self.records = (0..count as u32)
            .into_par_iter()
            .map(|i| {
                let (position, velocity) = world.flight::<F>(i, world.now);
                let p = position.to_array();
                Record {
                    x: [0, 1, 2].map(|axis| axes.coordinate(axis, p[axis])),
                    radius: world.class(i).radius as f32 * MARGIN,
                    v: velocity.to_array().map(|v| (v * step) as f32),
                    id: i,
                }
            })
            .collect();
        for i in 0..count as u32 {
            self.slot_of[i as usize] = i;
        }
        self.windows_since = 0;
    }

    /// Starts the next window.
    #[inline(always)]
    fn next_window<const VECTORS: bool>(&mut self, state: &mut State) {
        state.world.now = self.end;
        self.windows_since += 1;
        if self.windows_since >= RESYNC {
            self.start_afresh(state);
        } else {
            let ticks = self.end - self.begin;
            self.begin = self.end;
            self.end += ticks;
            for record in &mut self.records {
                let way = self.cells.axes.way(record.v, 1.0);
                for axis in 0..3 {
                    record.x[axis] = record.x[axis].wrapping_add(way[axis]);
                }
            }
        }
        self.look_ahead::<VECTORS>(state);
    }

    /// The batch phase: all contacts of the window, as things stand.
    #[inline(always)]
    fn look_ahead<const VECTORS: bool>(&mut self, state: &mut State) {
        state.book.counters.transfers += 1;
        self.cells.clear();
        for slot in 0..self.records.len() {
            let record = self.records[slot];
            self.cells.register::<true>(slot as u32, record.x, record.v, 1.0);
        }
        self.calendar.clear();
        let mut probes = Vec::with_capacity(BLOCK);
        for from in (0..self.records.len()).step_by(BLOCK) {
            probes.clear();
            let to = (from + BLOCK).min(self.records.len());
            for slot in from..to {
                let record = self.records[slot];
                probes.push(Probe { slot: slot as u32, record, place: record.x, from: 0.0 });
            }
            self.predict::<true, VECTORS>(&state.world, &probes);
        }
    }

    /// Enters all contacts of the probes up to the window's end.
    #[inline(always)]
    fn predict<const HALF: bool, const VECTORS: bool>(&mut self, world: &World, probes: &[Probe]) {
        filter::search::<F, HALF, VECTORS>(
            &self.records,
            &self.cells,
            self.radius,
            probes,
            &mut self.scratch,
        );
        self.exact += self.scratch.hits.len() as u64;
        for &(search, slot) in &self.scratch.hits {
            let (i, j) = (probes[search as usize].record.id, self.records[slot as usize].id);
            let Some(time) = exact::contact::<F>(world, i, j) else { continue };
            if time <= self.end {
                self.calendar.push(Entry {
                    time,
                    owner: i,
                    target: Target::new(Kind::Collision(j)),
                    own_count: world.particles[i as usize].count,
                    partner_count: world.particles[j as usize].count,
                });
            }
        }
    }

    /// Copies the new flight of particle i; how it is looked from now, and from where.
    #[inline(always)]
    fn renew(&mut self, world: &World, i: u32) -> Probe {
        let particle = &world.particles[i as usize];
        let slot = self.slot_of[i as usize];
        let from = ((particle.time - self.begin) as f64 * (world.clock.tick / self.step)) as f32;
        let v = particle.velocity.to_array().map(|v| (v * self.step) as f32);
        let p = particle.position.to_array();
        let place = [0, 1, 2].map(|axis| self.cells.axes.coordinate(axis, p[axis]));
        let back = self.cells.axes.way(v, from);
        let record = &mut self.records[slot as usize];
        record.x = [0, 1, 2].map(|axis| place[axis].wrapping_sub(back[axis]));
        record.v = v;
        let record = *record;
        // Its old path has brought it to where it is, so that it is registered there.
        self.cells.register::<false>(slot, place, v, 1.0 - from);
        Probe { slot, record, place, from }
    }

    #[inline(always)]
    fn run<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError> {
        let stop = loop {
            if state.book.counters.collisions >= limit.collisions {
                break Stop::Collisions;
            }
            if limit.entries == 0 {
                break Stop::Slice;
            }
            let Some(entry) = self.calendar.pop_until(limit.ticks.min(self.end)) else {
                if limit.ticks <= self.end {
                    state.world.now = state.world.now.max(limit.ticks);
                    break Stop::Time;
                }
                limit.entries = limit.entries.saturating_sub(1 + self.records.len() as u64 / 64);
                self.next_window::<VECTORS>(state);
                continue;
            };
            let world = &mut state.world;
            let i = entry.owner;
            let Kind::Collision(j) = entry.target.kind() else { unreachable!() };
            if world.particles[i as usize].count != entry.own_count
                || world.particles[j as usize].count != entry.partner_count
            {
                state.book.counters.dropped += 1;
                continue;
            }
            limit.entries -= 1;
            world.now = world.now.max(entry.time);
            resolve::collision::<F, EVENTS>(state, i, j, entry.time, observer)?;
            state.world.wrap_anchor(i);
            state.world.wrap_anchor(j);
            let movable = |body: u32| F::UNIFORM || state.world.class(body).inverse_mass != 0.0;
            match (movable(i), movable(j)) {
                (true, true) => {
                    let probes = [i, j].map(|body| self.renew(&state.world, body));
                    self.predict::<false, VECTORS>(&state.world, &probes);
                }
                (first, _) => {
                    let probe = self.renew(&state.world, if first { i } else { j });
                    self.predict::<false, VECTORS>(&state.world, &[probe]);
                }
            }
        };
        state.book.counters.predictions += std::mem::take(&mut self.exact);
        state.book.counters.stale += std::mem::take(&mut self.scratch.tested);
        Ok(stop)
    }
}

impl<F: Features> Engine for Windows<F> {
    fn rebuild(&mut self, state: &mut State, _geometry: &Geometry) {
        self.start_afresh(state);
        match self.kernel {
            Kernel::Portable => self.look_ahead::<false>(state),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Kernel::Avx2` is made by `Kernel::choose` alone, after it has found AVX2 and FMA.
            Kernel::Avx2 => unsafe { self.look_ahead_avx2(state) },
        }
    }

    fn is_idle(&self) -> bool {
        false
    }

    fn advance(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError> {
        match (self.kernel, observer.wants_events()) {
            (Kernel::Portable, false) => self.run::<false, false>(state, limit, observer),
            (Kernel::Portable, true) => self.run::<true, false>(state, limit, observer),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Kernel::Avx2` is made by `Kernel::choose` alone, after it has found AVX2 and FMA.
            (Kernel::Avx2, false) => unsafe { self.run_avx2::<false>(state, limit, observer) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            (Kernel::Avx2, true) => unsafe { self.run_avx2::<true>(state, limit, observer) },
        }
    }
}

/// The same loops, compiled as a whole for processors with 256-bit vectors.
#[cfg(target_arch = "x86_64")]
impl<F: Features> Windows<F> {
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn run_avx2<const EVENTS: bool>(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError> {
        self.run::<EVENTS, true>(state, limit, observer)
    }

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn look_ahead_avx2(&mut self, state: &mut State) {
        self.look_ahead::<true>(state);
    }
}
