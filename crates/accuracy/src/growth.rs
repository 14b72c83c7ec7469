/*!
Growth of rounding errors in a chaotic gas.

Two trajectories that differ by δ are 2^{λ c} δ apart after c collisions per particle: λ is the largest
Lyapunov exponent in bits a collision. A program that keeps the state in double precision starts with δ of
some 2^−53 diameters and adds as much at each collision; after about 53/λ collisions only the statistics of
the initial state are left. The question is how much earlier a program reaches that point than necessary. The
standard of comparison is exact arithmetic on a state that is rounded to double after each collision
([`Rounding::StateToDouble`]), or with flights that are rounded, too ([`Rounding::FlightToDouble`]).
*/

use haff_engine::{Counters, NeighborChoice, Options, Silent, SimdChoice, Simulation, System, Until};

use crate::{
    Error,
    big::big,
    methods::State,
    reference::{Reference, Rounding},
    scenes::perturbed,
    trial::Solution,
};

pub use crate::series::Series;

/// Deviation at which a trajectory counts as lost [diameters].
pub const LOST: f64 = 0.1;
/// Deviation up to which the growth is fitted [diameters]: above it the growth is no longer exponential.
const LINEAR: f64 = 1e-3;

impl Series {
    /// Slope of log₂ deviation against collisions per particle [bits a collision], by least squares, up to a
    /// thousandth of a diameter. `None` with fewer than three points.
    pub fn slope(&self) -> Option<f64> {
        let points: Vec<_> = self.linear().collect();
        if points.len() < 3 {
            return None;
        }
        let count = points.len() as f64;
        let mean_x = points.iter().map(|point| point.0).sum::<f64>() / count;
        let mean_y = points.iter().map(|point| point.1).sum::<f64>() / count;
        let covariance: f64 = points.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
        Some(covariance / points.iter().map(|(x, _)| (x - mean_x).powi(2)).sum::<f64>())
    }

    /// (collisions per particle, log₂ deviation) of the points before the deviation reaches [`LINEAR`].
    fn linear(&self) -> impl Iterator<Item = (f64, f64)> {
        let pairs = self.collisions.iter().zip(&self.deviation);
        pairs.take_while(|(_, d)| **d < LINEAR).filter(|(_, d)| **d > 0.0).map(|(c, d)| (*c, d.log2()))
    }

    /// Collisions per particle at which the deviation reaches [`LOST`], interpolated in its logarithm; `None`
    /// if it does not.
    pub fn lost(&self) -> Option<f64> {
        let k = self.deviation.iter().position(|d| *d >= LOST)?;
        if k == 0 {
            return Some(self.collisions[0]);
        }
        let [low, high] = [self.deviation[k - 1].max(f64::MIN_POSITIVE).log2(), self.deviation[k].log2()];
        let part = (LOST.log2() - low) / (high - low);
        Some(self.collisions[k - 1] + part * (self.collisions[k] - self.collisions[k - 1]))
    }

    /// Mean of log₂ of the ratio of two deviations over the points at which both are small \[bits\].
    pub fn bits_beyond(&self, other: &Self) -> Option<f64> {
        let differences: Vec<f64> = self.linear().zip(other.linear()).map(|(a, b)| a.1 - b.1).collect();
        (!differences.is_empty()).then(|| differences.iter().sum::<f64>() / differences.len() as f64)
    }
}

/// The error growth of one initial state.
#[derive(Debug, Clone)]
pub struct Growth {
    /// haff's engine, in every configuration that supports the scene.
    pub engine: Series,
    /// Exact arithmetic on a state that is rounded to double after each collision.
    pub rounded: Series,
    /// Exact arithmetic on states and flights that are rounded to double.
    pub flight: Series,
    /// Exact arithmetic from an initial state with every number moved to the next double.
    pub perturbed: Series,
    /// The configurations that were run, as (search, vector instructions).
    pub configurations: Vec<(NeighborChoice, SimdChoice)>,
    /// Whether all of them gave the same bits at every time.
    pub identical: bool,
    /// Counters of the first of them.
    pub counters: Counters,
}

/// A mean over initial states and its standard error; NaN without any.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    /// Mean.
    pub mean: f64,
    /// Standard error of the mean.
    pub standard_error: f64,
}

impl Mean {
    /// Mean of the values that are present.
    pub fn of(values: impl Iterator<Item = Option<f64>>) -> Self {
        let values: Vec<f64> = values.flatten().collect();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
        Self { mean, standard_error: (variance / count).sqrt() }
    }
}

/// Compares haff's engine, in all its configurations, with the reference from one initial state.
///
/// `solution` is that of the unrounded reference; `seed` is that of the perturbation.
pub fn measure(solution: &Solution, bits: usize, seed: u64) -> Result<Growth, Error> {
    let mut configurations = Vec::new();
    let mut first: Option<(Vec<State>, Counters)> = None;
    let mut identical = true;
    for neighbors in
        [NeighborChoice::AllPairs, NeighborChoice::Cells, NeighborChoice::Lists, NeighborChoice::Windows]
    {
        for simd in [SimdChoice::Portable, SimdChoice::Avx2] {
            let found = match follow(
                &solution.system,
                Options { neighbors, simd, ..Options::default() },
                &solution.times,
            ) {
                // Not supported for this scene, or by this processor.
                Err(Error::Engine(
                    haff_engine::EngineError::Unsuitable { .. } | haff_engine::EngineError::NoAvx2,
                )) => {
                    continue;
                }
                other => other?,
            };
            configurations.push((neighbors, simd));
            match &first {
                None => first = Some(found),
                Some((states, _)) => identical &= *states == found.0,
            }
        }
    }
    let (states, counters) = first.unwrap_or_default();
    let series = |deviation: Vec<f64>| Series { collisions: solution.collisions.clone(), deviation };
    let deviation = states.iter().enumerate().map(|(k, state)| solution.error(k, state)).collect();
    Ok(Growth {
        engine: series(deviation),
        rounded: series(deviations(solution, &solution.system, bits, Rounding::StateToDouble)?),
        flight: series(deviations(solution, &solution.system, bits, Rounding::FlightToDouble)?),
        perturbed: series(deviations(
            solution,
            &perturbed(solution.system.clone(), seed),
            bits,
            Rounding::None,
        )?),
        configurations,
        identical,
        counters,
    })
}

/// The engine's states at the given times.
fn follow(system: &System, options: Options, times: &[f64]) -> Result<(Vec<State>, Counters), Error> {
    let mut simulation = Simulation::new(system.clone(), options)?;
    let mut states = Vec::new();
    for &time in times {
        simulation.advance(Until { time, ..Until::default() }, &mut Silent)?;
        let frame = simulation.frame();
        states.push(State { position: frame.position, velocity: frame.velocity });
    }
    Ok((states, simulation.counters()))
}

/// Deviations of a reference run from the solution.
pub fn deviations(
    solution: &Solution,
    system: &System,
    bits: usize,
    rounding: Rounding,
) -> Result<Vec<f64>, Error> {
    let mut reference = Reference::new(system, bits, rounding)?;
    let mut found = Vec::new();
    for (k, &time) in solution.times.iter().enumerate() {
        reference.run_to(&big(time, bits));
        found.push(solution.error_of(k, reference.position()));
        // After the trajectory is lost, the rest has no information; a few points are kept to show the final
        // level.
        if found.len() > 8 && found[found.len() - 8] > 1.0 {
            break;
        }
    }
    Ok(found)
}
