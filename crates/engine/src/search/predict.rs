//! Predictions of the next event of a particle. They do not change the state.
//!
//! A prediction is a pure function of two anchors (`gather`): the earlier anchor is moved to the later one's
//! time, the periodic image is an integer shift, and the kernel is even under exchange of the two. When, how
//! often and by which search a pair is predicted therefore does not matter, and this is why windows, lists,
//! cells, all pairs, SIMD paths, thread counts and resumed runs agree to the last bit. Event order is by
//! (time, kind, ids); entries of one tick whose partner has had another event are predicted again before the
//! first of that tick is taken (`Queue::next_tie`).

use std::collections::BTreeMap;

use glam::DVec3;
use haff_mechanics::{contact::CONTACT_NOISE, time_to_contact_accelerated};
use haff_neighbors::{Flight, Search, Shift};

use crate::{
    laws::slide,
    model::features::Features,
    motion::pair_flight::is_spurious_recontact,
    numerics::clock::{HORIZON, whole},
    search::{
        batch::{self, Batch, Kernel, LANES},
        carried,
        earliest::Earliest,
        entry::{Entry, Target},
        planes,
        search_event::SearchEvent,
    },
    state::{Pending, world::World},
};

/// The earliest physical event of a particle that first crosses into another cell.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BestEvent {
    time: i64,
    target: Target<SearchEvent>,
    partner_count: u32,
}

impl BestEvent {
    pub const NONE: Self = Self { time: i64::MAX, target: Target::NONE, partner_count: 0 };
}

/// The candidates of a prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    /// All candidates of the search.
    All,
    /// Those in the cells that are new neighbors after the crossing with this code. The earliest event with
    /// other candidates is kept.
    New(u8),
}

/// Working space of a prediction.
pub(crate) struct Scratch {
    batch: Batch,
    kernel: Kernel,
    /// Number of pair predictions.
    pub predictions: u64,
}

impl Scratch {
    pub fn new(kernel: Kernel) -> Self {
        Self { batch: Batch::new(), kernel, predictions: 0 }
    }

    pub fn kernel(&self) -> Kernel {
        self.kernel
    }
}

/// Predicts the next event of particle i from the present. If that is a crossing, returns the earliest
/// physical event, too.
#[inline(always)]
pub(crate) fn predict<F: Features, S: Search>(
    world: &World,
    search: &S,
    pending: &BTreeMap<u32, Pending>,
    i: u32,
    scope: Scope,
    best: BestEvent,
    scratch: &mut Scratch,
) -> (Entry<SearchEvent>, Option<BestEvent>) {
    let particle = &world.particles[i as usize];
    let nothing = Entry::none(i, particle.count);
    let mut earliest = Earliest { entry: nothing, far: false };

    let carrier = if F::GRAVITY { world.carrier(i) } else { None };
    if F::GRAVITY && particle.rests() {
        predict_support(world, pending, i, &mut earliest);
    }
    let position = |k: u32| world.flight::<F>(k, world.now).0;
    let owner = Owner::of::<F>(world, i);
    let visit = |j: u32, shift: Shift| gather::<F>(world, &owner, j, shift, scratch, &mut earliest);
    match scope {
        Scope::All => search.candidates(i, world.now, position, visit),
        Scope::New(code) => {
            search.new_candidates(i, code, world.now, position, visit);
            if best.time < i64::MAX {
                earliest.offer(best.time, best.target, best.partner_count);
            }
        }
    }
    flush::<F>(world, i, scratch, &mut earliest);

    // A crossing later than the earliest contact with a particle is not needed exactly.
    let within = earliest.entry.time.saturating_sub(world.now) as f64 * world.clock.tick;
    let crossing = match carrier {
        Some(wall) => carried::next_crossing::<F, S>(world, search, i, wall, within),
        None => search.next_crossing(i, &flight::<F>(world, i), within),
    };
    let mut crossing_time = i64::MAX;
    if let Some(crossing) = crossing {
        let delay = crossing.delay * world.clock.per_time;
        if delay > HORIZON {
            earliest.far = true;
        } else {
            crossing_time = world.now + whole(delay);
        }
    }

    // After a crossing all walls of the new cell are predicted.
    let walls = search.walls(i);
    if !walls.is_empty() {
        let until = crossing_time.min(earliest.entry.time);
        predict_walls::<F>(world, i, walls, until, &mut earliest);
    }

    if let Some(crossing) = crossing
        && crossing_time < earliest.entry.time
    {
        let Entry { time: best, target, partner_count, .. } = earliest.entry;
        let entry = Entry {
            time: crossing_time,
            target: Target::new(SearchEvent::Crossing(crossing.code)),
            ..nothing
        };
        return (entry, Some(BestEvent { time: best, target, partner_count }));
    }
    if earliest.far && earliest.entry.time > world.now + HORIZON as i64 {
        return (Entry { time: world.now + HORIZON as i64, ..nothing }, None);
    }
    (earliest.entry, None)
}

