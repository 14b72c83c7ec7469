/*!
Friction on a grain that a wall supports: it slides, and then rolls.

With the weight m p towards the wall, the component a of gravity along it, the slip s of the surface of the
grain over the wall and Coulomb's coefficient μ, friction gives the grain the acceleration f:

```text
sliding   f = −μ p s/|s|        ds/dt = a + f (1 + 1/q)
rolling   f = −a/(1 + 1/q)      s = 0, while |f| ≤ μ p
          dω/dt = −n × f/(q R)  n: normal of the wall, towards the grain
```

On a level wall, a = 0, and where s is parallel to a, both are flights of constant acceleration, and the slip
ends at t = |s|/|ds/dt|: a ball without spin rolls from 2 v/(7 μ g) on, at 5/7 of its speed v. If s is oblique
to a, the direction of f turns. The slide is then a sequence of short ones, each with the direction of its
middle; the error of a slide is of the order of [`TURN`]².

Without a bound of friction (β alone) the slip is taken at once. Friction acts on grains that one wall
supports, which neither moves nor carries them.
*/

use glam::DVec3;
use haff_mechanics::{Impact, RoughBody, Roughness, TangentialImpact, slip_velocity, tangential_impact};

use crate::{
    motion::flights,
    numerics::clock::{HORIZON, whole},
    report::{EventKind, Observer, row},
    state::{State, slide::Slide, world::World},
};

/// A slip below this fraction of the speeds that it is the difference of is rounding error.
const NOISE: f64 = 16.0 * f64::EPSILON;
/// Gravity along a wall below this fraction of gravity is rounding error.
const LEVEL: f64 = 1e-13;
/// Angle by which a slide may turn \[rad\].
const TURN: f64 = 2e-3;
/// A slide that turns ends when its slip is below this fraction of the speeds that it is the difference of.
const TURNED: f64 = 1e-9;

/// When particle i ends to slide [ticks].
pub(crate) fn end_of_slide(world: &World, i: u32) -> Option<i64> {
    world.spin.as_ref()?.slides.get(&i)?.end
}

impl World {
    /// Particle i and a wall at rest as bodies in a contact.
    fn bodies_on_wall(&self, i: u32, ticks: i64) -> Option<[RoughBody; 2]> {
        let spins = self.spin.as_deref()?;
        let (_, velocity) = self.state(i, ticks);
        let angular_velocity = self.angular_velocity(i, ticks);
        let body = RoughBody { angular_velocity, ..spins.body(i, self.class(i), velocity, 1.0) };
        let wall =
            RoughBody { velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO, inverse_mass: 0.0, ..body };
        Some([body, RoughBody { radius: 0.0, ..wall }])
    }

    /// Adds the force of friction on particle i from `ticks` on, or takes it off (`sign` −1).
    fn change_friction(&mut self, i: u32, slide: &Slide, sign: f64, ticks: i64) {
        let force = slide.friction * (sign * self.class(i).mass);
        if force != DVec3::ZERO {
            let time = self.clock.shown(ticks);
            self.force.change(force, time);
            if let Some(sums) = &mut self.boundary.wall_sums {
                sums.change_support([(slide.wall as u16, force)].into_iter(), 1.0, time);
            }
        }
    }
}

