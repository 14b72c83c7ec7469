/*!
The engine of neighbor lists, for fluids in periodic boxes without gravity.

Like [`Machine`](crate::machine::Machine), it keeps for every particle its earliest event. But its lists name no periodic images
([`lists`]), and of the members of a list most are dismissed in single precision, eight at a time ([`filter`]), from records of
half a cache line ([`frame`]): what cannot touch before the earliest event known needs no exact prediction ([`exact`]).
*/

mod bins;
mod exact;
mod filter;
mod frame;
mod lists;
mod sets;

use std::marker::PhantomData;

use glam::DVec3;
use haff_calendar::{Calendar, Ladder};
use haff_neighbors::{Axis, Geometry, prefetch_at, roomy};
use rayon::prelude::*;

use crate::{
    batch::Kernel,
    census::{Census, Crowd},
    clock::{HORIZON, whole},
    entry::{Entry, Kind, Target},
    error::EngineError,
    machine::{Engine, Features, Limit, State},
    model::System,
    particles::World,
    predict::Earliest,
    queue::{Prophet, Queue},
    report::{Observer, Stop},
    resolve,
};
use filter::Bounds;
use frame::{Frame, Record};
use lists::Lists;
use sets::MOST;

/// Members that a list shall have: with what it fluctuates, two groups of the filter hold it. Where members come from memory ([`MANY`]), fewer.
const MEMBERS: [f64; 2] = [14.5, 10.0];
/// Distances at which particles become neighbors, at least and at most [mean diameters].
const SHELL: [f64; 2] = [1.3, 2.5];
/// A new center lies this part of the ball's radius ahead of its particle.
const AHEAD: f32 = 0.5;
/// Radii may differ by this factor: the bins are made for the largest.
const SIZE_RATIO: f64 = 2.0;
/// From this many particles on lists are shorter: members come from memory.
const MANY: usize = 40_000;
/// From this many particles on the records and anchors of those in the lists of events to come are asked for: the nearest caches do not hold all.
pub(crate) const AWAY: usize = 15_000;
/// Of the event so many entries ahead, particles, records and lists are asked for, …
const FAR_AHEAD: usize = 8;
/// … and of this nearer one the records of those in the lists.
const NEARLY_DUE: usize = 3;

/// No time within reach [spans].
const NEVER: f32 = 0.5 * filter::NEVER;
/// No event.
const NOTHING: Entry =
    Entry { time: i64::MAX, owner: 0, target: Target::NONE, own_count: 0, partner_count: 0 };
/// Particles predicted at a time at the start.
const BLOCK: usize = 1 << 16;

/// Whether this engine is made for a system, if its box is large enough.
pub(crate) fn serves(system: &System, census: &Census) -> bool {
    census.count < i32::MAX as usize
        && census.movable
        && system.domain.gravity == DVec3::ZERO
        && system.walls.is_empty()
        && !is_wide(census)
}

/// Whether sizes differ too much for its bins.
pub(crate) fn is_wide(census: &Census) -> bool {
    census.largest > SIZE_RATIO * census.least
}

/// What this engine knows of a system before it starts.
struct Plan {
    frame: Frame,
    /// Radius of the balls, and the edges, 0 where nothing moves [largest contact distances].
    half: f64,
    edges: [f64; 3],
    /// Mean distance of neighbors [largest contact distances].
    spacing: f64,
    /// Members that a list has on average, where particles are as near as their neighbors.
    members: f64,
}

impl Plan {
    /// `None` if this engine does not serve the system.
    fn new(geometry: &Geometry, system: &System, census: &Census, crowd: &Crowd) -> Option<Self> {
        if census.count == 0 || !serves(system, census) {
            return None;
        }
        let sigma = geometry.reach;
        let edges =
            [0, 1, 2].map(|k| if geometry.axes[k] == Axis::Flat { 0.0 } else { geometry.size[k] / sigma });
        let flat = census.dimension == 2;
        let ball = if flat { std::f64::consts::PI } else { 4.0 / 3.0 * std::f64::consts::PI };
        let spacing = census.spacing(crowd.packing) / sigma;
        let members = MEMBERS[usize::from(census.count >= MANY)];
        let volume = (members + 1.0) * spacing.powi(census.dimension) / ball;
        let shell = libm::pow(volume, 1.0 / f64::from(census.dimension));
        let mean = 2.0 * census.mean / sigma;
        let half = 0.5 * ((shell / mean).clamp(SHELL[0], SHELL[1]) - 1.0) * mean;
        // Centers of neighbors are a contact distance and two radii apart, and they themselves up to two more.
        let frame = Frame::new(geometry, (1.01 + 4.0 * half) * sigma)?;
        let members = ball * ((mean + 2.0 * half) / spacing).powi(census.dimension) - 1.0;
        Some(Self { frame, half, edges, spacing, members })
    }
}