/// Offers what ends the rest of particle i on a wall, or the bounces or the slide that it counts as: the wall
/// leaves it, or their time is over.
pub(crate) fn predict_support(
    world: &World,
    pending: &BTreeMap<u32, Pending>,
    i: u32,
    earliest: &mut Earliest<SearchEvent>,
) {
    if let Some(wall) = world.carrier(i) {
        carried::predict_release(world, i, wall, earliest);
    }
    if let Some(rest) = pending.get(&i) {
        earliest.offer(rest.end, Target::new(SearchEvent::EndOfBounces), 0);
    }
    if let Some(end) = slide::end_of_slide(world, i) {
        earliest.offer(end, Target::new(SearchEvent::EndOfSlide), 0);
    }
}

/// The flight of particle i from its present state.
#[inline(always)]
pub(crate) fn flight<F: Features>(world: &World, i: u32) -> Flight {
    let (position, velocity) = world.flight::<F>(i, world.now);
    let acceleration = if F::GRAVITY { world.acceleration(i) } else { DVec3::ZERO };
    Flight { position, velocity, acceleration, now: world.now }
}

/// The particle whose partners are predicted: a copy of its data.
struct Owner {
    i: u32,
    position: DVec3,
    velocity: DVec3,
    time: i64,
    radius: f64,
    movable: bool,
    acceleration: DVec3,
    /// The wall that carries it.
    carrier: Option<u32>,
}

impl Owner {
    #[inline]
    fn of<F: Features>(world: &World, i: u32) -> Self {
        let particle = &world.particles[i as usize];
        let class = &world.classes[if F::UNIFORM { 0 } else { particle.class() }];
        Self {
            i,
            position: particle.position,
            velocity: particle.velocity,
            time: particle.time,
            radius: class.radius,
            movable: class.inverse_mass != 0.0,
            acceleration: if F::GRAVITY { world.acceleration(i) } else { DVec3::ZERO },
            carrier: if F::GRAVITY { world.carrier(i) } else { None },
        }
    }
}

/// A pair with one acceleration, at the later of its two anchors.
struct Pair {
    /// Relative position, j − i, of the image \[length\], and relative velocity [length/time].
    r: DVec3,
    v: DVec3,
    /// Contact distance [length].
    sigma: f64,
    /// Time of the later anchor, minus that of the anchor of the owner [ticks].
    offset: i64,
}

/// The relative flight of the owner and a candidate. Offers the contact at once, and returns `None`, for a
/// pair with different accelerations; offers nothing for two bodies that pass through each other.
#[inline(always)]
fn relative_flight<F: Features>(
    world: &World,
    a: &Owner,
    j: u32,
    shift: Shift,
    predictions: &mut u64,
    earliest: &mut Earliest<SearchEvent>,
) -> Option<Pair> {
    let b = &world.particles[j as usize];
    let partner_lag = a.time - b.time;
    let tick = world.clock.tick;
    let (dt_a, dt_b) = ((-partner_lag).max(0) as f64 * tick, partner_lag.max(0) as f64 * tick);
    let sigma = if F::UNIFORM {
        a.radius + a.radius
    } else {
        let class = &world.classes[b.class()];
        if !a.movable && class.inverse_mass == 0.0 && !(F::REST && can_driven_hit_asleep(world, a.i, j)) {
            return None; // Two bodies of infinite mass pass through each other.
        }
        a.radius + class.radius
    };
    let (mut ra, mut rb, va, vb);
    if F::GRAVITY {
        let acceleration = world.acceleration(j);
        ra = haff_mechanics::free_flight(a.position, a.velocity, a.acceleration, dt_a);
        rb = haff_mechanics::free_flight(b.position, b.velocity, acceleration, dt_b);
        va = haff_mechanics::free_flight_velocity(a.velocity, a.acceleration, dt_a);
        vb = haff_mechanics::free_flight_velocity(b.velocity, acceleration, dt_b);
        if world.boundary.carries {
            let carrier = world.carrier(j);
            if carrier != a.carrier {
                *predictions += 1;
                carried::predict_pair::<F>(world, [a.i, j], shift, sigma, a.time.max(b.time), earliest);
                return None;
            }
            if carrier.is_some() {
                // The same motion along the normal, which leaves the relative velocity as it is.
                let from = a.time.max(b.time);
                (ra, rb) = (world.flight::<F>(a.i, from).0, world.flight::<F>(j, from).0);
            }
        }
        if acceleration != a.acceleration {
            // Under gravity no boundary slides.
            let (r, v, relative_acceleration) =
                (world.boundary.periodicity.image(rb - ra, shift), vb - va, acceleration - a.acceleration);
            *predictions += 1;
            let from = a.time.max(b.time);
            if is_out_of_reach(
                r,
                v,
                relative_acceleration,
                sigma,
                (earliest.entry.time.saturating_sub(from)) as f64 * tick,
            ) {
                return None;
            }
            let contact_end =
                spurious_contact_time(r, v, relative_acceleration, sigma, va.length().max(vb.length()));
            let (r, v) = (
                r + (v + relative_acceleration * (0.5 * contact_end)) * contact_end,
                v + relative_acceleration * contact_end,
            );
            if let Some(delay) = time_to_contact_accelerated(r, v, relative_acceleration, sigma) {
                let delay = (contact_end + delay) * world.clock.per_time;
                earliest.offer_after(from, delay, SearchEvent::Collision(j), b.count);
            }
            return None;
        }
    } else {
        ra = haff_mechanics::drift(a.position, a.velocity, dt_a);
        rb = haff_mechanics::drift(b.position, b.velocity, dt_b);
        (va, vb) = (a.velocity, b.velocity);
    }
    let (r, v) = world.image::<F>(rb - ra, vb - va, shift, a.time.max(b.time));
    Some(Pair { r, v, sigma, offset: (-partner_lag).max(0) })
}

