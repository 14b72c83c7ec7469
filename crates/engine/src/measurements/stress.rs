//! The pressure tensor, as the mean over an interval.
//!
//! V P = ⟨Σ m v ⊗ v⟩ + (1/Δt) Σ r ⊗ J, with the vector r between the centers of two particles in contact and
//! the impulse J on the one to which it points (J. H. Irving, J. G. Kirkwood, J. Chem. Phys. 18, 817 (1950)).
//! Particles without acceleration have constant velocities between events, so that the integral of the first
//! term over the interval is its value at the end times Δt, minus every change times the time before it. With
//! gravity, or on walls that carry grains, it is the mean of the values at both ends. Under shear v is the
//! peculiar velocity, which is linear in time: the term is integrated for each flight.

use glam::DVec3;

use super::{
    Measurement, Words,
    words::{put_reals, put_sums},
};
use crate::{
    error::EngineError,
    measure::{Totals, total},
    model::System,
    particles::World,
    report::{Exchange, Partner, Sample},
    shear::SlidingImages,
    state::State,
    sum::Sum,
};

/// A tensor, row by row.
pub(super) type Tensor = [f64; 9];

/// The product a ⊗ b.
#[inline]
pub(super) fn product(a: DVec3, b: DVec3) -> Tensor {
    let (a, b) = (a.to_array(), b.to_array());
    std::array::from_fn(|k| a[k / 3] * b[k % 3])
}

/// A pressure tensor, or one of its parts [energy/length^d]. Its components beyond the dimension are zero.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StressTensor {
    /// Momentum that particles carry in their flights.
    pub kinetic: Tensor,
    /// Momentum that contacts transfer over the distance of the centers.
    pub collisional: Tensor,
}

impl StressTensor {
    /// The sum of both parts.
    #[must_use]
    pub fn total(&self) -> Tensor {
        std::array::from_fn(|k| self.kinetic[k] + self.collisional[k])
    }
}

/// Sums over the events of an interval.
#[derive(Debug, Clone)]
pub(super) struct StressSums {
    /// Start of the interval \[time\], and Σ m v ⊗ v then.
    since: f64,
    kinetic: Tensor,
    /// Σ r ⊗ J.
    virial: [Sum; 9],
    /// Σ Δ(m v ⊗ v) (t − since).
    moment: [Sum; 9],
    volume: f64,
    shear: Option<ShearedFlights>,
}

/// The integral of Σ m c ⊗ c over flights in a sheared system.
#[derive(Debug, Clone)]
struct ShearedFlights {
    images: SlidingImages,
    /// The time up to which the flight of each particle is in the sums.
    until: Vec<f64>,
    /// ∫ Σ m c ⊗ c dt.
    integral: [Sum; 9],
}

impl ShearedFlights {
    fn new(world: &World) -> Option<Self> {
        let images = world.shear?;
        Some(Self { images, until: vec![0.0; world.particles.len()], integral: Default::default() })
    }

    /// Adds the flight of a particle up to `time`, where it has the peculiar velocity `c`.
    fn add(&mut self, i: u32, mass: f64, c: DVec3, time: f64) {
        let age = time - std::mem::replace(&mut self.until[i as usize], time);
        let SlidingImages { flow, gradient, rate, .. } = self.images;
        // Before, c was larger along the flow by γ̇ c_y for each unit of time.
        let growth = DVec3::AXES[flow] * (rate * c[gradient]);
        let (constant, linear) = (product(c, c), product(c, growth));
        let square = product(growth, growth);
        for (k, sum) in self.integral.iter_mut().enumerate() {
            let transposed = 3 * (k % 3) + k / 3;
            let slope = linear[k] + linear[transposed];
            sum.add(mass * age * (constant[k] + age * (0.5 * slope + age * square[k] / 3.0)));
        }
    }
}