/// The friction on particle i from `time` on, if a wall supports it that is rough.
fn friction_on(state: &State, i: u32, time: i64) -> Option<Slide> {
    let world = &state.world;
    let spins = world.spin.as_deref()?;
    let [Some(wall), None, None] = world.support(i) else { return None };
    let wall = u32::from(wall);
    let law = world.roughness(spins, i, wall);
    if state.pending.contains_key(&i) || world.carrier(i).is_some() || law.is_smooth() {
        return None;
    }
    let n = world.boundary.walls[wall as usize].normal;
    let pressure = -world.gravity.dot(n);
    if pressure <= 0.0 {
        return None;
    }
    let limit = law.friction * pressure;
    let [body, floor] = world.bodies_on_wall(i, time)?;
    let slip = slip_velocity(&body, &floor, -n);
    let (speed, scale) =
        (slip.length(), body.velocity.length() + body.radius * body.angular_velocity.length());
    let along = world.acceleration(i);
    let along = if along.length() <= LEVEL * world.gravity.length() { DVec3::ZERO } else { along };
    let stiffness = 1.0 + 1.0 / body.inertia;
    let slide = |friction: DVec3, end: Option<(f64, bool)>| {
        // No component along the normal, not even by rounding: the grain would leave the wall.
        let friction = friction - n * friction.dot(n);
        let end = end.filter(|(ticks, _)| *ticks < f64::INFINITY).map(|(delay, rolls)| {
            let ticks = delay * world.clock.per_time;
            (time + whole(ticks.min(HORIZON)), rolls && ticks <= HORIZON)
        });
        Slide {
            wall,
            since: time,
            end: end.map(|(end, _)| end),
            rolls: end.is_some_and(|(_, rolls)| rolls),
            friction,
            slip: if speed <= NOISE * scale { DVec3::ZERO } else { slip },
            slip_rate: along + friction * stiffness,
            spin_rate: n.cross(friction) * (-1.0 / (body.inertia * body.radius)),
            lost: 0.0,
            given: DVec3::ZERO,
        }
    };
    if speed <= NOISE * scale {
        let holding = along.length() / stiffness;
        return if along == DVec3::ZERO {
            None
        } else if holding < limit {
            // A grain that rolls does not slip, not even by rounding.
            Some(Slide { slip_rate: DVec3::ZERO, ..slide(-along / stiffness, None) })
        } else {
            Some(slide(-along.normalize_or_zero() * limit, None))
        };
    }
    if limit == f64::INFINITY {
        return Some(Slide { slip_rate: DVec3::ZERO, ..slide(DVec3::ZERO, Some((0.0, true))) });
    }
    let direction = slip / speed;
    let parallel = along.dot(direction);
    let across = along - direction * parallel;
    if across.length() <= LEVEL * world.gravity.length() {
        let rate = limit * stiffness - parallel;
        let end = if rate > 0.0 { Some((speed / rate, true)) } else { None };
        return Some(slide(-direction * limit, end));
    }
    if speed <= TURNED * scale {
        return Some(Slide { slip_rate: DVec3::ZERO, ..slide(DVec3::ZERO, Some((0.0, true))) });
    }
    // Neither the direction nor the speed may change much within a step.
    let step = TURN * speed / across.length().max(0.1 * limit * stiffness).max(0.1 * parallel.abs());
    let middle = slip + (along - direction * (limit * stiffness)) * (0.5 * step);
    Some(slide(-middle.normalize_or_zero() * limit, Some((step, false))))
}

/// Begins the friction on particle i at `time`, if a rough wall supports it: its anchor is moved there.
pub(crate) fn begin(state: &mut State, i: u32, time: i64) {
    let Some(spins) = &state.world.spin else { return };
    if !state.world.particles[i as usize].rests() || spins.slides.contains_key(&i) {
        return;
    }
    if let Some(slide) = friction_on(state, i, time) {
        insert(state, i, slide, time);
    }
}

fn insert(state: &mut State, i: u32, slide: Slide, time: i64) {
    flights::end(state, i, time);
    let world = &mut state.world;
    // Also if the anchor is at this time: what has been predicted since, without friction, must not count.
    let (position, velocity) = world.state(i, time);
    world.particles[i as usize].set_anchor(position, velocity, time);
    world.note_contact(i, time);
    world.change_friction(i, &slide, 1.0, time);
    if let Some(spins) = &mut world.spin {
        spins.slides.insert(i, slide);
    }
}

