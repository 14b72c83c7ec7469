//! Run time against error of one method on one scene with a known solution.

use std::time::Duration;

use glam::DVec3;
use haff_engine::{Boundary, System};

use crate::{
    Error,
    big::{Big, BigVec, big, nearest},
    closed::ClosedForm,
    methods::{Method, Run, State},
    reference::{Reference, Rounding},
    series::Series,
};

/// Short runs are repeated for at least this long; the median of their times is used.
const SHORT: Duration = Duration::from_millis(20);
/// Largest number of repeats.
const REPEATS: u32 = 1000;

/// A scene and the exact state of its particles at some times.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Short name for tables.
    pub name: String,
    /// Description in one line.
    pub description: String,
    /// The initial state.
    pub system: System,
    /// Ascending times > 0 [time].
    pub times: Vec<f64>,
    /// Collisions per particle up to each time; a collision counts for both partners, one with a wall for its
    /// particle.
    pub collisions: Vec<f64>,
    /// Exact centres at each time [length].
    pub position: Vec<Vec<BigVec>>,
    /// Time in which the fastest sphere moves by about its diameter [time]: the unit of a step or a contact.
    pub time_scale: f64,
}

/// Cost and error of a method.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// The method's name.
    pub method: String,
    /// Its parameter, as text.
    pub parameter: String,
    /// Its parameter, as a number.
    pub value: Option<f64>,
    /// Time steps, or events.
    pub steps: u64,
    /// Wall time of one run to the last time [s].
    pub seconds: f64,
    /// Root mean square over the particles of the distance from the exact positions, at each time
    /// [diameters].
    pub error: Vec<f64>,
}

impl From<ClosedForm> for Solution {
    fn from(closed_form: ClosedForm) -> Self {
        Self {
            name: closed_form.name.to_owned(),
            description: closed_form.description,
            system: closed_form.system,
            times: vec![closed_form.time],
            collisions: Vec::new(),
            position: vec![closed_form.position],
            time_scale: closed_form.time_scale,
        }
    }
}

impl Solution {
    /// The solution of the reference with `bits` at `samples` times per collision and particle, up to
    /// `collisions` for each particle on average.
    pub fn by_reference(
        name: &str,
        description: &str,
        system: System,
        collisions: u32,
        samples: u32,
        bits: usize,
    ) -> Result<Self, Error> {
        let mut reference = Reference::new(&system, bits, Rounding::None)?;
        let n = system.bodies.len() as f64;
        let (mut times, mut position, mut counts) = (Vec::new(), Vec::new(), Vec::new());
        for k in 1..=collisions * samples {
            let count = 0.5 * n * f64::from(k) / f64::from(samples);
            let time = reference.run_to_collision(count.round() as u64);
            reference.run_to(&big(time, bits));
            times.push(time);
            position.push(reference.position().to_vec());
            counts.push((2 * reference.collisions() + reference.wall_collisions()) as f64 / n);
        }
        Ok(Self {
            name: name.to_owned(),
            description: description.to_owned(),
            system,
            times,
            collisions: counts,
            position,
            // Thermal gases of unit temperature, mass and diameter: the fastest of some dozens moves at about
            // 3.
            time_scale: 1.0 / 3.0,
        })
    }

    /// The solution at the first `samples` times only.
    #[must_use]
    pub fn truncated(&self, samples: usize) -> Self {
        let mut short = self.clone();
        short.times.truncate(samples);
        short.collisions.truncate(samples);
        short.position.truncate(samples);
        short
    }

    /// Deviation of a method against collisions per particle: with four times as many samples each time, as
    /// long as the trajectory is not lost and `affordable` is true for the time of the next run [time].
    pub fn error_growth(
        &self,
        method: &dyn Method,
        affordable: impl Fn(f64) -> bool,
    ) -> Result<Series, Error> {
        let mut samples = self.times.len().min(4);
        loop {
            let run = method.run(&self.system, &self.times[..samples])?;
            let deviation = run.states.iter().enumerate().map(|(k, state)| self.error(k, state)).collect();
            let series = Series { collisions: self.collisions[..samples].to_vec(), deviation };
            let more = self.times.len().min(4 * samples);
            if more == samples || series.lost().is_some() || !affordable(self.times[more - 1]) {
                return Ok(series);
            }
            samples = more;
        }
    }

    /// Root mean square distance of a state from the solution at time number `k` [diameters].
    pub fn error(&self, k: usize, state: &State) -> f64 {
        let bits = self.position[k].first().map_or(64, |first| first.0[0].precision());
        let square = self.position[k].iter().zip(&state.position).map(|(exact, found)| {
            if found.is_finite() {
                self.difference(exact, &BigVec::new(*found, bits)).length_squared()
            } else {
                f64::INFINITY
            }
        });
        (square.sum::<f64>() / state.position.len() as f64).sqrt() / self.diameter()
    }

    /// The same for a run of the reference.
    pub fn error_of(&self, k: usize, position: &[BigVec]) -> f64 {
        let square = self.position[k]
            .iter()
            .zip(position)
            .map(|(exact, found)| self.difference(exact, found).length_squared());
        (square.sum::<f64>() / position.len() as f64).sqrt() / self.diameter()
    }

    /// Nearest image of the difference, rounded after it has been formed.
    fn difference(&self, exact: &BigVec, found: &BigVec) -> DVec3 {
        let mut r = found.minus(exact);
        let size = self.system.domain.size;
        for axis in 0..3 {
            if self.system.domain.boundary[axis] == Boundary::Periodic {
                let edge: Big = big(size[axis], r.0[axis].precision());
                let x = &r.0[axis];
                let image = (x / &edge).round();
                r.0[axis] = x - edge * image;
            }
        }
        DVec3::from_array(r.0.map(|x| nearest(&x)))
    }

    /// Mean diameter [length].
    fn diameter(&self) -> f64 {
        let bodies = &self.system.bodies;
        let radii = bodies.iter().map(|body| self.system.classes[body.class as usize].radius);
        2.0 * radii.sum::<f64>() / bodies.len() as f64
    }

    /// Runs a method on the scene.
    pub fn measure(&self, method: &dyn Method) -> Result<Trial, Error> {
        let run = method.run(&self.system, &self.times)?;
        let seconds = timed(run.wall, || method.run(&self.system, &self.times))?;
        Ok(Trial {
            method: method.name().to_owned(),
            parameter: method.parameter(),
            value: method.value(),
            steps: run.steps,
            seconds,
            error: run.states.iter().enumerate().map(|(k, state)| self.error(k, state)).collect(),
        })
    }
}

/// Median wall time of repeated runs; `first` is the wall time of the first one [s].
fn timed(first: Duration, mut run: impl FnMut() -> Result<Run, Error>) -> Result<f64, Error> {
    let repeats = (SHORT.as_secs_f64() / first.as_secs_f64().max(1e-9)).ceil().min(f64::from(REPEATS)) as u32;
    let mut all = Vec::new();
    // A single long run is sufficient; the first of several short ones is for warm-up.
    for _ in 1..repeats {
        all.push(run()?.wall.as_secs_f64());
    }
    all.sort_by(f64::total_cmp);
    Ok(all.get(all.len() / 2).copied().unwrap_or(first.as_secs_f64()))
}
