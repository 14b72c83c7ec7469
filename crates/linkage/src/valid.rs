//! Checks of a checkpoint before a simulation is restored from it, as in the granular engine.
//!
//! Each bound is either one that no run can violate, or far wider than rounding errors. A checkpoint written
//! by the simulation always passes.

use glam::DVec3;
use haff_engine::{Checkpoint, Counters, Dimension, Instant, Sum};

use crate::{error::LinkageError, mechanism::Link, model::Tether, simulation::Simulation, world::World};

/// Largest coordinate and velocity: their squares must be finite. Scenes allow 1e50.
const FARTHEST: f64 = 1e150;
/// Largest relative deviation of lengths of strings and rods, of contact distances and of the energy balance.
/// Rounding causes 1e-12.
const PART: f64 = 1e-3;
/// Deviation due to the rounding of coordinates, as a part of the largest coordinate.
const COORDINATE: f64 = 1e-12;

/// An error unless the condition is true.
fn require(holds: bool, what: impl FnOnce() -> String) -> Result<(), LinkageError> {
    if holds { Ok(()) } else { Err(LinkageError::Checkpoint(what())) }
}

fn finite(name: &str, value: f64) -> Result<(), LinkageError> {
    require(value.is_finite(), || format!("{name} = {value} must be a finite number"))
}

fn at_least_zero(name: &str, value: f64) -> Result<(), LinkageError> {
    require(value.is_finite() && value >= 0.0, || format!("{name} = {value} must be a finite number ≥ 0"))
}

fn vector(name: impl Fn() -> String, vector: DVec3) -> Result<(), LinkageError> {
    require(vector.is_finite() && vector.abs().max_element() <= FARTHEST, || {
        format!("{} = {vector:?} must be finite, at most {FARTHEST:e} in size", name())
    })
}

/// Checks that an instant is in [from, to], and that its low part is a rounding error.
fn instant(name: &str, at: Instant, [from, to]: [Instant; 2]) -> Result<(), LinkageError> {
    let rounding = f64::EPSILON * at.high.abs();
    require(at.low.is_finite() && at.low.abs() <= rounding, || {
        format!("{name}.low = {} must be the rounding of {}", at.low, at.high)
    })?;
    require(at.high.is_finite() && from <= at && at <= to, || {
        format!("{name} = {} must be in [{}, {}]", at.high, from.high, to.high)
    })
}

/// Checks the count of events without progress of time.
pub(crate) fn stall((since, events): (Instant, u64), now: Instant) -> Result<(), LinkageError> {
    instant("stall.since", since, [Instant::ZERO, now])?;
    require(events <= Counters::MOST, || {
        format!("stall.events = {events} must be at most {}", Counters::MOST)
    })
}

/// Checks the arrays: their lengths, and each value. Those used only by the granular engine are zero.
pub(crate) fn arrays(checkpoint: &Checkpoint, n: usize) -> Result<(), LinkageError> {
    let Checkpoint { position, velocity, anchor, image, count, resting, .. } = checkpoint;
    let lengths = [position.len(), velocity.len(), anchor.len(), image.len(), count.len(), resting.len()];
    require(lengths == [n; 6], || format!("the scene has {n} particles, it has {lengths:?}"))?;
    for i in 0..n {
        vector(|| format!("position[{i}]"), position[i])?;
        vector(|| format!("velocity[{i}]"), velocity[i])?;
        let zero = (anchor[i], image[i], count[i], resting[i]) == (0, [0; 3], 0, 0);
        require(zero, || {
            format!(
                "anchor[{i}] = {}, image[{i}] = {:?}, count[{i}] = {}, resting[{i}] = {} must be zero",
                anchor[i], image[i], count[i], resting[i]
            )
        })?;
    }
    Ok(())
}

