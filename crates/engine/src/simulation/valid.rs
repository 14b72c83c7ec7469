//! Checks of a checkpoint before the engine uses it. A checksum only proves that a file is unchanged since it
//! was written, not that its values form a possible state.
//!
//! Each bound is either one that no run can exceed, or far wider than rounding errors. A checkpoint that the
//! engine has written is never rejected.

use glam::DVec3;

use crate::{
    measure::totals::{Totals, ledger},
    model::{Boundary, Dimension, System},
    numerics::{
        clock::{Clock, EPOCH, OLDEST_ANCHOR},
        error::EngineError,
        instant::Instant,
        sum::Sum,
    },
    report::{Checkpoint, Counters},
    simulation::run::open_axes,
    state::{Pending, State, accumulators::Accumulators, slide::Slide, world::World},
    support::{geometry::geometry, overlap},
};

/// Largest coordinate and velocity: their squares must be finite. Scenes allow up to 1e50.
const MAX_MAGNITUDE: f64 = 1e150;
/// Least distance of an image number from the limits of its type, so that a run can continue.
const SPARE_IMAGES: u32 = 1 << 24;
/// Largest overlap [contact distances]. Rounding causes up to 1e-12.
const MAX_OVERLAP: f64 = 1e-3;
/// Largest overlap due to the rounding of coordinates, relative to the largest coordinate.
const COORDINATE_ERROR: f64 = 1e-12;
/// Largest residual of the energy balance, relative to its largest term. Rounding causes up to 1e-12.
const MAX_RESIDUAL: f64 = 1e-3;
/// Largest excess of the clock's exponent over the exponent for the present speeds. The exponent is chosen at
/// the start of an epoch, which lasts 64 crossing times. Speeds do not change by a factor of 2^100 in that
/// time.
const MAX_EXPONENT_EXCESS: i32 = 100;

/// Returns an error unless a condition holds.
fn require(holds: bool, what: impl FnOnce() -> String) -> Result<(), EngineError> {
    if holds { Ok(()) } else { Err(EngineError::Checkpoint(what())) }
}

/// Checks that a number is finite and in [low, high].
fn within(name: &str, value: f64, low: f64, high: f64) -> Result<(), EngineError> {
    let inside = value.is_finite() && low <= value && value <= high;
    require(inside, || match (low == f64::MIN, high == f64::MAX) {
        (true, true) => format!("{name} = {value:?} must be a finite number"),
        (false, true) => format!("{name} = {value:?} must be a finite number, at least {low:?}"),
        _ => format!("{name} = {value:?} must be in [{low:?}, {high:?}]"),
    })
}

fn finite(name: &str, value: f64) -> Result<(), EngineError> {
    within(name, value, f64::MIN, f64::MAX)
}

fn at_least_zero(name: &str, value: f64) -> Result<(), EngineError> {
    within(name, value, 0.0, f64::MAX)
}

/// Checks and returns the exponent of the clock.
pub(crate) fn exponent(bits: u64) -> Result<i32, EngineError> {
    let found = bits as i64;
    let exponent = found.clamp(-1000, 900) as i32;
    require(i64::from(exponent) == found, || format!("clock.exponent = {found} must be in [-1000, 900]"))?;
    Ok(exponent)
}

/// Checks the clock, the present tick and the present time after a number of epochs.
pub(crate) fn clock(clock: &Clock, now: i64, time: f64, epochs: u64) -> Result<(), EngineError> {
    count("epochs", epochs)?;
    // In the first epoch the base is zero.
    let base = if epochs == 0 { 0.0 } else { f64::MAX };
    within("clock.base", clock.base, 0.0, base)?;
    // Each epoch adds at most half an ulp.
    let low = f64::EPSILON * clock.base * epochs as f64;
    within("clock.base_low", clock.base_low, -low, low)?;
    let start = tolerance(clock, clock.base);
    within("clock.earliest", clock.earliest, 0.0, clock.base + start)?;
    require((0..=EPOCH).contains(&now), || format!("clock.now = {now} must be in [0, {EPOCH}] ticks"))?;
    let expected = clock.shown(now);
    let tolerance = tolerance(clock, time);
    within("clock.time", time, expected - tolerance, expected + tolerance)
}

