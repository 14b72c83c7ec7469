/*!
Impact of smooth bodies: impulse, velocities after it, energy loss.

With the approach speed `v_n = (w1 − w2)·n > 0` and the inverse effective mass `Λ = 1/m1 + 1/m2` (1/m against
a wall or a fixed body; `Σ n·M⁻¹·n` for constrained bodies), every impact follows from

```text
J  = (1 + e) v_n / Λ             impulse                                       (2.11), (2.14)
ΔT = ½ (1 − e²) v_n² / Λ         kinetic energy lost                           (2.16)
E' = ½ (1 + e)² v_n² / Λ         energy of the lost velocities, Σ ½ m |Δw|²     (2.31)
ΔT = E' (1 − e)/(1 + e)          Carnot's theorem for any e
```

These closed forms are used throughout: an energy loss computed as a difference of kinetic energies would lose
its digits where the loss is small.
*/

use glam::DVec3;

/// Result of one impact: its impulse with the two parts, and its two energies.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Impact {
    /// Approach speed `v_n` = (w1 − w2)·n ≥ 0 [length/time].
    pub approach_speed: f64,
    /// J = (1 + e) `v_n` / Λ = `compression_impulse` + `restitution_impulse` [mass·length/time], (2.14).
    pub impulse: f64,
    /// `J_c` = `v_n` / Λ, until the normal velocities are equal [mass·length/time], (2.7).
    pub compression_impulse: f64,
    /// `J_r` = e `J_c`, after that [mass·length/time], (2.11).
    pub restitution_impulse: f64,
    /// `ΔT = ½ (1 − e²) v_n² / Λ` ≥ 0, kinetic energy lost \[energy\], (2.16).
    pub energy_loss: f64,
    /// `E'_c = ½ (1 + e)² v_n² / Λ = ½ Λ J²`, energy of the lost velocities \[energy\], (2.31).
    pub carnot_energy: f64,
}

/// The impact of two bodies that approach at `approach_speed` = (w1 − w2)·n [length/time] with restitution
/// `e`, `inverse_effective_mass` Λ = 1/m1 + 1/m2 [1/mass].
///
/// Bodies that do not approach, and two bodies of infinite mass (Λ = 0), exert no impulse: all fields are
/// zero.
///
/// ```
/// use haff_mechanics::impact;
/// // Problem 2.2: equal masses m = 1 approach at 40 along x with e = 0.5.
/// let hit = impact(40.0, 0.5, 2.0);
/// assert_eq!(hit.impulse, 30.0);
/// assert_eq!((hit.compression_impulse, hit.restitution_impulse), (20.0, 10.0));
/// assert_eq!(hit.energy_loss, 300.0); // (2.16)
/// // Carnot's theorem: the loss is (1 − e)/(1 + e) of the energy of the lost velocities.
/// assert_eq!(hit.energy_loss, hit.carnot_energy / 3.0);
/// ```
#[inline]
#[must_use]
pub fn impact(approach_speed: f64, restitution: f64, inverse_effective_mass: f64) -> Impact {
    if !(approach_speed > 0.0 && inverse_effective_mass > 0.0) {
        return Impact::default();
    }
    let (e, v) = (restitution, approach_speed);
    let compression_impulse = v / inverse_effective_mass;
    let half = 0.5 * compression_impulse * v;
    Impact {
        approach_speed,
        impulse: (1.0 + e) * compression_impulse,
        compression_impulse,
        restitution_impulse: e * compression_impulse,
        // (1 − e)(1 + e): 1 − e² would cancel for nearly elastic contacts.
        energy_loss: half * ((1.0 - e) * (1.0 + e)),
        carnot_energy: half * ((1.0 + e) * (1.0 + e)),
    }
}

/// Approach speed `v_n` = (w1 − w2)·n [length/time] of two bodies; `n` is the unit vector from 1 to 2.
#[inline]
#[must_use]
pub fn approach_speed(w1: DVec3, w2: DVec3, n: DVec3) -> f64 {
    (w1 - w2).dot(n)
}