/// Checks a flight: its key, its start and the present, the first step of its motion, its bodies and its
/// links.
pub(crate) fn flight(
    world: &World,
    flight_key: u64,
    [start, now]: [Instant; 2],
    hint: f64,
    bodies: &[usize],
    links: &[Link],
) -> Result<(), LinkageError> {
    let name = format!("flight.{flight_key}");
    instant(&format!("{name}.start"), start, [Instant::ZERO, now])?;
    at_least_zero(&format!("{name}.hint"), hint)?;
    require(bodies.first().is_some_and(|&first| first as u64 == flight_key), || {
        format!("{name}.body = {bodies:?} must begin with {flight_key}")
    })?;
    require(bodies.is_sorted_by(|a, b| a < b), || {
        format!("{name}.body = {bodies:?} must be in ascending order")
    })?;
    for &link in links {
        // All movable bodies of a link are on the same flight.
        let linked = world.particles_of(link).into_iter().map(|i| world.body[i]);
        let away = linked.clone().find(|&body| !world.immovable(body) && !bodies.contains(&body));
        require(away.is_none() && linked.clone().any(|body| bodies.contains(&body)), || {
            format!("{name}.row: {link:?} must hold bodies of the flight, {bodies:?}")
        })?;
    }
    let immovable = bodies.iter().any(|&body| world.immovable(body));
    require(!immovable || (bodies.len() == 1 && links.is_empty()), || {
        format!("{name}.body = {bodies:?}: a body of infinite mass has a flight of its own")
    })
}

/// Checks that every body is on exactly one flight.
pub(crate) fn bodies_in_flight<'a>(
    world: &World,
    flying: impl Iterator<Item = &'a usize>,
) -> Result<(), LinkageError> {
    let mut flights = vec![0; world.count()];
    flying.for_each(|&body| flights[body] += 1);
    for (i, flights) in flights.into_iter().enumerate() {
        let expected = usize::from(world.body[i] == i);
        require(flights == expected, || {
            format!(
                "body.{i} = {}: body {i} is in {flights} flights and must be in {expected}",
                world.body[i]
            )
        })?;
    }
    Ok(())
}

/// Checks everything but the flights.
pub(crate) fn state(world: &World, time: f64) -> Result<(), LinkageError> {
    let now = world.now;
    instant("now", now, [Instant::ZERO, Instant::at(f64::MAX)])?;
    let rounding = 16.0 * f64::EPSILON * now.high;
    require((time - now.high).abs() <= rounding, || {
        format!("clock.time = {time} must be {}, the time of now", now.high)
    })?;
    for i in 0..world.count() {
        let body = world.body[i];
        require(body <= i && world.body[body] == body, || {
            format!("body.{i} = {body} must be the first particle of a body")
        })?;
        vector(|| format!("offset.{i}"), world.offset[i])?;
        finite(&format!("excess.{i}"), world.excess[i])?;
        require(body != i || world.offset[i] == DVec3::ZERO, || {
            format!("offset.{i} = {:?} must be zero: particle {i} is the first of its body", world.offset[i])
        })?;
    }
    for (link, axis) in &world.closed {
        let length = axis.length();
        require(length == 0.0 || (length - 1.0).abs() <= PART, || {
            format!("closed: the normal of {link:?} = {axis:?} must be a unit vector or zero")
        })?;
        require(matches!(link, Link::Pair(..) | Link::Wall(..)), || {
            format!("closed: {link:?} is not a contact")
        })?;
    }
    for (link, rest) in &world.pending {
        require(matches!(link, Link::Pair(..) | Link::Wall(..) | Link::Tether(_)), || {
            format!("rest: {link:?} is not a contact")
        })?;
        let name = format!("rest of {link:?}");
        instant(&format!("{name}, end"), rest.end, [now, Instant::at(f64::MAX)])?;
        at_least_zero(&format!("{name}, speed"), rest.speed)?;
        at_least_zero(&format!("{name}, impulse"), rest.impulse)?;
        finite(&format!("{name}, energy_loss"), rest.energy_loss)?;
        finite(&format!("{name}, carnot_energy"), rest.carnot_energy)?;
    }
    instant("released.at", world.released.0, [Instant::ZERO, now])?;
    for (link, burst) in &world.bursts {
        require(matches!(link, Link::Pair(..) | Link::Wall(..)), || {
            format!("burst: {link:?} is not a contact")
        })?;
        let name = format!("burst of {link:?}");
        instant(&format!("{name}, at"), burst.at, [Instant::ZERO, now])?;
        at_least_zero(&format!("{name}, speed"), burst.speed)?;
        require(burst.impacts <= Counters::MOST, || {
            format!("{name}, impacts = {} must be at most {}", burst.impacts, Counters::MOST)
        })?;
    }
    accumulators(world, time)
}

