//! Output of the command: results on standard output, messages for users on standard error.
//!
//! External text (titles, names, keys, values, paths, errors of libraries) enters messages through [`shown`]
//! or [`path`], so that it stays on one line. Printing escapes control characters once more, except line
//! ends.
//!
//! `println!` panics on a closed pipe, as in `haff schema | head -1`; the functions here do not. A lint of
//! clippy forbids `println!` in the command.

use std::{
    fmt::Display,
    io::{self, ErrorKind, Write},
    path::Path,
};

use haff_scene::text::escaped_lines;
pub use haff_scene::text::shown;

use crate::failure::{Failure, Status};

/// A path for messages.
pub fn path(path: &Path) -> String {
    shown(path.display())
}

/// Writes lines to standard output, with control characters escaped, and ends the last one.
pub fn lines(text: impl Display) -> Result<(), Failure> {
    line(escaped_lines(&text.to_string()))
}

/// Writes to standard output without escaping: JSON, scenes, completions. A closed pipe ends the command
/// without a message; any other error is reported.
pub fn print(text: impl Display) -> Result<(), Failure> {
    let mut output = io::stdout().lock();
    match output.write_all(text.to_string().as_bytes()).and_then(|()| output.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Err(Failure::new(Status::Unread, "")),
        Err(error) => Err(Failure::new(Status::File, format!("standard output: {error}"))),
        Ok(()) => Ok(()),
    }
}

/// Writes a line to standard output; as [`print()`].
pub fn line(text: impl Display) -> Result<(), Failure> {
    print(format_args!("{text}\n"))
}

/// Writes a message of one or more lines to standard error. Errors are ignored: a closed standard error must
/// not stop a run.
pub fn message(text: impl Display) {
    let text = text.to_string();
    let _ = io::stderr().lock().write_all(format!("{}\n", escaped_lines(&text)).as_bytes());
}
