//! Errors of a scene: all of them, each where it stands.

use std::fmt;
use std::ops::Range;

/// Where the value of a key comes from.
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
    /// An override, as it was given: `contact.restitution=1.2`.
    Override(String),
    /// Nowhere: the file as a whole.
    Whole,
}

/// One error of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneError {
    /// Name of the scene file.
    pub file: String,
    /// Where the key stands, or the nearest table above it if it is missing.
    pub place: Place,
    /// Dotted path of the key, as `--set` takes it; empty for the file as a whole.
    pub path: String,
    /// The value as TOML, where there is one.
    pub value: Option<String>,
    /// What is wrong and what is allowed.
    pub message: String,
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut show_key = !self.path.is_empty();
        match &self.place {
            Place::File { line, .. } => write!(f, "{}:{line}: ", self.file)?,
            Place::Whole => write!(f, "{}: ", self.file)?,
            Place::Override(text) => {
                write!(f, "--set {text}: ")?;
                show_key &= text.split('=').next().map(str::trim) != Some(self.path.as_str());
            }
        }
        if show_key {
            match &self.value {
                Some(value) => write!(f, "{} = {value}: ", self.path)?,
                None => write!(f, "{}: ", self.path)?,
            }
        }
        f.write_str(&self.message)
    }
}

/// What an error means for the exit status of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// The scene says something that cannot be.
    Invalid,
    /// The scene file, or a state file that it names, cannot be read.
    Unreadable,
}

/// All errors found in a scene; never empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneErrors {
    /// The errors, in the order of the file where they have a line.
    pub errors: Vec<SceneError>,
    /// Text of the scene file, for pointing into it.
    pub source: String,
    pub(crate) kind: ErrorKind,
}

impl SceneErrors {
    /// Whether the scene is invalid or a file cannot be read. Invalid wins where both hold.
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
        Ok(())
    }
}

impl std::error::Error for SceneErrors {}
