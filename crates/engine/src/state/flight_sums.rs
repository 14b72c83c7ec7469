//! Sums over the flights of particles that accelerate; see [`crate::motion::flights`].

use glam::DVec3;

use crate::{
    model::{Boundary, System},
    numerics::{
        exact_sum::ExactSum,
        instant::Instant,
        scalars::{ScalarReader, ScalarWriter},
        sum::Sum,
        tensor::Tensor,
    },
};

/// What is summed of the flights of a system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Summed {
    /// They are straight, or no pressure needs them.
    #[default]
    Nothing,
    /// The trace of the tensor, for the pressure.
    Trace,
    /// All moments, for the pressure tensor.
    Tensor,
}

impl Summed {
    /// What the pressures of a system need, if its particles do not fly straight.
    pub fn of(system: &System) -> Self {
        let measure = &system.measure;
        let axes = &system.domain.boundary[..system.dimension.count()];
        if measure.stress || measure.correlations.stress {
            Self::Tensor
        } else if axes.contains(&Boundary::Open) {
            Self::Nothing
        } else {
            Self::Trace
        }
    }
}

/// Moments of the velocity c of a mass: the components xx, xy, xz, yy, yz, zz of m c ⊗ c, and m c.
pub(crate) type Moments = [f64; 9];

/// Number of components of m c ⊗ c in [`Moments`]; those of m c follow.
pub(crate) const SECOND: usize = 6;

/// Rows and columns of the components.
pub(crate) const PLACES: [(usize, usize); SECOND] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// The components of (a ⊗ b + b ⊗ a)/2.
pub(crate) fn symmetric(a: DVec3, b: DVec3) -> [f64; SECOND] {
    PLACES.map(|(i, j)| if i == j { a[i] * b[i] } else { 0.5 * (a[i] * b[j] + a[j] * b[i]) })
}

/// The moments of a body.
pub(crate) fn moments(mass: f64, c: DVec3) -> Moments {
    let [xx, xy, xz, yy, yz, zz] = symmetric(c, mass * c);
    let p = mass * c;
    [xx, xy, xz, yy, yz, zz, p.x, p.y, p.z]
}

/// The tensor m c ⊗ c, row by row, and the vector m c.
pub(crate) fn tensor_and_momentum(moments: &Moments) -> (Tensor, DVec3) {
    let [xx, xy, xz, yy, yz, zz, x, y, z] = *moments;
    ([xx, xy, xz, xy, yy, yz, xz, yz, zz], DVec3::new(x, y, z))
}

/// Sums over the flights that have ended.
#[derive(Debug, Clone, Default)]
pub(crate) struct FlightSums {
    /// Since `until`: the trace of the tensor, or all moments.
    pub sums: [ExactSum; 9],
    /// The time up to which all flights have been taken.
    pub until: Instant,
    /// The trace of what has been taken since the previous sample.
    pub sampled: Sum,
}

impl FlightSums {
    /// The trace, over the flights that have ended since the previous sample, and those that go on up to the
    /// last time at which all were taken.
    pub fn ended(&self) -> f64 {
        let [xx, _, _, yy, _, zz, ..] = &self.sums;
        self.sampled.value() + (xx.value() + yy.value() + zz.value())
    }

    /// Adds its numbers to a checkpoint.
    pub fn save(&self, scalars: &mut ScalarWriter) {
        for (k, sum) in self.sums.iter().enumerate() {
            scalars.exact_sum(&format!("flights.{k}"), sum);
        }
        scalars.pair("flights.until", self.until.high, self.until.low);
        scalars.sum("flights.sampled", &self.sampled);
    }

    /// Loads what [`Self::save`] has saved.
    pub fn load(scalars: &mut ScalarReader) -> Self {
        let sums = std::array::from_fn(|k| scalars.exact_sum(&format!("flights.{k}")));
        let (high, low) = scalars.pair("flights.until");
        Self { sums, until: Instant { high, low }, sampled: scalars.sum("flights.sampled") }
    }

    /// Adds the sums of another thread.
    pub fn merge(&mut self, other: &Self) {
        for (sum, other) in self.sums.iter_mut().zip(&other.sums) {
            sum.merge(other);
        }
    }
}
