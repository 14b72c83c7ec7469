//! How the command fails: a message and an exit status.

use std::fmt;

/// The exit statuses of the command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Whoever read the output has gone: nothing is left to do, and nothing is wrong.
    Unread = 0,
    /// The scene or the arguments are invalid.
    Invalid = 2,
    /// The simulation cannot go on.
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

/// What went wrong, in words for the user.
#[derive(Debug)]
pub struct Failure {
    /// Exit status.
    pub status: Status,
    /// One line or more, without "error:"; each piece that comes from outside went through
    /// [`crate::output::shown`].
    pub message: String,
}

impl Failure {
    /// A failure with a message.
    pub fn new(status: Status, message: impl fmt::Display) -> Self {
        Self { status, message: message.to_string() }
    }
}