/// Σ m v ⊗ v of all particles of finite mass.
fn kinetic(world: &World) -> Tensor {
    let [xx, xy, xz, yy, yz, zz] = total(world.particles.len(), |i| {
        let class = world.body(i);
        if class.inverse_mass == 0.0 {
            return [0.0; 6];
        }
        let (_, v) = world.peculiar(i, world.now);
        let p = class.mass * v;
        [p.x * v.x, p.x * v.y, p.x * v.z, p.y * v.y, p.y * v.z, p.z * v.z]
    });
    [xx, xy, xz, xy, yy, yz, xz, yz, zz]
}

impl StressSums {
    pub fn new(system: &System, world: &World) -> Self {
        let size = system.domain.size.to_array();
        Self {
            since: 0.0,
            kinetic: kinetic(world),
            virial: Default::default(),
            moment: Default::default(),
            volume: size[..system.dimension.count()].iter().product(),
            shear: ShearedFlights::new(world),
        }
    }

    /// Adds the changes of an event.
    pub fn exchange(&mut self, exchange: &Exchange) {
        let age = exchange.time - self.since;
        if let Some(shear) = &mut self.shear {
            for change in exchange.changes {
                shear.add(change.i, change.mass, change.before, exchange.time);
            }
        }
        for change in exchange.changes {
            let before = product(change.before, change.before);
            let after = product(change.after, change.after);
            for (k, sum) in self.moment.iter_mut().enumerate() {
                sum.add(change.mass * age * (after[k] - before[k]));
            }
        }
        if let (Partner::Particle { branch, .. }, Some(change)) = (exchange.partner, exchange.changes.first())
        {
            let impulse = -change.mass * (change.after - change.before);
            for (sum, term) in self.virial.iter_mut().zip(product(branch, impulse)) {
                sum.add(term);
            }
        }
    }

    /// The mean over the interval that ends at `time`, which is the present, with `momentum` ⊗ velocity of
    /// the center of mass taken off; NaN for an empty interval. Starts the next interval.
    pub fn finish(&mut self, world: &World, time: f64, drift: Tensor) -> StressTensor {
        let (span, volume) = (time - self.since, self.volume);
        let end = kinetic(world);
        let integral = self.shear.as_mut().map(|shear| {
            for i in 0..world.particles.len() as u32 {
                shear.add(i, world.body(i).mass, world.peculiar(i, world.now).1, time);
            }
            std::mem::take(&mut shear.integral)
        });
        let straight = world.flies_straight();
        let mean = |k: usize| {
            let thermal = if let Some(integral) = &integral {
                integral[k].value() / span
            } else if straight {
                end[k] - self.moment[k].value() / span
            } else {
                0.5 * (end[k] + self.kinetic[k])
            };
            (thermal - drift[k]) / volume
        };
        let stress = if span > 0.0 {
            StressTensor {
                kinetic: std::array::from_fn(mean),
                collisional: std::array::from_fn(|k| self.virial[k].value() / (span * volume)),
            }
        } else {
            StressTensor { kinetic: [f64::NAN; 9], collisional: [f64::NAN; 9] }
        };
        (self.since, self.kinetic) = (time, end);
        (self.virial, self.moment) = Default::default();
        stress
    }

    pub fn save(&self, words: &mut Vec<u64>) {
        put_reals(words, &[self.since]);
        put_reals(words, &self.kinetic);
        put_sums(words, &self.virial);
        put_sums(words, &self.moment);
        if let Some(shear) = &self.shear {
            put_reals(words, &shear.until);
            put_sums(words, &shear.integral);
        }
    }

    pub fn load(&mut self, words: &mut Words) -> Result<(), EngineError> {
        self.since = words.real()?;
        self.kinetic.copy_from_slice(&words.reals(9)?);
        words.sums(&mut self.virial)?;
        words.sums(&mut self.moment)?;
        if let Some(shear) = &mut self.shear {
            let count = shear.until.len();
            shear.until.copy_from_slice(&words.reals(count)?);
            words.sums(&mut shear.integral)?;
        }
        Ok(())
    }
}

/// The pressure tensor in samples.
pub(super) struct Stress {
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

    fn complete(&mut self, state: &State, time: f64, sample: &mut Sample) {
        let totals = Totals::of(&state.world);
        let mut stress = self.sums.finish(&state.world, time, product(totals.momentum, totals.drift()));
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
