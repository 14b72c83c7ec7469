/*!
Impact of rough spheres and disks: the tangential part, by Walton's law.

Bodies with angular velocities ω touch with the relative velocity of their surfaces

```text
g = w1 − w2 − n × (R1 ω1 + R2 ω2)
```

whose tangential component is `g_t`. An impulse `P_t` along it changes `g_t` by `−Λ_t P_t`, with

```text
Λ_t = 1/m1 + 1/m2 + R1²/I1 + R2²/I2 = (1/m1)(1 + 1/q1) + (1/m2)(1 + 1/q2),    I = q m R²
```

so that a contact that sticks, with the tangential restitution β, has `P_t = (1 + β) g_t/Λ_t`, and one that
slides has `|P_t| = μ P_n`, whichever is smaller. With `κ = Λ_t |P_t|/|g_t|`, which is 1 + β or less,

```text
g_t' = (1 − κ) g_t
ΔT   = ½ κ (2 − κ) g_t²/Λ_t      kinetic energy lost, of translation and rotation
E'   = ½ κ² g_t²/Λ_t             energy of the lost velocities
ΔT   = E' (2 − κ)/κ              Carnot's theorem with the coefficient κ − 1 in place of e
```

The tangential impulse does not change the normal velocities, nor the normal one the tangential velocities:
energies of the two parts add up.

With β = 1 the impact reverses the slip, and a relative error δ of the factor κ/Λ_t changes the energy by
2 δ g_t²/Λ_t, about 4 δ T: rounded in the same way in every impact, it would let the energy of a gas drift by
an ε T or two per impact, where it now performs a random walk with steps of 5 ε T. As in
[`resolve_contact`](crate::resolve_contact), every rounding error is therefore made random, with mean zero.
*/

use glam::DVec3;
use thiserror::Error;

use crate::impact::random_scale;

/// The tangential law of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Roughness {
    /// Coefficient of tangential restitution β in [−1, 1]: −1 smooth, 1 perfectly rough.
    pub tangential_restitution: f64,
    /// Coulomb's coefficient of friction μ ≥ 0, which bounds |P_t| by μ `P_n`; infinite for none.
    pub friction: f64,
}

/// A parameter of a [`Roughness`] outside its range.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("{parameter} = {value} {allowed}")]
pub struct RoughnessError {
    /// Name of the parameter: `tangential_restitution` or `friction`.
    pub parameter: &'static str,
    /// The value it has.
    pub value: f64,
    /// What is allowed, as the end of a sentence.
    pub allowed: &'static str,
}

impl Roughness {
    /// Smooth contacts, which exert no tangential impulse.
    pub const SMOOTH: Self = Self { tangential_restitution: -1.0, friction: f64::INFINITY };

    /// Whether contacts never exert a tangential impulse.
    #[must_use]
    pub fn is_smooth(&self) -> bool {
        self.tangential_restitution == -1.0 || self.friction == 0.0
    }

    /// Whether contacts never lose energy by the tangential impulse, at any speed.
    #[must_use]
    pub fn is_elastic(&self) -> bool {
        self.is_smooth() || (self.tangential_restitution == 1.0 && self.friction == f64::INFINITY)
    }

    /// Checks every parameter against its range.
    ///
    /// # Errors
    /// The first parameter out of range (also NaN).
    ///
    /// ```
    /// use haff_mechanics::Roughness;
    /// let error = Roughness { tangential_restitution: 1.5, friction: 0.3 }.check().unwrap_err();
    /// assert_eq!(error.to_string(), "tangential_restitution = 1.5 must be in [-1, 1]");
    /// ```
    pub fn check(&self) -> Result<(), RoughnessError> {
        let error = |parameter, value, allowed| Err(RoughnessError { parameter, value, allowed });
        if !(-1.0..=1.0).contains(&self.tangential_restitution) {
            return error("tangential_restitution", self.tangential_restitution, "must be in [-1, 1]");
        }
        if self.friction.is_nan() || self.friction < 0.0 {
            return error("friction", self.friction, "must be zero or positive");
        }
        Ok(())
    }
}

