//! The deformation of a periodic box: its edge vectors are linear in time.
//!
//! h(t) = (I + A t) h₀ with a constant matrix A [1/time]: images at h(t) n move with A h₀ n. Simple shear has
//! one entry of A off the diagonal; compression and expansion are entries on the diagonal. The flow is G x
//! with G(t) = A (I + A t)⁻¹.

use glam::DVec3;

use crate::{
    model::{Boundary, System},
    numerics::instant::Instant,
    report::ledger::Term,
    state::sliding_images::SlidingImages,
};

/// The box is as good as undeformed until an edge has changed by this part of itself: searches that were made
/// for its edges are then made again.
pub(crate) const HORIZON: f64 = 0.05;
/// Lists in a sheared box are made again after this strain.
pub(crate) const SHEAR_HORIZON: f64 = 0.15;

/// Places and weights of Gauss's formula with five points, on the interval from 0 to 1.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668_0, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_46, 0.239_314_335_249_683_23),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_23),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

/// The same with three and two points, and up to which change of the edges they are exact to rounding: their
/// errors are some (change)⁶/13 and (change)⁴/3.
const GAUSS_3: [(f64, f64); 3] = [
    (0.112_701_665_379_258_31, 0.277_777_777_777_777_8),
    (0.5, 0.444_444_444_444_444_4),
    (0.887_298_334_620_741_7, 0.277_777_777_777_777_8),
];
const GAUSS_2: [(f64, f64); 2] = [(0.211_324_865_405_187_1, 0.5), (0.788_675_134_594_812_9, 0.5)];
const THREE_POINTS: f64 = 5e-3;
const TWO_POINTS: f64 = 2e-4;

/// How the box deforms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Deformation {
    /// Simple shear; only without rates.
    pub sliding: Option<SlidingImages>,
    /// The diagonal of A [1/time]: −γ along periodic axes that are compressed, else 0.
    pub rates: DVec3,
    /// Velocity at which each edge becomes longer [length/time].
    pub speeds: DVec3,
    /// Edges at time 0 along periodic axes, infinite along others \[length\].
    edges: DVec3,
    /// The largest diameter: a particle must not touch its own image [length].
    least: f64,
    /// If all axes have one rate.
    pub isotropic: Option<Isotropic>,
}

/// Compression or expansion at one rate along all axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Isotropic {
    /// a, the entry of A [1/time].
    rate: f64,
    /// d, the number of axes.
    axes: usize,
}

impl Isotropic {
    /// Of the flight of a mass from a position and with a velocity at a time, over a `duration`: the work of
    /// the flow \[energy\], and the integral of m c² with its [weight](Deformation::weight)
    /// \[energy·time\].
    ///
    /// C = c s is constant for s = 1 + a t. So the work is ½ m C² (s₁⁻² − s₀⁻²), and the integral
    /// m C² ∫ s^−(d+2) dt = m C² τ Σ s₀^k s₁^(d−k)/((d + 1) (s₀ s₁)^(d+1)): neither loses digits.
    #[inline(always)]
    pub fn flight(&self, mass: f64, motion: [DVec3; 2], start: f64, duration: f64) -> [f64; 2] {
        let ([position, velocity], rate) = (motion, self.rate);
        let before = 1.0 + rate * start;
        let after = before + rate * duration;
        let constant = mass * (velocity * before - position * rate).length_squared();
        let (sum, inverse) = (before + after, 1.0 / (before * after));
        let work = -0.5 * constant * rate * duration * sum * (inverse * inverse);
        let mean = if self.axes == 2 {
            (sum * sum - before * after) * (inverse * inverse * inverse) / 3.0
        } else {
            0.25 * sum * (before * before + after * after) * ((inverse * inverse) * (inverse * inverse))
        };
        [work, constant * duration * mean]
    }
}

/// Time from `time` until an edge that changes at a `rate`, the diagonal of A [1/time], is that at time 0
/// times a whole power of 1 − [`HORIZON`] \[time\]. So such times do not depend on what a search has done
/// before.
pub(crate) fn until_boundary(rate: f64, time: f64) -> f64 {
    if rate == 0.0 {
        return f64::INFINITY;
    }
    let step = libm::log(1.0 - HORIZON);
    let passed = libm::log(1.0 + rate * time) / step;
    // Along the change of the edge, and not where it is already, but for rounding.
    let next = if rate < 0.0 { (passed + 1e-6).floor() + 1.0 } else { (passed - 1e-6).ceil() - 1.0 };
    (libm::exp(next * step) - 1.0) / rate - time
}

