/*!
Predictions of many pairs at a time.

The candidates of one particle are gathered into a structure of arrays and predicted without branches, so that
the compiler vectorizes the kernel. The earliest contact is selected afterwards. The same source is compiled
once for the baseline instruction set and once for AVX2. Rust neither fuses nor reorders floating-point
operations, so that both give the same bits as [`haff_mechanics::time_to_contact`].
*/

use crate::model::SimdChoice;

/// Number of candidates per batch; more candidates are predicted in several batches.
pub(crate) const LANES: usize = 64;

/// The candidates of one particle, each pair at the time of its later anchor.
#[derive(Debug, Clone)]
pub(crate) struct Batch {
    /// Relative position r_j − r_i + s L [length].
    pub r: [[f64; LANES]; 3],
    /// Relative velocity v_j − v_i [length/time].
    pub v: [[f64; LANES]; 3],
    /// Square of the contact distance [length²].
    pub sigma2: [f64; LANES],
    /// Time of the later anchor of the pair, minus that of the anchor of the particle [ticks].
    pub offset: [i64; LANES],
    /// Index of the candidate.
    pub id: [u32; LANES],
    /// Result: time from the later anchor to the contact [time], infinite without a contact.
    pub delay: [f64; LANES],
    /// Number of candidates.
    pub len: usize,
}

impl Batch {
    pub fn new() -> Self {
        Self {
            r: [[0.0; LANES]; 3],
            v: [[0.0; LANES]; 3],
            sigma2: [0.0; LANES],
            offset: [0; LANES],
            id: [0; LANES],
            delay: [0.0; LANES],
            len: 0,
        }
    }

    /// Predicts all candidates.
    #[inline]
    pub fn predict(&mut self, kernel: Kernel) {
        match kernel {
            Kernel::Portable => predict(self),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: only `Kernel::choose` makes this variant, after it has detected the features.
            Kernel::Avx2 => unsafe { predict_avx2(self) },
        }
    }
}

/// The builds of the kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kernel {
    /// For the baseline instruction set.
    Portable,
    /// With vectors of 256 bits. Vectors of 512 bits gave no overall gain (benches/record/throughput.md).
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Kernel {
    /// Whether there are engines for particles of one size, which are only faster than the others. Not for
    /// the portable kernel of x86-64, which is rare, to compile fewer of them.
    pub const fn has_engines_of_one_size(self) -> bool {
        !cfg!(target_arch = "x86_64") || !matches!(self, Self::Portable)
    }

    /// The kernel for this choice; `None` if the processor does not support it.
    pub fn choose(choice: SimdChoice) -> Option<Self> {
        #[cfg(target_arch = "x86_64")]
        let avx2 = (std::is_x86_feature_detected!("avx2")
            && std::is_x86_feature_detected!("fma")
            && std::is_x86_feature_detected!("bmi1")
            && std::is_x86_feature_detected!("bmi2")
            && std::is_x86_feature_detected!("lzcnt")
            && std::is_x86_feature_detected!("popcnt"))
        .then_some(Self::Avx2);
        #[cfg(not(target_arch = "x86_64"))]
        let avx2 = None;
        match choice {
            SimdChoice::Auto => avx2.or(Some(Self::Portable)),
            SimdChoice::Avx2 => avx2,
            SimdChoice::Portable => Some(Self::Portable),
        }
    }
}

/// [`predict`], compiled for vectors of 256 bits: 1.3–1.5 times the collisions per second in dense systems.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn predict_avx2(batch: &mut Batch) {
    predict(batch);
}

/// Computes the delays of all candidates.
#[inline(always)]
fn predict(batch: &mut Batch) {
    let Batch { r: [rx, ry, rz], v: [vx, vy, vz], sigma2, delay: delays, len, .. } = batch;
    // Whole vectors are computed: the lanes after the last candidate hold old ones, whose results are not
    // read.
    let lanes = (*len).next_multiple_of(4).min(LANES);
    for k in 0..lanes {
        delays[k] = delay([rx[k], ry[k], rz[k]], [vx[k], vy[k], vz[k]], sigma2[k]);
    }
}

/// The smaller root of |r + v t| = σ [time], infinite without a contact; see
/// [`haff_mechanics::time_to_contact`] for the numerical method.
#[inline(always)]
pub(crate) fn delay([rx, ry, rz]: [f64; 3], [vx, vy, vz]: [f64; 3], sigma2: f64) -> f64 {
    let b = rx * vx + ry * vy + rz * vz;
    let rr = rx * rx + ry * ry + rz * rz;
    let vv = vx * vx + vy * vy + vz * vz;
    let (cx, cy, cz) = (ry * vz - vy * rz, rz * vx - vz * rx, rx * vy - vx * ry);
    let cc = cx * cx + cy * cy + cz * cz;
    let gap = rr - sigma2;
    let disc = vv * sigma2 - cc;
    let den = disc.max(0.0).sqrt() - b;
    // Limited to the time of closest approach: in a sliding contact, gap and den are only rounding errors.
    let beyond = gap * vv > -b * den;
    let time = (if beyond { -b } else { gap }) / (if beyond { vv } else { den });
    let time = if disc >= 0.0 { time } else { f64::INFINITY };
    let time = if gap > 0.0 { time } else { 0.0 };
    if b < 0.0 { time } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use haff_mechanics::time_to_contact;
    use haff_testing::Random;

    /// Random pairs, many of which graze or touch.
    fn fill(batch: &mut Batch, random: &mut Random) {
        let mut uniform = || random.uniform(-1.0, 1.0);
        batch.len = LANES - 3;
        for k in 0..batch.len {
            for axis in 0..3 {
                batch.r[axis][k] = uniform() * 3.0;
                batch.v[axis][k] = uniform();
            }
            let rr: f64 = (0..3).map(|axis| batch.r[axis][k] * batch.r[axis][k]).sum();
            batch.sigma2[k] = if k % 4 == 0 { rr * (1.0 + uniform() * 4e-16) } else { 1.0 + uniform() * 0.5 };
        }
    }

    #[test]
    fn every_kernel_has_the_bits_of_the_reference() {
        let mut random = Random(3);
        let (mut hits, mut batch) = (0, Batch::new());
        for _ in 0..2000 {
            fill(&mut batch, &mut random);
            for choice in [SimdChoice::Portable, SimdChoice::Avx2, SimdChoice::Auto] {
                let Some(kernel) = Kernel::choose(choice) else { continue };
                batch.predict(kernel);
                for k in 0..batch.len {
                    let vector = |a: &[[f64; LANES]; 3]| DVec3::new(a[0][k], a[1][k], a[2][k]);
                    let sigma = batch.sigma2[k].sqrt();
                    if sigma * sigma != batch.sigma2[k] {
                        continue; // The reference takes σ, not its square.
                    }
                    let expected = time_to_contact(vector(&batch.r), vector(&batch.v), sigma);
                    assert_eq!(batch.delay[k].to_bits(), expected.unwrap_or(f64::INFINITY).to_bits());
                    hits += u32::from(expected.is_some());
                }
            }
        }
        assert!(hits > 1000, "{hits} contacts");
    }
}
