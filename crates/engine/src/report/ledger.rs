//! The energy balance, T + V = T₀ + V₀ − Σ ΔT + Σ sign · term, with named terms; T with that of rotation
//! and of pistons, under shear that of peculiar velocities.
//!
//! To add a source or sink of energy, add a [`Term`]. Files, reports and Python take names and signs from
//! here.

use crate::{
    model::{System, WallLaw},
    numerics::number::significant,
};

/// A term of the balance, besides T, V, the energy of pistons and the losses Σ ΔT of impacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Term {
    /// Work of moving walls and driven bodies on the particles.
    WallWork,
    /// Heat from thermal walls.
    WallHeat,
    /// Work of drives on the particles.
    DriveWork,
    /// Work of shear on the particles.
    ShearWork,
    /// Work of the loads and the weights of pistons.
    LoadWork,
    /// Kinetic energy lost by drag.
    Drag,
    /// Kinetic energy removed by putting grains to rest.
    Rest,
    /// Energy given by changes of the state from outside.
    Change,
    /// Energy that inlets bring in.
    Inlet,
    /// Energy that outlets take out.
    Outlet,
}

impl Term {
    /// Every term; the index of a term is its discriminant.
    pub const ALL: [Self; 10] = [
        Self::WallWork,
        Self::WallHeat,
        Self::DriveWork,
        Self::ShearWork,
        Self::LoadWork,
        Self::Drag,
        Self::Rest,
        Self::Change,
        Self::Inlet,
        Self::Outlet,
    ];

    /// The name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::WallWork => "wall_work",
            Self::WallHeat => "wall_heat",
            Self::DriveWork => "drive_work",
            Self::ShearWork => "shear_work",
            Self::LoadWork => "load_work",
            Self::Drag => "drag_loss",
            Self::Rest => "rest_energy",
            Self::Change => "change_work",
            Self::Inlet => "inlet_energy",
            Self::Outlet => "outlet_energy",
        }
    }

    /// The name in text.
    pub fn label(self) -> &'static str {
        match self {
            Self::WallWork => "work of walls",
            Self::WallHeat => "heat from walls",
            Self::DriveWork => "work of drives",
            Self::ShearWork => "work of shear",
            Self::LoadWork => "work of loads",
            Self::Drag => "lost by drag",
            Self::Rest => "taken by rest",
            Self::Change => "given by changes",
            Self::Inlet => "brought in by inlets",
            Self::Outlet => "taken out by outlets",
        }
    }

    /// 1 if the term is energy given to the particles and pistons, −1 if it is energy taken from them.
    pub fn sign(self) -> f64 {
        match self {
            Self::WallWork
            | Self::WallHeat
            | Self::DriveWork
            | Self::ShearWork
            | Self::LoadWork
            | Self::Change
            | Self::Inlet => 1.0,
            Self::Drag | Self::Rest | Self::Outlet => -1.0,
        }
    }

    /// Whether a system can have this term. Files contain only such terms.
    pub fn exists(self, system: &System) -> bool {
        match self {
            Self::WallWork => true,
            Self::WallHeat => system.contacts.wall.iter().any(WallLaw::is_thermal),
            // The work of the flow of a compression, too.
            Self::DriveWork => !system.drives.is_empty() || system.domain.compression.is_some(),
            Self::ShearWork => system.domain.shear.is_some(),
            Self::LoadWork => system.pistons().next().is_some(),
            Self::Drag => system.drag.is_some(),
            Self::Rest => system.contacts.rest_speed > 0.0,
            // No system says whether a run is changed on its way: `SceneFeatures::with_terms` does.
            Self::Change => false,
            Self::Inlet => system.flow.as_ref().is_some_and(|flow| !flow.inlets.is_empty()),
            Self::Outlet => system.flow.as_ref().is_some_and(|flow| !flow.outlets.is_empty()),
        }
    }
}

/// Largest residual of the balance that rounding explains.
pub const LARGEST_RESIDUAL: f64 = 1e-12;

/// A warning, if a residual of the balance is more than rounding, as text without a final point.
pub fn residual_warning(residual: f64) -> Option<String> {
    // Also if it is no number.
    let within = residual.abs() <= LARGEST_RESIDUAL;
    (!within).then(|| {
        format!(
            "the ledger residual is {}, beyond {LARGEST_RESIDUAL:e}: this part of the energy is missing in the \
             balance, and energies are not more accurate than that",
            significant(residual, 2)
        )
    })
}

/// Energies and their balance (compensated sums).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ledger {
    /// T of the bodies of finite mass, of translation [energy].
    pub kinetic: f64,
    /// T of rotation; zero without spin [energy].
    pub rotational: f64,
    /// T of pistons [energy].
    pub pistons: f64,
    /// V of gravity, zero at the origin, plus that of springs [energy].
    pub potential: f64,
    /// The part of V that is in springs, zero without force [energy]. This engine has no springs: 0.
    pub spring: f64,
    /// Σ ΔT so far [energy].
    pub dissipated: f64,
    /// Σ E'_c so far [energy].
    pub carnot: f64,
    /// The other terms so far \[energy\], indexed by [`Term`].
    pub terms: [f64; Term::ALL.len()],
    /// T + V − (T₀ + V₀ − Σ ΔT + Σ sign · term), relative to the largest |summand|. T includes here the
    /// energy that pending series of bounces, completed but not yet ended, will still lose.
    pub residual: f64,
}

impl Ledger {
    /// The value of a term so far [energy].
    pub fn term(&self, term: Term) -> f64 {
        self.terms[term as usize]
    }

    /// Energy that all terms together have given to the particles and pistons so far [energy].
    pub fn supplied(&self) -> f64 {
        Term::ALL.into_iter().map(|term| term.sign() * self.term(term)).sum()
    }
}