impl Deformation {
    pub fn of(system: &System) -> Option<Self> {
        let domain = &system.domain;
        let periodic = domain.boundary.map(|boundary| boundary == Boundary::Periodic);
        let given = domain.compression.map_or(DVec3::ZERO, |compression| -compression.rates);
        let along = |k: usize| k < system.dimension.count() && periodic[k];
        let rates = DVec3::from_array([0, 1, 2].map(|k| if along(k) { given[k] } else { 0.0 }));
        let sliding = SlidingImages::of(system);
        let count = system.dimension.count();
        let one = rates.to_array()[..count].iter().all(|&rate| rate == rates.x) && rates != DVec3::ZERO;
        (sliding.is_some() || rates != DVec3::ZERO).then(|| Self {
            sliding,
            rates,
            speeds: rates * domain.size,
            edges: DVec3::from_array(
                [0, 1, 2].map(|k| if periodic[k] { domain.size[k] } else { f64::INFINITY }),
            ),
            least: 2.0 * system.classes.iter().map(|class| class.radius).fold(0.0, f64::max),
            isotropic: one.then_some(Isotropic { rate: rates.x, axes: count }),
        })
    }

    /// Whether edges become shorter or longer.
    #[inline(always)]
    pub fn stretches(&self) -> bool {
        self.sliding.is_none()
    }

    /// The diagonal of I + A t.
    #[inline(always)]
    pub fn scale(&self, time: f64) -> DVec3 {
        DVec3::ONE + self.rates * time
    }

    /// Edges at a time along periodic axes; infinite along others \[length\].
    #[inline(always)]
    pub fn edges(&self, time: f64) -> DVec3 {
        self.edges + self.speeds * time
    }

    /// The largest velocity of an image of the next box [length/time].
    pub fn fastest(&self) -> f64 {
        self.sliding.map_or(self.speeds.abs().max_element(), |shear| shear.speed.abs())
    }

    /// Velocity of the flow G x at a position and a time [length/time].
    #[inline]
    pub fn velocity(&self, position: DVec3, time: f64) -> DVec3 {
        match &self.sliding {
            Some(shear) => shear.velocity(position),
            None => self.rates / self.scale(time) * position,
        }
    }

    /// The work of the flow in an impact at a time, −J·G r: r is the vector between the centers and `impulse`
    /// that on the second particle \[energy\].
    pub fn work_of_impact(&self, r: DVec3, impulse: DVec3, time: f64) -> f64 {
        match &self.sliding {
            Some(shear) => -shear.rate * r[shear.gradient] * impulse[shear.flow],
            None => -impulse.dot(self.velocity(r, time)),
        }
    }

    /// The work of the flow, −∫ m c·G c dt, on a mass in a flight of `duration` from a time: `velocity` is
    /// that of the lab, and c the peculiar one at the start. c changes by −G c in a unit of time, so that
    /// along a diagonal axis c (1 + a t) is constant.
    pub fn work_in_flight(
        &self,
        mass: f64,
        [position, velocity]: [DVec3; 2],
        start: f64,
        duration: f64,
    ) -> f64 {
        if let Some(shear) = &self.sliding {
            let across = velocity[shear.gradient];
            let along = (velocity - shear.velocity(position))[shear.flow];
            // c_x after a time, and its change in a unit of time.
            let fall = shear.rate * across;
            let power = -shear.rate * mass * across;
            return power * duration * (along - 0.5 * fall * duration);
        }
        if let Some(isotropic) = &self.isotropic {
            return isotropic.flight(mass, [position, velocity], start, duration)[0];
        }
        let before = self.scale(start);
        let change = self.rates * duration;
        let after = before + change;
        let c = velocity - self.rates / before * position;
        // ½ m c² ((s₀/s₁)² − 1).
        -0.5 * mass * (c * c * change * (before + after) / (after * after)).element_sum()
    }

    /// The quantity of a total peculiar momentum that gives its external impulse, see [`super::force`]: the
    /// force −γ̇ P_y along the flow of a shear; P (1 + a t), which is constant, along other axes.
    pub fn force(&self, momentum: DVec3, time: f64) -> DVec3 {
        if let Some(shear) = &self.sliding {
            return shear.force(momentum);
        }
        let stretched = self.rates.cmpne(DVec3::ZERO);
        DVec3::select(stretched, momentum * self.scale(time), DVec3::ZERO)
    }

