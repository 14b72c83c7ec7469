//! `-v`: log messages on standard error.

use haff_engine::significant;
use tracing::Level;
use tracing_subscriber::{
    field::MakeExt,
    fmt::{self, format},
};

use crate::terminal::output::shown;

/// A real number with six digits; any other value as it is.
fn shortened(value: String) -> String {
    match value.parse::<f64>() {
        Ok(number) if value.contains(['.', 'e']) => significant(number, 6),
        _ => value,
    }
}

/// Starts the log: nothing, decisions (`-v`), or also infrequent events (`-vv`).
pub fn start(verbosity: u8) {
    let level = match verbosity {
        0 => return,
        1 => Level::INFO,
        _ => Level::DEBUG,
    };
    let color = std::io::IsTerminal::is_terminal(&std::io::stderr());
    // Values such as names of files are escaped as other external text.
    let fields = format::debug_fn(|out, field, value| {
        let value = shortened(shown(format_args!("{value:?}")));
        if field.name() == "message" { write!(out, "{value}") } else { write!(out, "{field}={value}") }
    });
    fmt::fmt()
        .with_max_level(level)
        .with_writer(std::io::stderr)
        .with_ansi(color)
        .with_timer(fmt::time::uptime())
        .fmt_fields(fields.delimited(" "))
        .init();
}
