//! `-v`: what the machinery decides, on standard error.

use tracing::Level;
use tracing_subscriber::fmt;

/// Starts telling: nothing, decisions (`-v`), or everything that happens now and then (`-vv`).
pub fn start(verbosity: u8) {
    let level = match verbosity {
        0 => return,
        1 => Level::INFO,
        _ => Level::DEBUG,
    };
    let color = std::io::IsTerminal::is_terminal(&std::io::stderr());
    fmt()
        .with_max_level(level)
        .with_writer(std::io::stderr)
        .with_ansi(color)
        .with_timer(fmt::time::uptime())
        .init();
}
