//! The balance of energies, T + V = T₀ + V₀ − Σ ΔT + Σ terms, by named terms.
//!
//! A new way in which energy comes or goes is one more [`Term`]: files, reports and Python take names and
//! signs from here.

use crate::model::{System, WallLaw};

/// A term of the balance beside T, V and the losses Σ ΔT of impacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Term {
    /// Work of moving walls and driven bodies on the particles.
    WallWork,
    /// Heat from thermal walls.
    WallHeat,
    /// Work of drives on the particles.
    DriveWork,
    /// Kinetic energy that putting grains to rest has taken.
    Rest,
}

impl Term {
    /// Every term, each at the index of its number.
    pub const ALL: [Self; 4] = [Self::WallWork, Self::WallHeat, Self::DriveWork, Self::Rest];

    /// The name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::WallWork => "wall_work",
            Self::WallHeat => "wall_heat",
            Self::DriveWork => "drive_work",
            Self::Rest => "rest_energy",
        }
    }

    /// The name in text.
    pub fn label(self) -> &'static str {
        match self {
            Self::WallWork => "work of walls",
            Self::WallHeat => "heat from walls",
            Self::DriveWork => "work of drives",
            Self::Rest => "taken by rest",
        }
    }

    /// 1 if the term is energy given to the particles, −1 if it is energy taken.
    pub fn sign(self) -> f64 {
        match self {
            Self::WallWork | Self::WallHeat | Self::DriveWork => 1.0,
            Self::Rest => -1.0,
        }
    }

    /// Whether a system can have this term. Files leave out the others.
    pub fn exists(self, system: &System) -> bool {
        match self {
            Self::WallWork => true,
            Self::WallHeat => system.contacts.wall.iter().any(WallLaw::is_thermal),
            Self::DriveWork => !system.drives.is_empty(),
            Self::Rest => system.contacts.rest_speed > 0.0,
        }
    }
}

/// Energies and their balance (Neumaier sums).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ledger {
    /// T [energy], bodies of finite mass.
    pub kinetic: f64,
    /// V of gravity, zero at the origin, and of springs [energy].
    pub potential: f64,
    /// The part of springs in it, zero without force [energy]; the engine has none.
    pub spring: f64,
    /// Σ ΔT so far [energy].
    pub dissipated: f64,
    /// Σ E'_c so far [energy].
    pub carnot: f64,
    /// The other terms so far \[energy\], by [`Term`].
    pub terms: [f64; Term::ALL.len()],
    /// T + V − (T₀ + V₀ − Σ ΔT + Σ sign · term), relative to the largest |term|. T counts here what the
    /// bounces of a completed series that has not come to its end still have to lose.
    pub residual: f64,
}

impl Ledger {
    /// A term so far [energy].
    pub fn term(&self, term: Term) -> f64 {
        self.terms[term as usize]
    }

    /// What the terms have given to the particles so far [energy].
    pub fn supplied(&self) -> f64 {
        Term::ALL.into_iter().map(|term| term.sign() * self.term(term)).sum()
    }
}
