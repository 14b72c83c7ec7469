/*!
The scheduler with neighbor lists for fluids in closed boxes without gravity.

Like [`CalendarScheduler`](crate::calendar_scheduler::CalendarScheduler), it keeps for every particle its
earliest event. But its lists contain no periodic images ([`lists`]), and most members of a list are rejected
in single precision, eight at a time ([`filter`]), from records of half a cache line ([`frame`]): what cannot
touch before the earliest event known needs no exact prediction ([`exact`]).
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
use haff_neighbors::{Axis, Geometry, prefetch_at, with_huge_pages};
use rayon::prelude::*;

use crate::{
    batch::Kernel,
    census::{Census, Crowd},
    clock::{HORIZON, whole},
    entry::{self, Kind, Target},
    event::{Collision, Impact, Pause},
    event_loop::{Limit, Next, Scheduler},
    features::Features,
    model::{Boundary, System},
    particles::World,
    predict::Earliest,
    queue::{Predictor, Queue},
    state::State,
};
use filter::Bounds;
use frame::{Frame, Record};
use lists::Lists;
use sets::MOST;

/// Members that a list shall have: with what it fluctuates, two groups of the filter hold it. Where members
/// come from memory ([`MANY`]), fewer.
const MEMBERS: [f64; 2] = [14.5, 10.0];
/// Distances at which particles become neighbors, at least and at most [mean diameters].
const SHELL: [f64; 2] = [1.3, 2.5];
/// A new center lies this part of the ball's radius ahead of its particle.
const AHEAD: f32 = 0.5;
/// A particle near one wall is predicted against all: there may be so many.
const FEW_WALLS: usize = 16;
/// Radii may differ by this factor: the bins are made for the largest.
const SIZE_RATIO: f64 = 2.0;
/// From this many particles on lists are shorter: members come from memory.
const MANY: usize = 40_000;
/// From this many particles on the records and anchors of those in the lists of events to come are asked for:
/// the nearest caches do not hold all.
pub(crate) const AWAY: usize = 15_000;
/// Of the event so many entries ahead, particles, records and lists are asked for, …
const FAR_AHEAD: usize = 8;
/// … and of this nearer one the records of those in the lists.
const NEARLY_DUE: usize = 3;

/// No time within reach [spans].
const NEVER: f32 = 0.5 * filter::NEVER;

/// What the entries of this calendar announce.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ListEvent {
    /// Collision with particle `.0`.
    Collision(u32),
    /// Collision with wall `.0`.
    Wall(u32),
    /// The particle leaves the range that its list has been made for.
    ListUpdate,
    /// Nothing within the horizon: a prediction is due there.
    Prediction,
}

impl Kind for ListEvent {
    #[inline]
    fn encode(self) -> (u32, u32) {
        match self {
            Self::Collision(j) => (entry::COLLISION, j),
            Self::Wall(wall) => (entry::WALL, wall),
            Self::ListUpdate => (entry::UPDATE, 0),
            Self::Prediction => (entry::UPDATE, entry::PREDICTION),
        }
    }

    #[inline]
    fn decode(tag: u32, index: u32) -> Self {
        match (tag, index) {
            (entry::COLLISION, j) => Self::Collision(j),
            (entry::WALL, wall) => Self::Wall(wall),
            (_, entry::PREDICTION) => Self::Prediction,
            _ => Self::ListUpdate,
        }
    }
}

type Entry = entry::Entry<ListEvent>;

/// Particles predicted at a time at the start.
const BLOCK: usize = 1 << 16;

/// Whether this scheduler supports a system, if its box is large enough.
pub(crate) fn supports(system: &System, census: &Census) -> bool {
    census.count < i32::MAX as usize
        && system.domain.gravity == DVec3::ZERO
        && system.walls.len() <= FEW_WALLS
        && (0..system.dimension.count()).all(|axis| system.domain.boundary[axis] != Boundary::Open)
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
    /// `None` if this scheduler does not support the system.
    fn new(geometry: &Geometry, system: &System, census: &Census, crowd: &Crowd) -> Option<Self> {
        if census.count == 0 || !supports(system, census) {
            return None;
        }
        let sigma = geometry.reach;
        let flat = census.dimension == 2;
        let ball = if flat { std::f64::consts::PI } else { 4.0 / 3.0 * std::f64::consts::PI };
        let spacing = census.spacing(crowd.packing) / sigma;
        let members = MEMBERS[usize::from(census.count >= MANY)];
        let volume = (members + 1.0) * spacing.powi(census.dimension) / ball;
        let shell = libm::pow(volume, 1.0 / f64::from(census.dimension));
        let mean = 2.0 * census.mean / sigma;
        let half = 0.5 * ((shell / mean).clamp(SHELL[0], SHELL[1]) - 1.0) * mean;
        // Centers of neighbors are a contact distance and two radii apart, and they themselves up to two
        // more.
        let frame = Frame::new(geometry, (1.01 + 4.0 * half) * sigma)?;
        let edges =
            [0, 1, 2].map(|k| if geometry.axes[k] == Axis::Flat { 0.0 } else { frame.period[k] / sigma });
        let members = ball * ((mean + 2.0 * half) / spacing).powi(census.dimension) - 1.0;
        Some(Self { frame, half, edges, spacing, members })
    }
}

/// The scheduler for one set of features.
pub(crate) struct Nearby<F> {
    kernel: Kernel,
    queue: Queue<ListEvent>,
    predictor: ListPredictor<F>,
    bounds: [Bounds; 2],
    work: Work,
    /// Work that has been added to the counters of the state.
    counted: Work,
}

/// All that predictions need besides the world.
struct ListPredictor<F> {
    plan: Plan,
    /// Of every particle, and a sentinel.
    records: Vec<Record>,
    lists: Lists,
    /// Whether the particles are too many for the cache.
    prefetches: bool,
    features: PhantomData<F>,
}

/// Pairs that the filter has looked at, and exact predictions.
#[derive(Debug, Clone, Copy, Default)]
struct Work {
    candidates: u64,
    exact: u64,
}

impl<F: Features> Nearby<F> {
    /// A scheduler for a system; it has to be [built](Scheduler::rebuild) before it runs. `None` if it does
    /// not support the system.
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
            predictor: ListPredictor {
                plan,
                records: Vec::new(),
                lists: Lists::default(),
                prefetches: count >= AWAY,
                features: PhantomData,
            },
            bounds: [Bounds::new(); 2],
            work: Work::default(),
            counted: Work::default(),
        })
    }

    /// Out of line, so that the loop of collisions stays short.
    #[inline(never)]
    fn update_after_wall(&mut self, state: &mut State, i: u32) {
        self.reschedule(state, &[i]);
    }

    /// The predictor, by vectors or not.
    #[inline(always)]
    fn split<const VECTORS: bool>(&mut self) -> (&mut Queue<ListEvent>, VectorPredictor<'_, F, VECTORS>) {
        let Self { queue, predictor, bounds, work, .. } = self;
        (queue, VectorPredictor { predictor, bounds, work })
    }
}

impl<F: Features> Scheduler for Nearby<F> {
    type Features = F;
    type Event = Impact;

    fn kernel(&self) -> Kernel {
        self.kernel
    }

    fn rebuild(&mut self, state: &mut State, geometry: &Geometry) {
        let count = state.world.particles.len();
        self.queue.clear();
        let predictor = &mut self.predictor;
        if predictor.records.is_empty() {
            predictor.records = with_huge_pages(count + 1);
            predictor.records.resize(count + 1, Record::SENTINEL);
        }
        predictor.begin(&state.world);
        predictor.lists = Lists::default();
        predictor.lists = Lists::new::<F>(&predictor.plan, geometry, &predictor.records);
        let (predictor, world) = (&self.predictor, &state.world);
        let mut block = Vec::with_capacity(BLOCK.min(count));
        for start in (0..count).step_by(BLOCK) {
            (start as u32..(start + BLOCK).min(count) as u32)
                .into_par_iter()
                .map_init(Bounds::new, |bounds, i| {
                    let mut work = Work::default();
                    (predictor.predict::<false>(world, i, bounds, &mut work), work)
                })
                .collect_into_vec(&mut block);
            if start == 0 {
                let entries: Vec<Entry> = block.iter().map(|(entry, _)| *entry).collect();
                self.queue.prepare(&entries, count);
            }
            for (entry, part) in &block {
                self.queue.push(*entry);
                self.work.candidates += part.candidates;
                self.work.exact += part.exact;
            }
        }
    }

    #[inline(always)]
    fn next<const VECTORS: bool>(&mut self, state: &mut State, limit: &mut Limit) -> Next<Impact> {
        let (queue, mut predictor) = self.split::<VECTORS>();
        loop {
            let Some(entry) = queue.next(state, &mut predictor, limit.ticks) else { return Next::Nothing };
            let i = entry.owner;
            let updates = match entry.target.kind() {
                ListEvent::Collision(j) => {
                    return Next::Event(entry.time, Impact::Pair(Collision([i, j])));
                }
                ListEvent::Wall(wall) => return Next::Event(entry.time, Impact::Wall { i, wall }),
                ListEvent::ListUpdate => true,
                ListEvent::Prediction => false,
            };
            limit.entries -= 1;
            state.world.now = state.world.now.max(entry.time);
            state.book.counters.transfers += 1;
            if updates {
                predictor.predictor.update_list::<VECTORS>(&state.world, i);
            }
            queue.push(predictor.predict(state, i));
            if limit.entries == 0 {
                return Next::Interrupted;
            }
        }
    }

    #[inline(always)]
    fn update<const VECTORS: bool>(
        &mut self,
        state: &mut State,
        event: Impact,
        _woken: &[u32],
        _limit: &mut Limit,
    ) -> Option<Pause> {
        let [i, j] = match event {
            Impact::Pair(Collision(bodies)) => bodies,
            Impact::Wall { i, .. } => {
                self.update_after_wall(state, i);
                return None;
            }
        };
        let (queue, mut predictor) = self.split::<VECTORS>();
        // Both anchors are in place before either is predicted.
        let bodies = [i.min(j), i.max(j)];
        for body in bodies {
            state.world.wrap_anchor(body);
            predictor.predictor.update(&state.world, body);
        }
        for entry in predictor.predict_both(&state.world, bodies) {
            // A body of infinite mass has not changed: its own entry is valid unless it is this one.
            if F::UNIFORM || entry.owner == i || state.world.class(entry.owner).inverse_mass != 0.0 {
                queue.push(entry);
            }
        }
        None
    }

    fn reschedule(&mut self, state: &mut State, bodies: &[u32]) {
        let (queue, mut predictor) = self.split::<false>();
        for &body in bodies {
            state.world.wrap_anchor(body);
            predictor.predictor.update(&state.world, body);
        }
        for &body in bodies {
            queue.push(predictor.predict(state, body));
        }
    }

    fn is_idle(&self) -> bool {
        self.queue.is_empty()
    }

    fn count_work(&mut self, state: &mut State) {
        let counters = &mut state.book.counters;
        counters.predictions += self.work.exact - self.counted.exact;
        counters.candidates += self.work.candidates - self.counted.candidates;
        self.counted = self.work;
    }
}

impl<F: Features> ListPredictor<F> {
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

    /// Makes the list of particle i anew, now.
    #[inline(always)]
    fn update_list<const VECTORS: bool>(&mut self, world: &World, i: u32) {
        if world.now > self.plan.frame.end {
            self.begin(world);
        }
        let part = self.plan.frame.part(world.now);
        self.lists.transfer::<F, VECTORS>(i, &self.records, part, AHEAD);
    }

    /// The next event of particle i, predicted at the world's present, which is within the span.
    ///
    /// With `VECTORS` set the caller must be compiled for AVX2 and FMA, and run where they exist.
    #[inline(always)]
    fn predict<const VECTORS: bool>(
        &self,
        world: &World,
        i: u32,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> Entry {
        let part = self.plan.frame.part(world.now);
        let query = self.query::<VECTORS>(i, part, bounds, work);
        let contact = Self::first(world, &query, work);
        self.decide::<VECTORS>(world, &query, contact, bounds, work)
    }

    /// The same for two particles, step by step for both: the processor need not wait for one to be done
    /// before it begins with the other.
    #[inline(always)]
    fn predict_both<const VECTORS: bool>(
        &self,
        world: &World,
        [i, j]: [u32; 2],
        [a, b]: &mut [Bounds; 2],
        work: &mut Work,
    ) -> [Entry; 2] {
        let part = self.plan.frame.part(world.now);
        let one = self.query::<VECTORS>(i, part, a, work);
        let other = self.query::<VECTORS>(j, part, b, work);
        let contacts = [Self::first(world, &one, work), Self::first(world, &other, work)];
        [
            self.decide::<VECTORS>(world, &one, contacts[0], a, work),
            self.decide::<VECTORS>(world, &other, contacts[1], b, work),
        ]
    }

    /// Bounds for the contacts of particle i.
    #[inline(always)]
    fn query<const VECTORS: bool>(
        &self,
        i: u32,
        part: f32,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> Query<'_> {
        let (record, list) = (&self.records[i as usize], self.lists.of(i));
        work.candidates += list.len() as u64;
        let least = filter::bounds::<F, VECTORS>(&self.plan.frame, &self.records, record, part, list, bounds);
        Query { i, part, record, list, least }
    }

    /// The contact with the first by its bound.
    #[inline(always)]
    fn first(world: &World, query: &Query, work: &mut Work) -> i64 {
        if query.least >= filter::NEVER {
            return exact::NEVER;
        }
        work.exact += 1;
        let (i, j) = (query.i as usize, query.list[Bounds::lane(query.least)] as usize);
        exact::contact::<F>(world, &world.particles[i], &world.particles[j])
    }

    /// The next event of particle i, when the contact with the first by its bound is known.
    #[inline(always)]
    fn decide<const VECTORS: bool>(
        &self,
        world: &World,
        query: &Query,
        contact: i64,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> Entry {
        let frame = &self.plan.frame;
        let &Query { i, part, record, list, least } = query;
        let particle = &world.particles[i as usize];
        let nothing = Entry::none(i, particle.count);
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
            self.query_rest::<VECTORS>(world, i, part, &mut earliest, bounds, work);
            within = self.until(world, &earliest);
        }
        if !world.walls.is_empty() && self.lists.is_near_wall(i) {
            Self::predict_walls(world, i, &mut earliest);
            within = self.until(world, &earliest).min(NEVER);
        }
        // A later update of the list need not be known exactly.
        if let Some(delay) = self.lists.exit(i, record, part, within) {
            let delay = f64::from(delay) / frame.per_tick;
            if delay > HORIZON {
                earliest.far = true;
            } else {
                let time = world.now + whole(delay);
                if time < earliest.entry.time {
                    return Entry { time, target: Target::new(ListEvent::ListUpdate), ..nothing };
                }
            }
        }
        if earliest.far && earliest.entry.time > world.now + HORIZON as i64 {
            return Entry { time: world.now + HORIZON as i64, ..nothing };
        }
        earliest.entry
    }

    #[inline(always)]
    fn offer(world: &World, earliest: &mut Earliest<ListEvent>, j: u32, contact: i64) {
        if contact < exact::FAR {
            let count = world.particles[j as usize].count;
            earliest.offer(contact, Target::new(ListEvent::Collision(j)), count);
        } else {
            earliest.far |= contact == exact::FAR;
        }
    }

    /// From now to the earliest event known, and a little more [spans].
    #[inline(always)]
    fn until(&self, world: &World, earliest: &Earliest<ListEvent>) -> f32 {
        let ticks = earliest.entry.time.saturating_sub(world.now).max(0);
        filter::limit(ticks as f64 * self.plan.frame.per_tick)
    }

    /// Offers the contacts of a particle with all walls.
    #[inline(never)]
    fn predict_walls(world: &World, i: u32, earliest: &mut Earliest<ListEvent>) {
        let particle = &world.particles[i as usize];
        let class = world.class(i);
        if class.inverse_mass == 0.0 {
            return;
        }
        for wall in 0..world.walls.len() as u32 {
            if let Some(delay) = world.wall_contact(particle, class.radius, DVec3::ZERO, wall) {
                earliest.offer_after(particle.time, delay, ListEvent::Wall(wall), 0);
            }
        }
    }

    /// Adds the members of a long list beyond the first [`MOST`].
    #[cold]
    fn query_rest<const VECTORS: bool>(
        &self,
        world: &World,
        i: u32,
        part: f32,
        earliest: &mut Earliest<ListEvent>,
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

/// Bounds for the contacts of particle i with the members of its list.
struct Query<'a> {
    i: u32,
    /// The present, as a part of the span.
    part: f32,
    record: &'a Record,
    list: &'a [u32],
    /// The least bound of the first [`MOST`].
    least: f32,
}

/// A [`ListPredictor`] by vectors or not, with its working space.
struct VectorPredictor<'a, F, const VECTORS: bool> {
    predictor: &'a mut ListPredictor<F>,
    bounds: &'a mut [Bounds; 2],
    work: &'a mut Work,
}

impl<F: Features, const VECTORS: bool> VectorPredictor<'_, F, VECTORS> {
    /// The next events of two particles, predicted at the world's present.
    #[inline(always)]
    fn predict_both(&mut self, world: &World, bodies: [u32; 2]) -> [Entry; 2] {
        if world.now > self.predictor.plan.frame.end {
            self.predictor.begin(world);
        }
        self.predictor.predict_both::<VECTORS>(world, bodies, self.bounds, self.work)
    }
}

impl<F: Features, const VECTORS: bool> Predictor for VectorPredictor<'_, F, VECTORS> {
    type Features = F;
    type Kind = ListEvent;

    #[inline(always)]
    fn predict(&mut self, state: &State, i: u32) -> Entry {
        if state.world.now > self.predictor.plan.frame.end {
            self.predictor.begin(&state.world);
        }
        #[cfg(target_arch = "x86_64")]
        if VECTORS {
            // SAFETY: the caller has the features.
            return unsafe { self.predictor.predict_avx2(&state.world, i, &mut self.bounds[0], self.work) };
        }
        self.predictor.predict::<false>(&state.world, i, &mut self.bounds[0], self.work)
    }

    /// First the anchors, records and lists of particles, later those of the members of these (the sentinel
    /// has no anchor).
    #[inline(always)]
    fn prefetch(&self, calendar: &Ladder<Entry>, state: &State) {
        let ListPredictor { records, lists, prefetches, .. } = &*self.predictor;
        if let Some(entry) = calendar.upcoming(FAR_AHEAD) {
            let partner = entry.target.partner().unwrap_or(entry.owner);
            for i in [entry.owner, partner] {
                prefetch_at(&state.world.particles, i as usize);
                prefetch_at(records, i as usize);
                lists.prefetch(i);
            }
        }
        if !prefetches {
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
            if let Some(j) = entry.target.partner()
                && !calendar.upcoming(NEARLY_DUE + 1).is_some_and(|next| next.mirrors(entry))
            {
                neighbors(j);
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl<F: Features> ListPredictor<F> {
    /// One copy of the code, so that the loop stays short.
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    #[inline(never)]
    fn predict_avx2(&self, world: &World, i: u32, bounds: &mut Bounds, work: &mut Work) -> Entry {
        self.predict::<true>(world, i, bounds, work)
    }
}
