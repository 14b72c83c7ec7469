//! Resolves collisions of particles: changes velocities, sets anchors and records losses.
//!
//! Impacts on walls are in [`crate::laws::wall_impact`].

use glam::DVec3;
use haff_mechanics::{Impact, work_of_moving_body};

use crate::{
    laws::{
        contact::{add_impact, check_velocity, touch},
        deforming,
        pair_law::{self, PairContact},
        rough::{self, RoughPair},
        series::{end_of_bounces_early, keep_support},
    },
    model::features::Features,
    motion::{drag, flights},
    numerics::error::EngineError,
    report::{EventKind, Exchange, Observer, Partner, VelocityChange, ledger::Term, row},
    state::{State, particle::ClassData, world::World},
};

/// An impact of two particles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PairImpact {
    /// In ascending order.
    bodies: [u32; 2],
    classes: [ClassData; 2],
    /// Positions at the contact.
    positions: [DVec3; 2],
    /// Velocities before and after the impact. Before it the second one is that of the image in contact.
    before: [DVec3; 2],
    after: [DVec3; 2],
    /// Unit vector from the first to the second, and the distance of their centers.
    n: DVec3,
    distance: f64,
    impact: Impact,
}

/// The impact of two particles at `time`: a function of their anchors. `rough` is for [`apply`].
///
/// # Errors
/// An overlap that is more than rounding, or a velocity that is not finite.
#[inline(always)]
pub(crate) fn collide<F: Features>(
    world: &World,
    bodies: [u32; 2],
    time: i64,
    rough: &mut RoughPair,
) -> Result<PairImpact, EngineError> {
    let (contact, [ri, rj]) = touch::<F>(world, bodies, time)?;
    let PairContact { bodies: [i, j], classes: [a, b], velocities: [wi, wj], distance, n, .. } = contact;
    let (ui, uj, impact) = pair_law::resolve::<F>(world, &contact);
    let [ui, mut uj] = if !F::ELASTIC && world.spin.is_some() {
        rough::velocities::<F>(world, [i, j], time, rough)
    } else {
        [ui, uj]
    };
    if F::DEFORMS {
        // Of the same image: where two are as near as each other, rounding would choose again.
        uj -= contact.image_velocity;
    }
    if a.inverse_mass != 0.0 {
        check_velocity(world, i, ui, time)?;
    }
    if b.inverse_mass != 0.0 {
        check_velocity(world, j, uj, time)?;
    }
    Ok(PairImpact {
        bodies: [i, j],
        classes: [a, b],
        positions: [ri, rj],
        before: [wi, wj],
        after: [ui, uj],
        n,
        distance,
        impact,
    })
}

/// Resolves the collision of two particles at `time`.
#[inline(always)]
pub(crate) fn collision<F: Features, const EVENTS: bool>(
    state: &mut State,
    [i, j]: [u32; 2],
    time: i64,
    observer: &mut dyn Observer,
) -> Result<(), EngineError> {
    if F::GRAVITY {
        end_of_bounces_early::<EVENTS>(state, i.min(j), time, observer);
        end_of_bounces_early::<EVENTS>(state, i.max(j), time, observer);
    }
    let mut rough = None;
    let impact = collide::<F>(&state.world, [i, j], time, &mut rough)?;
    apply::<F, EVENTS>(state, &impact, &rough, time, observer);
    Ok(())
}

/// Sets the anchors of two particles after their impact, and adds its energies.
#[inline(always)]
pub(crate) fn apply<F: Features, const EVENTS: bool>(
    state: &mut State,
    impact: &PairImpact,
    rough: &RoughPair,
    time: i64,
    observer: &mut dyn Observer,
) {
    let &PairImpact { bodies: [i, j], classes: [a, b], positions, before, after, n, distance, .. } = impact;
    let impact = impact.impact;
    if F::DAMPED {
        // Before the spins change.
        drag::end_flights(state, &[i, j], time);
    }
    let tangential = if !F::ELASTIC && state.world.spin.is_some() {
        Some(rough::apply_pair(state, rough, time))
    } else {
        None
    };
    if F::DEFORMS {
        let more = tangential.as_ref().map_or(DVec3::ZERO, |tangential| tangential.impulse);
        deforming::end_flights(state, [i, j], n * distance, n * impact.impulse + more, time);
    }
    if F::GRAVITY {
        flights::end(state, i, time);
        flights::end(state, j, time);
    }
    let world = &mut state.world;
    // A body of infinite mass keeps its anchor: its flight has not changed, so predictions with it stay
    // valid.
    if a.inverse_mass != 0.0 {
        let velocity = world.anchor_velocity::<F>(after[0], time);
        world.particles[i as usize].set_anchor(positions[0], velocity, time);
    }
    if b.inverse_mass != 0.0 {
        let velocity = world.anchor_velocity::<F>(after[1], time);
        world.particles[j as usize].set_anchor(positions[1], velocity, time);
    }
    if !F::ELASTIC && world.laws.contact_times.is_some() {
        world.note_contacts([i, j], time);
    }
    if F::REST {
        world.particles[i as usize].set_recently_hit(true);
        world.particles[j as usize].set_recently_hit(true);
    }
    let now = world.shown::<F>(time);
    if F::GRAVITY {
        keep_support(state, i, time);
        keep_support(state, j, time);
    }

    let accumulators = &mut state.accumulators;
    accumulators.counters.collisions += 1;
    // In a box that is compressed the volume at the impact counts.
    let virial = impact.impulse * distance;
    let virial = if F::DEFORMS { virial * state.world.pressure_weight(time) } else { virial };
    add_impact::<F>(accumulators, now, virial, &impact);
    if !F::UNIFORM {
        // The impulse on i is −J n, on j +J n.
        if a.inverse_mass == 0.0 {
            accumulators.counters.fixed_collisions += 1;
            accumulators.add_impulse(n * impact.impulse);
            accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, -n, before[0]));
        } else if b.inverse_mass == 0.0 {
            accumulators.counters.fixed_collisions += 1;
            accumulators.add_impulse(n * -impact.impulse);
            accumulators.add_energy(Term::WallWork, now, work_of_moving_body(impact.impulse, n, before[1]));
        }
    }
    if EVENTS {
        let change =
            |i, class: &ClassData, before, after| VelocityChange { i, mass: class.mass, before, after };
        let mut changes = [change(i, &a, before[0], after[0]), change(j, &b, before[1], after[1])];
        if F::DEFORMS {
            deforming::make_peculiar(&state.world, &mut changes, positions, n * distance, time);
        }
        let [ri, rj] = positions;
        let (changes, position, branch) = match (a.inverse_mass == 0.0, b.inverse_mass == 0.0) {
            (false, false) => (&changes[..], ri, n * distance),
            (false, true) => (&changes[..1], ri, n * distance),
            (true, _) => (&changes[1..], rj, n * -distance),
        };
        let partner = Partner::Particle { bodies: [i, j], position, branch };
        observer.exchange(&Exchange { time: now, changes, partner });
        let contact_point = state.world.wrap(ri + n * a.radius, time).0;
        let mut row = row(now, EventKind::Collision, [i, j], &impact, n, contact_point);
        if let Some(tangential) = tangential {
            tangential.add_to(&mut row);
        }
        observer.event(&row);
    }
}

impl PairImpact {
    /// The particles with their positions and velocities after the impact.
    #[inline(always)]
    pub fn after(&self) -> [(u32, DVec3, DVec3); 2] {
        [0, 1].map(|k| (self.bodies[k], self.positions[k], self.after[k]))
    }
}