/// The number q = I/(m R²) of a homogeneous sphere.
pub const SPHERE: f64 = 0.4;
/// The number q = I/(m R²) of a homogeneous disk.
pub const DISK: f64 = 0.5;

/// A body in a rough contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoughBody {
    /// Velocity of the center [length/time].
    pub velocity: DVec3,
    /// Angular velocity [1/time].
    pub angular_velocity: DVec3,
    /// Radius [length]; zero for a plane wall.
    pub radius: f64,
    /// 1/m [1/mass]; 0 for a body of infinite mass.
    pub inverse_mass: f64,
    /// q = I/(m R²) > 0.
    pub inertia: f64,
}

/// The tangential part of an impact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TangentialImpact {
    /// `P_t`, the impulse on body 2; body 1 receives −`P_t` [mass·length/time].
    pub impulse: DVec3,
    /// Kinetic energy lost, of translation and rotation \[energy\].
    pub energy_loss: f64,
    /// Energy of the lost velocities, Σ ½ m |Δw|² + ½ I |Δω|² \[energy\].
    pub carnot_energy: f64,
    /// The part of `energy_loss` that translation loses; negative if it gains \[energy\].
    pub translational_loss: f64,
    /// Change of the angular velocities of body 1 and 2 [1/time].
    pub spin_changes: [DVec3; 2],
}

/// Tangential component of the relative velocity of the surfaces of two bodies in contact [length/time]. `n`
/// points from 1 to 2, and may have any length.
#[inline]
#[must_use]
pub fn slip_velocity(first: &RoughBody, second: &RoughBody, n: DVec3) -> DVec3 {
    let nn = n.length_squared();
    let length = nn.sqrt();
    let relative = first.velocity - second.velocity;
    let [arm1, arm2] = [first.radius / length, second.radius / length];
    let spin = first.angular_velocity * arm1 + second.angular_velocity * arm2;
    // Not through g: the normal component of a fast approach would leave its rounding error in g_t.
    relative - n * (relative.dot(n) / nn) - n.cross(spin)
}

