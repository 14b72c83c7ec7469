//! Impacts of particles on walls.

use glam::DVec3;
use haff_mechanics::{
    Impact, NormalContact, Restitution, random::Draw, reduced_mass, resolve_contact, work_of_moving_body,
};

use crate::{
    laws::{
        carried,
        contact::{add_impact, check_velocity},
        hop,
        pair_law::{coefficient, impact_with_separation, random_bits},
        resting,
        rough::{self, RoughWall},
        series::{come_to_rest, end_of_bounces_early, keep_support, keep_supporting_walls},
        slide,
        wall_contact::{WallContact, touch_wall},
    },
    model::{features::Features, thermal::ThermalWall, wall_law::WallLaw, wall_motion::WallMotion},
    motion::{drag, flights},
    numerics::error::EngineError,
    report::{EventKind, Exchange, Observer, Partner, VelocityChange, ledger::Term, row},
    state::{State, world::World},
};

/// Resolves the collision of particle i with a wall at `time`.
#[inline]
pub(crate) fn wall<F: Features, const EVENTS: bool>(
    state: &mut State,
    i: u32,
    wall: u32,
    time: i64,
    observer: &mut dyn Observer,
) -> Result<(), EngineError> {
    if F::GRAVITY {
        end_of_bounces_early::<EVENTS>(state, i, time, observer);
    }
    let mut rough = None;
    let (contact, outcome) = collide_with_wall::<F>(&state.world, i, wall, time, &mut rough)?;
    apply_wall::<F, EVENTS>(state, &contact, &outcome, &rough, observer);
    Ok(())
}

/// Sets the anchor of a particle after its impact on a wall, and adds the energies of the impact.
#[inline(always)]
pub(crate) fn apply_wall<F: Features, const EVENTS: bool>(
    state: &mut State,
    contact: &WallContact,
    outcome: &WallOutcome,
    rough: &RoughWall,
    observer: &mut dyn Observer,
) {
    match outcome {
        WallOutcome::Bounce(bounce) => apply_bounce::<F, EVENTS>(state, contact, bounce, rough, observer),
        WallOutcome::Reflection { velocity, spin } => {
            reflect::<EVENTS>(state, contact, (*velocity, *spin), Term::WallHeat, observer);
        }
    }
}

/// The impact of particle i on a wall at `time`: a function of its anchor. `rough` is for [`apply_wall`].
/// Not inlined, so that it is compiled once for the loops of all searches.
///
/// # Errors
/// An overlap that is more than rounding, or a velocity that is not finite.
#[inline(never)]
pub(crate) fn collide_with_wall<F: Features>(
    world: &World,
    i: u32,
    wall: u32,
    time: i64,
    rough: &mut RoughWall,
) -> Result<(WallContact, WallOutcome), EngineError> {
    let contact = touch_wall::<F>(world, i, wall, time)?;
    let class = *world.class(i);
    let law = match world.wall_law(&class, wall) {
        WallLaw::Restitution(law) => Ok(law),
        // Nothing predicts such a contact.
        WallLaw::Passes => Err(WallOutcome::Reflection { velocity: contact.velocity, spin: None }),
        WallLaw::Thermal(law) => thermal_reflection(world, &contact, &law).map_or(Ok(law.restitution), Err),
    };
    let outcome = match law {
        Ok(law) => WallOutcome::Bounce(bounce::<F>(world, &contact, law, rough)),
        Err(reflection) => reflection,
    };
    check_velocity(world, i, outcome.velocity(), time)?;
    if F::PISTONS
        && let WallOutcome::Bounce(bounce) = &outcome
        && let Some(piston) = world.piston(wall)
    {
        check_velocity(
            world,
            i,
            contact.wall_velocity + contact.n * (bounce.impact.impulse / piston.mass),
            time,
        )?;
    }
    Ok((contact, outcome))
}

/// The reflection from a thermal wall; `None` if this one is not thermal.
fn thermal_reflection(world: &World, contact: &WallContact, law: &ThermalWall) -> Option<WallOutcome> {
    let &WallContact { i, n, wall_velocity, .. } = contact;
    let class = world.class(i);
    let draw = Draw::new(world.seed, world.id(i), u64::from(world.particles[i as usize].count));
    let relative = law.velocity(draw, class.mass, n, world.dimension)?;
    let spin = world.spin.as_deref().map(|spins| {
        let moment = class.moment_of_inertia(&spins.inertia);
        law.angular_velocity(draw, moment, world.dimension)
    });
    Some(WallOutcome::Reflection { velocity: wall_velocity + relative, spin })
}