/// Offers the contact of the owner with one candidate, for the image that is nearest at present.
pub(crate) fn predict_nearest<F: Features>(
    world: &World,
    i: u32,
    j: u32,
    predictions: &mut u64,
    earliest: &mut Earliest<SearchEvent>,
) {
    let [a, b] = [i, j].map(|k| world.flight::<F>(k, world.now).0);
    let shift = [0, 1, 2].map(|axis| -world.boundary.periodicity.turns((b - a)[axis], axis) as i32);
    let owner = Owner::of::<F>(world, i);
    let Some(pair) = relative_flight::<F>(world, &owner, j, shift, predictions, earliest) else { return };
    *predictions += 1;
    let Pair { r, v, sigma, offset } = pair;
    let delay = batch::delay(r.to_array(), v.to_array(), sigma * sigma);
    let from = owner.time + offset;
    let speed = || [i, j].map(|k| world.flight::<F>(k, from).1.length()).into_iter().fold(0.0, f64::max);
    if delay < f64::INFINITY && !is_spurious_recontact(r, v, sigma * sigma, speed) {
        let count = world.particles[j as usize].count;
        earliest.offer_after(from, delay * world.clock.per_time, SearchEvent::Collision(j), count);
    }
}

/// Adds a candidate to the batch. A pair with different accelerations is predicted at once.
#[inline(always)]
fn gather<F: Features>(
    world: &World,
    a: &Owner,
    j: u32,
    shift: Shift,
    scratch: &mut Scratch,
    earliest: &mut Earliest<SearchEvent>,
) {
    let pair = relative_flight::<F>(world, a, j, shift, &mut scratch.predictions, earliest);
    let Some(Pair { r, v, sigma, offset }) = pair else { return };
    if scratch.batch.len >= LANES {
        flush::<F>(world, a.i, scratch, earliest);
    }
    let batch = &mut scratch.batch;
    // Below `LANES` by the test above; the mask spares the checks.
    let k = batch.len % LANES;
    batch.r[0][k] = r.x;
    batch.r[1][k] = r.y;
    batch.r[2][k] = r.z;
    batch.v[0][k] = v.x;
    batch.v[1][k] = v.y;
    batch.v[2][k] = v.z;
    batch.sigma2[k] = sigma * sigma;
    batch.offset[k] = offset;
    batch.id[k] = j;
    batch.len = k + 1;
}

/// Whether one of two bodies of infinite mass is an asleep particle and the other a driven body, which can
/// hit it.
fn can_driven_hit_asleep(world: &World, i: u32, j: u32) -> bool {
    let moves = |k: u32| world.particles[k as usize].velocity != DVec3::ZERO;
    world.is_asleep(i) != world.is_asleep(j) && (moves(i) || moves(j))
}

/// The duration of a spurious contact \[time\]: of a pair that touches, approaches no faster than the
/// rounding of its velocities, and is separated by its relative acceleration. After this time the pair
/// recedes. 0 for any other pair.
///
/// Whether such a pair has a gap or an overlap of one ulp depends on rounding. Its times are rounded again
/// when the tick of the clock changes, and a contact that is found only then would be in the past.
#[inline]
fn spurious_contact_time(r: DVec3, v: DVec3, relative_acceleration: DVec3, sigma: f64, speed: f64) -> f64 {
    let outward = v.length_squared() + r.dot(relative_acceleration);
    let spurious = outward > 0.0 && r.dot(v) < 0.0 && is_spurious_recontact(r, v, sigma * sigma, || speed);
    if !spurious {
        return 0.0;
    }
    // After this time r·v has changed from a rounding error below zero to one above.
    let time = 2.0 * CONTACT_NOISE * r.length() * speed / outward;
    // If the relative acceleration is too weak for that, the contact is predicted.
    if speed * time <= MAX_SEPARATING_PATH * sigma { time } else { 0.0 }
}