/// Largest difference between a time and the time of its nearest tick [time].
fn tolerance(clock: &Clock, time: f64) -> f64 {
    clock.tick + 16.0 * f64::EPSILON * (time.abs() + clock.base)
}

fn count(name: &str, count: u64) -> Result<(), EngineError> {
    require(count <= Counters::MOST, || format!("{name} = {count} must be at most {}", Counters::MOST))
}

/// Checks the values of each particle against the scene and the present tick of `world`.
pub(crate) fn particles(system: &System, world: &World, checkpoint: &Checkpoint) -> Result<(), EngineError> {
    let now = world.now;
    let flat = system.dimension == Dimension::Two;
    for i in 0..system.bodies.len() {
        let (position, velocity) = (checkpoint.position[i], checkpoint.velocity[i]);
        for (name, vector) in [("position", position), ("velocity", velocity)] {
            require(vector.is_finite() && vector.abs().max_element() <= MAX_MAGNITUDE, || {
                format!("{name}[{i}] = {vector:?} must be finite, at most {MAX_MAGNITUDE:e} in size")
            })?;
            require(!flat || vector.z == 0.0, || {
                format!("{name}[{i}] = {vector:?} must have z = 0 in two dimensions")
            })?;
        }
        if let Some(spin) = checkpoint.angular_velocity.get(i) {
            require(spin.is_finite() && spin.abs().max_element() <= MAX_MAGNITUDE, || {
                format!("angular_velocity[{i}] = {spin:?} must be finite, at most {MAX_MAGNITUDE:e} in size")
            })?;
            require(!flat || (spin.x, spin.y) == (0.0, 0.0), || {
                format!("angular_velocity[{i}] = {spin:?} must be along z in two dimensions")
            })?;
        }
        let anchor = checkpoint.anchor[i];
        require((-OLDEST_ANCHOR..=now).contains(&anchor), || {
            format!("anchor[{i}] = {anchor} must be in [{}, {now}] ticks, now at the latest", -OLDEST_ANCHOR)
        })?;
        let rounding = if world.boundary.deformation.is_some() { 4.0 * f64::EPSILON } else { 0.0 };
        let edges = world.periodicity(anchor).size * (1.0 + rounding);
        for axis in 0..3 {
            // The box at the time of the anchor, which may be that of another epoch.
            let (x, size) = (position[axis], edges[axis]);
            let (image, initial) = (checkpoint.image[i][axis], system.bodies[i].image[axis]);
            if system.domain.boundary[axis] == Boundary::Periodic {
                require((0.0..=size).contains(&x), || {
                    format!("position[{i}][{axis}] = {x} must be in [0, {size}), a periodic axis")
                })?;
                let most = i32::MAX.unsigned_abs() - SPARE_IMAGES;
                require(image.unsigned_abs() <= most, || {
                    format!("image[{i}][{axis}] = {image} must be in [-{most}, {most}]")
                })?;
            } else {
                require(image == initial, || {
                    format!("image[{i}][{axis}] = {image} must be {initial}: the axis is not periodic")
                })?;
            }
        }
    }
    Ok(())
}

/// Checks the numbers of entries and exits so far, and of exits up to the last sample, for this number of
/// particles that are there.
pub(crate) fn passages(
    system: &System,
    count: usize,
    [entered, left, left_before]: [u64; 3],
) -> Result<(), EngineError> {
    let start = system.flow.as_ref().map_or(0, |flow| flow.present) as u64;
    require(start.checked_add(entered).and_then(|all| all.checked_sub(left)) == Some(count as u64), || {
        format!("{count} particles are there, of {start} at the start, {entered} entries and {left} exits")
    })?;
    require(left_before <= left, || format!("flow.left_before = {left_before} must be at most {left}"))
}

