//! Random and adversarial flights, from fixed seeds.

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// A relative flight of two spheres.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    pub r: DVec3,
    pub v: DVec3,
    pub a: DVec3,
    pub sigma: f64,
    /// Random units of length and time, for changes of unit.
    pub units: [i32; 2],
}

pub struct Draw(Pcg64Mcg);

impl Draw {
    pub fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..high)
    }

    pub fn index(&mut self, n: u32) -> u32 {
        self.0.random_range(0..n)
    }

    pub fn sign(&mut self) -> f64 {
        if self.0.random_bool(0.5) { 1.0 } else { -1.0 }
    }

    /// Log-uniform between powers of ten.
    pub fn decades(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(self.uniform(low, high))
    }

    /// 1, or 1 ± 10^-k, k up to beyond the last digit, or an ordinary number in [0, 1.2).
    fn near_one(&mut self) -> f64 {
        match self.index(4) {
            0 => 1.0,
            1 | 2 => 1.0 + self.sign() * self.decades(-17.0, -1.0),
            _ => self.uniform(0.0, 1.2),
        }
    }

    pub fn direction(&mut self) -> DVec3 {
        let (z, phi) = (self.uniform(-1.0, 1.0), self.uniform(0.0, TAU));
        let rho = (1.0 - z * z).sqrt();
        // Sometimes along an axis or in a plane, as scenes often are.
        match self.index(6) {
            0 => DVec3::AXES[self.index(3) as usize] * self.sign(),
            1 => DVec3::new(phi.cos(), phi.sin(), 0.0),
            _ => DVec3::new(rho * phi.cos(), rho * phi.sin(), z),
        }
    }

    /// Two orthogonal unit vectors.
    fn frame(&mut self) -> (DVec3, DVec3) {
        let n = self.direction();
        let (p, q) = n.any_orthonormal_pair();
        let phi = self.uniform(0.0, TAU);
        (n, p * phi.cos() + q * phi.sin())
    }

    /// σ = R1 + R2 with size ratios up to 10⁶, over twelve decades.
    fn sigma(&mut self) -> f64 {
        let radius = if self.index(2) == 0 { 0.5 } else { self.decades(-6.0, 6.0) };
        radius + radius * self.decades(-6.0, 0.0)
    }

    fn units(&mut self) -> [i32; 2] {
        [self.0.random_range(-400..400), self.0.random_range(-250..250)]
    }
}

/// Straight flights: random, grazing to the last bit, near contact, in contact, overlapping, far, fast and
/// slow.
pub fn straight(count: u32) -> impl Iterator<Item = Case> {
    let mut draw = Draw::new(0x5eed_0001);
    (0..count).map(move |k| {
        let sigma = draw.sigma();
        let (along, across) = draw.frame();
        let distance = match k % 6 {
            0 => draw.uniform(1.0, 10.0),
            1 => 1.0 + draw.decades(-17.0, 0.0),
            2 => 1.0 - draw.decades(-17.0, -0.3),
            3 => draw.decades(0.0, 2.0),
            4 => draw.decades(2.0, 4.5),
            _ => draw.decades(0.0, 8.0),
        };
        let impact = draw.near_one().min(distance);
        let r = (across * impact - along * (distance * distance - impact * impact).max(0.0).sqrt()) * sigma;
        let speed = if draw.index(2) == 0 { draw.uniform(0.1, 3.0) } else { draw.decades(-20.0, 20.0) };
        // One in eight moves away.
        let v = along * speed * if draw.index(8) == 0 { -1.0 } else { 1.0 };
        Case { r, v, a: DVec3::ZERO, sigma, units: draw.units() }
    })
}

/// Straight flights aimed at a contact from a given distance [σ], without grazing ones.
pub fn aimed(count: u32, distance: f64) -> impl Iterator<Item = Case> {
    let mut draw = Draw::new(0x5eed_0005);
    (0..count).map(move |_| {
        let (along, across) = draw.frame();
        let impact = draw.uniform(0.0, 0.99);
        let r = across * impact - along * (distance * distance - impact * impact).sqrt();
        Case { r, v: along * draw.uniform(0.5, 2.0), a: DVec3::ZERO, sigma: 1.0, units: [0, 0] }
    })
}

