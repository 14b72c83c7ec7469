//! The terminal: its width, and where bars are drawn.

use std::io;

use console::Term;
use indicatif::{ProgressDrawTarget, TermLike};

/// Drawings a second, at most.
const RATE: u8 = 10;

/// Columns of a terminal; `None` without a terminal, where lines may have any length.
pub fn width(terminal: &Term) -> Option<usize> {
    terminal.size_checked().map(|(_, columns)| columns.into())
}

/// Where bars are drawn: on standard error.
pub fn bars() -> ProgressDrawTarget {
    ProgressDrawTarget::term_like_with_hz(Box::new(Resting(Term::buffered_stderr())), RATE)
}

/// A terminal whose cursor rests at the start of the last line drawn. If it stayed at the end of a full line,
/// as `indicatif` leaves it, echoed text such as `^C` would start another line, and clearing the bars would
/// remove only that one.
#[derive(Debug)]
struct Resting(Term);

impl TermLike for Resting {
    fn width(&self) -> u16 {
        TermLike::width(&self.0)
    }

    fn height(&self) -> u16 {
        TermLike::height(&self.0)
    }

    fn move_cursor_up(&self, n: usize) -> io::Result<()> {
        self.0.move_cursor_up(n)
    }

    fn move_cursor_down(&self, n: usize) -> io::Result<()> {
        self.0.move_cursor_down(n)
    }

    fn move_cursor_right(&self, n: usize) -> io::Result<()> {
        self.0.move_cursor_right(n)
    }

    fn move_cursor_left(&self, n: usize) -> io::Result<()> {
        self.0.move_cursor_left(n)
    }

    fn write_line(&self, text: &str) -> io::Result<()> {
        self.0.write_line(text)
    }

    fn write_str(&self, text: &str) -> io::Result<()> {
        self.0.write_str(text)
    }

    fn clear_line(&self) -> io::Result<()> {
        self.0.clear_line()
    }

    fn flush(&self) -> io::Result<()> {
        self.0.write_str("\r")?;
        self.0.flush()
    }
}
