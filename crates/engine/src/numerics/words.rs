//! The data of measurements in a checkpoint: a sequence of numbers, each as the bits of a 64-bit word.

use crate::numerics::{error::EngineError, exact_sum::ExactSums, sum::Sum};

/// Reads words in the order in which they have been written. A fault ends the reading.
#[derive(Debug)]
pub(crate) struct Words<'a> {
    words: std::slice::Iter<'a, u64>,
}

/// The error of data that cannot be those of the measurement.
pub(crate) fn fault(what: &str) -> EngineError {
    EngineError::Checkpoint(format!("measured: {what}"))
}

impl<'a> Words<'a> {
    pub fn new(words: &'a [u64]) -> Self {
        Self { words: words.iter() }
    }

    pub fn take(&mut self) -> Result<u64, EngineError> {
        self.words.next().copied().ok_or_else(|| fault("there are too few numbers"))
    }

    /// A whole number with a sign.
    pub fn integer(&mut self) -> Result<i64, EngineError> {
        Ok(self.take()? as i64)
    }

    /// A number; finite.
    pub fn real(&mut self) -> Result<f64, EngineError> {
        let value = f64::from_bits(self.take()?);
        if value.is_finite() { Ok(value) } else { Err(fault(&format!("{value} must be finite"))) }
    }

    /// `count` numbers.
    pub fn reals(&mut self, count: usize) -> Result<Vec<f64>, EngineError> {
        if count > self.words.len() {
            return Err(fault("there are too few numbers"));
        }
        (0..count).map(|_| self.real()).collect()
    }

    pub fn sum(&mut self) -> Result<Sum, EngineError> {
        Ok(Sum { high: self.real()?, low: self.real()? })
    }

    /// Loads sums that have been written by [`put_sums`].
    pub fn sums(&mut self, sums: &mut [Sum]) -> Result<(), EngineError> {
        sums.iter_mut().try_for_each(|sum| {
            *sum = self.sum()?;
            Ok(())
        })
    }

    /// Loads exact sums that have been written by [`put_exact_sums`].
    pub fn exact_sums<const K: usize>(&mut self, sums: &mut ExactSums<K>) -> Result<(), EngineError> {
        for sum in sums.sums_mut() {
            let parts = self.take()?;
            *sum = self.reals(usize::try_from(parts).unwrap_or(usize::MAX))?.into_iter().collect();
        }
        Ok(())
    }

    /// A number up to `most`, which is called `what`.
    pub fn count(&mut self, what: &str, most: u64) -> Result<u64, EngineError> {
        let value = self.take()?;
        if value <= most { Ok(value) } else { Err(fault(&format!("{what} = {value} is above {most}"))) }
    }

    /// Succeeds if no words are left.
    pub fn finish(mut self) -> Result<(), EngineError> {
        match self.words.next() {
            None => Ok(()),
            Some(_) => Err(fault("there are too many numbers")),
        }
    }
}

/// Appends numbers.
pub(crate) fn put_reals(words: &mut Vec<u64>, values: &[f64]) {
    words.extend(values.iter().map(|value| value.to_bits()));
}

/// Appends exact sums: for each the number of its parts, and these.
pub(crate) fn put_exact_sums<const K: usize>(words: &mut Vec<u64>, sums: &ExactSums<K>) {
    for sum in sums.clone().sums_mut() {
        let parts = sum.parts();
        words.push(parts.len() as u64);
        put_reals(words, &parts);
    }
}

/// Appends sums.
pub(crate) fn put_sums(words: &mut Vec<u64>, sums: &[Sum]) {
    for sum in sums {
        put_reals(words, &[sum.high, sum.low]);
    }
}
