//! Errors of a scene, each with its position.

use std::fmt;
use std::ops::Range;

use crate::source::text::{LONGEST_VALUE, cut, shown};

/// Source of the value of a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// The scene file.
    File {
        /// Line of the key, from 1.
        line: usize,
        /// Column of the key in characters, from 1.
        column: usize,
        /// Bytes of the key in the source text.
        span: Range<usize>,
    },
    /// An override, as given: `contact.restitution=1.2`.
    Override(String),
    /// The file as a whole.
    Whole,
}

/// One error of a scene. The fields hold text of the file without escapes; [`fmt::Display`] gives one line
/// that is safe on a terminal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneError {
    /// Name of the scene file.
    pub file: String,
    /// Position of the key, or of the nearest table above it if it is missing.
    pub place: Place,
    /// Dotted path of the key, as for `--set`; empty for the file as a whole.
    pub path: String,
    /// The value as TOML, if there is one.
    pub value: Option<String>,
    /// The error and the allowed values.
    pub message: String,
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut show_key = !self.path.is_empty();
        match &self.place {
            Place::File { line, .. } => write!(f, "{}:{line}: ", shown(&self.file))?,
            Place::Whole => write!(f, "{}: ", shown(&self.file))?,
            Place::Override(text) => {
                write!(f, "--set {}: ", shown(cut(text, LONGEST_VALUE)))?;
                show_key &= text.split('=').next().map(str::trim) != Some(self.path.as_str());
            }
        }
        if show_key {
            match &self.value {
                Some(value) => {
                    write!(f, "{} = {}: ", shown(&self.path), shown(cut(value, LONGEST_VALUE)))?;
                }
                None => write!(f, "{}: ", shown(&self.path))?,
            }
        }
        f.write_str(&shown(&self.message))
    }
}

/// Class of an error, which gives the exit status of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// The scene is invalid.
    Invalid,
    /// The scene file, or a state file that it names, cannot be read.
    Unreadable,
}

/// The errors found in a scene; never empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneErrors {
    /// The first [`SceneErrors::MOST`] errors, in the order of the file where they have a line.
    pub errors: Vec<SceneError>,
    /// Number of further errors.
    pub more: usize,
    /// Text of the scene file, for pointing into it.
    pub source: String,
    pub(crate) kind: ErrorKind,
}

impl SceneErrors {
    /// Largest number of errors kept; the others are only counted.
    pub const MOST: usize = 20;

    /// Whether the scene is invalid or a file cannot be read; invalid if both are true.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }
}

impl fmt::Display for SceneErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, error) in self.errors.iter().enumerate() {
            if k > 0 {
                f.write_str("\n")?;
            }
            error.fmt(f)?;
        }
        if self.more > 0 {
            write!(f, "\nand {} more", self.more)?;
        }
        Ok(())
    }
}

impl std::error::Error for SceneErrors {}