/// The same flights in units up to 2^±400 of length and 2^±250 of time.
pub fn extreme_units(case: Case) -> Case {
    let power = |k: i32| 2f64.powi(k);
    let [length, time] = case.units;
    Case {
        r: case.r * power(length),
        v: case.v * power(length / 2 - time / 2) * power(length - length / 2 - (time - time / 2)),
        a: case.a * power(length - time) * power(-time),
        sigma: case.sigma * power(length),
        ..case
    }
}

/// The flight that has position q and velocity w after `time`.
fn backwards(q: DVec3, w: DVec3, a: DVec3, time: f64) -> (DVec3, DVec3) {
    (q - w * time + a * (0.5 * time * time), w - a * time)
}

/// Curved flights aimed at a contact at some time, or slightly beyond it, from near to 10⁴ σ away and more.
pub fn curved(count: u32) -> impl Iterator<Item = Case> {
    let mut draw = Draw::new(0x5eed_0002);
    (0..count).map(move |k| {
        let sigma = draw.sigma();
        let (n, _) = draw.frame();
        let q = n * (sigma * draw.near_one().max(0.05));
        let speed = draw.decades(-3.0, 3.0);
        let w = draw.direction() * (sigma * speed);
        let strength = match k % 4 {
            0 => draw.uniform(0.1, 3.0),
            1 => draw.decades(-12.0, -2.0),
            2 => draw.decades(-2.0, 4.0),
            _ => draw.decades(-8.0, 8.0),
        };
        // Of the order of the curvature speed²/σ, times `strength`.
        let a = draw.direction() * (sigma * strength * if k % 3 == 0 { 1.0 } else { speed * speed });
        // A time in which the flight covers between 10⁻⁶ and 10⁵ σ.
        let path = if k % 5 == 0 { draw.decades(-6.0, 0.0) } else { draw.decades(-1.0, 5.0) };
        let time = (path * sigma / w.length()).min((2.0 * path * sigma / a.length()).sqrt());
        let (r, v) = backwards(q, w, a, time);
        Case { r, v, a, sigma, units: draw.units() }
    })
}

/// Parabolas that touch the contact sphere tangentially, from outside, inside and with equal curvature.
pub fn curved_grazing(count: u32) -> impl Iterator<Item = Case> {
    let mut draw = Draw::new(0x5eed_0003);
    (0..count).map(move |k| {
        let sigma = draw.sigma();
        let (n, tangent) = draw.frame();
        let offset = if draw.index(4) == 0 { 0.0 } else { draw.sign() * draw.decades(-17.0, -3.0) };
        let q = n * (sigma * (1.0 + offset));
        let w = tangent * sigma;
        // |w|² + q·a is half the curvature of the squared distance; zero where parabola and sphere osculate.
        let a = match k % 4 {
            0 => draw.direction() * (sigma * draw.decades(-3.0, 2.0)),
            1 => {
                (n * (-1.0 + draw.sign() * draw.decades(-16.0, -1.0)) + tangent * draw.uniform(-1.0, 1.0))
                    * sigma
            }
            2 => n * (-sigma * (1.0 + draw.sign() * draw.decades(-16.0, 0.0))),
            _ => (n.cross(tangent) * draw.uniform(-2.0, 2.0) - n) * sigma,
        };
        let time = draw.decades(-4.0, 1.5);
        let (r, v) = backwards(q, w, a, time);
        Case { r, v, a, sigma, units: draw.units() }
    })
}

/// Starts in contact to a few ulp: bounces of all sizes, rolling off and sliding along.
pub fn curved_from_contact(count: u32) -> impl Iterator<Item = Case> {
    let mut draw = Draw::new(0x5eed_0004);
    (0..count).map(move |k| {
        let sigma = draw.sigma();
        let (n, tangent) = draw.frame();
        let r = n * (sigma * (1.0 + if k % 3 == 0 { 0.0 } else { draw.sign() * draw.decades(-16.5, -15.0) }));
        let normal = draw.decades(-18.0, 1.0) * if draw.index(5) == 0 { -1.0 } else { 1.0 };
        let sliding = if draw.index(2) == 0 { 0.0 } else { draw.decades(-6.0, 0.5) };
        let v = (n * normal + tangent * sliding) * sigma;
        let a = (draw.direction() * draw.uniform(0.0, 0.9) - n) * (sigma * draw.decades(-1.0, 2.0));
        Case { r, v, a, sigma, units: draw.units() }
    })
}