    /// The term of the energy balance that has the work of the flow.
    pub fn term(&self) -> Term {
        if self.stretches() { Term::DriveWork } else { Term::ShearWork }
    }

    /// The weight of what happens at a time in means of the pressure: the volume at time 0 by that of the
    /// time.
    #[inline]
    pub fn weight(&self, time: f64) -> f64 {
        1.0 / self.scale(time).element_product()
    }

    /// ∫ of `moments` of the peculiar velocity c of a flight, with their [weight](Self::weight), from a
    /// time over a `duration`. Along a diagonal axis c (1 + a t) is constant. By Gauss's formula with as
    /// many points as the change of the edges needs, which is exact to rounding.
    pub fn integral<const N: usize>(
        &self,
        [position, velocity]: [DVec3; 2],
        start: f64,
        duration: f64,
        moments: impl Fn(DVec3) -> [f64; N],
    ) -> [f64; N] {
        let before = self.scale(start);
        let constant = before * velocity - self.rates * position;
        let rates = [start, start + duration].map(|time| (self.rates / self.scale(time)).abs().max_element());
        let change = duration * rates[0].max(rates[1]);
        let points: &[(f64, f64)] = match change {
            change if change < TWO_POINTS => &GAUSS_2,
            change if change < THREE_POINTS => &GAUSS_3,
            _ => &GAUSS,
        };
        let parts = (change / HORIZON).ceil().max(1.0);
        let step = duration / parts;
        let mut sums = [0.0; N];
        for part in 0..parts as u64 {
            for (place, weight) in points {
                let time = start + (part as f64 + place) * step;
                let factor = step * weight * self.weight(time);
                for (sum, moment) in sums.iter_mut().zip(moments(constant / self.scale(time))) {
                    *sum += factor * moment;
                }
            }
        }
        sums
    }

    /// [`Self::integral`] of m c², which is all of it that the pressure needs.
    pub fn trace(&self, mass: f64, motion: [DVec3; 2], start: f64, duration: f64) -> f64 {
        match &self.isotropic {
            Some(isotropic) => isotropic.flight(mass, motion, start, duration)[1],
            None => self.integral(motion, start, duration, |c| [mass * c.length_squared()])[0],
        }
    }

    /// How long searches that are made at a time may be used [time]; under shear lists only. 0 if a
    /// particle is about to touch its own image.
    pub fn horizon(&self, time: f64) -> f64 {
        if let Some(shear) = &self.sliding {
            return SHEAR_HORIZON / shear.rate.abs();
        }
        (0..3).map(|axis| self.next_boundary(axis, time)).fold(f64::INFINITY, f64::min)
    }

    /// Time from `time` to the next boundary of an axis \[time\], see [`until_boundary`], or until a particle
    /// touches its own image.
    fn next_boundary(&self, axis: usize, time: f64) -> f64 {
        let delay = until_boundary(self.rates[axis], time);
        if self.rates[axis] >= 0.0 {
            return delay;
        }
        let room = self.edges(time)[axis] - self.least;
        delay.min(room / -self.speeds[axis]).max(0.0)
    }

    /// An axis along which a particle touches its own image at a time, and the edge.
    pub fn too_short(&self, time: f64) -> Option<(usize, f64)> {
        let edges = self.edges(time);
        let is_short = |&axis: &usize| edges[axis] <= self.least * (1.0 + 1e-9) && self.speeds[axis] < 0.0;
        (0..3).find(is_short).map(|axis| (axis, edges[axis]))
    }

    /// The distance by which particles that are no faster than `speeds` along each axis, relative to the
    /// flow, still move relative to it if they do not collide, in lengths of the box at a time \[length\];
    /// infinite unless the box expands.
    pub fn path_left(&self, speeds: DVec3, time: f64) -> f64 {
        // ∫ c s/s' dt for c = c₀ s/s', up to an edge without end.
        let along = |axis: usize| {
            let growth = self.rates[axis] / self.scale(time)[axis];
            if speeds[axis] == 0.0 { 0.0 } else { speeds[axis] / growth.max(0.0) }
        };
        (0..3).map(along).fold(0.0, f64::max)
    }

    /// A position in the box of the edges of time 0: a particle at rest relative to the flow keeps it
    /// \[length\].
    pub fn unstretched(&self, position: DVec3, time: Instant) -> DVec3 {
        position / self.scale(time.time())
    }
}
