//! The pressure tensor, as the mean over an interval.
//!
//! |box| P = ⟨Σ m c ⊗ c⟩ + (1/Δt) Σ r ⊗ J, with the vector r between the centers of two particles in contact
//! and the impulse J on the one to which it points (J. H. Irving, J. G. Kirkwood, J. Chem. Phys. 18, 817
//! (1950)), and with c = v − V, where V is the velocity of the center of mass along the axes on which
//! momentum is conserved, and 0 along the others ([`crate::state::center`]). So
//!
//! Σ m c ⊗ c = Σ m v ⊗ v − (M V ⊗ V between conserved axes; V ⊗ p and p ⊗ V between them and the others),
//!
//! with the momentum p. Every mean is an exact integral over the interval: particles without acceleration
//! have constant velocities between events, so that the integral of a moment of v is its value at the end
//! times Δt, minus every change times the time before it. Where they accelerate, each flight has its own
//! ([`crate::motion::flights`]). V is a constant unless there are kicks at Poisson times; V ⊗ p is then the
//! product of both means.

use crate::{
    model::{Dimension, Domain, System},
    numerics::{
        error::EngineError,
        sum::Sum,
        tensor::product,
        total::total,
        words::{Words, put_reals, put_sums},
    },
    report::{Exchange, Partner, Sample, stress_tensor::StressTensor},
    state::{
        State,
        center::Center,
        deformation::Deformation,
        flight_sums::{Moments, Summed, moments, tensor_and_momentum},
        world::World,
    },
};

use super::Measurement;

/// Sums over the events of an interval.
#[derive(Debug, Clone)]
pub(crate) struct StressSums {
    /// Start of the interval \[time\].
    since: f64,
    /// Σ r ⊗ J.
    virial: [Sum; 9],
    kinetic: KineticSums,
    center: Center,
    domain: Domain,
    dimension: Dimension,
    images: Option<Deformation>,
}

/// What makes the integrals of the moments of v.
#[derive(Debug, Clone)]
enum KineticSums {
    /// Their changes times (t − since), summed over the events, without acceleration.
    Changes([Sum; 9]),
    /// Their integrals over all flights.
    Flights([Sum; 9]),
}

impl KineticSums {
    fn sums(&self) -> &[Sum; 9] {
        let (Self::Changes(sums) | Self::Flights(sums)) = self;
        sums
    }

    fn sums_mut(&mut self) -> &mut [Sum; 9] {
        let (Self::Changes(sums) | Self::Flights(sums)) = self;
        sums
    }
}

/// The moments of all particles of finite mass at the present.
fn present(world: &World) -> Moments {
    total(world.particles.len(), |i| {
        let class = world.body(i);
        if class.inverse_mass == 0.0 {
            return [0.0; 9];
        }
        moments(class.mass, world.peculiar(i, world.now).1)
    })
}

impl StressSums {
    pub fn new(system: &System, world: &World) -> Self {
        let sums = Default::default();
        Self {
            since: 0.0,
            virial: Default::default(),
            kinetic: match world.flights {
                Summed::Nothing => KineticSums::Changes(sums),
                Summed::Trace | Summed::Tensor => KineticSums::Flights(sums),
            },
            center: Center::of(world, 0.0),
            domain: system.domain,
            dimension: system.dimension,
            images: world.boundary.deformation.filter(Deformation::stretches),
        }
    }

    /// Adds the changes of an event.
    pub fn exchange(&mut self, exchange: &Exchange) {
        let age = exchange.time - self.since;
        if let KineticSums::Changes(sums) = &mut self.kinetic {
            for change in exchange.changes {
                let before = moments(change.mass, change.before);
                let after = moments(change.mass, change.after);
                for (k, sum) in sums.iter_mut().enumerate() {
                    sum.add(age * (after[k] - before[k]));
                }
            }
        }
        match (exchange.partner, exchange.changes.first()) {
            (Partner::Particle { branch, .. }, Some(change)) => {
                let impulse = -change.mass * (change.after - change.before);
                let weight = self.images.map_or(1.0, |images| images.weight(exchange.time));
                for (sum, term) in self.virial.iter_mut().zip(product(branch, impulse)) {
                    sum.add(weight * term);
                }
            }
            (Partner::Drive, _) => {
                let momentum =
                    exchange.changes.iter().map(|change| change.mass * (change.after - change.before));
                self.center.change(momentum.sum(), exchange.time);
            }
            _ => {}
        }
    }

