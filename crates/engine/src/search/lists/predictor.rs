/*!
The next event of a particle from its list: bounds in single precision first, then exact predictions of the
members that can be the first to collide.
*/

use std::{collections::BTreeMap, marker::PhantomData};

use glam::DVec3;
use haff_mechanics::duration;
use haff_neighbors::Array;

use crate::{
    model::features::Features,
    numerics::clock::{HORIZON, whole},
    search::{
        compact::CompactParticle,
        earliest::Earliest,
        entry::Target,
        planes::{self, Planes},
        predict::{predict_nearest, predict_support, predict_walls},
        search_event::SearchEvent,
    },
    state::{Pending, world::World},
};

use super::{
    Entry, UPDATE,
    filter::{self, Bounds},
    narrow_phase,
    neighbor_lists::Lists,
    plan::Plan,
    sets::MASK_BITS,
};

/// A new reference position is ahead of its particle by this fraction of half of the skin.
const AHEAD: f32 = 0.5;
/// Distance of an event from the next one in the calendar, in entries, at which its anchors, compact
/// particles and lists are prefetched.
pub(super) const FAR_AHEAD: usize = 8;
/// The same distance for the anchors and compact particles of the members of these lists.
pub(super) const NEARLY_DUE: usize = 3;

/// Later than any event [spans], but below [`filter::NEVER`], as [`Bounds::up_to`] requires.
const NEVER: f32 = 0.5 * filter::NEVER;

/// The series of bounces that have been completed, but not ended.
pub(super) type Waiting = BTreeMap<u32, Pending>;

/// The data of predictions, except for the world.
pub(super) struct ListPredictor<F> {
    pub plan: Plan,
    /// The compact particles of all particles, then the sentinel.
    pub particles: Array<CompactParticle>,
    pub lists: Lists,
    /// Under gravity, whether each particle is fixed or supported: it has no path in the frame of the filter.
    pub fixed: Array<bool>,
    /// Number of these particles.
    pub fixed_count: usize,
    /// The walls, for bounds on the distance from them; and their indices.
    pub planes: Planes,
    pub walls: Vec<u16>,
    /// Whether members of lists are prefetched, because the particles are too many for the cache.
    pub prefetches: bool,
    pub features: PhantomData<F>,
}

/// Number of pairs that the filter has processed, and of exact predictions.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Work {
    pub candidates: u64,
    pub predictions: u64,
}

impl Work {
    pub fn add(&mut self, other: Self) {
        self.candidates += other.candidates;
        self.predictions += other.predictions;
    }
}

impl<F: Features> ListPredictor<F> {
    /// Begins a span at the present time: all compact particles are computed from their anchors.
    #[cold]
    pub fn begin(&mut self, world: &World) {
        self.begin_at(world, world.now, false);
    }

    /// [`Self::begin`] for lists that are made then.
    pub fn begin_lists(&mut self, world: &World) {
        self.begin_at(world, world.now, true);
    }

    /// The same at a time `now` [ticks] before the next event.
    pub fn begin_at(&mut self, world: &World, now: i64, made: bool) {
        self.plan.frame.begin::<F>(world, now, made);
        for i in 0..world.particles.len() as u32 {
            self.particles[i as usize] = self.plan.frame.compact::<F>(world, i);
        }
        if F::GRAVITY {
            let fixed = |i: u32| !world.falls(i);
            self.fixed = (0..world.particles.len() as u32).map(fixed).collect();
            self.fixed_count = self.fixed.iter().filter(|&&fixed| fixed).count();
        }
    }

    /// Copies the new path of particle i. If the particle is too fast for the span, a new span begins.
    #[inline(always)]
    pub fn update(&mut self, world: &World, i: u32) {
        // Also in boxes that deform compiled with the vector instructions of the loop.
        if !(self.plan.frame.is_plain::<F>() || F::DEFORMS && !F::GRAVITY) {
            self.update_falling(world, i);
            return;
        }
        let compact = self.plan.frame.compact::<F>(world, i);
        let allowed = compact.is_within(self.plan.frame.limit2);
        compact.store(&mut self.particles[i as usize]);
        if !allowed {
            self.begin(world);
        }
    }

    /// [`Self::update`] in general.
    #[inline(never)]
    fn update_falling(&mut self, world: &World, i: u32) {
        let compact = self.plan.frame.compact::<F>(world, i);
        let mut allowed = compact.is_within(self.plan.frame.limit2);
        compact.store(&mut self.particles[i as usize]);
        if F::GRAVITY {
            let fixed = !world.falls(i);
            allowed |= fixed;
            let before = std::mem::replace(&mut self.fixed[i as usize], fixed);
            self.fixed_count = self.fixed_count + usize::from(fixed) - usize::from(before);
        }
        if !allowed {
            self.begin(world);
        }
    }

