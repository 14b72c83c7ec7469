//! Named numbers of a checkpoint: written under unique names, and read back one by one until none is left.

use std::{collections::BTreeMap, str::FromStr};

use glam::DVec3;

use crate::numerics::{exact_sum::ExactSum, sum::Sum};

/// Parts of the names of vectors.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Collects named numbers.
#[derive(Debug, Default)]
pub struct ScalarWriter {
    /// Names and the bits of their values, in the order of writing.
    pub scalars: Vec<(String, u64)>,
}

impl ScalarWriter {
    /// Adds an integer or the bits of a number.
    pub fn put(&mut self, name: &str, bits: u64) {
        self.scalars.push((name.to_owned(), bits));
    }

    /// Adds a number.
    pub fn real(&mut self, name: &str, value: f64) {
        self.put(name, value.to_bits());
    }

    /// Adds the components of a vector.
    pub fn vector(&mut self, name: &str, vector: DVec3) {
        for (axis, x) in AXES.into_iter().zip(vector.to_array()) {
            self.real(&format!("{name}.{axis}"), x);
        }
    }

    /// Adds both parts of a compensated sum, or of an instant.
    pub fn pair(&mut self, name: &str, high: f64, low: f64) {
        self.real(&format!("{name}.high"), high);
        self.real(&format!("{name}.low"), low);
    }

    /// Adds a compensated sum.
    pub fn sum(&mut self, name: &str, sum: &Sum) {
        self.pair(name, sum.high, sum.low);
    }

    /// Adds all parts of an exact sum.
    pub(crate) fn exact_sum(&mut self, name: &str, sum: &ExactSum) {
        for (k, part) in sum.parts().into_iter().enumerate() {
            self.real(&format!("{name}.{k}"), part);
        }
    }

    /// Adds compensated sums of vectors.
    pub fn total(&mut self, name: &str, total: &[Sum; 3]) {
        for (axis, sum) in AXES.into_iter().zip(total) {
            self.sum(&format!("{name}.{axis}"), sum);
        }
    }
}

/// Takes named numbers. The first one that is missing or wrong is reported by [`Self::finish`]; until then
/// reading goes on with 0.
#[derive(Debug)]
pub struct ScalarReader {
    values: BTreeMap<String, u64>,
    fault: Option<String>,
}

impl ScalarReader {
    /// Reads these numbers.
    ///
    /// # Errors
    /// A name that occurs twice.
    pub fn new(scalars: &[(String, u64)]) -> Result<Self, String> {
        let values: BTreeMap<String, u64> = scalars.iter().cloned().collect();
        if values.len() != scalars.len() {
            return Err("a scalar is given twice".to_owned());
        }
        Ok(Self { values, fault: None })
    }

    /// Reports a fault, if it is the first.
    pub fn fail(&mut self, fault: impl FnOnce() -> String) {
        self.fault.get_or_insert_with(fault);
    }

    /// Takes an integer or the bits of a number.
    pub fn take(&mut self, name: &str) -> u64 {
        self.take_if_present(name).unwrap_or_else(|| {
            self.fail(|| format!("it lacks {name}"));
            0
        })
    }

    /// Takes a number that need not be there.
    pub fn take_if_present(&mut self, name: &str) -> Option<u64> {
        self.values.remove(name)
    }

    /// Whether there is a number of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.values.contains_key(name)
    }

    /// Takes a number.
    pub fn real(&mut self, name: &str) -> f64 {
        f64::from_bits(self.take(name))
    }

    /// Takes an index less than `limit`.
    pub fn index(&mut self, name: &str, limit: usize) -> usize {
        let index = self.take(name);
        if index >= limit as u64 {
            self.fail(|| format!("{name} = {index} must be less than {limit}"));
            return 0;
        }
        index as usize
    }

    /// Takes the components of a vector.
    pub fn vector(&mut self, name: &str) -> DVec3 {
        DVec3::from_array(AXES.map(|axis| self.real(&format!("{name}.{axis}"))))
    }

    /// Takes both parts of a compensated sum, or of an instant: (high, low).
    pub fn pair(&mut self, name: &str) -> (f64, f64) {
        (self.real(&format!("{name}.high")), self.real(&format!("{name}.low")))
    }

    /// Takes a compensated sum.
    pub fn sum(&mut self, name: &str) -> Sum {
        let (high, low) = self.pair(name);
        Sum { high, low }
    }

    /// Takes all parts of an exact sum.
    pub(crate) fn exact_sum(&mut self, name: &str) -> ExactSum {
        let mut sum = ExactSum::default();
        let mut part = Some(self.take(&format!("{name}.0")));
        for k in 1.. {
            let Some(bits) = part else { break };
            let term = f64::from_bits(bits);
            if !term.is_finite() {
                self.fail(|| format!("{name}.{} = {term:?} must be finite", k - 1));
            }
            sum.add(term);
            part = self.take_if_present(&format!("{name}.{k}"));
        }
        sum
    }

    /// Takes compensated sums of vectors.
    pub fn total(&mut self, name: &str) -> [Sum; 3] {
        AXES.map(|axis| self.sum(&format!("{name}.{axis}")))
    }

    /// The numbers between prefix and suffix in the names that are left, in order.
    pub fn numbers<N: FromStr + Ord>(&self, prefix: &str, suffix: &str) -> Vec<N> {
        let number = |name: &String| name.strip_prefix(prefix)?.strip_suffix(suffix)?.parse().ok();
        let mut numbers: Vec<N> = self.values.keys().filter_map(number).collect();
        numbers.sort_unstable();
        numbers
    }

    /// Succeeds if every number was there and none is left.
    ///
    /// # Errors
    /// The first number that was missing or wrong, or one that is unknown.
    pub fn finish(self) -> Result<(), String> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        match self.values.keys().next() {
            Some(name) => Err(format!("{name} is unknown; it was written by another version")),
            None => Ok(()),
        }
    }
}