    /// Adds the integrals over all flights since the previous call.
    pub fn flights(&mut self, integrals: &Moments) {
        if let KineticSums::Flights(sums) = &mut self.kinetic {
            sums.iter_mut().zip(integrals).for_each(|(sum, term)| sum.add(*term));
        }
    }

    /// Goes on with another world from `time` on, after the changes and flights until then.
    pub fn replace(&mut self, world: &World, time: f64) {
        self.center.replace(world, time);
        let present = present(world);
        let other = |k: usize, sum: &Sum| -> Sum {
            [present[k] * (time - self.since), -sum.value()].into_iter().collect()
        };
        self.kinetic = match (&self.kinetic, world.flights) {
            (KineticSums::Changes(sums), Summed::Nothing) => KineticSums::Changes(*sums),
            (KineticSums::Flights(sums), Summed::Trace | Summed::Tensor) => KineticSums::Flights(*sums),
            // The integrals so far are the same in both forms.
            (KineticSums::Changes(sums), _) => {
                KineticSums::Flights(std::array::from_fn(|k| other(k, &sums[k])))
            }
            (KineticSums::Flights(sums), _) => {
                KineticSums::Changes(std::array::from_fn(|k| other(k, &sums[k])))
            }
        };
    }

    /// The mean over the interval that ends at `time`, which is the present; NaN for an empty interval.
    /// Starts the next interval.
    pub fn finish(&mut self, world: &World, time: f64) -> StressTensor {
        let span = time - self.since;
        let volume = self.domain.mean_volume(self.dimension, [self.since, time]);
        let sums = self.kinetic.sums().map(|sum| sum.value() / span);
        let mean = match &self.kinetic {
            KineticSums::Changes(_) => {
                let end = present(world);
                std::array::from_fn(|k| end[k] - sums[k])
            }
            KineticSums::Flights(_) => sums,
        };
        let (kinetic, momentum) = tensor_and_momentum(&mean);
        let center = self.center.take(time);
        let stress = if span > 0.0 {
            let common = center.mean(momentum, span);
            StressTensor {
                kinetic: std::array::from_fn(|k| (kinetic[k] - common[k]) / volume),
                collisional: std::array::from_fn(|k| self.virial[k].value() / (span * volume)),
            }
        } else {
            StressTensor { kinetic: [f64::NAN; 9], collisional: [f64::NAN; 9] }
        };
        self.since = time;
        self.virial = Default::default();
        *self.kinetic.sums_mut() = Default::default();
        stress
    }

    pub fn save(&self, words: &mut Vec<u64>) {
        put_reals(words, &[self.since, self.center.until]);
        put_sums(words, &self.virial);
        put_sums(words, self.kinetic.sums());
        put_sums(words, &self.center.momentum);
        put_sums(words, &self.center.integrals.energy);
        put_sums(words, &self.center.integrals.path);
    }

    pub fn load(&mut self, words: &mut Words) -> Result<(), EngineError> {
        self.since = words.real()?;
        self.center.until = words.real()?;
        words.sums(&mut self.virial)?;
        words.sums(self.kinetic.sums_mut())?;
        words.sums(&mut self.center.momentum)?;
        words.sums(&mut self.center.integrals.energy)?;
        words.sums(&mut self.center.integrals.path)
    }
}

/// The pressure tensor in samples.
pub(crate) struct Stress {
    sums: StressSums,
    /// Whether there was a sample: as for the pressure, the first one has no interval.
    started: bool,
}

impl Stress {
    pub fn new(system: &System, world: &World) -> Self {
        Self { sums: StressSums::new(system, world), started: false }
    }
}

impl Measurement for Stress {
    fn exchange(&mut self, exchange: &Exchange) {
        self.sums.exchange(exchange);
    }

    fn flights(&mut self, integrals: &Moments) {
        self.sums.flights(integrals);
    }

    fn replace(&mut self, world: &World, time: f64) {
        self.sums.replace(world, time);
    }

    fn complete(&mut self, state: &State, time: f64, sample: &mut Sample) {
        let mut stress = self.sums.finish(&state.world, time);
        if !self.started {
            stress = StressTensor { kinetic: [f64::NAN; 9], collisional: [f64::NAN; 9] };
        }
        self.started = true;
        sample.stress = Some(stress);
    }

    fn save(&self, words: &mut Vec<u64>) {
        words.push(u64::from(self.started));
        self.sums.save(words);
    }

    fn load(&mut self, words: &mut Words, _time: f64) -> Result<(), EngineError> {
        self.started = words.count("the flag of the first sample", 1)? == 1;
        self.sums.load(words)
    }
}