/// Reduced mass μ = m1 m2/(m1 + m2) \[mass\]; with an infinite mass, the other one.
///
/// ```
/// use haff_mechanics::reduced_mass;
/// assert_eq!(reduced_mass(2.0, 2.0), 1.0);
/// assert_eq!(reduced_mass(3.0, f64::INFINITY), 3.0);
/// ```
#[inline]
#[must_use]
pub fn reduced_mass(m1: f64, m2: f64) -> f64 {
    let (light, heavy) = if m1 <= m2 { (m1, m2) } else { (m2, m1) };
    // No product of two masses: it could overflow; ∞/∞ only if both are infinite.
    if light == f64::INFINITY { light } else { light / (1.0 + light / heavy) }
}

/// Velocities after the impact of two smooth spheres, (2.14), (2.19), (2.20), and the impact itself.
///
/// `w1`, `w2`: velocities before [length/time]; `inv_m1`, `inv_m2`: inverse masses [1/mass], 0 for a body of
/// infinite mass, whose velocity does not change; `n`: unit vector from 1 to 2; `e`: restitution. The
/// tangential velocities do not change. Bodies that do not approach keep their velocities.
///
/// ```
/// use glam::DVec3;
/// use haff_mechanics::resolve_pair;
/// // Problem 2.2: w1 = (30, 10), w2 = (−10, −30), equal masses, impact axis x, e = 0.5.
/// let (w1, w2) = (DVec3::new(30.0, 10.0, 0.0), DVec3::new(-10.0, -30.0, 0.0));
/// let (u1, u2, impact) = resolve_pair(w1, w2, 1.0, 1.0, DVec3::X, 0.5);
/// assert_eq!(u1, DVec3::new(0.0, 10.0, 0.0));
/// assert_eq!(u2, DVec3::new(20.0, -30.0, 0.0));
/// let kinetic = |a: DVec3, b: DVec3| 0.5 * (a.length_squared() + b.length_squared());
/// assert_eq!(kinetic(w1, w2) - kinetic(u1, u2), impact.energy_loss);
/// ```
#[inline]
#[must_use]
pub fn resolve_pair(
    w1: DVec3,
    w2: DVec3,
    inv_m1: f64,
    inv_m2: f64,
    n: DVec3,
    e: f64,
) -> (DVec3, DVec3, Impact) {
    let lambda = inv_m1 + inv_m2;
    let impact = impact(approach_speed(w1, w2, n), e, lambda);
    if impact.impulse == 0.0 {
        return (w1, w2, impact);
    }
    // The shares of the change of relative velocity are formed first: exactly 1/2 for equal masses, exactly
    // 0 and 1 against a body of infinite mass.
    let change = n * ((1.0 + e) * impact.approach_speed);
    (w1 - change * (inv_m1 / lambda), w2 + change * (inv_m2 / lambda), impact)
}

