//! The `haff` command: event-driven hard spheres from a scene file to an H5MD file.

use std::process::ExitCode;

fn main() -> ExitCode {
    haff_cli::main_with(haff_cli::Plugins::new())
}
