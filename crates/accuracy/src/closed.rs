/*!
Scenes with closed-form solutions, evaluated in high precision from the same numbers that a method starts
with.
*/

use glam::DVec3;
use haff_engine::{Boundary, System};

use crate::{
    Error,
    big::{Big, BigVec, big, nearest, twice},
    reference::{Reference, Rounding},
    scenes::{add_sphere, add_wall, empty},
};

/// A scene and the exact state of its particles at one time.
#[derive(Debug, Clone)]
pub struct ClosedForm {
    /// Short name for tables.
    pub name: &'static str,
    /// Description in one line.
    pub description: String,
    /// The initial state.
    pub system: System,
    /// Time of the solution [time].
    pub time: f64,
    /// Exact centres, unwrapped [length].
    pub position: Vec<BigVec>,
    /// Exact velocities [length/time].
    pub velocity: Vec<BigVec>,
    /// Time in which the fastest sphere moves by its diameter [time]: the natural unit of a step or a
    /// contact.
    pub time_scale: f64,
}

/// Bits of the solutions.
pub const BITS: usize = 256;

/// All scenes of this module.
pub fn all() -> Vec<ClosedForm> {
    vec![bouncing_ball(10), billiard(1000), oblique_impact(0.8), chain(10)]
}

fn number(x: f64) -> Big {
    big(x, BITS)
}

/// Problem 2.1: a ball dropped on a floor, e = 0.9, halfway between two bounces after `bounces` of them.
///
/// Between the k-th bounce and the next the ball leaves the floor at e^k √(2gH).
pub fn bouncing_ball(bounces: u32) -> ClosedForm {
    let (e, g, radius, height) = (0.9, 1.0, 0.5, 2.0);
    let mut system = empty(DVec3::splat(8.0), [Boundary::Open; 3], 1.0, e);
    system.domain.gravity = DVec3::new(0.0, 0.0, -g);
    add_wall(&mut system, "floor", DVec3::ZERO, DVec3::Z, e);
    // Shifted to one side: there is no obstacle, and the sideways flight is checked, too.
    let start = DVec3::new(1.0, 2.0, radius + height);
    let drift = DVec3::new(0.25, -0.125, 0.0);
    add_sphere(&mut system, radius, 1.0, start, drift);
    let (e, g, height) = (number(e), number(g), number(height));
    // t_k = √(2H/g) (1 + 2 Σ_{m=1}^{k−1} e^m), v_k = e^k √(2gH)
    let fall = (twice(&height) / &g).sqrt();
    let mut sum = number(1.0);
    let mut power = number(1.0);
    for _ in 1..bounces {
        power = &power * &e;
        sum = &sum + twice(&power);
    }
    let bounced = &fall * &sum;
    let speed = power * &e * twice(&(&height * &g)).sqrt();
    // A third of the time to the next bounce, as an f64.
    let time = nearest(&(&bounced + twice(&speed) / &g / number(3.0)));
    let dt = number(time) - bounced;
    let z = number(radius) + &speed * &dt - ((&g * &dt * &dt) >> 1);
    let vz = speed - g * dt;
    let flown = BigVec::new(start, BITS).plus(&BigVec::new(drift, BITS), &number(time));
    let mut position = flown.clone();
    position.0[2] = z;
    let mut velocity = BigVec::new(drift, BITS);
    velocity.0[2] = vz;
    ClosedForm {
        name: "ball",
        description: format!("ball on a floor, e = 0.9, after {bounces} bounces"),
        system,
        time,
        position: vec![position],
        velocity: vec![velocity],
        time_scale: 0.5,
    }
}

/// One elastic sphere between six walls, after about `bounces` wall collisions. Unfolded, its flight is
/// straight.
pub fn billiard(bounces: u32) -> ClosedForm {
    let (radius, size) = (0.5, DVec3::new(3.0, 4.0, 5.0));
    let mut system = empty(size, [Boundary::Wall; 3], 1.0, 1.0);
    let start = DVec3::new(1.1, 1.3, 1.7);
    let flight = DVec3::new(0.718_281_828, -0.577_215_665, 0.414_213_562);
    add_sphere(&mut system, radius, 1.0, start, flight);
    let rate: f64 = (0..3).map(|axis| flight[axis].abs() / (size[axis] - 2.0 * radius)).sum();
    let time = f64::from(bounces) / rate;
    let mut position = BigVec::new(start, BITS);
    let mut velocity = BigVec::new(flight, BITS);
    for axis in 0..3 {
        // The centre moves in [R, L − R]; unfolded with period 2 (L − 2R).
        let low = number(radius);
        let width = number(size[axis]) - twice(&low);
        let unfolded = number(start[axis]) - &low + number(flight[axis]) * number(time);
        let period = twice(&width);
        let phase = &unfolded - &period * (&unfolded / &period).floor();
        let back = phase > width;
        position.0[axis] = low + if back { period - phase } else { phase };
        if back {
            velocity.0[axis] = -velocity.0[axis].clone();
        }
    }
    ClosedForm {
        name: "billiard",
        description: format!("sphere between six elastic walls, after about {bounces} of them"),
        system,
        time,
        position: vec![position],
        velocity: vec![velocity],
        time_scale: 1.0,
    }
}