/// The tangential part of the impact of two rough bodies. `n` points from 1 to 2, or into a wall, and may
/// have any length; `normal_impulse` is `P_n` ≥ 0 [mass·length/time].
///
/// Bodies that are smooth, do not slip, or both have infinite mass exert no tangential impulse.
///
/// ```
/// use glam::DVec3;
/// use haff_mechanics::{Roughness, RoughBody, tangential_impact};
/// // A sphere that slides over a floor with v = 7 and bounces on it, β = 0: 2/7 of the slip go into
/// // translation, 5/7 into rotation, so that it rolls.
/// let velocity = DVec3::new(7.0, 0.0, -1.0);
/// let still = DVec3::ZERO;
/// let ball =
///     RoughBody { velocity, angular_velocity: still, radius: 2.0, inverse_mass: 1.0, inertia: 0.4 };
/// let floor = RoughBody { velocity: still, radius: 0.0, inverse_mass: 0.0, ..ball };
/// let law = Roughness { tangential_restitution: 0.0, friction: f64::INFINITY };
/// let impact = tangential_impact(&ball, &floor, DVec3::NEG_Z, 2.0, law);
/// assert!((impact.impulse - DVec3::new(2.0, 0.0, 0.0)).length() < 1e-15);
/// assert!((impact.spin_changes[0].y - 2.5).abs() < 1e-15); // v' = 5 = R ω'
/// assert!((impact.energy_loss - 7.0).abs() < 1e-14); // ½ m v² q/(1 + q)
/// ```
#[inline]
#[must_use]
pub fn tangential_impact(
    first: &RoughBody,
    second: &RoughBody,
    n: DVec3,
    normal_impulse: f64,
    law: Roughness,
) -> TangentialImpact {
    let relative = first.velocity - second.velocity;
    // The length of a unit vector has an error with a bias, as that of a contact vector has.
    let p = n * random_scale(relative * n);
    let slip = slip_velocity(first, second, p);
    let speed2 = slip.length_squared();
    let speed = speed2.sqrt();
    // 1/(q m R). A body of infinite mass has no inertia that counts.
    let turn = |body: &RoughBody| {
        if body.inverse_mass == 0.0 { 0.0 } else { body.inverse_mass / (body.inertia * body.radius) }
    };
    let turns = [turn(first), turn(second)];
    // Λ_t of these rounded numbers, Σ 1/m + R turn, and its rounding error.
    let (mut lambda, mut lost) = two_sum(first.inverse_mass, second.inverse_mass);
    for (turn, radius) in [(turns[0], first.radius), (turns[1], second.radius)] {
        let (product, low) = two_product(turn, radius);
        let (sum, error) = two_sum(lambda, product);
        lost += error + low;
        lambda = sum;
    }
    let stick = 1.0 + law.tangential_restitution;
    if !(lambda > 0.0 && speed > 0.0 && stick > 0.0) {
        return TangentialImpact::default();
    }
    // κ; without friction's bound not even a comparison with ∞ · 0.
    let slide =
        if law.friction == f64::INFINITY { stick } else { law.friction * normal_impulse * lambda / speed };
    let kappa = stick.min(slide);
    // 2 − κ; not from 1 + β, which is rounded: the loss of nearly elastic contacts would lose its digits.
    let left = if kappa < stick { 2.0 - kappa } else { 1.0 - law.tangential_restitution };
    // κ/Λ_t in a random unit of the slip, with up to half an ulp at random before Λ_t is rounded.
    let (unit, dither) = random_unit_and_dither(speed2, speed);
    let ulp = f64::from_bits((lambda * unit).to_bits() & f64::INFINITY.to_bits()) * f64::EPSILON;
    let (whole, low) = two_product(lambda, unit);
    let share = kappa / (whole + (low + (lost * unit + ulp * dither)));
    let in_unit = slip * unit;
    let impulse = in_unit * share;
    let (turned, length) = (p.cross(in_unit), p.length());
    let half = 0.5 * speed * (speed * (unit * share));
    // The impulse does work on the mean relative velocity of the centers, before and after it.
    let inverse_mass = first.inverse_mass + second.inverse_mass;
    TangentialImpact {
        impulse,
        energy_loss: half * left,
        carnot_energy: half * kappa,
        translational_loss: impulse.dot(relative - impulse * (0.5 * inverse_mass)),
        spin_changes: turns.map(|turn| turned * (share * (-turn / length))),
    }
}

/// Two numbers that are in effect random, made of the last bits of two others: from 1 to 2, and from −½ to ½.
/// They are 1 and 0 where those bits are zero, so that simple numbers stay exact.
#[inline]
fn random_unit_and_dither(first: f64, second: f64) -> (f64, f64) {
    let [first, second] = [first, second].map(|x| x.to_bits() as u32);
    (1.0 + f64::from(first) * 2f64.powi(-32), f64::from(second as i32) * 2f64.powi(-32))
}

/// The rounded sum, and its rounding error (Knuth, TAOCP 2, 4.2.2, theorem B).
#[inline]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let second = sum - a;
    (sum, (a - (sum - second)) + (b - second))
}