    /// The same data for another thread.
    ///
    /// # Safety
    ///
    /// As for [`Array::alias`]: no thread changes particles, lists and bins that another one uses.
    pub unsafe fn alias(&mut self) -> Self {
        Self {
            plan: self.plan.clone(),
            // SAFETY: guaranteed by the caller.
            particles: unsafe { self.particles.alias() },
            // SAFETY: as above.
            lists: unsafe { self.lists.alias() },
            // Not read: blocks take no events of fixed particles.
            fixed: Array::default(),
            fixed_count: self.fixed_count,
            planes: self.planes.clone(),
            walls: Vec::new(),
            prefetches: self.prefetches,
            features: PhantomData,
        }
    }

    /// Copies the new path of particle i, whose displacement the present span allows.
    #[inline(always)]
    pub fn copy(&mut self, world: &World, i: u32) {
        self.plan.frame.compact::<F>(world, i).store(&mut self.particles[i as usize]);
    }

    /// Updates the list of particle i at the present time, which must be within the span. Returns false if an
    /// alias would need memory for it.
    #[inline(always)]
    pub fn renew_list<const VECTORS: bool>(&mut self, world: &World, i: u32) -> bool {
        if self.is_fixed(i) {
            return self.renew_fixed(world, i);
        }
        // Not inlined, it took 0.8 % more instructions in the loops that are the fastest.
        if F::UNIFORM {
            return self.renew::<VECTORS>(world, i);
        }
        #[cfg(target_arch = "x86_64")]
        if VECTORS {
            // SAFETY: with `VECTORS` set the caller guarantees the features of `renew_avx2`.
            return unsafe { self.renew_avx2(world, i) };
        }
        self.renew_portable(world, i)
    }

    #[inline(never)]
    fn renew_portable(&mut self, world: &World, i: u32) -> bool {
        self.renew::<false>(world, i)
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(never)]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn renew_avx2(&mut self, world: &World, i: u32) -> bool {
        self.renew::<true>(world, i)
    }

    /// [`Self::renew_list`] for a particle that is not fixed.
    #[inline(always)]
    fn renew<const VECTORS: bool>(&mut self, world: &World, i: u32) -> bool {
        let frame = &self.plan.frame;
        let fraction = frame.fraction(world.now);
        self.lists.renew::<F, VECTORS>(i, frame, &self.particles, fraction, AHEAD)
    }

    /// Whether particle i has no path in the frame of the filter.
    #[inline(always)]
    fn is_fixed(&self, i: u32) -> bool {
        F::GRAVITY && self.fixed_count > 0 && self.fixed[i as usize]
    }

    /// [`Self::renew_list`] for a fixed particle, whose reference position becomes the present one.
    #[cold]
    #[inline(never)]
    fn renew_fixed(&mut self, world: &World, i: u32) -> bool {
        self.lists.set_reference::<F, false>(i, self.present_place(world, i), &self.particles)
    }

    /// The present position of a particle, in coordinates.
    fn present_place(&self, world: &World, i: u32) -> [i32; 3] {
        self.plan.frame.coordinates(world.flight::<F>(i, world.now).0.to_array())
    }

    /// Offers all events of a fixed particle, or the contacts of another one with the fixed members of its
    /// list.
    #[cold]
    #[inline(never)]
    fn predict_fixed(
        &self,
        world: &World,
        pending: &Waiting,
        i: u32,
        earliest: &mut Earliest<SearchEvent>,
        work: &mut Work,
    ) {
        let own = self.fixed[i as usize];
        if own && world.particles[i as usize].rests() {
            predict_support(world, pending, i, earliest);
        }
        let count = world.particles.len() as u32;
        for &j in self.lists.of(i).iter().filter(|&&j| j < count) {
            if own || self.fixed[j as usize] {
                predict_nearest::<F>(world, i, j, &mut work.predictions, earliest);
            }
        }
        if own && self.lists.has_walls() && self.lists.is_near_wall(i) {
            predict_walls::<F>(world, i, &self.walls, earliest.entry.time, earliest);
        }
        if own {
            self.predict_exit_of_fixed(world, i, earliest);
        }
    }