/// [`resolve_pair`] for the vector `r` from centre 1 to centre 2 \[length\], of any length, in place of the
/// unit normal.
///
/// By rounding, the kinetic energy and the momentum of many impacts perform a random walk; they do not drift.
/// For that, the rounding error of every operation must have mean zero. Near a power of two it does not, and
/// |r| is always near a contact distance, often 1; and the quotients of two masses would be rounded in the
/// same way each time. So `r` is first given a random length, and the inverse masses a random unit. An impact
/// along an axis is left unchanged, so that it is exact where the numbers are.
///
/// The bodies do not approach each other afterwards, not even by rounding.
///
/// ```
/// use glam::DVec3;
/// use haff_mechanics::resolve_contact;
/// let (w1, w2) = (DVec3::new(30.0, 10.0, 0.0), DVec3::new(-10.0, -30.0, 0.0));
/// let (u1, u2, _) = resolve_contact(w1, w2, 1.0, 1.0, DVec3::X * 0.125, 0.5);
/// assert_eq!((u1, u2), (DVec3::new(0.0, 10.0, 0.0), DVec3::new(20.0, -30.0, 0.0)));
/// ```
#[inline(always)]
#[must_use]
pub fn resolve_contact(
    w1: DVec3,
    w2: DVec3,
    inv_m1: f64,
    inv_m2: f64,
    r: DVec3,
    e: f64,
) -> (DVec3, DVec3, Impact) {
    let relative = w1 - w2;
    let parts = relative * r;
    let approach = parts.x + parts.y + parts.z;
    let impact = impact(approach / r.length(), e, inv_m1 + inv_m2);
    if impact.impulse == 0.0 {
        return (w1, w2, impact);
    }
    let scale = random_scale(parts);
    let p = r * scale;
    let pp = p.length_squared();
    let shares = inverse_masses_in_random_unit(inv_m1, inv_m2, scale);
    let approach = approach * scale;
    // Not (1 + e) v, because 1 + e is rounded in the same way each time.
    let (mut u1, mut u2) = push(w1, w2, approach + e * approach, (p, pp), shares);
    // The rounding error of Newton's law, (u2 − u1)·p = e (w1 − w2)·p, is a large part of the total error
    // where e is small, and is biased along an axis. One correction reduces it to the rounding of the
    // velocities.
    if e < 1.0 || scale == 1.0 {
        (u1, u2) = push(u1, u2, (u1 - u2).dot(p) + e * approach, (p, pp), shares);
    }
    // With e = 0 an approach of a few ulp may remain, and the pair would collide again without end.
    let mut excess = 1.0;
    while (u1 - u2).dot(r) > 0.0 && excess < 1e3 {
        excess *= 2.0;
        (u1, u2) = push(u1, u2, excess * (u1 - u2).dot(r), (p, pp), shares);
    }
    (u1, u2, impact)
}

/// The velocities after an impulse along p that takes `speed` off the approach; `pp` = |p|². Not a closure:
/// it may remain a call, which costs 1 % of all instructions.
#[inline(always)]
fn push(
    u1: DVec3,
    u2: DVec3,
    speed: f64,
    (p, pp): (DVec3, f64),
    [unit1, unit2, both]: [f64; 3],
) -> (DVec3, DVec3) {
    let change = speed / (pp * both);
    (u1 - p * (change * unit1), u2 + p * (change * unit2))
}

/// A factor from 1 to 2, in effect random, made of the last bits of `parts`, the products of an approach by
/// component; 1 if only one of them is not zero.
#[inline(always)]
pub(crate) fn random_scale(parts: DVec3) -> f64 {
    const SIGNIFICAND: u64 = (1 << 52) - 1;
    let mixed = parts.x * (parts.y + parts.z) + parts.y * parts.z;
    // The last 32 bits become the first of the significand.
    f64::from_bits(((mixed.to_bits() << 20) & SIGNIFICAND) | 1f64.to_bits())
}

/// Two inverse masses and their sum in a unit of mass that depends on `scale`, a random number: their
/// rounding errors then differ from impact to impact, and that of the sum has mean zero.
///
/// Exact for equal masses, and where one is infinite. A `scale` of 1 gives the mass fractions, whose sum is
/// 1.
#[inline(always)]
fn inverse_masses_in_random_unit(inv_m1: f64, inv_m2: f64, scale: f64) -> [f64; 3] {
    if inv_m1 == inv_m2 {
        return [1.0, 1.0, 2.0];
    }
    let sum = inv_m1 + inv_m2;
    if scale == 1.0 || inv_m1 == 0.0 || inv_m2 == 0.0 {
        return [inv_m1 / sum, inv_m2 / sum, 1.0];
    }
    // The exact rounding error of the sum (Knuth, TAOCP 2, 4.2.2, theorem B), and up to half an ulp at random
    // before the sum is rounded.
    let second = sum - inv_m1;
    let lost = (inv_m1 - (sum - second)) + (inv_m2 - second);
    let ulp = f64::from_bits(sum.to_bits() & f64::INFINITY.to_bits()) * f64::EPSILON;
    // Independent of the unit of length; and about as large as the sum, so that nothing overflows.
    let unit = sum * (3.0 - scale);
    [inv_m1 / unit, inv_m2 / unit, (sum + (lost + ulp * (scale - 1.5))) / unit]
}

