//! Checks of single values.

use crate::document::{Document, Path};

/// Lengths, masses, times and speeds lie between 1e-50 and 1e50, so that no product of a few of them leaves
/// the range of a double.
pub(super) const LARGEST: f64 = 1e50;
pub(super) const SMALLEST: f64 = 1e-50;

/// A path from its segments.
pub(super) fn at<const N: usize>(segments: [&str; N]) -> Path {
    segments.iter().map(|&segment| segment.to_owned()).collect()
}

/// A path of a table in an array: `species.3`, or a key of it.
pub(super) fn item(list: &str, index: usize, key: &str) -> Path {
    let mut path = vec![list.to_owned(), index.to_string()];
    if !key.is_empty() {
        path.extend(key.split('.').map(str::to_owned));
    }
    path
}

/// Reports a value that is not positive and finite.
pub(super) fn positive(document: &mut Document, path: &[String], value: f64) -> bool {
    let fine = (SMALLEST..=LARGEST).contains(&value);
    if !fine {
        let message = if value > 0.0 && value.is_finite() {
            "must be between 1e-50 and 1e50"
        } else {
            "must be a positive finite number"
        };
        document.report(path, message);
    }
    fine
}

/// Reports a value that is not 0 or positive and finite.
pub(super) fn not_negative(document: &mut Document, path: &[String], value: f64) -> bool {
    let fine = (0.0..=LARGEST).contains(&value);
    if !fine {
        document.report(path, "must be a finite number ≥ 0");
    }
    fine
}

/// Reports a text that HDF5 files and the system's file names cannot hold.
pub(super) fn storable(document: &mut Document, path: &[String], text: &str) {
    if text.contains('\0') {
        document.report(path, "must not contain the character NUL (U+0000), which files cannot store");
    }
}

/// Reports a mass that is neither positive and finite nor infinite.
pub(super) fn mass(document: &mut Document, path: &[String], value: f64) -> bool {
    let fine = value == f64::INFINITY || (SMALLEST..=LARGEST).contains(&value);
    if !fine {
        document.report(path, "must be a positive number, or inf for a fixed or driven body");
    }
    fine
}