/// The engine for one set of features.
pub(crate) struct Nearby<F> {
    kernel: Kernel,
    queue: Queue,
    sight: Sight<F>,
    bounds: [Bounds; 2],
    work: Work,
}

/// All that predictions need besides the world.
struct Sight<F> {
    plan: Plan,
    /// Of every particle, and of nobody.
    records: Vec<Record>,
    lists: Lists,
    /// Whether the particles are too many for the cache.
    looks_ahead: bool,
    features: PhantomData<F>,
}

/// Pairs that the filter has looked at, and exact predictions.
#[derive(Debug, Clone, Copy, Default)]
struct Work {
    candidates: u64,
    exact: u64,
}

impl<F: Features> Nearby<F> {
    /// An engine for a system; it has to be [built](Engine::rebuild) before it runs. `None` if it does not serve the system.
    pub fn new(
        geometry: &Geometry,
        kernel: Kernel,
        system: &System,
        census: &Census,
        crowd: &Crowd,
    ) -> Option<Self> {
        let plan = Plan::new(geometry, system, census, crowd)?;
        let count = census.count;
        Some(Self {
            kernel,
            queue: Queue::new(count, FAR_AHEAD),
            sight: Sight {
                plan,
                records: Vec::new(),
                lists: Lists::default(),
                looks_ahead: count >= AWAY,
                features: PhantomData,
            },
            bounds: [Bounds::new(); 2],
            work: Work::default(),
        })
    }

    #[inline(always)]
    fn run<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError> {
        let before = self.work;
        let stop = self.events::<EVENTS, VECTORS>(state, limit, observer);
        self.work.book_since(before, state);
        stop
    }

    #[inline(always)]
    fn events<const EVENTS: bool, const VECTORS: bool>(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError> {
        let mut seer =
            Seer::<F, VECTORS> { sight: &mut self.sight, bounds: &mut self.bounds, work: &mut self.work };
        loop {
            if state.book.counters.collisions >= limit.collisions {
                return Ok(Stop::Collisions);
            }
            if limit.entries == 0 {
                return Ok(Stop::Slice);
            }
            let Some(entry) = self.queue.next(state, &mut seer, limit.ticks) else {
                state.world.now = state.world.now.max(limit.ticks);
                return Ok(Stop::Time);
            };
            limit.entries -= 1;
            state.world.now = state.world.now.max(entry.time);
            let i = entry.owner;
            match entry.target.kind() {
                Kind::Collision(j) => {
                    state.stall.watch(&state.world, &entry)?;
                    resolve::collision::<F, EVENTS>(state, i, j, entry.time, observer)?;
                    // Both are in place before either looks.
                    let bodies = [i.min(j), i.max(j)];
                    for body in bodies {
                        state.world.wrap_anchor(body);
                        seer.sight.update(&state.world, body);
                    }
                    for entry in seer.foresee_both(&state.world, bodies) {
                        self.queue.push(entry);
                    }
                }
                Kind::Transfer(_) => {
                    state.book.counters.transfers += 1;
                    seer.sight.transfer::<VECTORS>(&state.world, i);
                    self.queue.push(seer.foresee(state, i));
                }
                Kind::Renewal | Kind::Wall(_) | Kind::Rest => {
                    state.book.counters.transfers += 1;
                    self.queue.push(seer.foresee(state, i));
                }
            }
        }
    }
}

impl<F: Features> Sight<F> {
    /// Begins a span at the present: all records are made afresh.
    #[cold]
    fn begin(&mut self, world: &World) {
        self.plan.frame.begin(world);
        for i in 0..world.particles.len() as u32 {
            self.records[i as usize] = self.plan.frame.record::<F>(world, i);
        }
    }

