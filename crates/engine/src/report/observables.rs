//! The table of observables. Recorder, reports, Python and documentation take names and units from it. To add
//! an observable, add a row, or a [`Term`] of the energy balance.

use std::borrow::Cow;

use glam::DVec3;

use crate::{
    model::{Boundary, Column, System},
    report::{
        Sample,
        ledger::{Ledger, Term},
        stress_tensor::StressTensor,
    },
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
    /// A number for each pair of species.
    PerPair(fn(&Sample) -> &[f64]),
    /// A number for each wall.
    PerWall(fn(&Sample) -> &[f64]),
    /// A vector for each wall.
    VectorPerWall(fn(&Sample) -> &[DVec3]),
    /// A vector for each piston.
    VectorPerPiston(fn(&Sample) -> &[DVec3]),
    /// A tensor.
    Tensor(fn(&Sample) -> [f64; 9]),
    /// A term of the energy balance.
    Term(Term),
    /// A column of a probe.
    Probe {
        /// Index of its first number in [`Sample::probes`].
        first: usize,
        /// Number of components.
        components: usize,
    },
}

/// One observable.
#[derive(Debug, Clone)]
pub struct Observable {
    /// Name in files.
    pub name: Cow<'static, str>,
    /// Unit, as an expression in the scene's units; "1" for dimensionless numbers.
    pub unit: Cow<'static, str>,
    /// How its value follows from a sample.
    pub quantity: Quantity,
    /// Whether a scene with these features has it.
    pub exists: fn(&SceneFeatures) -> bool,
}

/// The features of a scene that decide which observables exist.
#[expect(clippy::struct_excessive_bools, reason = "each feature is present or absent")]
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneFeatures {
    /// There are springs.
    pub springs: bool,
    /// There is a volume: no axis is open.
    pub volume: bool,
    /// Angular momentum is defined: no axis is periodic.
    pub angular_momentum: bool,
    /// There are named species.
    pub species: bool,
    /// There are spins.
    pub spin: bool,
    /// The box is sheared.
    pub shear: bool,
    /// The box is compressed.
    pub compression: bool,
    /// The pressure tensor is measured.
    pub stress: bool,
    /// The forces on walls are measured.
    pub wall_forces: bool,
    /// The rates of collisions by pair of species are measured.
    pub pair_collisions: bool,
    /// Particles come and go.
    pub flow: bool,
    /// There are pistons.
    pub pistons: bool,
    /// Which terms of the energy balance exist, indexed by [`Term`].
    pub terms: [bool; Term::ALL.len()],
    /// The columns of probes.
    pub columns: Vec<Column>,
}

impl SceneFeatures {
    /// The features of a system. Springs are not part of a [`System`].
    pub fn of(system: &System) -> Self {
        let axes = &system.domain.boundary[..system.dimension.count()];
        Self {
            springs: false,
            volume: !axes.contains(&Boundary::Open),
            angular_momentum: !axes.contains(&Boundary::Periodic),
            species: !system.species.is_empty(),
            spin: system.spin.is_some(),
            shear: system.domain.shear.is_some(),
            compression: system.domain.compression.is_some(),
            stress: system.measure.stress,
            wall_forces: system.measure.wall_forces && !system.walls.is_empty(),
            pair_collisions: system.measure.pair_collisions && !system.species.is_empty(),
            flow: system.flow.is_some(),
            pistons: system.piston_count() > 0,
            terms: Term::ALL.map(|term| term.exists(system)),
            columns: system.measure.probes.iter().flat_map(|probe| probe.columns()).cloned().collect(),
        }
    }

    /// These features, and the terms of a ledger that are not zero: in a run that goes on in another system
    /// they are from before, or from the change itself.
    #[must_use]
    pub fn with_terms(mut self, ledger: &Ledger) -> Self {
        for (present, value) in self.terms.iter_mut().zip(ledger.terms) {
            *present |= value != 0.0;
        }
        self
    }

