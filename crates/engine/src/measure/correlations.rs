//! Correlations in time of displacements, velocities and the pressure tensor, from which the coefficients of
//! transport follow by the relations of Einstein and of Green and Kubo.

use crate::{
    model::{
        System,
        measure::{Correlations, Followed},
    },
    numerics::{
        error::EngineError,
        sum::Sum,
        tensor::Tensor,
        words::{Words, fault, put_reals, put_sums},
    },
    report::{CORRELATIONS, Correlation, Exchange, Observer},
    state::{State, deformation::Deformation, flight_sums::Moments, world::World},
};

use super::{
    Measurement,
    multiple_tau::{MultipleTau, Operation},
    stress::StressSums,
};

pub(crate) struct Correlator {
    plan: Correlations,
    /// Number of states taken so far after the initial one.
    taken: u64,
    msd: Vec<Curve>,
    vacf: Vec<Curve>,
    stress: Option<StressCorrelation>,
}

/// A correlation over some particles.
struct Curve {
    tracers: Vec<u32>,
    correlation: MultipleTau,
}

impl Curve {
    /// The curves of what is followed: their tracers are bodies of finite mass.
    fn all(
        followed: &Followed,
        operation: Operation,
        tracers: usize,
        system: &System,
        world: &World,
    ) -> Vec<Self> {
        let of = |species: Option<u32>| {
            let is_followed = |&i: &u32| {
                let is_of =
                    species.is_none_or(|species| system.bodies[world.id(i) as usize].species == species);
                is_of && world.body(i).inverse_mass != 0.0
            };
            let movable: Vec<u32> = (0..world.particles.len() as u32).filter(is_followed).collect();
            let count = movable.len().min(tracers);
            let tracers: Vec<u32> = (0..count).map(|k| movable[k * movable.len() / count]).collect();
            let correlation = MultipleTau::new(operation, 3 * tracers.len(), tracers.len() as f64);
            Self { tracers, correlation }
        };
        match followed {
            Followed::Nothing => Vec::new(),
            Followed::All => vec![of(None)],
            Followed::Species(species) => species.iter().map(|&species| of(Some(species))).collect(),
        }
    }

    /// Adds a state.
    fn add(&mut self, of_particle: impl Fn(u32) -> [f64; 3]) {
        self.correlation.add(self.tracers.iter().flat_map(|&i| of_particle(i)).collect());
    }
}

/// The autocorrelation of the components of a pressure tensor that vanish on average in an isotropic system.
struct StressCorrelation {
    dimension: usize,
    sums: StressSums,
    stress: MultipleTau,
    /// The integrals of the components, and the mean square of their changes.
    integral: Vec<Sum>,
    helfand: MultipleTau,
}

/// The symmetric traceless part of a tensor as independent components of equal variance: P_xy, (P_xx −
/// P_yy)/2, and in three dimensions P_xz, P_yz, (P_xx + P_yy − 2 P_zz)/(2√3). The mean of their squares is
/// the variance of P_xy (P. J. Daivis, D. J. Evans, J. Chem. Phys. 100, 541 (1994)).
fn traceless(tensor: &Tensor, dimension: usize) -> Vec<f64> {
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = *tensor;
    let mut components = vec![0.5 * (xy + yx), 0.5 * (xx - yy)];
    if dimension == 3 {
        let third = (xx + yy - 2.0 * zz) / (2.0 * 3.0_f64.sqrt());
        components.extend([0.5 * (xz + zx), 0.5 * (yz + zy), third]);
    }
    components
}

impl Correlator {
    pub fn new(system: &System, state: &State) -> Self {
        let plan = system.measure.correlations.clone();
        let curves =
            |followed, operation| Curve::all(followed, operation, plan.tracers, system, &state.world);
        let mut correlator = Self {
            taken: 0,
            msd: curves(&plan.msd, Operation::SquareDifference),
            vacf: curves(&plan.vacf, Operation::Product),
            stress: plan.stress.then(|| StressCorrelation::new(system, state)),
            plan,
        };
        correlator.add_particles(state);
        correlator
    }

    /// Adds the present positions and velocities.
    fn add_particles(&mut self, state: &State) {
        let world = &state.world;
        let unwrapped = |i: u32| {
            let [x, y, z] = world.images[i as usize].map(f64::from);
            let image = glam::DVec3::new(x, y, z) * world.periodicity(world.now).size;
            let mut position = world.state(i, world.now).0 + image;
            match &world.boundary.deformation {
                Some(Deformation { sliding: Some(shear), .. }) => {
                    // Only across the flow are displacements those of diffusion.
                    position[shear.flow] = 0.0;
                }
                // Relative to the flow.
                Some(images) => position = images.unstretched(position, world.clock.instant(world.now)),
                None => {}
            }
            position.to_array()
        };
        self.msd.iter_mut().for_each(|curve| curve.add(unwrapped));
        let velocity = |i: u32| world.peculiar(i, world.now).1.to_array();
        self.vacf.iter_mut().for_each(|curve| curve.add(velocity));
    }