    /// Puts the new flight of particle i on record.
    #[inline(always)]
    fn update(&mut self, world: &World, i: u32) {
        let record = self.plan.frame.record::<F>(world, i);
        let allowed = self.plan.frame.allows(&record);
        record.store(&mut self.records[i as usize]);
        if !allowed {
            self.begin(world);
        }
    }

    /// Carries out the transfer of particle i, now.
    #[inline(always)]
    fn transfer<const VECTORS: bool>(&mut self, world: &World, i: u32) {
        if world.now > self.plan.frame.end {
            self.begin(world);
        }
        let part = self.plan.frame.part(world.now);
        self.lists.transfer::<F, VECTORS>(i, &self.records, part, AHEAD);
    }

    /// The next event of particle i, as seen at the world's present, which is within the span.
    ///
    /// With `VECTORS` set the caller must be compiled for AVX2 and FMA, and run where they exist.
    #[inline(always)]
    fn foresee<const VECTORS: bool>(
        &self,
        world: &World,
        i: u32,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> Entry {
        let part = self.plan.frame.part(world.now);
        let glance = self.glance::<VECTORS>(i, part, bounds, work);
        let contact = Self::first(world, &glance, work);
        self.decide::<VECTORS>(world, &glance, contact, bounds, work)
    }

    /// The same for two particles, step by step for both: the processor need not wait for one to be done before it begins with
    /// the other.
    #[inline(always)]
    fn foresee_both<const VECTORS: bool>(
        &self,
        world: &World,
        [i, j]: [u32; 2],
        [a, b]: &mut [Bounds; 2],
        work: &mut Work,
    ) -> [Entry; 2] {
        let part = self.plan.frame.part(world.now);
        let one = self.glance::<VECTORS>(i, part, a, work);
        let other = self.glance::<VECTORS>(j, part, b, work);
        let contacts = [Self::first(world, &one, work), Self::first(world, &other, work)];
        [
            self.decide::<VECTORS>(world, &one, contacts[0], a, work),
            self.decide::<VECTORS>(world, &other, contacts[1], b, work),
        ]
    }

    /// Bounds for all whom particle i may meet.
    #[inline(always)]
    fn glance<const VECTORS: bool>(
        &self,
        i: u32,
        part: f32,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> Glance<'_> {
        let (record, list) = (&self.records[i as usize], self.lists.of(i));
        work.candidates += list.len() as u64;
        let least = filter::bounds::<F, VECTORS>(&self.plan.frame, &self.records, record, part, list, bounds);
        Glance { i, part, record, list, least }
    }

    /// The contact with the first by its bound.
    #[inline(always)]
    fn first(world: &World, glance: &Glance, work: &mut Work) -> i64 {
        if glance.least >= filter::NEVER {
            return exact::NEVER;
        }
        work.exact += 1;
        let (i, j) = (glance.i as usize, glance.list[Bounds::lane(glance.least)] as usize);
        exact::contact::<F>(world, &world.particles[i], &world.particles[j])
    }

    /// The next event of particle i, when the contact with the first by its bound is known.
    #[inline(always)]
    fn decide<const VECTORS: bool>(
        &self,
        world: &World,
        glance: &Glance,
        contact: i64,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> Entry {
        let frame = &self.plan.frame;
        let &Glance { i, part, record, list, least } = glance;
        let particle = &world.particles[i as usize];
        let nothing = Entry { owner: i, own_count: particle.count, ..NOTHING };
        let mut earliest = Earliest { entry: nothing, far: false };
        let mut within = NEVER;
        if least < filter::NEVER {
            let lane = Bounds::lane(least);
            Self::offer(world, &mut earliest, list[lane], contact);
            within = self.until(world, &earliest);
            let length = list.len().min(MOST);
            let mut others = bounds.up_to::<VECTORS>(length, within) & !(1 << lane);
            while others != 0 {
                let j = list[others.trailing_zeros() as usize];
                others &= others - 1;
                work.exact += 1;
                let contact = exact::contact::<F>(world, particle, &world.particles[j as usize]);
                Self::offer(world, &mut earliest, j, contact);
            }
            within = self.until(world, &earliest);
        }
        if list.len() > MOST {
            self.look_on::<VECTORS>(world, i, part, &mut earliest, bounds, work);
            within = self.until(world, &earliest);
        }
        // Of the transfer nothing need be known but whether it comes first.
        if let Some(delay) = self.lists.exit(i, record, part, within) {
            let delay = f64::from(delay) / frame.per_tick;
            if delay > HORIZON {
                earliest.far = true;
            } else {
                let time = world.now + whole(delay);
                if time < earliest.entry.time {
                    return Entry { time, target: Target::new(Kind::Transfer(0)), ..nothing };
                }
            }
        }
        if earliest.far && earliest.entry.time > world.now + HORIZON as i64 {
            return Entry { time: world.now + HORIZON as i64, ..nothing };
        }
        earliest.entry
    }

    #[inline(always)]
    fn offer(world: &World, earliest: &mut Earliest, j: u32, contact: i64) {
        if contact < exact::FAR {
            let count = world.particles[j as usize].count;
            earliest.offer(contact, Target::new(Kind::Collision(j)), count);
        } else {
            earliest.far |= contact == exact::FAR;
        }
    }

    /// From now to the earliest event known, and a little more [spans].
    #[inline(always)]
    fn until(&self, world: &World, earliest: &Earliest) -> f32 {
        let ticks = earliest.entry.time.saturating_sub(world.now).max(0);
        filter::limit(ticks as f64 * self.plan.frame.per_tick)
    }

    /// Looks at the members of a long list beyond the first.
    #[cold]
    fn look_on<const VECTORS: bool>(
        &self,
        world: &World,
        i: u32,
        part: f32,
        earliest: &mut Earliest,
        bounds: &mut Bounds,
        work: &mut Work,
    ) {
        for list in self.lists.of(i)[MOST..].chunks(MOST) {
            let record = &self.records[i as usize];
            // Not compiled for vectors.
            filter::bounds::<F, false>(&self.plan.frame, &self.records, record, part, list, bounds);
            let mut others = bounds.up_to::<false>(list.len(), self.until(world, earliest).min(NEVER));
            while others != 0 {
                let j = list[others.trailing_zeros() as usize];
                others &= others - 1;
                work.exact += 1;
                let (particle, partner) = (&world.particles[i as usize], &world.particles[j as usize]);
                Self::offer(world, earliest, j, exact::contact::<F>(world, particle, partner));
            }
        }
    }
}

/// What a first look at the list of particle i has found.
struct Glance<'a> {
    i: u32,
    /// The present, as a part of the span.
    part: f32,
    record: &'a Record,
    list: &'a [u32],
    /// The least bound of the first [`MOST`].
    least: f32,
}

/// A [`Sight`] that looks by vectors or not.
struct Seer<'a, F, const VECTORS: bool> {
    sight: &'a mut Sight<F>,
    bounds: &'a mut [Bounds; 2],
    work: &'a mut Work,
}

impl<F: Features, const VECTORS: bool> Seer<'_, F, VECTORS> {
    /// The next events of two particles, as seen at the world's present.
    #[inline(always)]
    fn foresee_both(&mut self, world: &World, bodies: [u32; 2]) -> [Entry; 2] {
        if world.now > self.sight.plan.frame.end {
            self.sight.begin(world);
        }
        self.sight.foresee_both::<VECTORS>(world, bodies, self.bounds, self.work)
    }
}