/// Checks the flights of pistons.
pub(crate) fn pistons(world: &World) -> Result<(), EngineError> {
    let now = world.clock.instant(world.now);
    for (wall, piston) in world.pistons() {
        let Instant { high, low } = piston.since;
        within(&format!("piston.{wall}.since"), high, 0.0, now.high)?;
        within(&format!("piston.{wall}.since_low"), low, -f64::EPSILON * high, f64::EPSILON * high)?;
        require(piston.since <= now, || format!("piston.{wall}: its flight must have begun by now"))?;
        let (displacement, speed) = piston.at(now);
        let least = f64::EPSILON * piston.displacement.abs();
        within(&format!("piston.{wall}.displacement_low"), piston.displacement_low, -least, least)?;
        for (name, value) in piston.flight()[..3]
            .iter()
            .copied()
            .chain([("displacement now", displacement), ("speed now", speed)])
        {
            within(&format!("piston.{wall}.{name}"), value, -MAX_MAGNITUDE, MAX_MAGNITUDE)?;
        }
    }
    Ok(())
}

/// Checks the walls and flags of particle i, which were decoded from `code`.
pub(crate) fn support(
    world: &World,
    i: u32,
    code: u64,
    asleep: bool,
    recently_hit: bool,
) -> Result<(), EngineError> {
    let refuse = |what: &str| Err(EngineError::Checkpoint(format!("resting[{i}] = {code}: {what}")));
    if (asleep || recently_hit) && world.laws.thresholds.is_none() {
        return refuse("the scene has no contact.rest_speed, so no grain can be asleep");
    }
    let body = world.body(i);
    if asleep && (body.inverse_mass == 0.0 || world.particles[i as usize].velocity != DVec3::ZERO) {
        return refuse("only a grain of finite mass and without velocity can be asleep");
    }
    let walls: Vec<u16> = world.support(i).into_iter().flatten().collect();
    if walls.is_empty() {
        return Ok(());
    }
    let moves = |wall: &u16| world.boundary.walls[usize::from(*wall)].motion.is_moving();
    if world.boundary.carries
        && world.laws.thresholds.is_none()
        && !asleep
        && let Some(carrier) = world.carrier(i)
        && walls[1..].iter().all(|wall| !moves(wall) && world.are_perpendicular(carrier, u32::from(*wall)))
        && (walls.len() == 1 || world.gravity != DVec3::ZERO)
    {
        return Ok(());
    }
    if asleep || body.inverse_mass == 0.0 || world.gravity == DVec3::ZERO {
        return refuse("what is asleep, or feels no gravity, rests on no wall");
    }
    if walls.iter().any(moves) {
        return refuse(
            "nothing rests on a wall that moves, unless it oscillates and all other walls that support the \
             particle are at rest and perpendicular to it",
        );
    }
    Ok(())
}

/// Checks a completed series of bounces that has not ended yet.
pub(crate) fn pending(world: &World, i: u32, rest: &Pending) -> Result<(), EngineError> {
    let name = |part: &str| format!("rest.{i}.{part}");
    let particles = world.particles.len();
    require((i as usize) < particles, || format!("rest.{i}: there are {particles} particles"))?;
    require(world.support(i).iter().flatten().any(|&wall| u32::from(wall) == rest.wall), || {
        format!("rest.{i}.wall = {} must be a wall that particle {i} rests on", rest.wall)
    })?;
    let (end, now) = (rest.end, world.now);
    require(end >= now, || format!("{} = {end} must not be before now, {now} ticks", name("end")))?;
    at_least_zero(&name("speed"), rest.speed)?;
    at_least_zero(&name("impulse"), rest.impulse)?;
    finite(&name("energy_loss"), rest.energy_loss)?;
    finite(&name("tangential_loss"), rest.tangential_loss)?;
    require(rest.tangential.is_finite(), || format!("{} must be finite", name("tangential")))?;
    finite(&name("carnot_energy"), rest.carnot_energy)
}