/// Velocity after the impact of a smooth sphere on a wall, (2.21), and the impact itself.
///
/// `w`, `w_wall`: velocities of sphere and wall [length/time]; `inv_m`: the sphere's inverse mass [1/mass];
/// `n`: unit vector **into the wall** (from body 1, the sphere, to body 2, the wall), the negative of a
/// wall's inward normal; `e`: restitution. Bits are those of [`resolve_pair`] with a second body of infinite
/// mass.
///
/// ```
/// use glam::DVec3;
/// use haff_mechanics::resolve_wall;
/// // 3-4-5 triangle: tan α = 3/4 from the normal, so tan β = tan α / e = 3/2 after the impact (2.22).
/// let (u, impact) = resolve_wall(DVec3::new(3.0, 0.0, -4.0), DVec3::ZERO, 1.0, DVec3::NEG_Z, 0.5);
/// assert_eq!(u, DVec3::new(3.0, 0.0, 2.0));
/// assert_eq!(impact.energy_loss, 6.0); // ½ 4² (1 − 0.5²)
/// ```
#[inline]
#[must_use]
pub fn resolve_wall(w: DVec3, w_wall: DVec3, inv_m: f64, n: DVec3, e: f64) -> (DVec3, Impact) {
    let (after, _, impact) = resolve_pair(w, w_wall, inv_m, 0.0, n, e);
    (after, impact)
}

/// Work \[energy\] that a body of infinite mass, moving at `w_body` [length/time], does on a particle in an
/// impact of magnitude `impulse` along `n` (unit vector from the particle into the body).
///
/// The particle receives the impulse `P = −J n`, so the work is `P·w_body`, and the particle's energy balance
/// is `T' − T = W − energy_loss` with `energy_loss = ½ m v_n² (1 − e²)`:
///
/// ```text
/// T' − T = P·(w + w')/2                                             m (w' − w) = P
/// n·(w + w')/2 = n·w_body + (1 − e) v_n / 2                         n·(w − w_body) = v_n
///                                                                   n·(w' − w_body) = −e v_n
/// T' − T = −J n·w_body − ½ J (1 − e) v_n = W − ½ m v_n² (1 − e²)    J = (1 + e) m v_n
/// ```
///
/// ```
/// use glam::DVec3;
/// use haff_mechanics::{resolve_wall, work_of_moving_body};
/// // A piston at speed 2 hits a particle at rest, elastically: it leaves at 4, T' − T = 8 m.
/// let (piston, n) = (DVec3::new(2.0, 0.0, 0.0), DVec3::NEG_X);
/// let (after, hit) = resolve_wall(DVec3::ZERO, piston, 1.0, n, 1.0);
/// assert_eq!(after, DVec3::new(4.0, 0.0, 0.0));
/// assert_eq!(work_of_moving_body(hit.impulse, n, piston) - hit.energy_loss, 8.0);
/// ```
#[inline]
#[must_use]
pub fn work_of_moving_body(impulse: f64, n: DVec3, w_body: DVec3) -> f64 {
    -impulse * n.dot(w_body)
}

/// An impact after which the two bodies move as one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StickingImpact {
    /// P = (w1 − w2)/Λ, impulse on body 2; body 1 receives −P [mass·length/time].
    pub impulse: DVec3,
    /// ΔT = ½ |w1 − w2|² / Λ, kinetic energy lost \[energy\]; equal to the energy of the lost velocities
    /// (2.31), which is Carnot's theorem (2.32) for bodies that do not separate.
    pub energy_loss: f64,
}