impl<F: Features, const VECTORS: bool> Prophet for Seer<'_, F, VECTORS> {
    type Features = F;

    #[inline(always)]
    fn foresee(&mut self, state: &State, i: u32) -> Entry {
        if state.world.now > self.sight.plan.frame.end {
            self.sight.begin(&state.world);
        }
        #[cfg(target_arch = "x86_64")]
        if VECTORS {
            // SAFETY: the caller has the features.
            return unsafe { self.sight.foresee_avx2(&state.world, i, &mut self.bounds[0], self.work) };
        }
        self.sight.foresee::<false>(&state.world, i, &mut self.bounds[0], self.work)
    }

    /// First the anchors, records and lists of particles, later those of whoever stands in these (nobody has no anchor).
    #[inline(always)]
    fn look_ahead(&self, calendar: &Ladder<Entry>, state: &State) {
        let Sight { records, lists, looks_ahead, .. } = &*self.sight;
        if let Some(entry) = calendar.upcoming(FAR_AHEAD) {
            let partner = if let Kind::Collision(j) = entry.target.kind() { j } else { entry.owner };
            for i in [entry.owner, partner] {
                prefetch_at(&state.world.particles, i as usize);
                prefetch_at(records, i as usize);
                lists.prefetch(i);
            }
        }
        if !looks_ahead {
            return;
        }
        if let Some(entry) = calendar.upcoming(NEARLY_DUE)
            && state.world.particles[entry.owner as usize].count == entry.own_count
        {
            let neighbors = |i: u32| {
                for &j in lists.of(i) {
                    prefetch_at(records, j as usize);
                    prefetch_at(&state.world.particles, j as usize);
                }
            };
            neighbors(entry.owner);
            if let Kind::Collision(j) = entry.target.kind()
                && !calendar.upcoming(NEARLY_DUE + 1).is_some_and(|next| next.mirrors(entry))
            {
                neighbors(j);
            }
        }
    }
}

