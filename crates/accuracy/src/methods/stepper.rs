/*!
Hard spheres at fixed time steps, as in rigid-body programs: free flight for a step, then the impulse of the
exact law for every pair and wall that overlaps and still approaches.

A contact is detected up to a step late, and the flight in the meantime is an error of first order in the
step.
*/

use std::time::Instant;

use haff_engine::System;
use haff_mechanics::{resolve_contact, resolve_wall};

use super::{Method, Run, Spheres, Virial, pairs::Pairs, stretches};
use crate::Error;

/// A fixed-step hard-sphere integrator.
#[derive(Debug, Clone, Copy)]
pub struct Stepper {
    /// Largest step [time]; shortened so that a whole number of steps ends at each requested time.
    pub dt: f64,
}

impl Method for Stepper {
    fn name(&self) -> &'static str {
        "fixed step"
    }

    fn parameter(&self) -> String {
        format!("dt = {:.0e}", self.dt)
    }

    fn value(&self) -> Option<f64> {
        Some(self.dt)
    }

    fn run(&self, system: &System, times: &[f64]) -> Result<Run, Error> {
        let mut spheres = Spheres::new(system, self.name())?;
        let mut run = Run::default();
        let mut virial = Virial::default();
        let start = Instant::now();
        let mut pairs = Pairs::new(&spheres);
        for (steps, dt) in stretches(times, self.dt) {
            for _ in 0..steps {
                fly(&mut spheres, dt);
                pairs.update(&spheres);
                let contacts = collide(&mut spheres, &pairs);
                bounce(&mut spheres);
                virial.add(contacts, &spheres, dt);
            }
            run.steps += steps;
            run.states.push(spheres.state());
        }
        run.wall = start.elapsed();
        run.compressibility = virial.compressibility(&spheres);
        Ok(run)
    }
}

/// Free flight, exact.
fn fly(spheres: &mut Spheres, dt: f64) {
    let (kick, fall) = (spheres.gravity * dt, spheres.gravity * (0.5 * dt * dt));
    for (position, velocity) in spheres.position.iter_mut().zip(&mut spheres.velocity) {
        *position += *velocity * dt + fall;
        *velocity += kick;
    }
}

/// Impulses of the pairs that overlap and approach; returns Σ J |r|.
fn collide(spheres: &mut Spheres, pairs: &Pairs) -> f64 {
    let mut virial = 0.0;
    for near in &pairs.near {
        let (i, j) = (near.i as usize, near.j as usize);
        let r = spheres.position[j] - spheres.position[i] - near.shift;
        let sigma = spheres.radius[i] + spheres.radius[j];
        if r.length_squared() >= sigma * sigma {
            continue;
        }
        let (w1, w2) = (spheres.velocity[i], spheres.velocity[j]);
        if (w1 - w2).dot(r) <= 0.0 {
            continue;
        }
        let inverse = (spheres.inverse_mass[i], spheres.inverse_mass[j]);
        let (u1, u2, impact) = resolve_contact(w1, w2, inverse.0, inverse.1, r, spheres.restitution);
        (spheres.velocity[i], spheres.velocity[j]) = (u1, u2);
        virial += impact.impulse * r.length();
    }
    virial
}

fn bounce(spheres: &mut Spheres) {
    for plane in &spheres.planes {
        for (i, position) in spheres.position.iter().enumerate() {
            if (position - plane.point).dot(plane.normal) < spheres.radius[i] {
                let (velocity, _) = resolve_wall(
                    spheres.velocity[i],
                    glam::DVec3::ZERO,
                    spheres.inverse_mass[i],
                    -plane.normal,
                    spheres.wall_restitution,
                );
                spheres.velocity[i] = velocity;
            }
        }
    }
}
