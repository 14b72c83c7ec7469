/*!
Pressure and Haff's cooling rate measured in a fixed budget of time, compared with theory.

Every method starts from the same states, one after the other, until its time is used up: a fast method
averages over many, so its statistical error is small; a slow one averages over few. The error that does not
average out is the method's bias.
*/

use std::f64::consts::{FRAC_PI_6, PI};

use haff_engine::{Boundary, Options, Silent, Simulation, System, Until};

use crate::{
    Error,
    methods::{Method, State},
    scenes::{at_unit_temperature, gas, with_state},
};

/// Spheres along each edge of the initial lattice: 512 in all.
const PER_EDGE: usize = 8;
/// Spheres.
pub const PARTICLES: usize = PER_EDGE.pow(3);
/// Collisions per particle from one initial state to the next: the length of a run.
const STRETCH: f64 = 10.0;
/// Collisions per particle before the first initial state.
const MELT: f64 = 60.0;

/// The measured quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Z = P V/N T of elastic spheres, packing fraction 0.3.
    Compressibility,
    /// 1/τ of T = T₀/(1 + t/τ)² at T₀ = 1, packing fraction 0.05, e = 0.99.
    CoolingRate,
}

impl Quantity {
    /// Short name for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Compressibility => "pressure",
            Self::CoolingRate => "cooling",
        }
    }

    /// Description in one line.
    pub fn description(self) -> String {
        let n = PARTICLES;
        match self {
            Self::Compressibility => format!("Z = PV/NT, {n} elastic spheres, packing fraction 0.3"),
            Self::CoolingRate => format!("Haff's rate 1/τ, {n} spheres, packing fraction 0.05, e = 0.99"),
        }
    }

    fn packing_fraction(self) -> f64 {
        match self {
            Self::Compressibility => 0.3,
            Self::CoolingRate => 0.05,
        }
    }

    fn restitution(self) -> f64 {
        match self {
            Self::Compressibility => 1.0,
            Self::CoolingRate => 0.99,
        }
    }

    /// Theory for the given number of particles, with relative errors of about 1e-4 (pressure) and 5e-4
    /// (cooling rate).
    pub fn expected(self) -> f64 {
        let (n, phi, e) = (PARTICLES as f64, self.packing_fraction(), self.restitution());
        let finite = finite_compressibility(phi, n);
        if self == Self::Compressibility {
            return finite;
        }
        // ω₀ = 4 n σ² g₀ √(πT/m), 1/τ = (1 − e²) ω₀ (1 + 3a₂/16)/2d; (Z − 1)/4φ is g₀ with the corrections
        // for a finite number. The relative velocities have the temperature per remaining degree of freedom,
        // n/(n − 1).
        let temperature: f64 = n / (n - 1.0);
        let rate = 4.0 * (phi / FRAC_PI_6) * (finite - 1.0) / (4.0 * phi) * (PI * temperature).sqrt();
        let a2 = 16.0 * (1.0 - e) * (1.0 - 2.0 * e * e) / (81.0 - 17.0 * e + 30.0 * (1.0 - e) * e * e);
        (1.0 - e * e) * rate * (1.0 + 3.0 * a2 / 16.0) / 6.0
    }

    /// Length of a run [time]: about that from one initial state to the next.
    pub fn stretch(self) -> f64 {
        let phi = self.packing_fraction();
        STRETCH / (4.0 * (phi / FRAC_PI_6) * (compressibility(phi) - 1.0) / (4.0 * phi) * PI.sqrt())
    }
}

/// Z of the hard-sphere fluid by the modified Kolafa–Labík–Malijevský equation, accurate to some 4e-5.
pub fn compressibility(phi: f64) -> f64 {
    const TERMS: [(i32, f64); 11] = [
        (1, 4.0),
        (2, 6.0),
        (3, 2.364_768_4),
        (4, -0.869_855_1),
        (5, 1.106_280_3),
        (6, -1.101_422_1),
        (7, 0.666_058_66),
        (8, -0.036_334_31),
        (10, -0.209_651_64),
        (14, 0.105_565_69),
        (22, -0.008_723_8),
    ];
    let x = phi / (1.0 - phi);
    1.0 + TERMS.iter().map(|(power, factor)| factor * x.powi(*power)).sum::<f64>()
}