/// Ends the friction on particle i at `time`: its anchor is moved there. Returns the slide.
fn remove(state: &mut State, i: u32, time: i64) -> Option<Slide> {
    let slide = *state.world.spin.as_ref()?.slides.get(&i)?;
    flights::end(state, i, time);
    let world = &mut state.world;
    let (position, velocity) = world.state(i, time);
    let angular_velocity = world.angular_velocity(i, time);
    world.change_friction(i, &slide, -1.0, time);
    if let Some(spins) = &mut world.spin {
        spins.slides.remove(&i);
        spins.angular_velocity[i as usize] = angular_velocity;
    }
    world.particles[i as usize].set_anchor(position, velocity, time);
    world.note_contact(i, time);
    Some(slide)
}

/// Takes what is left of the slip of particle i: rounding, or all of it if friction has no bound.
fn stick(state: &mut State, i: u32, slide: &Slide, time: i64) -> TangentialImpact {
    let world = &mut state.world;
    let Some([body, floor]) = world.bodies_on_wall(i, time) else { return TangentialImpact::default() };
    let n = -world.boundary.walls[slide.wall as usize].normal;
    let law = Roughness { tangential_restitution: 0.0, friction: f64::INFINITY };
    let last = tangential_impact(&body, &floor, n, 0.0, law);
    world.particles[i as usize].velocity = body.velocity - last.impulse * body.inverse_mass;
    if let Some(spins) = &mut world.spin {
        spins.angular_velocity[i as usize] = body.angular_velocity + last.spin_changes[0];
    }
    world.add_wall_impulse(slide.wall, -last.impulse);
    state.accumulators.add_impulse(-last.impulse);
    last
}

/// Records what friction has taken from particle i, in a slide that ended at `time` with the impulse `last`.
fn record<const EVENTS: bool>(
    state: &mut State,
    i: u32,
    slide: &Slide,
    last: &TangentialImpact,
    time: i64,
    observer: &mut dyn Observer,
) {
    let world = &mut state.world;
    let mass = world.class(i).mass;
    let energy_loss = mass * slide.loss(&world.clock, time) + last.energy_loss;
    let now = world.clock.shown(time);
    state.accumulators.add_losses(now, energy_loss, last.carnot_energy);
    world.add_wall_heat(slide.wall, -energy_loss);
    if EVENTS && slide.slips() {
        let n = -world.boundary.walls[slide.wall as usize].normal;
        let position = world.particles[i as usize].position + n * world.class(i).radius;
        let impact = Impact { energy_loss, carnot_energy: last.carnot_energy, ..Impact::default() };
        let place = world.boundary.periodicity.wrap(position).0;
        let mut row = row(now, EventKind::Slide, [i, slide.wall], &impact, n, place);
        row.impulse_vector = last.impulse - slide.impulse(&world.clock, time) * mass;
        row.tangential_loss = energy_loss;
        observer.event(&row);
    }
}

/// Ends the friction on particle i before another event at `time`.
pub(crate) fn interrupt<const EVENTS: bool>(
    state: &mut State,
    i: u32,
    time: i64,
    observer: &mut dyn Observer,
) {
    if let Some(slide) = remove(state, i, time) {
        record::<EVENTS>(state, i, &slide, &TangentialImpact::default(), time, observer);
    }
}

/// The event at the end of a slide: the grain rolls from now on, or slides on in another direction.
pub(crate) fn end<const EVENTS: bool>(state: &mut State, i: u32, time: i64, observer: &mut dyn Observer) {
    let Some(slide) = remove(state, i, time) else { return };
    if slide.rolls {
        let last = stick(state, i, &slide, time);
        record::<EVENTS>(state, i, &slide, &last, time, observer);
        return begin(state, i, time);
    }
    let before = slide.moved_to(&state.world.clock, time);
    let next = friction_on(state, i, time);
    if let Some(next) = next.filter(Slide::slips) {
        return insert(state, i, Slide { lost: before.lost, given: before.given, ..next }, time);
    }
    record::<EVENTS>(state, i, &slide, &TangentialImpact::default(), time, observer);
    if let Some(next) = next {
        insert(state, i, next, time);
    }
}