/// Two unequal spheres in an off-centre collision with restitution `e`, as long after the impact as before
/// it.
pub fn oblique_impact(e: f64) -> ClosedForm {
    let mut system = empty(DVec3::splat(32.0), [Boundary::Open; 3], e, 1.0);
    let (r1, r2) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(7.3, 3.1, 2.2));
    let (w1, w2) = (DVec3::new(0.9, 0.2, -0.1), DVec3::new(-0.7, -0.1, 0.15));
    let (radii, masses) = ([0.5, 0.75], [1.0, 3.375]);
    add_sphere(&mut system, radii[0], masses[0], r1, w1);
    add_sphere(&mut system, radii[1], masses[1], r2, w2);
    let vector = |v| BigVec::new(v, BITS);
    let (r1, r2, w1, w2) = (vector(r1), vector(r2), vector(w1), vector(w2));
    let (r, v) = (r2.minus(&r1), w2.minus(&w1));
    // |r + v t| = σ
    let sigma = number(radii[0]) + number(radii[1]);
    let (b, vv) = (r.dot(&v), v.dot(&v));
    let disc = &b * &b - &vv * (r.dot(&r) - &sigma * &sigma);
    let contact = -(b + disc.sqrt()) / vv;
    let time = nearest(&twice(&contact));
    let rest = number(time) - &contact;
    let n = r.plus(&v, &contact);
    let n = BigVec(n.0.map(|x| x / &sigma));
    // (2.14), (2.19), (2.20)
    let (m1, m2) = (number(masses[0]), number(masses[1]));
    let impulse = -(number(1.0) + number(e)) * v.dot(&n) * &m1 * &m2 / (&m1 + &m2);
    let (u1, u2) = (w1.plus(&n, &(-(&impulse / m1))), w2.plus(&n, &(impulse / m2)));
    ClosedForm {
        name: "oblique",
        description: format!("oblique impact of two unequal spheres, e = {e}"),
        system,
        time,
        position: vec![r1.plus(&w1, &contact).plus(&u1, &rest), r2.plus(&w2, &contact).plus(&u2, &rest)],
        velocity: vec![u1, u2],
        time_scale: 0.625,
    }
}

/// A chain of elastic collisions on a line: `count` spheres at rest, each 0.9 times the mass of the one
/// before, the first of them hit by a heavier one. Each is hit once, hits the next once, and then follows it
/// more slowly.
pub fn chain(count: usize) -> ClosedForm {
    let (radius, gap, ratio) = (0.5, 0.5, 0.9);
    let masses: Vec<f64> =
        (0..=count).scan(1.0, |mass, _| Some(std::mem::replace(mass, *mass * ratio))).collect();
    let mut system = empty(DVec3::new(64.0, 8.0, 8.0), [Boundary::Open; 3], 1.0, 1.0);
    for (k, &mass) in masses.iter().enumerate() {
        let position = DVec3::new(2.0 + (2.0 * radius + gap) * k as f64, 4.0, 4.0);
        let velocity = if k == 0 { DVec3::X } else { DVec3::ZERO };
        add_sphere(&mut system, radius, mass, position, velocity);
    }
    // Sphere k moves at v_k from t_{k−1}, when it is hit, to t_k, when it hits the next, and at w_k from then
    // on: v_{k+1} = 2 m_k v_k/(m_k + m_{k+1}), w_k = (m_k − m_{k+1}) v_k/(m_k + m_{k+1})
    let gap = number(gap);
    let (mut speed, mut now) = (number(1.0), number(0.0));
    let mut after = Vec::new();
    for pair in masses.windows(2) {
        now += &gap / &speed;
        let (m1, m2) = (number(pair[0]), number(pair[1]));
        let sum = &m1 + &m2;
        after.push(((&m1 - &m2) * &speed / &sum, now.clone()));
        speed = twice(&m1) * &speed / sum;
    }
    let time = nearest(&(&now + number(1.0)));
    let (mut position, mut velocity) = (Vec::new(), Vec::new());
    for (k, body) in system.bodies.iter().enumerate() {
        let (mut x, mut v) = (BigVec::new(body.position, BITS), BigVec::new(DVec3::ZERO, BITS));
        let (slow, since) = after.get(k).cloned().unwrap_or((speed.clone(), now.clone()));
        // All except the last have crossed the gap to their successor.
        if k < count {
            x.0[0] = &x.0[0] + &gap;
        }
        x.0[0] = &x.0[0] + &slow * (number(time) - since);
        v.0[0] = slow;
        position.push(x);
        velocity.push(v);
    }
    ClosedForm {
        name: "chain",
        description: format!("chain of {count} elastic collisions on a line, masses falling by 0.9"),
        system,
        time,
        position,
        velocity,
        time_scale: 1.0 / nearest(&speed),
    }
}

impl ClosedForm {
    /// Largest distance of the reference run from the closed form [length]; a small value confirms both.
    pub fn reference_error(&self, bits: usize) -> Result<f64, Error> {
        let mut reference = Reference::new(&self.system, bits, Rounding::None)?;
        reference.run_to(&big(self.time, bits));
        let off = |(a, b): (&BigVec, &BigVec)| {
            let r = a.minus(b);
            nearest(&r.dot(&r).sqrt())
        };
        Ok(reference.position().iter().zip(&self.position).map(off).fold(0.0, f64::max))
    }
}