/// The rounded product, and its rounding error (Dekker, Numer. Math. 18, 224, 1971).
#[inline]
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let split = |x: f64| {
        let scaled = x * 134_217_729.0; // 2^27 + 1
        let high = scaled - (scaled - x);
        (high, x - high)
    };
    let ((a1, a2), (b1, b2), product) = (split(a), split(b), a * b);
    (product, a2 * b2 - (((product - a1 * b1) - a2 * b1) - a1 * b2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sphere(velocity: [f64; 3], angular_velocity: [f64; 3], mass: f64, radius: f64, q: f64) -> RoughBody {
        RoughBody {
            velocity: DVec3::from_array(velocity),
            angular_velocity: DVec3::from_array(angular_velocity),
            radius,
            inverse_mass: 1.0 / mass,
            inertia: q,
        }
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        for (beta, mu, parameter) in [
            (-1.1, 0.0, "tangential_restitution"),
            (1.1, 0.0, "tangential_restitution"),
            (f64::NAN, 0.0, "tangential_restitution"),
            (0.0, -0.1, "friction"),
            (0.0, f64::NAN, "friction"),
        ] {
            let law = Roughness { tangential_restitution: beta, friction: mu };
            assert_eq!(law.check().unwrap_err().parameter, parameter, "{law:?}");
        }
        for (beta, mu, smooth, elastic) in [
            (-1.0, f64::INFINITY, true, true),
            (0.5, 0.0, true, true),
            (1.0, f64::INFINITY, false, true),
            (1.0, 0.5, false, false),
            (0.0, f64::INFINITY, false, false),
        ] {
            let law = Roughness { tangential_restitution: beta, friction: mu };
            assert_eq!(law.check(), Ok(()));
            assert_eq!((law.is_smooth(), law.is_elastic()), (smooth, elastic), "{law:?}");
        }
    }

    #[test]
    fn a_smooth_contact_exerts_no_impulse() {
        let (a, b) =
            (sphere([1.0, 2.0, 3.0], [4.0; 3], 1.0, 0.5, 0.4), sphere([0.0; 3], [1.0; 3], 2.0, 0.7, 0.4));
        let impact = tangential_impact(&a, &b, DVec3::X, 1.0, Roughness::SMOOTH);
        assert_eq!(impact, TangentialImpact::default());
        let frictionless = Roughness { tangential_restitution: 0.5, friction: 0.0 };
        assert_eq!(tangential_impact(&a, &b, DVec3::X, 1.0, frictionless).energy_loss, 0.0);
    }

    #[test]
    fn a_sliding_contact_has_the_impulse_of_coulomb() {
        let a = sphere([0.0, 3.0, 4.0], [0.0; 3], 2.0, 0.5, 0.4);
        let b = sphere([-1.0, 0.0, 0.0], [0.0; 3], 3.0, 0.25, 0.3);
        let law = Roughness { tangential_restitution: 0.9, friction: 0.1 };
        let impact = tangential_impact(&a, &b, DVec3::X, 0.7, law);
        assert!((impact.impulse - DVec3::new(0.0, 0.042, 0.056)).length() < 1e-16, "{impact:?}");
    }

    #[test]
    fn elastic_rough_spheres_reverse_their_slip_and_keep_their_energy() {
        let a = sphere([0.3, 3.0, 4.0], [1.0, -2.0, 0.5], 2.0, 0.5, 0.4);
        let b = sphere([-1.0, 0.2, 0.1], [0.3, 0.7, -1.0], 3.0, 0.25, 0.3);
        let n = DVec3::new(0.6, 0.8, 0.0);
        let law = Roughness { tangential_restitution: 1.0, friction: f64::INFINITY };
        let impact = tangential_impact(&a, &b, n, 1.0, law);
        let moved = |body: &RoughBody, sign: f64, k: usize| RoughBody {
            velocity: body.velocity + impact.impulse * (sign * body.inverse_mass),
            angular_velocity: body.angular_velocity + impact.spin_changes[k],
            ..*body
        };
        let (after_a, after_b) = (moved(&a, -1.0, 0), moved(&b, 1.0, 1));
        let (before, after) = (slip_velocity(&a, &b, n), slip_velocity(&after_a, &after_b, n));
        assert!((before + after).length() < 1e-14, "{before} {after}");
        let energy = |body: &RoughBody| {
            let spin = body.angular_velocity.length_squared() * body.inertia * body.radius * body.radius;
            0.5 * (body.velocity.length_squared() + spin) / body.inverse_mass
        };
        let change = energy(&after_a) + energy(&after_b) - energy(&a) - energy(&b);
        assert!(change.abs() < 1e-13, "{change}");
        assert_eq!(impact.energy_loss, 0.0);
    }
}
