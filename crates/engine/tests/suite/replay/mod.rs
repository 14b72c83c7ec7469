//! The event log replayed: every particle's last position and velocity follow from its rows.
//!
//! Shares no code with the engine. Between rows a particle flies freely, and each row changes its velocity by
//! the impulse of the row. A missed, doubled or misplaced event gives a wrong final position.

use glam::DVec3;
use haff_engine::{EventKind, EventRecord, Frame, NO_PARTNER, System, WallMotion};

/// Rounding errors per row, of the velocities and of the position [ε].
const ROUNDINGS: f64 = 32.0;

/// State of a particle, with bounds of its rounding errors.
#[derive(Clone)]
struct Flier {
    time: f64,
    position: DVec3,
    velocity: DVec3,
    /// Walls that support it.
    support: Vec<usize>,
    /// Walls that supported it before its last bounce.
    slid_on: Vec<usize>,
    /// Bounds of the errors of velocity and position.
    off: [f64; 2],
}

impl Flier {
    fn acceleration(&self, system: &System, mass: f64) -> DVec3 {
        if mass.is_infinite() {
            return DVec3::ZERO;
        }
        let normals: Vec<DVec3> = self.support.iter().map(|&wall| system.walls[wall].normal).collect();
        along(system.domain.gravity, &normals)
    }

    fn fly(&mut self, system: &System, mass: f64, time: f64) {
        let dt = (time - self.time).max(0.0);
        let a = self.acceleration(system, mass);
        let displacement = (self.velocity + a * (0.5 * dt)) * dt;
        let speed = self.velocity.length() + a.length() * dt;
        self.position += displacement;
        self.velocity += a * dt;
        // Times are rounded, too.
        self.off[1] += self.off[0] * dt
            + ROUNDINGS * f64::EPSILON * (self.position.length() + displacement.length() + speed * time);
        self.off[0] += ROUNDINGS * f64::EPSILON * speed;
        self.time = time;
    }

    /// Changes the velocity and removes the walls that the particle moves away from. `speed` is a bound of
    /// the speeds of the partners before the impact. The velocity was parallel to these walls, so the
    /// threshold is the rounding of this step alone.
    fn kick(&mut self, system: &System, change: DVec3, speed: f64) {
        self.velocity += change;
        let rounding = ROUNDINGS * f64::EPSILON * (self.velocity.length() + speed + change.length());
        self.off[0] += rounding;
        let velocity = self.velocity;
        self.support.retain(|&wall| velocity.dot(system.walls[wall].normal).abs() <= rounding);
        for &wall in &self.support {
            let normal = system.walls[wall].normal;
            self.velocity -= normal * self.velocity.dot(normal);
        }
    }
}

/// The vector nearest to `gravity` that does not point into any wall with these normals.
fn along(gravity: DVec3, normals: &[DVec3]) -> DVec3 {
    let mut best = DVec3::ZERO;
    let mut offer = |a: DVec3| {
        let allowed = normals.iter().all(|n| a.dot(*n) >= -1e-12 * gravity.length());
        if allowed && (a - gravity).length_squared() < (best - gravity).length_squared() {
            best = a;
        }
    };
    offer(gravity);
    for (k, n) in normals.iter().enumerate() {
        offer(gravity - *n * gravity.dot(*n));
        for m in &normals[k + 1..] {
            let edge = n.cross(*m);
            if edge != DVec3::ZERO {
                offer(edge * (gravity.dot(edge) / edge.length_squared()));
            }
        }
    }
    best
}