impl Work {
    /// Books what has been done since `before`.
    fn book_since(self, before: Self, state: &mut State) {
        state.book.counters.predictions += self.exact - before.exact;
        state.book.counters.candidates += self.candidates - before.candidates;
    }
}

impl<F: Features> Engine for Nearby<F> {
    fn rebuild(&mut self, state: &mut State, _geometry: &Geometry) {
        let count = state.world.particles.len();
        self.queue.clear();
        let sight = &mut self.sight;
        if sight.records.is_empty() {
            sight.records = roomy(count + 1);
            sight.records.resize(count + 1, Record::NOBODY);
        }
        sight.begin(&state.world);
        sight.lists = Lists::default();
        sight.lists = Lists::new::<F>(&sight.plan, &sight.records);
        let (sight, world, before) = (&self.sight, &state.world, self.work);
        let mut work = before;
        let mut block = Vec::with_capacity(BLOCK.min(count));
        for start in (0..count).step_by(BLOCK) {
            (start as u32..(start + BLOCK).min(count) as u32)
                .into_par_iter()
                .map_init(Bounds::new, |bounds, i| {
                    let mut work = Work::default();
                    (sight.foresee::<false>(world, i, bounds, &mut work), work)
                })
                .collect_into_vec(&mut block);
            if start == 0 {
                let entries: Vec<Entry> = block.iter().map(|(entry, _)| *entry).collect();
                self.queue.prepare(&entries, count);
            }
            for (entry, part) in &block {
                self.queue.push(*entry);
                work.candidates += part.candidates;
                work.exact += part.exact;
            }
        }
        work.book_since(before, state);
    }

    fn is_idle(&self) -> bool {
        self.queue.is_empty()
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
            // SAFETY: made by `Kernel::choose` alone, after it has found the features.
            (Kernel::Avx2, false) => unsafe { self.run_avx2::<false>(state, limit, observer) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            (Kernel::Avx2, true) => unsafe { self.run_avx2::<true>(state, limit, observer) },
        }
    }
}

/// The same loop, compiled as a whole for processors with 256-bit vectors. Rust neither fuses nor reorders floating-point
/// operations by itself, so the bits are the same; the filter alone asks for fused ones.
#[cfg(target_arch = "x86_64")]
impl<F: Features> Nearby<F> {
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn run_avx2<const EVENTS: bool>(
        &mut self,
        state: &mut State,
        limit: &mut Limit,
        observer: &mut dyn Observer,
    ) -> Result<Stop, EngineError> {
        self.run::<EVENTS, true>(state, limit, observer)
    }
}

#[cfg(target_arch = "x86_64")]
impl<F: Features> Sight<F> {
    /// One copy of the code, so that the loop stays short.
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    #[inline(never)]
    fn foresee_avx2(&self, world: &World, i: u32, bounds: &mut Bounds, work: &mut Work) -> Entry {
        self.foresee::<true>(world, i, bounds, work)
    }
}