/// Common velocity after an adhesive impact, in which all components of the relative velocity vanish, and the
/// impact.
///
/// Meant for point particles: for finite radii equal centre velocities break the balance of angular momentum
/// (2.26) unless spin is modelled. Two bodies of infinite mass (Λ = 0) keep their velocities; that of the
/// first is returned.
///
/// ```
/// use glam::DVec3;
/// use haff_mechanics::resolve_sticking;
/// // Problem 2.4, just after the first impact: equal masses, e = 0: common velocity v/2, ΔT = T/2.
/// let (w, hit) = resolve_sticking(DVec3::new(6.0, 0.0, 0.0), DVec3::ZERO, 1.0, 1.0);
/// assert_eq!(w, DVec3::new(3.0, 0.0, 0.0));
/// assert_eq!(hit.energy_loss, 9.0);
/// ```
#[inline]
#[must_use]
pub fn resolve_sticking(w1: DVec3, w2: DVec3, inv_m1: f64, inv_m2: f64) -> (DVec3, StickingImpact) {
    let lambda = inv_m1 + inv_m2;
    if lambda.is_nan() || lambda <= 0.0 {
        return (w1, StickingImpact::default());
    }
    let relative = w1 - w2;
    // Relative to the heavier body: its own small change is then rounded at its own size.
    let common =
        if inv_m1 <= inv_m2 { w1 - relative * (inv_m1 / lambda) } else { w2 + relative * (inv_m2 / lambda) };
    let impulse = relative / lambda;
    (common, StickingImpact { impulse, energy_loss: 0.5 * impulse.dot(relative) })
}

/// Fraction ΔT/T of the kinetic energy lost when `m1` collides with `m2` at rest, with restitution `e`,
/// (2.16), (2.18): `(1 − e²)/(1 + m1/m2)`.
///
/// ```
/// use haff_mechanics::impact::energy_fraction_lost_at_rest;
/// // Hammer and nail: a heavy hammer m1 on a light nail m2 loses little: the energy drives the nail.
/// assert_eq!(energy_fraction_lost_at_rest(0.99, 0.01, 0.0), 0.01);
/// // Forging: a light hammer on a heavy anvil and workpiece: nearly all the energy deforms the workpiece.
/// assert_eq!(energy_fraction_lost_at_rest(0.01, 0.99, 0.0), 0.99);
/// assert_eq!(energy_fraction_lost_at_rest(1.0, f64::INFINITY, 0.0), 1.0);
/// ```
#[must_use]
pub fn energy_fraction_lost_at_rest(m1: f64, m2: f64, e: f64) -> f64 {
    (1.0 - e) * (1.0 + e) / (1.0 + m1 / m2)
}

/// Speed and angle after an oblique impact at `speed` [length/time] on a wall at rest, (2.21), (2.22).
///
/// `alpha` \[rad\] is the angle between the velocity and the wall's normal before the impact. Returns
/// `|w'| = |w| √(sin²α + e² cos²α)` and the angle β \[rad\] after it, `tan β = tan α / e`: a right angle,
/// sliding along the wall, for e = 0.
///
/// ```
/// use haff_mechanics::impact::oblique_wall;
/// let (speed, beta) = oblique_wall(5.0, (3.0f64 / 4.0).atan(), 0.5);
/// assert!((speed - 13f64.sqrt()).abs() < 1e-15 * 10.0);
/// assert!((beta.tan() - 1.5).abs() < 1e-15 * 10.0);
/// ```
#[must_use]
pub fn oblique_wall(speed: f64, alpha: f64, e: f64) -> (f64, f64) {
    let (tangential, normal) = (libm::sin(alpha), e * libm::cos(alpha));
    (speed * libm::hypot(tangential, normal), libm::atan2(tangential, normal))
}
