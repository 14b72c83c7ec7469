//! Integers that may be written as floats.

use std::fmt;

use serde::de::{self, Deserializer, Visitor};

/// An integer, also written as a float with an integer value such as `1e6`.
pub(crate) fn whole<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<i64>, D::Error> {
    struct Whole;
    impl Visitor<'_> for Whole {
        type Value = i64;
        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("an integer")
        }
        fn visit_i64<E: de::Error>(self, value: i64) -> Result<i64, E> {
            Ok(value)
        }
        fn visit_f64<E: de::Error>(self, value: f64) -> Result<i64, E> {
            // Beyond 2^53 not every integer is a float: such a value is a mistake, or meant as infinity.
            if value == value.trunc() && value.abs() <= 9_007_199_254_740_992.0 {
                Ok(value as i64)
            } else if value == value.trunc() && value.is_finite() {
                let allowed = "an integer; written as a float, at most 2^53 = 9007199254740992 in size";
                Err(E::invalid_value(de::Unexpected::Float(value), &allowed))
            } else {
                Err(E::invalid_type(de::Unexpected::Float(value), &self))
            }
        }
    }
    deserializer.deserialize_any(Whole).map(Some)
}
