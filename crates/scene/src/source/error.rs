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

/// Class of an error of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Code {
    /// A text that is no TOML, or no override.
    Syntax,
    /// The file cannot be read.
    Unreadable,
    /// The file is not text.
    NotText,
    /// A key that does not exist.
    UnknownKey,
    /// A key that is needed.
    Missing,
    /// A value of another type.
    Type,
    /// A value that is not allowed.
    Value,
    /// A value that other keys, the particles or a state exclude.
    Conflict,
}

impl Code {
    /// The name of the class for other programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Syntax => "syntax",
            Self::Unreadable => "unreadable",
            Self::NotText => "not_text",
            Self::UnknownKey => "unknown_key",
            Self::Missing => "missing",
            Self::Type => "type",
            Self::Value => "value",
            Self::Conflict => "conflict",
        }
    }
}

/// What is wrong, and what is allowed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Why {
    pub(crate) code: Code,
    pub(crate) message: String,
    pub(crate) allowed: Option<String>,
    pub(crate) meant: Vec<String>,
}

impl Why {
    /// Something else than a value that is not allowed.
    pub(crate) fn new(code: Code, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), allowed: None, meant: Vec::new() }
    }

    /// As a plug-in states it, with what is allowed if that is said.
    pub(crate) fn stated(why: impl Into<String>) -> Self {
        let why = why.into();
        if why.starts_with("must ") { Self::value(why) } else { Self::new(Code::Conflict, why) }
    }

    /// A value that is not allowed; `must` is what is, as the end of a sentence: "must be in [0, 1]".
    pub(crate) fn value(must: impl Into<String>) -> Self {
        let message = must.into();
        let allowed =
            message.strip_prefix("must ").map(|rest| rest.strip_prefix("be ").unwrap_or(rest).to_owned());
        debug_assert!(allowed.is_some(), "{message}");
        Self { allowed, ..Self::new(Code::Value, message) }
    }
}

/// Whose words a message is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Words {
    /// Those of the command: options.
    Command,
    /// Those of Python: keywords.
    Python,
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
    /// Class of the error.
    pub code: Code,
    /// The error and the allowed values.
    pub message: String,
    /// What is allowed, where that can be said of the value alone: `in [0, 1]`; of an unknown key the known
    /// ones.
    pub allowed: Option<String>,
    /// Dotted paths of the keys that an unknown one may stand for.
    pub meant: Vec<String>,
}

impl SceneError {
    /// An error of a file as a whole.
    pub fn of_file(file: impl Into<String>, code: Code, message: impl Into<String>) -> Self {
        Self {
            file: file.into(),
            place: Place::Whole,
            path: String::new(),
            value: None,
            code,
            message: message.into(),
            allowed: None,
            meant: Vec::new(),
        }
    }

    /// The key that an override sets, if the error is in one.
    pub fn set_key(&self) -> Option<&str> {
        let Place::Override(text) = &self.place else { return None };
        text.split('=').next().map(str::trim)
    }

    /// The error in one line, in the words of its reader.
    pub fn told(&self, words: Words) -> String {
        let place = match &self.place {
            Place::File { line, .. } => format!("{}:{line}: ", shown(&self.file)),
            Place::Whole => format!("{}: ", shown(&self.file)),
            Place::Override(text) => {
                let option = if words == Words::Command { "--set " } else { "" };
                format!("{option}{}: ", shown(cut(text, LONGEST_VALUE)))
            }
        };
        let is_shown = !self.path.is_empty() && self.set_key() != Some(self.path.as_str());
        let key = match (&self.value, is_shown) {
            (Some(value), true) => {
                format!("{} = {}: ", shown(&self.path), shown(cut(value, LONGEST_VALUE)))
            }
            (None, true) => format!("{}: ", shown(&self.path)),
            (_, false) => String::new(),
        };
        let hint = match (self.code, words) {
            (Code::NotText, Words::Command) => {
                format!("; if it is the output of a run: haff run --resume {}", shown(&self.file))
            }
            (Code::NotText, Words::Python) => {
                format!("; if it is the output of a run: haff.resume(\"{}\")", shown(&self.file))
            }
            _ => String::new(),
        };
        place + &key + &shown(&self.message) + &hint
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.told(Words::Command))
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

impl SceneErrors {
    /// The errors, one on each line, in the words of their reader.
    pub fn told(&self, words: Words) -> String {
        let rest = (self.more > 0).then(|| format!("and {} more", self.more));
        self.errors.iter().map(|error| error.told(words)).chain(rest).collect::<Vec<_>>().join("\n")
    }
}

impl fmt::Display for SceneErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.told(Words::Command))
    }
}

impl std::error::Error for SceneErrors {}