/// Z = P V/(⅔ T) of `n` spheres in a periodic box with zero total momentum, to first order in 1/n.
///
/// At fixed number the free energy contains ½ ln χ, χ = ∂n/∂(P/T), so that Z_n = Z + (1/2n) d ln χ/d ln φ;
/// and at fixed momentum relative velocities are larger than the kinetic energy over n by n/(n − 1): Z − 1
/// grows by that factor.
pub fn finite_compressibility(phi: f64, n: f64) -> f64 {
    let inverse = |phi: f64| {
        let h = 1e-4 * phi;
        ((phi + h) * compressibility(phi + h) - (phi - h) * compressibility(phi - h)) / (2.0 * h)
    };
    let h = 1e-3 * phi;
    let slope = -phi * (inverse(phi + h).ln() - inverse(phi - h).ln()) / (2.0 * h);
    1.0 + (compressibility(phi) + slope / (2.0 * n) - 1.0) * n / (n - 1.0)
}

/// Initial states in the steady state, each ten collisions per particle after the one before, generated on
/// demand.
pub struct Starts {
    quantity: Quantity,
    simulation: Simulation,
    system: System,
    made: Vec<System>,
}

impl Starts {
    /// Melts the gas.
    pub fn new(quantity: Quantity, seed: u64) -> Result<Self, Error> {
        let system =
            gas(PER_EDGE, quantity.packing_fraction(), Boundary::Periodic, quantity.restitution(), seed);
        let mut simulation = Simulation::new(system.clone(), Options::default())?;
        advance_by(&mut simulation, MELT)?;
        Ok(Self { quantity, simulation, system, made: Vec::new() })
    }

    fn get(&mut self, k: usize) -> Result<&System, Error> {
        while self.made.len() <= k {
            let start = at_unit_temperature(with_state(&self.system, &self.simulation.frame()));
            self.made.push(start);
            advance_by(&mut self.simulation, STRETCH)?;
        }
        Ok(&self.made[k])
    }
}

fn advance_by(simulation: &mut Simulation, per_particle: f64) -> Result<(), Error> {
    let more = (0.5 * per_particle * simulation.particles() as f64).round() as u64;
    let collisions = simulation.counters().collisions + more;
    simulation.advance(Until { collisions, ..Until::default() }, &mut Silent)?;
    Ok(())
}

/// A mean over runs, with the value of theory.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// The method's name.
    pub method: String,
    /// Its parameter, as text.
    pub parameter: String,
    /// Its parameter, as a number.
    pub value: Option<f64>,
    /// Number of runs.
    pub runs: usize,
    /// Wall time of all of them [s].
    pub seconds: f64,
    /// Mean.
    pub mean: f64,
    /// Standard error of the mean.
    pub standard_error: f64,
    /// Theory.
    pub expected: f64,
}

impl Estimate {
    /// mean/expected − 1
    pub fn relative_error(&self) -> f64 {
        self.mean / self.expected - 1.0
    }

    /// Relative standard error.
    pub fn relative_standard_error(&self) -> f64 {
        self.standard_error / self.expected
    }
}

/// Runs a method from one initial state after the other for `budget` seconds, but at least three times.
/// `None` if the method does not provide the quantity.
pub fn estimate(
    starts: &mut Starts,
    method: &dyn Method,
    budget: f64,
    stopped: &dyn Fn() -> bool,
) -> Result<Option<Estimate>, Error> {
    const LEAST: usize = 3;
    let quantity = starts.quantity;
    let time = quantity.stretch();
    let (mut found, mut seconds) = (Vec::new(), 0.0);
    while found.len() < LEAST || seconds < budget {
        if stopped() {
            return Err(Error::Interrupted);
        }
        let start = starts.get(found.len())?;
        let run = method.run(start, &[time])?;
        seconds += run.wall.as_secs_f64();
        let value = match quantity {
            Quantity::Compressibility => run.compressibility,
            // √(T₀/T) = 1 + t/τ, T₀ = 1
            Quantity::CoolingRate => {
                run.states.last().map(|state| (1.0 / temperature(state).sqrt() - 1.0) / time)
            }
        };
        let Some(value) = value else { return Ok(None) };
        found.push(value);
    }
    let count = found.len() as f64;
    let mean = found.iter().sum::<f64>() / count;
    let variance = found.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    Ok(Some(Estimate {
        method: method.name().to_owned(),
        parameter: method.parameter(),
        value: method.value(),
        runs: found.len(),
        seconds,
        mean,
        standard_error: (variance / count).sqrt(),
        expected: quantity.expected(),
    }))
}

/// T of spheres of unit mass, as set by `at_unit_temperature`: T = Σ|v − V|²/3N.
fn temperature(state: &State) -> f64 {
    let n = state.velocity.len() as f64;
    let mean = state.velocity.iter().sum::<glam::DVec3>() / n;
    state.velocity.iter().map(|v| (*v - mean).length_squared()).sum::<f64>() / (3.0 * n)
}
