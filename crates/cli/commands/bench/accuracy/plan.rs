//! Plan of the measurement: scenes, methods and their parameters, sizes. Takes about a minute in all.

use haff_accuracy::{
    Error, closed,
    growth::{self, Growth},
    methods::{Engine, Method, Peer, Program, SoftSpheres, Stepper},
    scenes::{at_unit_temperature, gas, melted},
    statistics::{PARTICLES, Quantity, Starts, estimate},
    trial::Solution,
};
use haff_engine::{Boundary, System};
use serde_json::Value;

use super::report;

/// Bits of the reference.
const BITS: usize = 256;
/// Extent of the measurement.
pub struct Size {
    /// Steps and contact times, in units of the time in which the fastest sphere moves by its diameter.
    parameters: &'static [f64],
    /// Collisions per particle of the walled gas.
    followed: u32,
    /// Wall time of a method for each quantity [s].
    budget: f64,
    /// Steps times particles that a run of the statistics may take.
    affordable: f64,
    /// Number of initial states of each gas whose error growth is measured.
    starts: u64,
    /// Gases whose error growth is measured: a name, spheres along an edge, packing fraction, collisions per
    /// particle.
    gases: &'static [(&'static str, usize, f64, u32)],
}

/// About a minute. The gases run for more collisions than double precision can follow and fewer than 256 bits
/// can; the dilute one crosses epochs of the engine's clock.
pub const FULL: Size = Size {
    parameters: &[1e-1, 1e-2, 1e-3, 1e-4],
    followed: 40,
    budget: 0.7,
    affordable: 1.1e8,
    starts: 6,
    gases: &[("fluid", 4, 0.1, 28), ("gas", 4, 0.01, 10), ("sparse", 2, 0.001, 8)],
};

/// Some seconds.
pub const QUICK: Size = Size {
    parameters: &[1e-1, 1e-2],
    followed: 4,
    budget: 0.05,
    affordable: 1.2e7,
    starts: 2,
    gases: &[("gas", 3, 0.01, 8), ("sparse", 2, 0.001, 6)],
};

/// Steps times particles that a run on a scene may take: about a second.
const AFFORDABLE: f64 = 3e7;
/// Steps of a soft contact; assumed for peers too.
const STEPS_PER_CONTACT: f64 = 50.0;
/// Samples of a gas for each collision per particle.
const SAMPLES: u32 = 2;
/// Collisions per particle after which the errors of the methods in the walled gas are compared.
const COMPARED: usize = 4;
/// A method with the steps that it takes for a simulated time.
struct Candidate<'a> {
    method: Box<dyn Method + 'a>,
    steps_per_time: f64,
}

/// The methods with all their parameters.
fn candidates<'a>(peers: &'a [Program], time_scale: f64, parameters: &[f64]) -> Vec<Candidate<'a>> {
    let mut all =
        vec![Candidate { method: Box::new(Engine::default()) as Box<dyn Method>, steps_per_time: 0.0 }];
    let values = || parameters.iter().map(|parameter| parameter * time_scale);
    all.extend(values().map(|dt| Candidate { method: Box::new(Stepper { dt }), steps_per_time: 1.0 / dt }));
    let contact = |value: f64, method| Candidate { method, steps_per_time: STEPS_PER_CONTACT / value };
    all.extend(values().map(|value| contact(value, Box::new(SoftSpheres::new(value)))));
    for program in peers {
        all.extend(values().map(|parameter| contact(parameter, Box::new(Peer { program, parameter }))));
    }
    all
}

impl Candidate<'_> {
    fn affords(&self, system: &System, time: f64) -> bool {
        self.work(system.bodies.len(), time) <= AFFORDABLE
    }

    /// Steps times particles.
    fn work(&self, particles: usize, time: f64) -> f64 {
        self.steps_per_time * time * particles as f64
    }
}

/// Methods that cannot run a scene, each reported once.
#[derive(Default)]
struct Unable(Vec<String>);

impl Unable {
    fn has(&self, candidate: &Candidate) -> bool {
        self.0.iter().any(|name| name == candidate.method.name())
    }

    fn note(&mut self, candidate: &Candidate, error: &Error, announce: &dyn Fn(&str)) {
        announce(&format!("{error}"));
        self.0.push(candidate.method.name().to_owned());
    }
}

/// The gas that all methods run: 64 inelastic spheres between walls, which every peer supports.
fn walled_gas(collisions: u32) -> Result<Solution, Error> {
    let system = at_unit_temperature(melted(&gas(4, 0.05, Boundary::Wall, 0.9, 1), 20.0)?);
    Solution::by_reference(
        "gas",
        &format!(
            "64 spheres between elastic walls, packing fraction 0.05, e = 0.9, after {COMPARED} collisions each"
        ),
        system,
        collisions,
        SAMPLES,
        BITS,
    )
}