    /// All features of haff itself: every observable exists, and there are no probes.
    pub fn all() -> Self {
        Self {
            springs: true,
            volume: true,
            angular_momentum: true,
            species: true,
            spin: true,
            shear: true,
            compression: true,
            stress: true,
            wall_forces: true,
            pair_collisions: true,
            flow: true,
            pistons: true,
            terms: [true; Term::ALL.len()],
            columns: Vec::new(),
        }
    }
}

/// Observables of which a mean has no meaning, beside the terms of the energy balance: sums since the start,
/// and an error.
pub const NO_MEANS: [&str; 3] = ["dissipated_energy", "carnot_energy", "ledger_residual"];

const ENERGY: &str = "energy";
const PRESSURE: &str = "energy/length^d";

/// Rows before the terms of the energy balance.
const ENERGIES: [Observable; 8] = [
    row("kinetic_energy", ENERGY, Quantity::Real(|s| s.ledger.kinetic), always),
    row("rotational_energy", ENERGY, Quantity::Real(|s| s.ledger.rotational), |p| p.spin),
    row("piston_energy", ENERGY, Quantity::Real(|s| s.ledger.pistons), |p| p.pistons),
    row("potential_energy", ENERGY, Quantity::Real(|s| s.ledger.potential), always),
    row("gravity_energy", ENERGY, Quantity::Real(|s| s.ledger.potential - s.ledger.spring), |p| p.springs),
    row("spring_energy", ENERGY, Quantity::Real(|s| s.ledger.spring), |p| p.springs),
    row("dissipated_energy", ENERGY, Quantity::Real(|s| s.ledger.dissipated), always),
    row("carnot_energy", ENERGY, Quantity::Real(|s| s.ledger.carnot), always),
];

/// Rows after the terms of the energy balance.
const OTHERS: [Observable; 29] = [
    row("ledger_residual", "1", Quantity::Real(|s| s.ledger.residual), always),
    row("temperature", ENERGY, Quantity::Real(|s| s.temperature), always),
    row("species_temperature", ENERGY, Quantity::PerSpecies(|s| &s.species_temperature), |p| p.species),
    row("rotational_temperature", ENERGY, Quantity::Real(|s| s.rotational_temperature), |p| p.spin),
    row(
        "species_rotational_temperature",
        ENERGY,
        Quantity::PerSpecies(|s| &s.species_rotational_temperature),
        |p| p.species && p.spin,
    ),
    row("sonine_a2", "1", Quantity::Real(|s| s.sonine_a2), always),
    row("pressure", PRESSURE, Quantity::Real(|s| s.pressure.unwrap_or(f64::NAN)), |p| p.volume),
    row("box_volume", "length^d", Quantity::Real(|s| s.box_volume), |p| p.compression),
    row("packing_fraction", "1", Quantity::Real(|s| s.packing_fraction), |p| p.compression),
    row("pressure_tensor", PRESSURE, Quantity::Tensor(|s| stress(s).total()), |p| p.stress),
    row("pressure_tensor_kinetic", PRESSURE, Quantity::Tensor(|s| stress(s).kinetic), |p| p.stress),
    row("pressure_tensor_collisional", PRESSURE, Quantity::Tensor(|s| stress(s).collisional), |p| p.stress),
    row("wall_force", "mass length/time^2", Quantity::VectorPerWall(|s| &s.wall_force), |p| p.wall_forces),
    row("wall_heat_flow", "energy/time", Quantity::PerWall(|s| &s.wall_heat_flow), |p| p.wall_forces),
    row("piston_position", "length", Quantity::VectorPerPiston(|s| &s.piston_position), |p| p.pistons),
    row("piston_velocity", "length/time", Quantity::VectorPerPiston(|s| &s.piston_velocity), |p| p.pistons),
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
    row("pair_collision_rate", "1/time", Quantity::PerPair(|s| &s.pair_collision_rate), |p| {
        p.pair_collisions
    }),
    row("species_mean_free_time", "time", Quantity::PerSpecies(|s| &s.species_mean_free_time), |p| {
        p.pair_collisions
    }),
    row("particles", "1", Quantity::Count(|s| s.particles), |p| p.flow),
    row("particles_in", "1", Quantity::Count(|s| s.particles_in), |p| p.flow),
    row("particles_out", "1", Quantity::Count(|s| s.particles_out), |p| p.flow),
    row("discharge_rate", "1/time", Quantity::Real(|s| s.discharge_rate), |p| p.flow),
];

