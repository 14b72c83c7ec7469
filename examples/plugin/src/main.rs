//! The command haff with the Δ model: `granular-layer run layer.toml`.

mod delta;

use std::process::ExitCode;

fn main() -> ExitCode {
    haff_cli::main_with(haff_cli::Plugins::new().law("delta", delta::make))
}