/// Checks the friction on particle i.
pub(crate) fn slide(world: &World, i: u32, slide: &Slide) -> Result<(), EngineError> {
    let (particles, now) = (world.particles.len(), world.now);
    require((i as usize) < particles, || format!("slide.{i}: there are {particles} particles"))?;
    require(world.spin.is_some(), || format!("slide.{i}: the scene has no spin"))?;
    require(world.support(i) == [u16::try_from(slide.wall).ok(), None, None], || {
        format!("slide.{i}.wall = {} must be the only wall that particle {i} rests on", slide.wall)
    })?;
    require((0..=now).contains(&slide.since), || {
        format!("slide.{i}.since = {} must be in [0, {now}] ticks", slide.since)
    })?;
    let end = slide.end.unwrap_or(now);
    require(end >= now, || format!("slide.{i}.end = {end} must not be before now, {now} ticks"))?;
    at_least_zero(&format!("slide.{i}.lost"), slide.lost)?;
    for (name, vector) in slide.vectors() {
        require(vector.is_finite(), || format!("slide.{i}.{name} = {vector:?} must be finite"))?;
    }
    Ok(())
}

/// Checks each sum and counter; `time` is the present.
pub(crate) fn accumulators(
    accumulators: &mut Accumulators,
    clock: &Clock,
    time: f64,
) -> Result<(), EngineError> {
    accumulators
        .counters
        .check(accumulators.sampled_collisions, accumulators.sampled_flights)
        .map_err(EngineError::Checkpoint)?;
    let [kinetic, potential] = accumulators.initial_energy;
    at_least_zero("initial_kinetic", kinetic)?;
    finite("initial_potential", potential)?;
    at_least_zero("max_overlap", accumulators.max_overlap)?;
    within("sampled_at", accumulators.sampled_at, 0.0, time + tolerance(clock, time))?;
    within("center.until", accumulators.center.until, 0.0, time + tolerance(clock, time))?;
    totals("center.momentum", &accumulators.center.momentum)?;
    for (k, sum) in accumulators.center.integrals.energy.iter().enumerate() {
        total(&format!("center.energy.{k}"), sum)?;
    }
    totals("center.path", &accumulators.center.integrals.path)?;
    if let Some(flights) = &accumulators.flights {
        let Instant { high, low } = flights.until;
        within("flights.until.high", high, 0.0, time + tolerance(clock, time))?;
        within("flights.until.low", low, -f64::EPSILON * high, f64::EPSILON * high)?;
        total("flights.sampled", &flights.sampled)?;
    }
    for (name, sum) in accumulators.sums_mut() {
        finite(name, sum.value())?;
    }
    Ok(())
}

fn totals(name: &str, sums: &[Sum; 3]) -> Result<(), EngineError> {
    for (axis, sum) in ["x", "y", "z"].into_iter().zip(sums) {
        total(&format!("{name}.{axis}"), sum)?;
    }
    Ok(())
}

fn total(name: &str, sum: &Sum) -> Result<(), EngineError> {
    finite(&format!("{name}.high"), sum.high)?;
    finite(&format!("{name}.low"), sum.low)?;
    finite(name, sum.value())
}

