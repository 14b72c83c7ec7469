//! What the command prints: results to standard output, words for people to standard error.
//!
//! Whatever comes from outside — titles, names, keys, values, paths, errors of libraries — goes into words
//! for people through [`shown`] or [`path`], so that it stays on its line; what is printed is held to that
//! once more, but for its line ends.
//!
//! `println!` panics when nobody reads any more, as in `haff schema | head -1`; these do not, and clippy holds the command
//! to them.

use std::{
    fmt::Display,
    io::{self, ErrorKind, Write},
    path::Path,
};

use haff_scene::text::escaped_lines;
pub use haff_scene::text::shown;

use crate::failure::{Failure, Status};

/// A path for people.
pub fn path(path: &Path) -> String {
    shown(path.display())
}

/// Writes lines for people to standard output, and ends the last one.
pub fn lines(text: impl Display) -> Result<(), Failure> {
    line(escaped_lines(&text.to_string()))
}

/// Writes to standard output, as it is: JSON, scenes, completions. A reader that has gone ends the command,
/// quietly; any other error is told.
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

/// Writes lines for people to standard error. Whoever does not want to read it must not stop a run.
pub fn tell(text: impl Display) {
    let text = text.to_string();
    let _ = io::stderr().lock().write_all(format!("{}\n", escaped_lines(&text)).as_bytes());
}