impl WallOutcome {
    /// The velocity after the impact.
    pub fn velocity(&self) -> DVec3 {
        match self {
            Self::Bounce(bounce) => bounce.after,
            Self::Reflection { velocity, .. } => *velocity,
        }
    }
}

/// What a wall does with a particle.
#[derive(Debug, Clone, Copy)]
pub(crate) enum WallOutcome {
    Bounce(WallBounce),
    /// The particle leaves a thermal wall with this velocity and, if there is spin, this angular velocity.
    Reflection {
        velocity: DVec3,
        spin: Option<DVec3>,
    },
}

/// An impact on a wall by a law of restitution.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WallBounce {
    law: Restitution,
    /// Velocity after the impact.
    after: DVec3,
    impact: Impact,
    /// Whether the impact repeats a recent one, see [`resting::is_repeated_wall_contact`].
    repeated: bool,
}

/// The impact of a particle on a wall by a law of restitution.
#[inline(always)]
fn bounce<F: Features>(
    world: &World,
    contact: &WallContact,
    law: Restitution,
    rough: &mut RoughWall,
) -> WallBounce {
    let &WallContact { i, wall, time, velocity, n, wall_velocity, .. } = contact;
    let class = world.class(i);
    let speed = haff_mechanics::approach_speed(velocity, wall_velocity, n);
    let of_wall = if F::PISTONS { world.inverse_wall_mass(wall) } else { 0.0 };
    let inverse_masses = [class.inverse_mass, of_wall];
    let (mass, radius) = (class.mass, class.radius);
    let details = move || NormalContact {
        approach_speed: speed,
        reduced_mass: reduced_mass(mass, of_wall.recip()),
        reduced_radius: radius,
        random: random_bits(world, &[i], Some(wall), time),
    };
    let e = coefficient::<F>(world, law, speed, time, [i, i], [class.inverse_mass; 2], details);
    let mut repeated = false;
    // Resolved as for two spheres, without assuming |n| = 1: the length of a tilted normal has a rounding
    // error, which is the same at every impact.
    let (after, _, impact) = if F::REST {
        let acceleration = world.acceleration(i).dot(n);
        repeated = resting::is_repeated_wall_contact(world, i, wall, speed, acceleration, time);
        let separation =
            if repeated { resting::separation_speed(world, e, speed, acceleration, true) } else { e * speed };
        impact_with_separation([velocity, wall_velocity], inverse_masses, n, e, speed, separation)
    } else if F::GRAVITY
        && let Some(acceleration) = hop::acceleration_to_wall(world, i, wall, time)
    {
        let separation = hop::separation_speed(e, speed, acceleration, class.radius);
        impact_with_separation([velocity, wall_velocity], inverse_masses, n, e, speed, separation)
    } else {
        resolve_contact(velocity, wall_velocity, class.inverse_mass, of_wall, n, e)
    };
    let after = if !F::ELASTIC && world.spin.is_some() {
        rough::wall_velocity::<F>(world, (i, wall, time), after, impact.impulse, rough)
    } else {
        after
    };
    WallBounce { law, after, impact, repeated }
}

/// Lets a particle leave a wall with a given velocity and spin. The energy that is not work of the moving
/// wall is added to `term`.
pub(crate) fn reflect<const EVENTS: bool>(
    state: &mut State,
    contact: &WallContact,
    (velocity, spin): (DVec3, Option<DVec3>),
    term: Term,
    observer: &mut dyn Observer,
) {
    let &WallContact { i, wall, time, position, n, wall_velocity, .. } = contact;
    let change = velocity - contact.velocity;
    let (before, after) = (contact.velocity - wall_velocity, velocity - wall_velocity);
    let class = *state.world.class(i);
    flights::end(state, i, time);
    state.world.set_anchor(i, position, velocity, time);
    state.world.note_contact(i, time);
    let now = state.world.clock.shown(time);
    if let Some(spin) = spin {
        let energy = state.world.set_spin(i, spin, time);
        state.accumulators.add_rotation(term, energy);
        state.world.add_wall_heat(wall, energy);
    }
    let accumulators = &mut state.accumulators;
    accumulators.counters.wall_collisions += 1;
    accumulators.add_energy(term, now, 0.5 * class.mass * change.dot(before + after));
    if wall_velocity != DVec3::ZERO {
        accumulators.add_energy(Term::WallWork, now, class.mass * change.dot(wall_velocity));
    }
    accumulators.add_impulse(change * class.mass);
    let heat = 0.5 * class.mass * change.dot(before + after);
    state.world.add_from_wall(wall, change * class.mass, heat);
    if EVENTS {
        let changes = [VelocityChange { i, mass: class.mass, before: contact.velocity, after: velocity }];
        observer.exchange(&Exchange { time: now, changes: &changes, partner: Partner::Wall(wall) });
        // Only the normal components. The energy of `term` is not a loss by restitution.
        let approach_speed = before.dot(n);
        let impulse = -class.mass * change.dot(n);
        let impact = Impact { approach_speed, impulse, ..Impact::default() };
        let contact_point = state.world.wrap(position + n * class.radius, time).0;
        let mut row = row(now, EventKind::Wall, [i, wall], &impact, n, contact_point);
        row.impulse_vector = change * -class.mass;
        observer.event(&row);
    }
    keep_support(state, i, time);
}