fn accumulators(world: &World, time: f64) -> Result<(), LinkageError> {
    let accumulators = &world.accumulators;
    accumulators
        .counters
        .check(accumulators.sampled_collisions, accumulators.sampled_flights)
        .map_err(LinkageError::Checkpoint)?;
    let at = accumulators.sampled_at;
    require(0.0 <= at && at <= time * (1.0 + 16.0 * f64::EPSILON), || {
        format!("sampled_at = {at} must be in [0, {time}]")
    })?;
    at_least_zero("initial_kinetic", accumulators.initial_kinetic)?;
    finite("initial_potential", accumulators.initial_potential)?;
    at_least_zero("max_overlap", accumulators.max_overlap)?;
    let total = |name: &str, sum: &Sum| {
        finite(&format!("{name}.high"), sum.high)?;
        finite(&format!("{name}.low"), sum.low)
    };
    total("dissipated", &accumulators.dissipated)?;
    total("carnot", &accumulators.carnot)?;
    total("work", &accumulators.work)?;
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
        total(&format!("impulse.{axis}"), &accumulators.impulse[k])?;
        total(&format!("moment.{axis}"), &accumulators.moment[k])?;
    }
    Ok(())
}

/// Checks the world as a whole, after its parts: present positions, lengths, overlaps and the energy balance.
pub(crate) fn whole(world: World) -> Result<World, LinkageError> {
    let now = world.now;
    for flight in world.flights.iter() {
        let flight_key = flight.bodies[0];
        let end = flight.end();
        require(end >= now, || {
            format!("flight.{flight_key} would have ended at {}, and now is {}", end.high, now.high)
        })?;
    }
    let mut farthest = world.length;
    for i in 0..world.count() {
        let (position, velocity) = world.state(i, now);
        let size = position.abs().max_element();
        require(position.is_finite() && velocity.is_finite() && size <= FARTHEST, || {
            format!("particle {i} would be at {position:?} now, at the velocity {velocity:?}")
        })?;
        require(
            world.system.dimension == Dimension::Three || position.z.abs() <= PART * world.length,
            || format!("particle {i} would be at {position:?} now: it must have z = 0 in two dimensions"),
        )?;
        farthest = farthest.max(size);
    }
    let rounding = COORDINATE * farthest;
    // At the start of a flight and now: motions along an arc keep the length, whatever their start.
    let start = |i: usize| world.anchor[world.body[i]].0 + world.offset[i];
    let present = |i: usize| world.state(i, now).0;
    for (p, pendulum) in world.joints.pendulums.iter().enumerate() {
        let (bob, length) = (pendulum.bob, pendulum.length);
        let fixed = pendulum.tether == Tether::Rod || world.taut[p];
        let slack = PART * length + rounding;
        for position in [start(bob), present(bob)] {
            let distance = (position - pendulum.pivot).length();
            require(distance <= length + slack && (!fixed || distance >= length - slack), || {
                format!("the bob of pendulum {p} would be {distance} from its pivot, its length is {length}")
            })?;
        }
    }
    for (r, rod) in world.joints.rods.iter().enumerate() {
        let [a, b] = rod.ends;
        let together = world.flight_key[world.body[a]] == world.flight_key[world.body[b]];
        let starts = together.then(|| start(a) - start(b));
        for apart in [present(a) - present(b)].into_iter().chain(starts) {
            let (distance, length) = (apart.length(), rod.length);
            require((distance - length).abs() <= PART * length + rounding, || {
                format!("the ends of rod {r} would be {distance} apart, its length is {length}")
            })?;
        }
    }
    let smallest = world.radius.iter().copied().filter(|&radius| radius > 0.0).fold(f64::INFINITY, f64::min);
    let (depth, _) = world.overlaps();
    require(depth <= PART + rounding / smallest, || {
        format!("particles would overlap each other or walls by {depth:e} contact distances")
    })?;
    let simulation = Simulation::without_predictions(world);
    let ledger = simulation.ledger();
    at_least_zero("the kinetic energy", ledger.kinetic)?;
    finite("the potential energy", ledger.potential)?;
    let residual = ledger.residual;
    require(residual.abs() <= PART, || {
        format!(
            "energies do not balance: {residual:e} of them is missing, with the kinetic energy {}",
            ledger.kinetic
        )
    })?;
    let energies =
        [ledger.kinetic, ledger.potential, ledger.supplied(), simulation.world.accumulators.initial_kinetic];
    let scale = energies.iter().fold(0.0, |scale: f64, energy| scale.max(energy.abs()));
    for (name, sum) in [("dissipated", ledger.dissipated), ("carnot", ledger.carnot)] {
        require(sum.is_finite() && sum >= -1e-6 * scale, || format!("{name} = {sum} must not be negative"))?;
    }
    Ok(simulation.world)
}
