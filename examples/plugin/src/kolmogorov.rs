//! A force along x that changes sign along y, as in a Kolmogorov flow, and what it does to the grains.

use std::f64::consts::TAU;

use haff_cli::{Action, Column, DVec3, DrivenParticles, Exchange, Parameters, Particles, Partner, Probe};

/// Kicks at regular times: the velocity along x grows by a cos(2πy/λ) Δt.
#[derive(Debug)]
struct Kolmogorov {
    /// a, the largest mean acceleration [length/time²].
    acceleration: f64,
    /// λ [length].
    wavelength: f64,
    /// Δt, the time between two kicks [time].
    interval: f64,
}

impl Action for Kolmogorov {
    fn time(&self, number: u64) -> f64 {
        number as f64 * self.interval
    }

    fn act(&self, _number: u64, particles: &mut dyn DrivenParticles) {
        for i in particles.driven().to_vec() {
            let phase = TAU * particles.position(i).y / self.wavelength;
            let change = self.acceleration * self.interval * phase.cos();
            particles.set_velocity(i, particles.velocity(i) + DVec3::X * change);
        }
    }
}

/// The drive with the parameters of a scene.
pub fn drive(parameters: &mut Parameters) -> Box<dyn Action> {
    Box::new(Kolmogorov {
        acceleration: parameters.number("acceleration"),
        wavelength: parameters.positive("wavelength"),
        interval: parameters.positive("interval"),
    })
}

/// The amplitude of the flow, and the momentum that collisions exchange.
struct Flow {
    /// λ [length].
    wavelength: f64,
    /// Σ |m Δv| of all impacts since the last sample [mass·length/time].
    exchanged: f64,
}

impl Probe for Flow {
    fn columns(&self) -> Vec<Column> {
        vec![
            // 2⟨v_x cos(2πy/λ)⟩ and 2⟨v_x sin(2πy/λ)⟩.
            Column::vector("flow_amplitude", "length/time", 2),
            Column::number("exchanged_momentum", "mass length/time"),
        ]
    }

    fn exchange(&mut self, exchange: &Exchange) {
        if !matches!(exchange.partner, Partner::Drive) {
            let changes = exchange.changes.iter();
            self.exchanged += changes.map(|one| one.mass * (one.after - one.before).length()).sum::<f64>();
        }
    }

    fn sample(&mut self, particles: &dyn Particles) -> Vec<f64> {
        let (mut along, mut across) = (0.0, 0.0);
        for i in 0..particles.count() {
            let (sin, cos) = (TAU * particles.position(i).y / self.wavelength).sin_cos();
            along += particles.velocity(i).x * cos;
            across += particles.velocity(i).x * sin;
        }
        let weight = 2.0 / f64::from(particles.count());
        vec![weight * along, weight * across, std::mem::take(&mut self.exchanged)]
    }

    fn save(&self) -> Vec<f64> {
        vec![self.exchanged]
    }

    fn load(&mut self, numbers: &[f64]) -> bool {
        let &[exchanged] = numbers else { return false };
        self.exchanged = exchanged;
        exchanged >= 0.0
    }
}

/// The probe with the parameters of a scene.
pub fn probe(parameters: &mut Parameters) -> Box<dyn Probe> {
    Box::new(Flow { wavelength: parameters.positive("wavelength"), exchanged: 0.0 })
}
