//! Failures of the command: a message and an exit status.

use std::fmt;

use haff_engine::Fault;
use haff_linkage::AnySimulationError;
use haff_record::RecordError;
use haff_scene::{
    ErrorKind, Place, SceneError, SceneErrors,
    text::{LONGEST, cut, shown},
};
use serde_json::{Value, json};

use crate::terminal::words::{say, words};

/// The exit statuses of the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// The reader of the output has closed it: the command ends without an error message.
    Unread = 0,
    /// The scene or the arguments are invalid.
    Invalid = 2,
    /// The simulation cannot continue.
    Stopped = 3,
    /// A file cannot be read or written.
    File = 4,
}

impl Status {
    /// The status of an exit code; anything else is a failure of a file.
    pub fn of(exit: Option<u8>) -> Self {
        match exit {
            Some(2) => Self::Invalid,
            Some(3) => Self::Stopped,
            _ => Self::File,
        }
    }
}

/// An error with a message for the user.
#[derive(Debug)]
pub struct Failure {
    /// Exit status.
    pub status: Status,
    /// One line or more, without "error:"; external text in it has been escaped by
    /// [`crate::terminal::output::shown`].
    pub message: String,
    /// The errors of a scene.
    pub problems: Vec<SceneError>,
}

impl Failure {
    /// A failure with a message.
    pub fn new(status: Status, message: impl fmt::Display) -> Self {
        Self { status, message: message.to_string(), problems: Vec::new() }
    }

    /// As a JSON object, which stands for the result that a command has not got.
    pub fn json(&self) -> Value {
        let problems: Vec<Value> = self.problems.iter().map(problem).collect();
        json!({ "error": self.message, "exit": self.status as u8, "problems": problems })
    }

    /// Whether this is the JSON of a failure.
    pub fn is_json(object: &Value) -> bool {
        object.get("problems").is_some()
    }
}

/// An error of a scene as JSON.
fn problem(error: &SceneError) -> Value {
    let line = if let Place::File { line, .. } = &error.place { Some(*line) } else { None };
    json!({
        "text": error.told(words()),
        "code": error.code.name(),
        "file": error.file,
        "line": line,
        "set": error.set_key(),
        "key": error.path,
        "value": error.value.as_ref().map(|value| cut(value, LONGEST)),
        "message": error.message,
        "allowed": error.allowed,
        "meant": error.meant,
    })
}

/// A scene's errors as a failure of the command.
pub fn scene_failure(errors: &SceneErrors) -> Failure {
    let status = match errors.kind() {
        ErrorKind::Invalid => Status::Invalid,
        ErrorKind::Unreadable => Status::File,
    };
    Failure { problems: errors.errors.clone(), ..Failure::new(status, errors.told(words())) }
}

/// A file's error as a failure of the command.
pub fn file_failure(error: &RecordError) -> Failure {
    match error {
        RecordError::Exists { .. } => {
            let option = say("--overwrite", "overwrite=True");
            Failure::new(
                Status::File,
                format!(
                    "{}: name another output file, or allow it to be overwritten ({option})",
                    shown(error)
                ),
            )
        }
        error => Failure::new(Status::File, shown(error)),
    }
}

/// An error of a simulation as a failure of the command.
pub fn simulation_failure(error: &AnySimulationError) -> Failure {
    let status = match error.fault() {
        Fault::Invalid => Status::Invalid,
        Fault::Checkpoint => Status::File,
        Fault::Stopped => Status::Stopped,
    };
    Failure::new(status, shown(error))
}