/// Run time against error on scenes whose final state is known.
pub fn scenes(
    size: &Size,
    peers: &[Program],
    announce: &dyn Fn(&str),
    stopped: &dyn Fn() -> bool,
) -> Result<Vec<Value>, Error> {
    announce(&report::trials_head());
    let mut found = Vec::new();
    let closed: Vec<Solution> = closed::all().into_iter().map(Solution::from).collect();
    for answer in closed.into_iter().chain([walled_gas(size.followed)?]) {
        let short = answer.truncated(COMPARED * SAMPLES as usize);
        let span = short.times.last().copied().unwrap_or(0.0);
        announce(&format!("{}: {}", answer.name, answer.description));
        let mut trials = Vec::new();
        let mut unable = Unable::default();
        for candidate in candidates(peers, answer.time_scale, size.parameters) {
            if stopped() {
                return Err(Error::Interrupted);
            }
            if unable.has(&candidate) || !candidate.affords(&answer.system, span) {
                continue;
            }
            let trial = match short.measure(candidate.method.as_ref()) {
                Ok(trial) => trial,
                Err(error @ (Error::Peer { .. } | Error::Unsupported { .. })) if !stopped() => {
                    unable.note(&candidate, &error, announce);
                    continue;
                }
                Err(error) => return Err(error),
            };
            let followed = if answer.collisions.is_empty() {
                None
            } else {
                Some(answer.error_growth(candidate.method.as_ref(), |time| {
                    candidate.affords(&answer.system, time)
                })?)
            };
            announce(&report::trial_line(&trial, followed.as_ref()));
            trials.push(report::trial(&trial, followed.as_ref()));
        }
        found.push(report::scene(&short, &trials));
    }
    Ok(found)
}

/// Pressure and cooling rate from a fixed time each.
pub fn statistics(
    size: &Size,
    peers: &[Program],
    announce: &dyn Fn(&str),
    stopped: &dyn Fn() -> bool,
) -> Result<Vec<Value>, Error> {
    announce(&report::estimates_head(size.budget));
    let mut found = Vec::new();
    for quantity in [Quantity::Compressibility, Quantity::CoolingRate] {
        announce(&format!(
            "{}: {}; theory {:.6}",
            quantity.name(),
            quantity.description(),
            quantity.expected()
        ));
        let mut starts = Starts::new(quantity, 1)?;
        let mut estimates = Vec::new();
        let mut unable = Unable::default();
        // The fastest thermal spheres move by their diameter in a time of about a third.
        for candidate in candidates(peers, 1.0 / 3.0, size.parameters) {
            if unable.has(&candidate) || candidate.work(PARTICLES, quantity.stretch()) > size.affordable {
                continue;
            }
            match estimate(&mut starts, candidate.method.as_ref(), size.budget, stopped) {
                Ok(Some(estimate)) => {
                    announce(&report::estimate_line(&estimate));
                    estimates.push(report::estimate(&estimate));
                }
                Ok(None) => (),
                Err(error @ (Error::Peer { .. } | Error::Unsupported { .. })) if !stopped() => {
                    unable.note(&candidate, &error, announce);
                }
                Err(error) => return Err(error),
            }
        }
        found.push(report::quantity(quantity, size.budget, &estimates));
    }
    Ok(found)
}

/// Growth of errors.
pub fn growth(size: &Size, announce: &dyn Fn(&str), stopped: &dyn Fn() -> bool) -> Result<Vec<Value>, Error> {
    announce(&report::growth_head());
    let mut found = Vec::new();
    for &(name, per_edge, phi, collisions) in size.gases {
        let description =
            format!("{} elastic spheres in a periodic cube, packing fraction {phi}", per_edge.pow(3));
        let mut runs: Vec<Growth> = Vec::new();
        for seed in 1..=size.starts {
            if stopped() {
                return Err(Error::Interrupted);
            }
            let system = melted(&gas(per_edge, phi, Boundary::Periodic, 1.0, seed), 20.0)?;
            let answer = Solution::by_reference(name, &description, system, collisions, SAMPLES, BITS)?;
            runs.push(growth::measure(&answer, BITS, seed)?);
        }
        let gas = report::growth(name, &description, per_edge.pow(3), BITS, &runs);
        announce(&report::growth_line(&gas));
        found.push(gas);
    }
    Ok(found)
}
