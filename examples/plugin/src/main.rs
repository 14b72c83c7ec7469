//! The command haff with the Δ model, a torus, a drive and a probe: `granular-layer run layer.toml`.

mod delta;
mod kolmogorov;
mod torus;

use std::process::ExitCode;

fn main() -> ExitCode {
    let plugins = haff_cli::Plugins::new().law("delta", delta::make).surface("torus", torus::make);
    let plugins = plugins.drive("kolmogorov", kolmogorov::drive).probe("flow", kolmogorov::probe);
    haff_cli::main_with(plugins)
}
