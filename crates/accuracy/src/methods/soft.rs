/*!
Soft spheres: a linear spring and a dashpot for each contact, integrated by velocity Verlet.

```text
F_n = k δ + γ δ̇,     δ = σ − |r|                                    while δ > 0
t_c = π √(μ/k) / √(1 − ζ²),     e = exp(−π ζ/√(1 − ζ²)),     ζ = γ/(2 √(k μ))
```

(Cundall and Strack 1979; Luding 1998). The force may be attractive shortly before the contact ends: only then
is e exact. At a given stiffness k every pair has the damping of the scene's restitution. The difference from
hard spheres is t_c: a contact takes time, during which the partners move on and third ones may join.
*/

use std::{f64::consts::PI, time::Instant};

use glam::DVec3;
use haff_engine::System;

use super::{Method, Run, Spheres, Virial, pairs::Pairs, stretches};
use crate::Error;

/// Steps of a contact of the lightest pair: the usual choice. The dashpot's force jumps where a contact
/// begins and ends within a step, which causes an error of e of some 1e-3 however short the contact is.
const STEPS_PER_CONTACT: f64 = 50.0;

/// A spring–dashpot integrator.
#[derive(Debug, Clone, Copy)]
pub struct SoftSpheres {
    /// Duration of a contact of the lightest pair [time]: k = μ (π² + ln² e)/t_c².
    pub contact_time: f64,
    /// Steps in that time.
    pub steps_per_contact: f64,
}

impl SoftSpheres {
    /// With 50 steps a contact.
    pub fn new(contact_time: f64) -> Self {
        Self { contact_time, steps_per_contact: STEPS_PER_CONTACT }
    }
}

/// Spring and dashpot of every pair.
struct Law {
    stiffness: f64,
    /// 2ζ √k of a pair, to be multiplied by √μ.
    pair: f64,
    wall: f64,
}

/// 2ζ for a restitution; e = 0 is critically damped.
fn damping(e: f64) -> f64 {
    let log = -e.max(f64::MIN_POSITIVE).ln();
    2.0 * log / PI.hypot(log)
}

impl Method for SoftSpheres {
    fn name(&self) -> &'static str {
        "soft spheres"
    }

    fn parameter(&self) -> String {
        format!("t_c = {:.0e}", self.contact_time)
    }

    fn value(&self) -> Option<f64> {
        Some(self.contact_time)
    }

    fn run(&self, system: &System, times: &[f64]) -> Result<Run, Error> {
        let mut spheres = Spheres::new(system, self.name())?;
        let mut run = Run::default();
        let start = Instant::now();
        // The lightest pair consists of two of the lightest spheres; a single sphere collides only with
        // walls.
        let heaviest = spheres.inverse_mass.iter().copied().fold(0.0, f64::max);
        let mu = if spheres.position.len() > 1 { 0.5 / heaviest } else { 1.0 / heaviest };
        let e = if spheres.position.len() > 1 { spheres.restitution } else { spheres.wall_restitution };
        let stiffness = mu * (PI.powi(2) + e.max(f64::MIN_POSITIVE).ln().powi(2)) / self.contact_time.powi(2);
        let law = Law {
            stiffness,
            pair: damping(spheres.restitution) * stiffness.sqrt(),
            wall: damping(spheres.wall_restitution) * stiffness.sqrt(),
        };
        let mut pairs = Pairs::new(&spheres);
        let mut predicted = spheres.velocity.clone();
        let mut force = vec![DVec3::ZERO; spheres.position.len()];
        forces(&spheres, &pairs, &law, &predicted, &mut force);
        let mut virial = Virial::default();
        for (steps, dt) in stretches(times, self.contact_time / self.steps_per_contact) {
            for _ in 0..steps {
                for i in 0..force.len() {
                    let acceleration = force[i] * spheres.inverse_mass[i] + spheres.gravity;
                    spheres.velocity[i] += acceleration * (0.5 * dt);
                    spheres.position[i] += spheres.velocity[i] * dt;
                    // Extrapolated full-step velocity for the dashpots.
                    predicted[i] = spheres.velocity[i] + acceleration * (0.5 * dt);
                }
                pairs.update(&spheres);
                let contacts = forces(&spheres, &pairs, &law, &predicted, &mut force) * dt;
                for i in 0..force.len() {
                    let acceleration = force[i] * spheres.inverse_mass[i] + spheres.gravity;
                    spheres.velocity[i] += acceleration * (0.5 * dt);
                }
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

/// Forces of springs and dashpots; returns Σ F |r| of the pairs.
fn forces(spheres: &Spheres, pairs: &Pairs, law: &Law, velocity: &[DVec3], force: &mut [DVec3]) -> f64 {
    force.fill(DVec3::ZERO);
    let mut virial = 0.0;
    for near in &pairs.near {
        let (i, j) = (near.i as usize, near.j as usize);
        let r = spheres.position[j] - spheres.position[i] - near.shift;
        let sigma = spheres.radius[i] + spheres.radius[j];
        let square = r.length_squared();
        if square >= sigma * sigma {
            continue;
        }
        let distance = square.sqrt();
        let n = r / distance;
        let mu = 1.0 / (spheres.inverse_mass[i] + spheres.inverse_mass[j]);
        let approach = (velocity[i] - velocity[j]).dot(n);
        let magnitude = law.stiffness * (sigma - distance) + law.pair * mu.sqrt() * approach;
        force[i] -= n * magnitude;
        force[j] += n * magnitude;
        virial += magnitude * distance;
    }
    for plane in &spheres.planes {
        for (i, position) in spheres.position.iter().enumerate() {
            let depth = spheres.radius[i] - (position - plane.point).dot(plane.normal);
            if depth > 0.0 {
                let approach = -velocity[i].dot(plane.normal);
                let root = (1.0 / spheres.inverse_mass[i]).sqrt();
                force[i] += plane.normal * (law.stiffness * depth + law.wall * root * approach);
            }
        }
    }
    virial
}
