//! Measurements that another crate adds.

use std::fmt;

use super::{exchange::Exchange, particles::Particles};

/// A measurement of a run: columns of the observables.
///
/// It receives the velocities that events change and the states at samples, and never changes the run.
pub trait Probe: Send {
    /// Its columns. They may depend on its parameters, not on the run.
    fn columns(&self) -> Vec<Column>;

    /// Receives the velocities that an event changes, in the order of time.
    fn exchange(&mut self, _exchange: &Exchange) {}

    /// The numbers of all columns at a sample, one after the other: each column has its number of components.
    /// Means over time cover the time since the previous sample.
    fn sample(&mut self, particles: &dyn Particles) -> Vec<f64>;

    /// What a resumed run needs besides the parameters, as finite numbers.
    fn save(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Loads what [`Self::save`] has returned. Returns whether it can be that.
    fn load(&mut self, numbers: &[f64]) -> bool {
        numbers.is_empty()
    }
}

/// A column of the observables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name in files, `observables/<name>`.
    pub name: String,
    /// Unit, as an expression in the units of the scene, such as "mass length/time"; "1" without a unit.
    pub unit: String,
    /// Number of components, 1 or more: one number, or a vector of so many.
    pub components: usize,
}

impl Column {
    /// A column of numbers.
    pub fn number(name: &str, unit: &str) -> Self {
        Self::vector(name, unit, 1)
    }

    /// A column of vectors with this number of components.
    pub fn vector(name: &str, unit: &str, components: usize) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), components }
    }
}

/// Makes a probe at the start of a run.
type MakeProbe = Box<dyn Fn() -> Box<dyn Probe> + Send + Sync>;

/// A probe with the name and the parameters by which scenes have it.
pub struct NamedProbe {
    name: &'static str,
    parameters: String,
    columns: Vec<Column>,
    make: MakeProbe,
}

impl NamedProbe {
    /// The probe with this name and these parameters, as text, which `make` makes.
    pub fn new(name: &'static str, parameters: String, make: MakeProbe) -> Self {
        let columns = make().columns();
        Self { name, parameters, columns, make }
    }

    /// The name in scenes.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The columns of the probe.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The probe at the start of a run.
    pub(crate) fn start(&self) -> Box<dyn Probe> {
        (self.make)()
    }
}

impl fmt::Debug for NamedProbe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.name, self.parameters)
    }
}

/// Probes are equal if their names and parameters are.
impl PartialEq for NamedProbe {
    fn eq(&self, other: &Self) -> bool {
        (self.name, &self.parameters) == (other.name, &other.parameters)
    }
}
