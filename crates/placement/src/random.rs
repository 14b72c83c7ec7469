//! Random numbers: one stream per purpose, name and particle, so that no draw depends on the number of other
//! draws. Adding a species, an observer or a thread does not change the numbers of the others.

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// The random numbers of one particle for one purpose.
#[derive(Debug)]
pub struct Stream(Pcg64Mcg);

/// Purposes of random numbers. The discriminants are part of the meaning of a seed: never reuse one.
#[derive(Debug, Clone, Copy)]
#[repr(u64)]
pub enum Purpose {
    /// Radii of a distribution.
    Radius = 1,
    /// Velocities.
    Velocity = 2,
    /// Places of a random packing.
    Insertion = 3,
    /// Which sites of a lattice stay empty.
    Vacancy = 4,
    /// The order of species on a lattice.
    Mixing = 5,
    /// Angular velocities.
    Spin = 6,
}

impl Stream {
    /// The stream of particle `index` of the species `name`.
    pub fn new(seed: u64, purpose: Purpose, name: &str, index: usize) -> Self {
        let mut key = [0_u8; 24];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..16].copy_from_slice(&(purpose as u64).to_le_bytes());
        key[16..].copy_from_slice(&(index as u64).to_le_bytes());
        Self(Pcg64Mcg::seed_from_u64(xxh3_64_with_seed(&key, xxh3_64_with_seed(name.as_bytes(), 0))))
    }

    /// Uniform in [0, 1): 53 random bits.
    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (0.5 / (1_u64 << 52) as f64)
    }

    /// Uniform in [a, b].
    pub fn between(&mut self, a: f64, b: f64) -> f64 {
        (a + (b - a) * self.unit()).clamp(a, b)
    }

    /// Uniform in 0..n, by multiplication; the bias of n/2^64 is far below anything measurable here.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.0.next_u64()) * n as u128) >> 64) as usize
    }

    /// Two independent standard normal deviates: Marsaglia's polar form of Box–Muller. The logarithm is
    /// `libm`'s and the square root is exact, so that all machines draw the same bits.
    pub fn normal_pair(&mut self) -> [f64; 2] {
        loop {
            let (x, y) = (2.0 * self.unit() - 1.0, 2.0 * self.unit() - 1.0);
            let s = x * x + y * y;
            if s > 0.0 && s < 1.0 {
                let scale = (-2.0 * libm::log(s) / s).sqrt();
                return [x * scale, y * scale];
            }
        }
    }

    /// Gamma deviate of this shape, with scale 1: Marsaglia and Tsang, ACM Trans. Math. Softw. 26, 363
    /// (2000).
    pub fn gamma(&mut self, shape: f64) -> f64 {
        // For a shape below 1 from that of shape + 1.
        let more = if shape < 1.0 { 1.0 } else { 0.0 };
        let d = shape + more - 1.0 / 3.0;
        let c = 1.0 / (9.0 * d).sqrt();
        let deviate = loop {
            let [x, _] = self.normal_pair();
            let v = (1.0 + c * x) * (1.0 + c * x) * (1.0 + c * x);
            // 1 − u is never zero.
            let u = 1.0 - self.unit();
            if v > 0.0 && libm::log(u) < 0.5 * x * x + d - d * v + d * libm::log(v) {
                break d * v;
            }
        };
        if more == 0.0 { deviate } else { deviate * libm::pow(1.0 - self.unit(), 1.0 / shape) }
    }

    /// Normal deviate restricted to [low, high], by rejection against the highest density there.
    /// `low` and `high` are in units of the standard deviation about the mean.
    pub fn truncated_normal(&mut self, low: f64, high: f64) -> f64 {
        let mode = 0.0_f64.clamp(low, high);
        // Beyond this the density is below e^-36 of its maximum: it contributes nothing.
        let (low, high) = (low.max(mode - 8.5), high.min(mode + 8.5));
        for _ in 0..100_000 {
            let x = self.between(low, high);
            if self.unit() < libm::exp(0.5 * (mode * mode - x * x)) {
                return x;
            }
        }
        mode
    }
}
