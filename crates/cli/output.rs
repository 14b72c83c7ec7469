//! What the command prints: results to standard output, words for people to standard error.
//!
//! `println!` panics when nobody reads any more, as in `haff schema | head -1`; these do not, and clippy holds the command
//! to them.

use std::{
    fmt::Display,
    io::{self, ErrorKind, Write},
};

use crate::failure::{Failure, Status};

/// Writes to standard output, as it is. A reader that has gone ends the command, quietly; any other error is told.
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

/// Writes a line to standard error. Whoever does not want to read it must not stop a run.
pub fn tell(text: impl Display) {
    let _ = io::stderr().lock().write_all(format!("{text}\n").as_bytes());
}