pub(crate) const fn row(
    name: &'static str,
    unit: &'static str,
    quantity: Quantity,
    exists: fn(&SceneFeatures) -> bool,
) -> Observable {
    Observable { name: Cow::Borrowed(name), unit: Cow::Borrowed(unit), quantity, exists }
}

fn stress(sample: &Sample) -> StressTensor {
    sample.stress.unwrap_or(StressTensor { kinetic: [f64::NAN; 9], collisional: [f64::NAN; 9] })
}

fn always(_: &SceneFeatures) -> bool {
    true
}

/// All observables of a scene with these features, in the order of output files.
pub fn observables(present: &SceneFeatures) -> Vec<Observable> {
    let terms = Term::ALL
        .into_iter()
        .filter(|&term| present.terms[term as usize])
        .map(|term| row(term.name(), ENERGY, Quantity::Term(term), always));
    let exists = |observable: &Observable| (observable.exists)(present);
    let mut first = 0;
    let columns = present.columns.iter().map(|Column { name, unit, components }| {
        let quantity = Quantity::Probe { first, components: *components };
        first += components;
        Observable { name: name.clone().into(), unit: unit.clone().into(), quantity, exists: always }
    });
    let others = OTHERS.into_iter().filter(exists);
    ENERGIES.into_iter().filter(exists).chain(terms).chain(others).chain(columns).collect()
}

/// The numbers on which the shapes of observables depend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sizes {
    /// Number of species.
    pub species: usize,
    /// Number of walls.
    pub walls: usize,
    /// Number of those that are pistons.
    pub pistons: usize,
    /// 2 or 3.
    pub dimension: usize,
}

impl Sizes {
    /// Those of a system.
    pub fn of(system: &System) -> Self {
        Self {
            species: system.species.len(),
            walls: system.walls.len(),
            pistons: system.piston_count(),
            dimension: system.dimension.count(),
        }
    }
}

/// The d·d components of a tensor in the first d dimensions.
fn leading(tensor: &[f64; 9], d: usize) -> impl Iterator<Item = f64> {
    (0..9).filter(move |k| k / 3 < d && k % 3 < d).map(|k| tensor[k])
}

impl Quantity {
    /// Shape of the value in a scene of these sizes; empty for a number.
    pub fn shape(self, sizes: Sizes) -> Vec<usize> {
        match self {
            Self::Real(_) | Self::Count(_) | Self::Term(_) | Self::Probe { components: 1, .. } => Vec::new(),
            Self::Vector(_) => vec![3],
            Self::PerSpecies(_) => vec![sizes.species],
            Self::PerPair(_) => vec![sizes.species; 2],
            Self::PerWall(_) => vec![sizes.walls],
            Self::VectorPerWall(_) => vec![sizes.walls, 3],
            Self::VectorPerPiston(_) => vec![sizes.pistons, 3],
            Self::Tensor(_) => vec![sizes.dimension; 2],
            Self::Probe { components, .. } => vec![components],
        }
    }

    /// Appends the values of a sample in a scene of these sizes. Counts are converted to `f64`.
    pub fn append(self, sample: &Sample, sizes: Sizes, numbers: &mut Vec<f64>) {
        match self {
            Self::Real(value) => numbers.push(value(sample)),
            Self::Count(value) => numbers.push(value(sample) as f64),
            Self::Vector(value) => numbers.extend(value(sample).to_array()),
            Self::PerSpecies(values) | Self::PerPair(values) | Self::PerWall(values) => {
                numbers.extend(values(sample));
            }
            Self::VectorPerWall(values) | Self::VectorPerPiston(values) => {
                numbers.extend(values(sample).iter().flat_map(DVec3::to_array));
            }
            Self::Tensor(value) => numbers.extend(leading(&value(sample), sizes.dimension)),
            Self::Term(term) => numbers.push(sample.ledger.term(term)),
            Self::Probe { first, components } => {
                numbers
                    .extend((first..first + components).map(|k| sample.probes.get(k).unwrap_or(&f64::NAN)));
            }
        }
    }
}