/// Replays a log from the start and compares the result with the last frame. `epochs` is the number of epochs
/// of the clock: at the end of an epoch old anchors are moved along their flight, which rounds.
pub fn check(system: &System, rows: &[EventRecord], last: &Frame, epochs: u64) -> Result<(), String> {
    let mass = |i: usize| system.classes[system.bodies[i].class as usize].mass;
    let mut fliers: Vec<Flier> = system
        .bodies
        .iter()
        .map(|body| Flier {
            time: 0.0,
            position: body.position + images(body.image) * system.domain.size,
            velocity: body.velocity,
            support: Vec::new(),
            slid_on: Vec::new(),
            off: [0.0; 2],
        })
        .collect();
    for row in rows {
        let i = row.i as usize;
        let change = row.normal * row.impulse;
        match row.kind {
            EventKind::Collision => {
                let j = row.j as usize;
                for k in [i, j] {
                    fliers[k].fly(system, mass(k), row.time);
                }
                let speed = fliers[i].velocity.length() + fliers[j].velocity.length();
                for (k, sign) in [(i, -1.0), (j, 1.0)] {
                    if mass(k).is_finite() {
                        fliers[k].kick(system, change * (sign / mass(k)), speed);
                        fliers[k].slid_on.clear();
                    }
                }
            }
            EventKind::Wall => {
                let wall = &system.walls[row.j as usize];
                fliers[i].fly(system, mass(i), row.time);
                let speed = fliers[i].velocity.length() + wall.motion.max_speed();
                let flier = &mut fliers[i];
                flier.slid_on.clone_from(&flier.support);
                fliers[i].kick(system, change * (-1.0 / mass(i)), speed);
            }
            EventKind::Rest if row.j != NO_PARTNER => {
                settle(system, &mut fliers[i], row.j as usize, row.time, mass(i));
            }
            other => return Err(format!("a row of kind {other:?} in a scene without rest")),
        }
    }
    for (i, flier) in fliers.iter().enumerate() {
        // `free`: a direction in which the particle is not tested.
        let ends = |mut flier: Flier, free: DVec3| {
            flier.fly(system, mass(i), last.time);
            let rounding = f64::EPSILON * epochs as f64;
            flier.off[0] += rounding * flier.velocity.length();
            // Anchors are in the box, or outside it along open axes.
            flier.off[1] += rounding * (system.domain.size.length() + last.position[i].length())
                + rounding * flier.velocity.length() * last.time;
            let shift = images(last.image[i]) * system.domain.size;
            let position = last.position[i] + shift;
            // The frame has the position in the box, rounded, and it is brought back here.
            flier.off[1] += f64::EPSILON * (last.position[i].length() + shift.length());
            let length = |vector: DVec3| (vector - free * vector.dot(free)).length();
            let off = [length(flier.velocity - last.velocity[i]), length(flier.position - position)];
            for (what, off, allowed) in
                [("velocity", off[0], flier.off[0]), ("position", off[1], flier.off[1])]
            {
                if off.is_nan() || off > allowed {
                    return Err(format!("{what} of particle {i} is off by {off:e}, allowed {allowed:e}"));
                }
            }
            Ok(())
        };
        // A series of bounces can be completed while its row, which is written at its end, is not in the log
        // yet. An oscillating wall then carries the grain along its normal.
        let series = (0..system.walls.len()).filter(|_| mass(i).is_finite()).map(|wall| {
            let mut flier = flier.clone();
            settle(system, &mut flier, wall, last.time, mass(i));
            let oscillates = matches!(system.walls[wall].motion, WallMotion::Oscillating(_));
            (flier, if oscillates { system.walls[wall].normal } else { DVec3::ZERO })
        });
        let free = ends(flier.clone(), DVec3::ZERO);
        if free.is_err() && !series.map(|(flier, free)| ends(flier, free)).any(|end| end.is_ok()) {
            return free;
        }
    }
    Ok(())
}

/// Completes a series of bounces: since its last row the grain has been at the wall within rounding, and now
/// the wall supports it.
fn settle(system: &System, flier: &mut Flier, wall: usize, time: f64, mass: f64) {
    let normal = system.walls[wall].normal;
    let before = flier.velocity;
    let dt = (time - flier.time).max(0.0);
    let speed = before.length() + system.domain.gravity.length() * dt;
    // A grain that slides along walls into another wall bounces on all of them, and comes to rest on all of
    // them at the same time.
    let mut slid_on = std::mem::take(&mut flier.slid_on);
    // Rounding can have lifted it off this same wall before.
    slid_on.retain(|&other| other != wall);
    let normals: Vec<DVec3> = slid_on.iter().map(|&wall| system.walls[wall].normal).collect();
    if !slid_on.is_empty() && along(system.domain.gravity, &normals).dot(normal) < 0.0 {
        flier.support = slid_on;
    }
    if !flier.support.contains(&wall) {
        flier.support.push(wall);
    }
    // It keeps the velocity component parallel to all walls that support it.
    let normals: Vec<DVec3> = flier.support.iter().map(|&wall| system.walls[wall].normal).collect();
    flier.velocity = along_all(before, &normals);
    flier.fly(system, mass, time);
    // The last bounces rise by 10⁻¹³ of a radius, or by rounding.
    flier.off[1] += before.dot(normal).abs() * dt + 1e-12 * (1.0 + flier.position.length());
    flier.off[0] += ROUNDINGS * f64::EPSILON * speed;
}

/// The component of a velocity parallel to all walls with these normals.
fn along_all(velocity: DVec3, normals: &[DVec3]) -> DVec3 {
    match *normals {
        [n, m] if n.cross(m) != DVec3::ZERO => {
            let edge = n.cross(m);
            edge * (velocity.dot(edge) / edge.length_squared())
        }
        [n] | [n, _] => velocity - n * velocity.dot(n),
        _ => DVec3::ZERO,
    }
}

/// Numbers of box images as a vector.
fn images(image: [i32; 3]) -> DVec3 {
    DVec3::from_array(image.map(f64::from))
}