    /// Time of state number `k`.
    fn time(&self, k: u64) -> f64 {
        k as f64 * self.plan.interval
    }
}

impl StressCorrelation {
    fn new(system: &System, state: &State) -> Self {
        let dimension = system.dimension.count();
        let width = traceless(&[0.0; 9], dimension).len();
        let mut helfand = MultipleTau::new(Operation::SquareDifference, width, width as f64);
        helfand.add(vec![0.0; width]);
        Self {
            dimension,
            sums: StressSums::new(system, &state.world),
            stress: MultipleTau::new(Operation::ProductOfMeans, width, width as f64),
            integral: vec![Sum::default(); width],
            helfand,
        }
    }

    /// Adds the interval that ends at `time`.
    fn add(&mut self, state: &State, time: f64, interval: f64) {
        let stress = self.sums.finish(&state.world, time).total();
        let components = traceless(&stress, self.dimension);
        for (sum, component) in self.integral.iter_mut().zip(&components) {
            sum.add(component * interval);
        }
        self.stress.add(components);
        self.helfand.add(self.integral.iter().map(Sum::value).collect());
    }
}

impl Measurement for Correlator {
    fn exchange(&mut self, exchange: &Exchange) {
        if let Some(stress) = &mut self.stress {
            stress.sums.exchange(exchange);
        }
    }

    fn flights(&mut self, integrals: &Moments) {
        if let Some(stress) = &mut self.stress {
            stress.sums.flights(integrals);
        }
    }

    fn replace(&mut self, world: &World, time: f64) {
        if let Some(stress) = &mut self.stress {
            stress.sums.replace(world, time);
        }
    }

    fn next(&self, state: &State) -> i64 {
        state.world.clock.ticks(self.time(self.taken + 1))
    }

    fn take(&mut self, state: &State, _observer: &mut dyn Observer) {
        self.taken += 1;
        let time = self.time(self.taken);
        self.add_particles(state);
        if let Some(stress) = &mut self.stress {
            stress.add(state, time, self.plan.interval);
        }
    }

    fn correlations(&self) -> Vec<Correlation> {
        let of_curves =
            |curves: &'_ [Curve]| -> Vec<_> { curves.iter().map(|curve| curve.correlation.lags()).collect() };
        let stress = self.stress.as_ref();
        let all = [
            of_curves(&self.msd),
            of_curves(&self.vacf),
            stress.iter().map(|stress| stress.stress.lags()).collect(),
            stress.iter().map(|stress| stress.helfand.lags()).collect(),
        ];
        let mut found = Vec::new();
        for (kind, curves) in CORRELATIONS.iter().zip(all) {
            // All curves have the same lags, and as many pairs of states.
            let Some(first) = curves.first() else { continue };
            let mut correlation = Correlation {
                name: kind.name,
                species: (kind.species)(&self.plan).to_vec(),
                lag: first.iter().map(|lag| self.time(lag.steps)).collect(),
                count: first.iter().map(|lag| lag.count).collect(),
                ..Correlation::default()
            };
            for k in 0..first.len() {
                correlation.value.extend(curves.iter().map(|lags| lags[k].value));
                correlation.error.extend(curves.iter().map(|lags| lags[k].error));
            }
            found.push(correlation);
        }
        found
    }

    fn save(&self, words: &mut Vec<u64>) {
        words.push(self.taken);
        self.msd.iter().chain(&self.vacf).for_each(|curve| curve.correlation.save(words));
        if let Some(stress) = &self.stress {
            stress.sums.save(words);
            put_sums(words, &stress.integral);
            stress.stress.save(words);
            stress.helfand.save(words);
        }
        put_reals(words, &[self.plan.interval]);
    }

    fn load(&mut self, words: &mut Words, time: f64) -> Result<(), EngineError> {
        self.taken = words.take()?;
        let rounding = 1e-9 * self.plan.interval;
        let last = self.time(self.taken);
        if !(last - rounding <= time && time <= last + self.plan.interval + rounding) {
            return Err(fault(&format!(
                "{} states of correlations do not fit to the time {time}",
                self.taken
            )));
        }
        for curve in self.msd.iter_mut().chain(&mut self.vacf) {
            curve.correlation.load(words)?;
        }
        if let Some(stress) = &mut self.stress {
            stress.sums.load(words)?;
            words.sums(&mut stress.integral)?;
            stress.stress.load(words)?;
            stress.helfand.load(words)?;
        }
        if words.real()? == self.plan.interval { Ok(()) } else { Err(fault("another interval")) }
    }
}
