//! Checks of single values.

use haff_engine::bounds;
pub(super) use haff_engine::bounds::{LARGEST, SMALLEST};

use crate::config::document::{Document, Path};

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

/// Reports a value that is not possible, with what is allowed. Returns whether it is possible.
fn checked(document: &mut Document, path: &[String], check: Result<(), &'static str>) -> bool {
    if let Err(why) = check {
        document.refuse(path, why);
    }
    check.is_ok()
}

/// Reports a value that is not positive and finite.
pub(super) fn positive(document: &mut Document, path: &[String], value: f64) -> bool {
    checked(document, path, bounds::positive(value))
}

/// Reports a value that is not 0 or positive and finite.
pub(super) fn not_negative(document: &mut Document, path: &[String], value: f64) -> bool {
    checked(document, path, bounds::not_negative(value))
}

/// Reports a text that HDF5 files and the system's file names cannot hold.
pub(super) fn storable(document: &mut Document, path: &[String], text: &str) {
    if text.contains('\0') {
        document.refuse(path, "must not contain the character NUL (U+0000), which files cannot store");
    }
}

/// Reports a mass that is neither positive and finite nor infinite.
pub(super) fn mass(document: &mut Document, path: &[String], value: f64) -> bool {
    checked(document, path, bounds::mass(value))
}