/// Checks the state as a whole, after its parts: present positions, overlaps and the energy balance.
pub(crate) fn whole(system: &System, state: &State, time: f64) -> Result<(), EngineError> {
    at_least_zero("longest_flight", state.world.resolution.longest_flight)?;
    at_least_zero("clock.extent", state.world.resolution.extent)?;
    at_least_zero("clock.fastest", state.world.resolution.fastest)?;
    let State { world, accumulators, settling, .. } = state;
    let now = world.now;
    if world.laws.thresholds.is_some() {
        let next = settling.next;
        require(next >= now, || format!("settling.next = {next} must not be before now, {now} ticks"))?;
        let since = settling.counted_since;
        require(since <= now, || format!("settling.counted_since = {since} must be at most {now} ticks"))?;
        count("settling.waited", settling.waited)?;
        count("settling.recent_contacts", settling.recent_contacts)?;
        require(settling.events == u64::MAX || settling.events <= Counters::MOST, || {
            format!("settling.events = {} must be at most {}", settling.events, Counters::MOST)
        })?;
    }
    let stall = &state.stall;
    require(stall.since <= now, || format!("stall.since = {} must be at most {now} ticks", stall.since))?;
    count("stall.events", stall.events)?;
    for (what, members, count) in [
        ("particle", &stall.particles, world.particles.len()),
        ("wall", &stall.walls, world.boundary.walls.len()),
    ] {
        require(members.last().is_none_or(|&last| (last as usize) < count), || {
            format!("stall.{what}.{} is unknown: the scene has {count}", members.last().unwrap_or(&0))
        })?;
    }
    totals("force", &world.force.total)?;
    totals("force_impulse", &world.force.impulse)?;
    within("force_until", world.force.until, 0.0, time + tolerance(&world.clock, time))?;

    let mut farthest: f64 = 0.0;
    let mut smallest = f64::INFINITY;
    for i in 0..world.particles.len() as u32 {
        let (position, velocity) = world.state(i, now);
        let size = position.abs().max_element();
        require(position.is_finite() && velocity.is_finite() && size <= MAX_MAGNITUDE, || {
            format!("particle {i} would be at {position:?} now, at the velocity {velocity:?}")
        })?;
        farthest = farthest.max(size);
        smallest = smallest.min(world.class(i).radius);
    }
    let extent = world.extent(open_axes(system));
    let speed = world.largest_speed(extent);
    let (found, suitable) = (world.clock.exponent, world.exponent_for(extent, speed));
    require(speed == 0.0 || found <= suitable.saturating_add(MAX_EXPONENT_EXCESS), || {
        format!("clock.exponent = {found}: the tick is far too coarse, {suitable} would suit these speeds")
    })?;

    let walls = world.boundary.walls.iter().map(|wall| {
        let shift = wall.motion.displacement(wall.normal, Instant::at(time));
        if wall.shape.is_some() {
            return (wall.coordinates() + shift.abs()).max_element();
        }
        (wall.point + shift).abs().max_element()
    });
    let farthest = walls.fold(farthest.max(extent), f64::max);
    let deepest = overlap::deepest(world, &geometry(system, world, f64::INFINITY)).deepest;
    let depth = deepest.depth;
    require(depth <= MAX_OVERLAP + COORDINATE_ERROR * farthest / smallest, || {
        let (i, partner) = deepest.pair.unwrap_or_default();
        let partner = partner.map_or("a wall".to_owned(), |j| format!("particle {j}"));
        format!("particle {i} and {partner} would overlap by {depth:e} contact distances")
    })?;

    let ledger = ledger(state, &Totals::of(world));
    at_least_zero("the kinetic energy", ledger.kinetic)?;
    finite("the potential energy", ledger.potential)?;
    let (residual, kinetic) = (ledger.residual, ledger.kinetic);
    require(residual.abs() <= MAX_RESIDUAL, || {
        format!("energies do not balance: {residual:e} of them is missing, with the kinetic energy {kinetic}")
    })?;
    // Losses may be negative: a law may have added energy, also one that the run has had before. The balance
    // holds them to the other energies.
    finite("dissipated", ledger.dissipated)?;
    let [first, start] = accumulators.initial_energy;
    let energies = [first, start, kinetic, ledger.potential].into_iter().chain(ledger.terms);
    let scale = energies.fold(0.0, |scale: f64, energy| scale.max(energy.abs()));
    within("carnot", ledger.carnot, -1e-6 * scale, f64::MAX)
}
