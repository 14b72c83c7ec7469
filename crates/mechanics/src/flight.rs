//! Free flight: straight, or under a constant acceleration.

use glam::DVec3;

/// Position \[length\] after straight flight over `dt` \[time\] at `velocity` [length/time].
///
/// Exactly `position + velocity · dt`, each operation rounded once.
///
/// ```
/// # use glam::DVec3;
/// let x = haff_mechanics::drift(DVec3::ONE, DVec3::new(2.0, 0.0, -4.0), 0.25);
/// assert_eq!(x, DVec3::new(1.5, 1.0, 0.0));
/// ```
#[inline]
#[must_use]
pub fn drift(position: DVec3, velocity: DVec3, dt: f64) -> DVec3 {
    position + velocity * dt
}

/// Position \[length\] after flight over `dt` \[time\] under a constant `acceleration` [length/time²].
///
/// `x + (v + ½ a dt) dt`. Where the acceleration is zero this has the bits of [`drift`].
///
/// ```
/// # use glam::DVec3;
/// // A stone dropped from rest falls g t²/2.
/// let x = haff_mechanics::free_flight(DVec3::ZERO, DVec3::ZERO, DVec3::new(0.0, 0.0, -10.0), 2.0);
/// assert_eq!(x, DVec3::new(0.0, 0.0, -20.0));
/// ```
#[inline]
#[must_use]
pub fn free_flight(position: DVec3, velocity: DVec3, acceleration: DVec3, dt: f64) -> DVec3 {
    // Horner's form rounds once at the size of x; x + v dt + ½ a dt² would round there twice.
    position + (velocity + acceleration * (0.5 * dt)) * dt
}

/// Velocity [length/time] after flight over `dt` \[time\] under a constant `acceleration` [length/time²].
///
/// ```
/// # use glam::DVec3;
/// let w = haff_mechanics::free_flight_velocity(DVec3::X, DVec3::new(0.0, 0.0, -10.0), 2.0);
/// assert_eq!(w, DVec3::new(1.0, 0.0, -20.0));
/// ```
#[inline]
#[must_use]
pub fn free_flight_velocity(velocity: DVec3, acceleration: DVec3, dt: f64) -> DVec3 {
    velocity + acceleration * dt
}

/// Time in which a `speed` [length/time] and an `acceleration` [length/time²] in its direction, both at least
/// zero, make a `path` \[length\]: the solution of v t + ½ a t² = s, without a difference of near numbers.
/// Not a number for a path of zero at rest.
///
/// ```
/// assert_eq!(haff_mechanics::duration(20.0, 0.0, 10.0), 2.0);
/// assert_eq!(haff_mechanics::duration(20.0, 5.0, 0.0), 4.0);
/// ```
#[inline]
#[must_use]
pub fn duration(path: f64, speed: f64, acceleration: f64) -> f64 {
    if acceleration > 0.0 {
        2.0 * path / (speed + (speed * speed + 2.0 * acceleration * path).sqrt())
    } else {
        path / speed
    }
}

/// State after flight over `dt` \[time\] under a constant `acceleration` [length/time²]: position \[length\]
/// and velocity [length/time], rounded stochastically.
///
/// [`free_flight`] and [`free_flight_velocity`] round to the nearest number. In many equal flights, such as
/// those between the bounces of one grain, the rounding error is the same each time, and grows in proportion
/// to their number. Here `random` bits move each sum by up to half an ulp before it is rounded, so that the
/// error has mean zero and grows as the square root of their number. A sum that is exact stays exact, and so
/// does flight along axes without acceleration.
#[inline]
#[must_use]
pub fn free_flight_stochastic(
    position: DVec3,
    velocity: DVec3,
    acceleration: DVec3,
    dt: f64,
    random: u64,
) -> (DVec3, DVec3) {
    let displacement = (velocity + acceleration * (0.5 * dt)) * dt;
    let gain = acceleration * dt;
    let (mut after, mut faster) = (position + displacement, velocity + gain);
    for axis in 0..3 {
        if acceleration[axis] != 0.0 {
            let bits = random >> (20 * axis);
            after[axis] = stochastically_rounded_sum(position[axis], displacement[axis], bits);
            faster[axis] = stochastically_rounded_sum(velocity[axis], gain[axis], bits >> 10);
        }
    }
    (after, faster)
}

/// `x + change`, rounded up or down at random, with probabilities that make its mean exact. Only the last ten
/// bits of `random` are used.
#[inline]
fn stochastically_rounded_sum(x: f64, change: f64, random: u64) -> f64 {
    const STEPS: u64 = 1 << 10;
    let sum = x + change;
    let ulp = f64::from_bits(sum.to_bits() & f64::INFINITY.to_bits()) * f64::EPSILON;
    // In the open interval (−½, ½), with mean zero.
    let part = ((random % STEPS) as f64 + 0.5) / STEPS as f64 - 0.5;
    x + (change + part * ulp)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flight_without_acceleration_has_the_bits_of_a_drift() {
        let (x, v) = (DVec3::new(0.1, -7.3e5, 3.3e-9), DVec3::new(1.0 / 3.0, 0.7, -1e-3));
        for dt in [0.0, 1e-12, 0.3, 1.7, 9.1e4] {
            assert_eq!(free_flight(x, v, DVec3::ZERO, dt), drift(x, v, dt), "dt = {dt}");
        }
    }

    #[test]
    fn flight_there_and_back_returns_within_rounding() {
        let (x, v, a) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.3, -0.2, 1.1), DVec3::new(0.0, 0.0, -9.81));
        let dt = 0.37;
        let (y, w) = (free_flight(x, v, a, dt), free_flight_velocity(v, a, dt));
        let (back, u) = (free_flight(y, -w, a, dt), free_flight_velocity(-w, a, dt));
        assert!((back - x).length() <= 8.0 * f64::EPSILON * x.length(), "{back} against {x}");
        assert!((u + v).length() <= 8.0 * f64::EPSILON * (a * dt).length(), "{u} against {}", -v);
    }
}