/// Sets the anchor of a particle after its impact on a wall, and adds the energies of the impact.
#[inline(always)]
fn apply_bounce<F: Features, const EVENTS: bool>(
    state: &mut State,
    contact: &WallContact,
    bounce: &WallBounce,
    rough: &RoughWall,
    observer: &mut dyn Observer,
) {
    let &WallContact { i, wall, time, position, velocity, n, wall_velocity } = contact;
    let &WallBounce { law, after, impact, repeated } = bounce;
    if F::DAMPED {
        // Before the spin changes.
        drag::end_flights(state, &[i], time);
    }
    let tangential =
        if !F::ELASTIC && state.world.spin.is_some() { Some(rough::apply_wall(state, rough)) } else { None };
    if F::GRAVITY || F::DEFORMS {
        flights::end(state, i, time);
    }
    let world = &mut state.world;
    let class = *world.class(i);
    let before = if F::GRAVITY { (world.support(i), world.acceleration(i)) } else { Default::default() };
    // A fixed or driven body that a piston strikes: nothing changes its flight.
    let is_struck = F::PISTONS && class.inverse_mass == 0.0;
    if !is_struck {
        let velocity = world.anchor_velocity::<F>(after, time);
        world.particles[i as usize].set_anchor(position, velocity, time);
    }
    if !F::ELASTIC {
        world.note_contact(i, time);
    }
    if F::REST {
        world.particles[i as usize].set_recently_hit(repeated);
    }

    let now = world.shown::<F>(time);
    let accumulators = &mut state.accumulators;
    accumulators.counters.wall_collisions += 1;
    add_impact::<F>(accumulators, now, 0.0, &impact);
    if !is_struck {
        accumulators.add_impulse(n * -impact.impulse);
    }
    world.add_from_wall(wall, n * -impact.impulse, -impact.energy_loss);
    if F::PISTONS && world.is_piston(wall) {
        // Its energy is part of the balance: only that of a driven body is from outside.
        world.push_piston(wall, n * impact.impulse, time);
        if is_struck && velocity != DVec3::ZERO {
            accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, -n, velocity));
        }
    } else if wall_velocity != DVec3::ZERO {
        accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, n, wall_velocity));
    }
    if EVENTS {
        let changes = [VelocityChange { i, mass: class.mass, before: velocity, after }];
        let changes = if is_struck { &[] } else { &changes[..] };
        observer.exchange(&Exchange { time: now, changes, partner: Partner::Wall(wall) });
        let contact_point = world.wrap(position + n * class.radius, time).0;
        let mut row = row(now, EventKind::Wall, [i, wall], &impact, n, contact_point);
        if let Some(tangential) = &tangential {
            tangential.add_to(&mut row);
        }
        observer.event(&row);
    }
    if F::GRAVITY {
        keep_supporting_walls(state, i, time);
        // Supports have the normal of the wall: no grain rests on a partition, or on a curved surface.
        let can_rest = state.world.boundary.walls[wall as usize].shape.is_none();
        if can_rest && !repeated && state.world.wall_law(&class, wall).has_series() {
            let rest = match state.world.boundary.walls[wall as usize].motion {
                WallMotion::Fixed => come_to_rest(state, i, wall, law, before, time),
                WallMotion::Oscillating(_) => carried::start(state, i, wall, law, time),
                WallMotion::Constant(_)
                | WallMotion::Rotating(_)
                | WallMotion::Piston(_)
                | WallMotion::Shrinking(_) => None,
            };
            if let Some(rest) = rest {
                state.pending.insert(i, rest);
            }
            slide::begin(state, i, time);
        }
    }
}
