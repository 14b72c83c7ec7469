//! The speed below which grains come to rest on each other, where a scene should state one.

/// A value for `contact.rest_speed` \[length/time\]: 0.05 √(g d), with one digit; for the diameter d
/// \[length\] and the gravity g [length/time²].
pub fn rest_speed_of_diameter(g: f64, d: f64) -> f64 {
    let speed = 0.05 * (g * d).sqrt();
    format!("{speed:.0e}").parse().ok().filter(|speed: &f64| speed.is_finite()).unwrap_or(0.0)
}