/// Whether two bodies cannot touch within `time`, by a bound on their relative path from relative speed and
/// acceleration, with a margin for rounding.
#[inline]
fn is_out_of_reach(r: DVec3, v: DVec3, a: DVec3, sigma: f64, time: f64) -> bool {
    let path = (v.length() + 0.5 * a.length() * time) * time;
    let reach = sigma + path * (1.0 + 1e-6) + 1e-9 * sigma;
    r.length_squared() > reach * reach
}

/// Predicts the batch, offers its earliest contact, and clears it.
#[inline]
fn flush<F: Features>(world: &World, i: u32, scratch: &mut Scratch, earliest: &mut Earliest<SearchEvent>) {
    let batch = &mut scratch.batch;
    if batch.len == 0 {
        return;
    }
    scratch.predictions += batch.len as u64;
    batch.predict(scratch.kernel);
    let per_time = world.clock.per_time;
    loop {
        let mut least = f64::INFINITY;
        for k in 0..batch.len {
            least = least.min(batch.offset[k] as f64 + batch.delay[k] * per_time);
        }
        if least == f64::INFINITY {
            break;
        }
        // These sums are rounded: all contacts that can be the earliest within rounding are offered, and
        // their exact times are compared.
        let bound = least * (1.0 + 4.0 * f64::EPSILON) + 2.0;
        let due = |batch: &Batch, k: usize| batch.offset[k] as f64 + batch.delay[k] * per_time <= bound;
        let mut any_spurious = false;
        for k in 0..batch.len {
            if due(batch, k) && is_batched_recontact::<F>(world, i, batch, k) {
                batch.delay[k] = f64::INFINITY;
                any_spurious = true;
            }
        }
        if any_spurious {
            continue;
        }
        let from = world.particles[i as usize].time;
        for k in 0..batch.len {
            if due(batch, k) {
                let j = batch.id[k];
                let count = world.particles[j as usize].count;
                earliest.offer_after(
                    from + batch.offset[k],
                    batch.delay[k] * per_time,
                    SearchEvent::Collision(j),
                    count,
                );
            }
        }
        break;
    }
    batch.len = 0;
}

/// Longest path of a pair during a spurious contact [contact distances].
const MAX_SEPARATING_PATH: f64 = 1e-13;

/// [`is_spurious_recontact`] for a candidate of a batch.
#[inline]
fn is_batched_recontact<F: Features>(world: &World, i: u32, batch: &Batch, k: usize) -> bool {
    let vector = |a: &[[f64; LANES]; 3]| DVec3::new(a[0][k], a[1][k], a[2][k]);
    let ticks = world.particles[i as usize].time + batch.offset[k];
    let speed = |body: u32| world.flight::<F>(body, ticks).1.length();
    let larger = || speed(i).max(speed(batch.id[k]));
    is_spurious_recontact(vector(&batch.r), vector(&batch.v), batch.sigma2[k], larger)
}

/// Offers the contacts of particle i with walls, predicted from its anchor: those until a time [ticks], and
/// perhaps some later ones.
#[inline]
pub(crate) fn predict_walls<F: Features>(
    world: &World,
    i: u32,
    walls: &[u16],
    until: i64,
    earliest: &mut Earliest<SearchEvent>,
) {
    let particle = &world.particles[i as usize];
    let class = world.class(i);
    let asleep = F::REST && world.is_asleep(i);
    if class.inverse_mass == 0.0 && !asleep {
        return;
    }
    let acceleration = if F::GRAVITY { world.acceleration(i) } else { DVec3::ZERO };
    let support = if F::GRAVITY { world.support(i) } else { [None; 3] };
    let duration = until.saturating_sub(particle.time) as f64 * world.clock.tick;
    let within = planes::searched(duration, world.clock.tick);
    for &wall in walls {
        if F::GRAVITY && support.contains(&Some(wall)) {
            continue;
        }
        // Its flight changes at impacts of others: `pistons.rs` predicts these contacts.
        if F::PISTONS && world.is_piston(u32::from(wall)) {
            continue;
        }
        if F::GRAVITY
            && let Some(carrier) = world.carrier(i)
            && carried::predict_wall::<F>(world, i, carrier, (u32::from(wall), particle.time), earliest)
        {
            continue;
        }
        if asleep && !world.boundary.walls[usize::from(wall)].motion.is_moving() {
            continue;
        }
        let wall = u32::from(wall);
        if let Some(delay) = world.wall_contact(particle, class.radius, acceleration, wall, within) {
            earliest.offer_after(particle.time, delay, SearchEvent::Wall(wall), 0);
        }
    }
}
