//! The command line.

use std::{ffi::OsString, path::PathBuf};

use clap::{Args, Parser, Subcommand};

/// Version and git revision.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("HAFF_GIT_REVISION"), ")");

const AFTER: &str = "Exit status: 0 done; 2 the scene or the arguments are invalid; 3 the simulation cannot go on; \
4 a file cannot be read or written; 130, 143 ended by SIGINT, SIGTERM (resumable).";

/// Event-driven hard-sphere simulator: granular gases, hard-sphere fluids and impact mechanics, event by event.
#[derive(Debug, Parser)]
#[command(name = "haff", version = VERSION, after_help = AFTER)]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a scene, or resume a run.
    Run(Run),
    /// Check a scene without running it: particles, packing fraction, expected collision rate, memory and file size.
    Check(Check),
    /// Print a commented starter scene.
    Init(Init),
    /// Print the JSON Schema of scene files.
    #[command(after_help = "Example:\n  haff schema > haff.schema.json")]
    Schema,
    /// Summarise an output file: scene, progress, ledger, counters.
    Info(Info),
    /// Draw the standard figures of an output file (needs the Python package haff).
    Plot(Plot),
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  haff run configs/cooling.toml
  haff run configs/cooling.toml -o dense.h5 --set domain.packing_fraction=0.2 --set contact.restitution=0.8
  haff run --resume cooling.h5")]
pub struct Run {
    /// Scene file (TOML).
    #[arg(required_unless_present = "resume", conflicts_with = "resume")]
    pub scene: Option<PathBuf>,
    /// Output file (HDF5); instead of the scene's `output.file`.
    #[arg(short, long, value_name = "FILE", conflicts_with = "resume")]
    pub output: Option<PathBuf>,
    /// Set a key of the scene by its dotted path, the value in TOML.
    #[arg(long, value_name = "KEY=VALUE", conflicts_with = "resume")]
    pub set: Vec<String>,
    /// Threads; all processors by default. No result depends on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Replace an existing output file.
    #[arg(long, conflicts_with = "resume")]
    pub overwrite: bool,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
    /// Go on from the last checkpoint in this file, to the run's original end.
    #[arg(long, value_name = "FILE")]
    pub resume: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  haff check configs/cooling.toml --set species.0.count=100000")]
pub struct Check {
    /// Scene file (TOML).
    pub scene: PathBuf,
    /// Set a key of the scene by its dotted path, the value in TOML.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  haff init --list\n  haff init cooling > my_gas.toml")]
pub struct Init {
    /// Template; see --list.
    pub template: Option<String>,
    /// Name the templates.
    #[arg(long)]
    pub list: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  haff info cooling.h5")]
pub struct Info {
    /// Output file (HDF5).
    pub file: PathBuf,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub struct Plot {
    /// Passed on to `python -m haff plot`; `haff plot --help` tells more.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    pub arguments: Vec<OsString>,
}