    /// Offers an update of the list of a fixed particle, before it leaves its skin sphere.
    fn predict_exit_of_fixed(&self, world: &World, i: u32, earliest: &mut Earliest<SearchEvent>) {
        let depth = self.lists.depth(i, self.present_place(world, i)) * self.plan.frame.sigma;
        // No faster than this on the way: a wall that carries the particle may turn.
        let carrier =
            world.carrier(i).map_or(0.0, |wall| world.boundary.walls[wall as usize].motion.max_speed());
        let speed = world.flight::<F>(i, world.now).1.length() + carrier;
        let acceleration = world.acceleration(i).length();
        if speed + acceleration > 0.0 {
            let delay = duration(depth, speed, acceleration);
            earliest.offer_after(world.now, delay * world.clock.per_time, UPDATE, 0);
        }
    }

    /// Updates the list of particle i at the present time.
    #[inline(always)]
    pub fn update_list<const VECTORS: bool>(&mut self, world: &World, i: u32) {
        if world.now > self.plan.frame.end {
            self.begin(world);
        }
        self.renew_list::<VECTORS>(world, i);
    }

    /// The next event of particle i, predicted at the world's present time, which must be within the span.
    ///
    /// With `VECTORS` set the caller must be compiled for AVX2 and FMA, and run where they exist.
    #[inline(always)]
    pub fn predict<const VECTORS: bool>(
        &self,
        world: &World,
        pending: &Waiting,
        i: u32,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> Entry {
        let fraction = self.plan.frame.fraction(world.now);
        let query = self.query::<VECTORS>(i, fraction, bounds, work);
        let contact = Self::first(world, &query, work);
        self.decide::<VECTORS>(world, pending, &query, contact, bounds, work)
    }

    /// [`Self::predict`] for two particles, each step for both, so that the processor can overlap the two
    /// predictions.
    #[inline(always)]
    pub(super) fn predict_both<const VECTORS: bool>(
        &self,
        world: &World,
        pending: &Waiting,
        [i, j]: [u32; 2],
        [a, b]: &mut [Bounds; 2],
        work: &mut Work,
    ) -> [Entry; 2] {
        let fraction = self.plan.frame.fraction(world.now);
        let one = self.query::<VECTORS>(i, fraction, a, work);
        let other = self.query::<VECTORS>(j, fraction, b, work);
        let contacts = [Self::first(world, &one, work), Self::first(world, &other, work)];
        [
            self.decide::<VECTORS>(world, pending, &one, contacts[0], a, work),
            self.decide::<VECTORS>(world, pending, &other, contacts[1], b, work),
        ]
    }

    /// Bounds for the contacts of particle i.
    #[inline(always)]
    fn query<const VECTORS: bool>(
        &self,
        i: u32,
        fraction: f32,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> ListQuery<'_> {
        let (compact, list) = (&self.particles[i as usize], self.lists.of(i));
        work.candidates += list.len() as u64;
        let least =
            filter::bounds::<F, VECTORS>(&self.plan.frame, &self.particles, compact, fraction, list, bounds);
        ListQuery { i, fraction, compact, list, least }
    }

    /// The exact contact with the member that has the least bound [ticks].
    #[inline(always)]
    fn first(world: &World, query: &ListQuery, work: &mut Work) -> i64 {
        if query.least >= filter::NEVER {
            return narrow_phase::NEVER;
        }
        work.predictions += 1;
        let (i, j) = (query.i as usize, query.list[Bounds::lane(query.least)] as usize);
        narrow_phase::contact::<F>(world, &world.particles[i], &world.particles[j])
    }

    /// The next event of the particle of a query. `contact` is that with the member that has the least bound.
    #[inline(always)]
    fn decide<const VECTORS: bool>(
        &self,
        world: &World,
        pending: &Waiting,
        query: &ListQuery,
        contact: i64,
        bounds: &mut Bounds,
        work: &mut Work,
    ) -> Entry {
        let frame = &self.plan.frame;
        let &ListQuery { i, fraction, compact, list, least } = query;
        let particle = &world.particles[i as usize];
        let nothing = Entry::none(i, particle.count);
        let mut earliest = Earliest { entry: nothing, far: false };
        let mut within = NEVER;
        if least < filter::NEVER {
            let lane = Bounds::lane(least);
            Self::offer(world, &mut earliest, list[lane], contact);
            within = self.until(world, &earliest);
            let length = list.len().min(MASK_BITS);
            let mut others = bounds.up_to::<VECTORS>(length, within) & !(1 << lane);
            while others != 0 {
                let j = list[others.trailing_zeros() as usize];
                others &= others - 1;
                work.predictions += 1;
                let contact = narrow_phase::contact::<F>(world, particle, &world.particles[j as usize]);
                Self::offer(world, &mut earliest, j, contact);
            }
            within = self.until(world, &earliest);
        }
        if list.len() > MASK_BITS {
            self.query_rest::<VECTORS>(world, i, fraction, &mut earliest, bounds, work);
            within = self.until(world, &earliest);
        }
        let is_fixed = self.is_fixed(i);
        if F::GRAVITY && self.fixed_count > 0 {
            self.predict_fixed(world, pending, i, &mut earliest, work);
            within = self.until(world, &earliest).min(NEVER);
        }
        if !is_fixed && self.lists.has_walls() && self.lists.is_near_wall(i) {
            self.predict_walls(world, i, &mut earliest);
            within = self.until(world, &earliest).min(NEVER);
        }
        // An update of the list after the earliest event is not needed.
        let exit = if is_fixed { None } else { self.lists.exit::<F>(i, frame, compact, fraction, within) };
        if let Some(delay) = exit {
            let delay = f64::from(delay) / frame.per_tick;
            if delay > HORIZON {
                earliest.far = true;
            } else {
                let time = world.now + whole(delay);
                if time < earliest.entry.time {
                    return Entry { time, target: Target::new(UPDATE), ..nothing };
                }
            }
        }
        if earliest.far && earliest.entry.time > world.now + HORIZON as i64 {
            return Entry { time: world.now + HORIZON as i64, ..nothing };
        }
        earliest.entry
    }

    /// Offers a contact with particle j [ticks] as the earliest event.
    #[inline(always)]
    fn offer(world: &World, earliest: &mut Earliest<SearchEvent>, j: u32, contact: i64) {
        if contact < narrow_phase::FAR {
            let count = world.particles[j as usize].count;
            earliest.offer(contact, Target::new(SearchEvent::Collision(j)), count);
        } else {
            earliest.far |= contact == narrow_phase::FAR;
        }
    }

    /// Largest bound of a contact that can be before the earliest event known so far [spans].
    #[inline(always)]
    fn until(&self, world: &World, earliest: &Earliest<SearchEvent>) -> f32 {
        let ticks = earliest.entry.time.saturating_sub(world.now).max(0);
        filter::limit(ticks as f64 * self.plan.frame.per_tick)
    }

    /// Offers the contacts of a particle with the walls that it can touch before the earliest event.
    #[inline(never)]
    fn predict_walls(&self, world: &World, i: u32, earliest: &mut Earliest<SearchEvent>) {
        let particle = &world.particles[i as usize];
        let class = world.class(i);
        if class.inverse_mass == 0.0 {
            return;
        }
        let acceleration = if F::GRAVITY { world.gravity } else { DVec3::ZERO };
        let duration = earliest.entry.time.saturating_sub(particle.time) as f64 * world.clock.tick;
        let within = planes::searched(duration, world.clock.tick);
        self.planes.for_each_in_reach(world, particle, class.radius, acceleration, duration, |wall| {
            if let Some(delay) = world.wall_contact(particle, class.radius, acceleration, wall, within) {
                earliest.offer_after(particle.time, delay, SearchEvent::Wall(wall), 0);
            }
        });
    }

    /// Offers the contacts with the members of a long list beyond the first [`MASK_BITS`].
    #[cold]
    fn query_rest<const VECTORS: bool>(
        &self,
        world: &World,
        i: u32,
        fraction: f32,
        earliest: &mut Earliest<SearchEvent>,
        bounds: &mut Bounds,
        work: &mut Work,
    ) {
        for list in self.lists.of(i)[MASK_BITS..].chunks(MASK_BITS) {
            let compact = &self.particles[i as usize];
            // Without vector instructions, because this function is not compiled for them.
            filter::bounds::<F, false>(&self.plan.frame, &self.particles, compact, fraction, list, bounds);
            let mut others = bounds.up_to::<false>(list.len(), self.until(world, earliest).min(NEVER));
            while others != 0 {
                let j = list[others.trailing_zeros() as usize];
                others &= others - 1;
                work.predictions += 1;
                let (particle, partner) = (&world.particles[i as usize], &world.particles[j as usize]);
                Self::offer(world, earliest, j, narrow_phase::contact::<F>(world, particle, partner));
            }
        }
    }
}

/// Bounds for the contacts of particle i with the members of its list.
struct ListQuery<'a> {
    i: u32,
    /// The fraction of the span that has passed.
    fraction: f32,
    compact: &'a CompactParticle,
    list: &'a [u32],
    /// The least bound of the first [`MASK_BITS`].
    least: f32,
}
