//! Bounds of the values that a particle can have, in a scene and in a change of a simulation.
//!
//! The caller names the value; a check returns what is allowed.

use glam::DVec3;

use crate::numerics::number::significant;

/// Lengths, masses, times and speeds lie between 1e-50 and 1e50, so that no product of a few of them leaves
/// the range of a double.
pub const LARGEST: f64 = 1e50;
/// See [`LARGEST`].
pub const SMALLEST: f64 = 1e-50;
/// What a text says of a number beyond [`LARGEST`].
pub const FINITE: &str = "must be a finite number, at most 1e50 in size";

/// Smallest radius, relative to the largest coordinate: 2⁻⁴². Coordinates are rounded to 2⁻⁵² of the largest
/// one or less, so the position of a contact is exact to a thousandth of the radius. Below, rounding decides
/// whether particles touch.
const FINEST: f64 = 1.0 / (1_u64 << 42) as f64;

/// Least edge of a sheared box along the gradient \[largest diameters\]: a particle must not touch another
/// one in two images.
pub const LEAST_SHEARED_EDGE: f64 = 2.0;

/// Smallest radius of a hole \[largest radii\].
pub const LEAST_HOLE: f64 = 1.0 + 1e-3;

/// A length, a density or a time.
///
/// # Errors
/// What is allowed.
pub fn positive(value: f64) -> Result<(), &'static str> {
    if (SMALLEST..=LARGEST).contains(&value) {
        Ok(())
    } else if value > 0.0 && value.is_finite() {
        Err("must be between 1e-50 and 1e50")
    } else {
        Err("must be a positive finite number")
    }
}

/// A temperature, or another number that can be 0.
///
/// # Errors
/// What is allowed.
pub fn not_negative(value: f64) -> Result<(), &'static str> {
    if (0.0..=LARGEST).contains(&value) { Ok(()) } else { Err("must be a finite number ≥ 0") }
}

/// A mass.
///
/// # Errors
/// What is allowed.
pub fn mass(value: f64) -> Result<(), &'static str> {
    if value == f64::INFINITY || (SMALLEST..=LARGEST).contains(&value) {
        Ok(())
    } else if value > 0.0 {
        Err("must be between 1e-50 and 1e50, or inf for a fixed or driven body")
    } else {
        Err("must be a positive number, or inf for a fixed or driven body")
    }
}

/// A component of a position, a velocity or an angular velocity.
///
/// # Errors
/// What is allowed.
pub fn component(value: f64) -> Result<(), &'static str> {
    if value.abs() <= LARGEST { Ok(()) } else { Err(FINITE) }
}

/// A vector, component by component.
///
/// # Errors
/// The axis of a component that is not possible, and what is allowed.
pub fn vector(value: DVec3) -> Result<(), (usize, &'static str)> {
    let check = |axis: usize| component(value[axis]).map_err(|why| (axis, why));
    (0..3).try_for_each(check)
}

/// A radius \[length\] in a box with coordinates up to `extent` \[length\].
///
/// # Errors
/// What is allowed.
pub fn resolved(radius: f64, extent: f64) -> Result<(), String> {
    let least = FINEST * extent;
    if radius >= least {
        return Ok(());
    }
    Err(format!(
        "must be at least {least:.1e}: coordinates up to {} are rounded to about {:.1e}, and it takes a thousand times \
         that to tell whether particles touch",
        significant(extent, 6),
        f64::EPSILON * extent
    ))
}

/// Largest overlap with which a run continues [contact distances].
const ALLOWED: f64 = 1e-12;
/// The same bound in units of ε times the largest coordinate or free path. The larger of the two applies.
const ROUNDINGS: f64 = 16.0;

/// Largest overlap with which a run continues \[length\], for bodies with the contact distance `sigma`
/// \[length\]. `reach` \[length\] is what rounding errors are relative to: the largest of their coordinates
/// and of the lengths of their flights since their own last events, plus the extent of the system. The time
/// of a contact is rounded to ticks so short that no particle moves by more than 16 ε of the extent in one.
pub fn allowed_overlap(sigma: f64, reach: f64) -> f64 {
    f64::max(ALLOWED * sigma, ROUNDINGS * f64::EPSILON * reach)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_at_the_bounds_are_possible_and_those_beyond_are_not() {
        for good in [1e-50, 1.0, 1e50] {
            assert_eq!((positive(good), mass(good), not_negative(good)), (Ok(()), Ok(()), Ok(())));
        }
        for bad in [-1.0, f64::NAN, f64::NEG_INFINITY, 1e51] {
            assert!(positive(bad).is_err() && mass(bad).is_err() && not_negative(bad).is_err(), "{bad}");
        }
        assert_eq!((mass(f64::INFINITY), not_negative(0.0)), (Ok(()), Ok(())));
        assert!(positive(0.0).is_err() && mass(0.0).is_err() && positive(f64::INFINITY).is_err());
        assert_eq!(vector(DVec3::new(0.0, -1e50, 1e50)), Ok(()));
        assert_eq!(vector(DVec3::new(0.0, 1e51, f64::NAN)), Err((1, FINITE)));
        assert_eq!(vector(DVec3::new(0.0, 0.0, f64::NAN)), Err((2, FINITE)));
        assert!(resolved(0.5, 1e11).is_ok() && resolved(1e-30, 10.0).is_err());
    }
}
