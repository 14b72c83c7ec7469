//! Numbers as a person writes them.

/// A number with at most so many significant digits: `0.25`, `1764`, `1.3e-7`. Digits before the point are
/// never cut below a thousand million.
///
/// ```
/// # use haff_engine::significant;
/// assert_eq!(significant(300.0, 6), "300");
/// assert_eq!(significant(1763.71, 3), "1764");
/// assert_eq!(significant(2.0 / 3e7, 3), "6.67e-8");
/// ```
pub fn significant(value: f64, digits: usize) -> String {
    const LARGEST_EXPONENT: i32 = 9;
    let decimals = digits.max(1) - 1;
    let scientific = format!("{value:.decimals$e}");
    let Some((mantissa, exponent)) = scientific.split_once('e') else { return value.to_string() };
    let trimmed = |text: &str| {
        let zeros = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text };
        zeros.to_owned()
    };
    match exponent.parse::<i32>() {
        Ok(exponent) if (-4..LARGEST_EXPONENT).contains(&exponent) => {
            let decimals = (decimals as i32 - exponent).max(0) as usize;
            trimmed(&format!("{value:.decimals$}"))
        }
        _ => format!("{}e{exponent}", trimmed(mantissa)),
    }
}

#[cfg(test)]
mod tests {
    use super::significant;

    #[test]
    fn numbers_have_the_digits_that_are_needed() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (-0.1, "-0.1"),
            (5_843.124_467_391_459, "5843.12"),
            (123_456_789.4, "123456789"),
            (9.999_999_9, "10"),
            (0.000_123_456_78, "0.000123457"),
            (0.000_012_5, "1.25e-5"),
            (-2.5e30, "-2.5e30"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(significant(value, 6), text);
        }
        assert!(significant(f64::NAN, 3) == "NaN");
    }
}
