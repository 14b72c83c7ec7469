//! The observables by name. Recorder, reports, Python and documentation take them from this table: a new one
//! is one more row, or one more [`Term`] of the balance of energies.

use glam::DVec3;

use crate::{
    ledger::Term,
    model::{Boundary, System},
    report::Sample,
};

/// The value of an observable in a sample.
#[derive(Debug, Clone, Copy)]
pub enum Quantity {
    /// A number.
    Real(fn(&Sample) -> f64),
    /// A count since the start.
    Count(fn(&Sample) -> u64),
    /// A vector.
    Vector(fn(&Sample) -> DVec3),
    /// A number for each species.
    PerSpecies(fn(&Sample) -> &[f64]),
    /// A term of the balance of energies.
    Term(Term),
}

/// One observable.
#[derive(Debug, Clone, Copy)]
pub struct Observable {
    /// Name in files.
    pub name: &'static str,
    /// Unit, in words of the scene's units; "1" for numbers.
    pub unit: &'static str,
    /// Its value.
    pub quantity: Quantity,
    /// Whether scenes like this have it.
    pub exists: fn(Present) -> bool,
}

/// What a scene has, as far as observables depend on it.
#[expect(clippy::struct_excessive_bools, reason = "features that are there or not")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Present {
    /// Springs.
    pub springs: bool,
    /// A volume: no axis is open.
    pub volume: bool,
    /// An angular momentum: no axis is periodic.
    pub angular_momentum: bool,
    /// Species to name.
    pub species: bool,
    /// Terms of the balance of energies, by [`Term`].
    pub terms: [bool; Term::ALL.len()],
}

impl Present {
    /// What a system has; springs are not part of it.
    pub fn of(system: &System) -> Self {
        let axes = &system.domain.boundary[..system.dimension.count()];
        Self {
            springs: false,
            volume: !axes.contains(&Boundary::Open),
            angular_momentum: !axes.contains(&Boundary::Periodic),
            species: !system.species.is_empty(),
            terms: Term::ALL.map(|term| term.exists(system)),
        }
    }

    /// Everything, so that every observable exists.
    pub fn all() -> Self {
        Self {
            springs: true,
            volume: true,
            angular_momentum: true,
            species: true,
            terms: [true; Term::ALL.len()],
        }
    }
}

const ENERGY: &str = "energy";

/// Rows before the terms of the balance of energies.
const ENERGIES: [Observable; 6] = [
    row("kinetic_energy", ENERGY, Quantity::Real(|s| s.ledger.kinetic), always),
    row("potential_energy", ENERGY, Quantity::Real(|s| s.ledger.potential), always),
    row("gravity_energy", ENERGY, Quantity::Real(|s| s.ledger.potential - s.ledger.spring), |p| p.springs),
    row("spring_energy", ENERGY, Quantity::Real(|s| s.ledger.spring), |p| p.springs),
    row("dissipated_energy", ENERGY, Quantity::Real(|s| s.ledger.dissipated), always),
    row("carnot_energy", ENERGY, Quantity::Real(|s| s.ledger.carnot), always),
];

/// Rows after them.
const OTHERS: [Observable; 12] = [
    row("ledger_residual", "1", Quantity::Real(|s| s.ledger.residual), always),
    row("temperature", ENERGY, Quantity::Real(|s| s.temperature), always),
    row("species_temperature", ENERGY, Quantity::PerSpecies(|s| &s.species_temperature), |p| p.species),
    row("sonine_a2", "1", Quantity::Real(|s| s.sonine_a2), always),
    row("pressure", "energy/length^d", Quantity::Real(|s| s.pressure.unwrap_or(f64::NAN)), |p| p.volume),
    row("momentum", "mass length/time", Quantity::Vector(|s| s.momentum), always),
    row("external_impulse", "mass length/time", Quantity::Vector(|s| s.external_impulse), always),
    row(
        "angular_momentum",
        "mass length^2/time",
        Quantity::Vector(|s| s.angular_momentum.unwrap_or(DVec3::NAN)),
        |p| p.angular_momentum,
    ),
    row("collisions", "1", Quantity::Count(|s| s.collisions), always),
    row("wall_collisions", "1", Quantity::Count(|s| s.wall_collisions), always),
    row("collision_rate", "1/time", Quantity::Real(|s| s.collision_rate), always),
    row("mean_free_time", "time", Quantity::Real(|s| s.mean_free_time), always),
];

const fn row(
    name: &'static str,
    unit: &'static str,
    quantity: Quantity,
    exists: fn(Present) -> bool,
) -> Observable {
    Observable { name, unit, quantity, exists }
}

fn always(_: Present) -> bool {
    true
}

/// All observables that scenes like this have, in the order of files.
pub fn observables(present: &Present) -> Vec<Observable> {
    let terms = Term::ALL
        .into_iter()
        .filter(|&term| present.terms[term as usize])
        .map(|term| row(term.name(), ENERGY, Quantity::Term(term), always));
    let exists = |observable: &Observable| (observable.exists)(*present);
    ENERGIES.into_iter().filter(exists).chain(terms).chain(OTHERS.into_iter().filter(exists)).collect()
}

impl Quantity {
    /// Numbers of one sample, of a scene with so many species.
    pub fn width(self, species: usize) -> Option<usize> {
        match self {
            Self::Real(_) | Self::Count(_) | Self::Term(_) => None,
            Self::Vector(_) => Some(3),
            Self::PerSpecies(_) => Some(species),
        }
    }

    /// Appends the numbers of a sample; a count as a number of the same value.
    pub fn append(self, sample: &Sample, numbers: &mut Vec<f64>) {
        match self {
            Self::Real(value) => numbers.push(value(sample)),
            Self::Count(value) => numbers.push(value(sample) as f64),
            Self::Vector(value) => numbers.extend(value(sample).to_array()),
            Self::PerSpecies(values) => numbers.extend(values(sample)),
            Self::Term(term) => numbers.push(sample.ledger.term(term)),
        }
    }
}
