//! Energies and momenta of a state, and the balance of energies.

use glam::DVec3;

use crate::{
    model::common_velocity,
    numerics::{sum::Sum, total::total},
    report::ledger::{Ledger, Term},
    state::{State, world::World},
};

/// Energies and momenta of the bodies of finite mass; in a box that deforms those of peculiar velocities.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Totals {
    pub bodies: f64,
    pub mass: f64,
    pub kinetic: f64,
    /// Energy and angular momentum of rotations.
    pub rotational: f64,
    pub spin: DVec3,
    /// Kinetic energy of pistons, and the work of their loads and weights from their given positions on.
    pub pistons: (f64, f64),
    pub potential: f64,
    pub momentum: DVec3,
    /// Angular momentum about the origin, from unwrapped positions.
    pub angular_momentum: DVec3,
    /// What walls have given to the grains that they carry: energy, and momentum.
    pub carried: (f64, DVec3),
    /// What a drag has done in the present flights: the energy that it has taken, and its impulse.
    pub drag: (f64, DVec3),
}

impl Totals {
    pub fn of(world: &World) -> Self {
        let [bodies, mass, kinetic, potential, px, py, pz, hx, hy, hz] = total(world.particles.len(), |i| {
            let class = world.body(i);
            if class.inverse_mass == 0.0 {
                return [0.0; 10];
            }
            let (r, v) = world.peculiar(i, world.now);
            let p = class.mass * v;
            let h = r.cross(p);
            let potential = -class.mass * world.gravity.dot(r);
            [1.0, class.mass, 0.5 * p.dot(v), potential, p.x, p.y, p.z, h.x, h.y, h.z]
        });
        let (rotational, spin) = world.all_rotation();
        Self {
            bodies,
            mass,
            kinetic,
            rotational,
            spin,
            pistons: world.energies_of_pistons(),
            potential,
            momentum: DVec3::new(px, py, pz),
            angular_momentum: DVec3::new(hx, hy, hz),
            carried: world.all_carried(),
            drag: world.pending_drag(),
        }
    }

    /// Kinetic energy of translation and rotation, and of pistons.
    pub fn all_kinetic(&self) -> f64 {
        self.kinetic + self.rotational + self.pistons.0
    }

    /// The velocity that temperatures and pressures are relative to ([`crate::state::center`]).
    pub fn common_velocity(&self, world: &World) -> DVec3 {
        common_velocity(self.momentum, self.mass, world.conserved)
    }
}

/// The energy balance.
///
/// The loss of a completed series of bounces is added to the sums at the end of the series. Until then the
/// balance includes it as a separate energy.
pub(crate) fn ledger(state: &State, totals: &Totals) -> Ledger {
    let State { world, accumulators, pending, .. } = state;
    let bounces: f64 = pending.values().map(|series| series.energy_loss).sum();
    let [kinetic, potential] = accumulators.initial_energy;
    let dissipated = accumulators.dissipated() + world.friction_loss();
    let mut terms = accumulators.terms();
    terms[Term::WallWork as usize] += totals.carried.0;
    terms[Term::LoadWork as usize] += totals.pistons.1;
    terms[Term::Drag as usize] += totals.drag.0;
    if let Some((term, work)) = world.pending_flow_work() {
        terms[term as usize] += work;
    }
    let supplied = Term::ALL.map(|term| -term.sign() * terms[term as usize]);
    let energies = [
        totals.kinetic,
        totals.rotational,
        totals.pistons.0,
        totals.potential,
        -kinetic,
        -potential,
        dissipated,
        bounces,
    ];
    let energies = || energies.into_iter().chain(supplied);
    let scale = energies().fold(0.0, |scale: f64, energy| scale.max(energy.abs()));
    let balance: Sum = energies().collect();
    Ledger {
        kinetic: totals.kinetic,
        rotational: totals.rotational,
        pistons: totals.pistons.0,
        potential: totals.potential,
        spring: 0.0,
        dissipated,
        carnot: accumulators.carnot(),
        terms,
        residual: if scale > 0.0 { balance.value() / scale } else { 0.0 },
    }
}
