//! The command line.

use std::{ffi::OsString, path::PathBuf};

use clap::{ArgAction, Args, Parser, Subcommand, error::ContextValue};
use clap_complete::Shell;

use crate::terminal::output::shown;

/// Version and git revision.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("HAFF_GIT_REVISION"), ")");

const AFTER: &str = "Examples:
  haff init cooling > gas.toml && haff check gas.toml && haff run gas.toml
  haff plot cooling.h5

Exit status: 0 done; 2 the scene or the arguments are invalid; 3 the simulation cannot continue; \
4 a file cannot be read or written; 130, 143 ended by SIGINT, SIGTERM (resumable).";

/// Event-driven hard-sphere simulator: granular gases, hard-sphere fluids and impact mechanics, event by
/// event.
#[derive(Debug, Parser)]
#[command(name = "haff", version = VERSION, after_help = AFTER)]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Command,
    /// Print which algorithm and files are used; -vv: also tuning, checkpoints, flushes.
    #[arg(short, long, action = ArgAction::Count, global = true)]
    pub verbose: u8,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run a scene, or resume a run.
    Run(Run),
    /// Check a scene without running it: particles, packing fraction, expected collision rate, memory and
    /// file size.
    Check(Check),
    /// Print a commented starter scene.
    Init(Init),
    /// Print the JSON Schema of scene files.
    #[command(after_help = "Example:\n  haff schema > haff.schema.json")]
    Schema,
    /// Summarise an output file: scene, progress, ledger, counters.
    Info(Info),
    /// Compare the means of two output files, or of two sweeps run by run: differences in standard errors.
    #[command(after_help = "Examples:
  haff compare cooling.h5 other.h5
  haff compare sweep_of_cells sweep_of_lists --json")]
    Compare(Compare),
    /// Measure collisions per second on standard scenes.
    Bench(Bench),
    /// Make a packing: hard spheres or disks that grow to a packing fraction, or until they jam.
    Pack(Pack),
    /// Run a scene for every combination of values and seeds, one file each.
    Sweep(Sweep),
    /// Draw the standard figures of an output file (needs the Python package haff).
    #[command(after_help = "Examples:
  haff plot cooling.h5
  haff plot cooling.h5 --kind temperature --format pdf -o paper
  haff plot cooling.h5 --movie cooling.mp4 --frames ::5")]
    Plot(Python),
    /// Write a file for other programs: GSD, extended XYZ, VTKHDF, CSV, Parquet (needs the Python package
    /// haff).
    #[command(after_help = "Examples:
  haff export cooling.h5 --to gsd
  haff export cooling.h5 --to extxyz --frames ::10 --unwrapped -o few.extxyz
  haff export cooling.h5 --to parquet --table events")]
    Export(Python),
    /// Make a web page that plays an output file (needs the Python package haff).
    #[command(after_help = "Examples:
  haff view cooling.h5 --open
  haff view cooling.h5 --frames ::10 -o talk.html")]
    View(Python),
    /// Write the impacts of a run as a table: velocities before and after, e, impulses, energies
    #[command(after_help = "Examples:
  haff table breakshot.h5
  haff table breakshot.h5 -o impacts.tex")]
    Table(Python),
    /// Write the manual pages into a folder.
    Man(Man),
    /// Print completions for a shell.
    Completions(Completions),
}

impl Command {
    /// Whether results are wanted as JSON.
    pub fn is_json(&self) -> bool {
        match self {
            Self::Run(options) => options.json,
            Self::Check(options) => options.json,
            Self::Info(options) => options.json,
            Self::Compare(options) => options.json,
            Self::Bench(options) => options.json,
            Self::Pack(options) => options.json,
            Self::Sweep(options) => options.json,
            _ => false,
        }
    }
}

// One bool for each switch of the command line.
#[allow(clippy::struct_excessive_bools)]
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  haff run configs/cooling.toml
  haff run configs/cooling.toml -o dense.h5 --set domain.packing_fraction=0.2 --set contact.restitution=0.8
  haff run configs/cooling.toml --watch               # a line for each sample during the run
  haff run --resume cooling.h5
  haff run --resume cooling.h5 --set run.until=2e4 -o longer.h5     # also of a run that is complete
  haff run --resume cooling.h5 --set contact.tc=1e-5 -o other.h5
  haff run --resume shaken.h5 --set wall.floor.motion.frequency=2.2 --set run.until=200 -o faster.h5

Ctrl-C ends a run with a checkpoint; --resume continues from it, with the same bits.")]
pub struct Run {
    /// Scene file (TOML).
    #[arg(required_unless_present = "resume", conflicts_with = "resume")]
    pub scene: Option<PathBuf>,
    /// Output file (HDF5); instead of the scene's `output.file`. With --resume, the run goes on in this file.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Set a key of the scene by its dotted path, the value in TOML. With --resume it needs -o, and acts from
    /// the checkpoint on.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Threads; all processors by default. No result depends on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Replace an existing output file. A file that is not HDF5, the scene itself and the state file it
    /// starts from are never replaced.
    #[arg(long)]
    pub overwrite: bool,
    /// Print only errors.
    #[arg(short, long)]
    pub quiet: bool,
    /// Show time, collisions, temperature, ledger residual and speed at samples, two a second at most.
    #[arg(short, long, conflicts_with = "quiet")]
    pub watch: bool,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
    /// Continue from the last checkpoint in this file to the run's original end; with -o, in a new file,
    /// which then begins at this checkpoint.
    #[arg(long, value_name = "FILE")]
    pub resume: Option<PathBuf>,
}

/// The box of a packing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Container {
    /// Periodic along all axes.
    Periodic,
    /// Walls on all sides.
    Box,
    /// A cylinder along z with flat ends; of disks, a circle.
    Cylinder,
    /// A cylinder along z, periodic along it.
    Tube,
    /// A sphere.
    Sphere,
}

// One bool for each switch of the command line.
#[allow(clippy::struct_excessive_bools)]
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  haff pack 1000 --packing-fraction 0.6 -o packing.h5
  haff pack 10000 --jammed --seed 3 -o jammed.h5
  haff pack 2000 --jammed --dimension 2 --sizes '{ list = [0.5, 0.7] }' -o disks.h5
  haff pack 500 --packing-fraction 0.55 --container box -o walled.h5
  haff pack 3000 --jammed --container tube --aspect 3 -o tube.h5

The last frame of the file is the packing: a start of scenes as initial.positions = { file = \"packing.h5\" }.
haff plot FILE --kind contacts draws it, haff.pack in Python returns it.")]
pub struct Pack {
    /// Number of particles.
    #[arg(value_name = "N", value_parser = clap::value_parser!(u32).range(2..=10_000_000))]
    pub count: u32,
    /// Packing fraction at which the growth ends, exactly to rounding.
    #[arg(long, value_name = "PHI", required_unless_present = "jammed", conflicts_with = "jammed")]
    pub packing_fraction: Option<f64>,
    /// Grow until the particles jam.
    #[arg(long)]
    pub jammed: bool,
    /// Reduced pressure P V/(N T) that counts as jammed.
    #[arg(long, value_name = "P", default_value_t = 1e9, conflicts_with = "packing_fraction")]
    pub reduced_pressure: f64,
    /// Radii, as the radius of a species in scenes, in TOML: 0.5 (default), { list = [0.5, 0.7] },
    /// { lognormal = [0.5, 0.1] }, …
    #[arg(long, value_name = "TOML")]
    pub sizes: Option<String>,
    /// 3: spheres; 2: disks.
    #[arg(long, value_name = "D", default_value_t = 3, value_parser = clap::value_parser!(u8).range(2..=3))]
    pub dimension: u8,
    /// What the particles are in.
    #[arg(long, value_enum, default_value_t = Container::Periodic)]
    pub container: Container,
    /// Length of a cylinder or tube [its diameter]; 2 by default.
    #[arg(long, value_name = "RATIO")]
    pub aspect: Option<f64>,
    /// Growth of the largest diameter in a unit of time by the thermal speed √(T/m); slow growth jams
    /// later, and equal particles crystallise. Default: 0.1 up to packing fractions of 0.6 (disks: 0.82),
    /// 0.01 above, and 0.035 to jamming.
    #[arg(long, value_name = "R")]
    pub rate: Option<f64>,
    /// Seed of the random numbers.
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub seed: u64,
    /// Output file (HDF5).
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Threads; all processors by default. No result depends on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Replace an existing output file.
    #[arg(long)]
    pub overwrite: bool,
    /// Print only errors.
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
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
    /// Name of a shipped scene; see --list. A mesh that it needs is written into the working directory.
    pub template: Option<String>,
    /// Name the shipped scenes, by kind.
    #[arg(long)]
    pub list: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  haff info cooling.h5
  haff info cooling.h5 --json
  haff info cooling.h5 --watch      # of a run that another process is making")]
pub struct Info {
    /// Output file (HDF5).
    pub file: PathBuf,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
    /// Show the newest sample whenever there is one, until the run is complete.
    #[arg(short, long, conflicts_with = "json")]
    pub watch: bool,
}

#[derive(Debug, Args)]
pub struct Compare {
    /// Output file (HDF5), or folder of a sweep.
    pub a: PathBuf,
    /// Another one of the same kind.
    pub b: PathBuf,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  haff man ~/.local/share/man/man1 && man haff-run")]
pub struct Man {
    /// Folder; created if it does not exist.
    pub folder: PathBuf,
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  haff completions bash > ~/.local/share/bash-completion/completions/haff
  haff completions zsh > ~/.zfunc/_haff
  haff completions fish > ~/.config/fish/completions/haff.fish")]
pub struct Completions {
    /// The shell.
    pub shell: Shell,
}

// One bool for each switch of the command line.
#[allow(clippy::struct_excessive_bools)]
#[derive(Debug, Args)]
#[command(after_help = "Several values, separated by commas, give one cell each, in a separate process.

Examples:
  haff bench                                          # elastic fluid, N = 32,000, a tenth full
  haff bench --n 4000,32000,500000 --phi 0.01,0.1,0.49 --repeats 3
  haff bench --scene cooling --n 100000 --threads 1,2 --json
  haff bench --scene configs/cooling.toml --collisions 1e6
  haff bench --n 4000 --neighbors cells,lists,windows --csv > searches.csv
  haff bench --phi 0.1,0.49 --against ../before/target/release/haff       # two builds side by side
  haff bench --n 4000 --phi 0.3 --print-scene > fluid.toml && haff run fluid.toml   # the same trajectory
  haff bench --accuracy --json > accuracy.json        # run time against error, beside other methods; about a minute

Melting, packing and the building of the engine are not timed; collisions are those between particles.
The columns after the rate are counts per collision. See benches/record/ for records over whole grids.")]
pub struct Bench {
    /// A standard scene (see --list) or a scene file.
    #[arg(long, value_name = "NAME|FILE", default_value = "fluid")]
    pub scene: String,
    /// Numbers of particles of a standard scene, exactly; also as 1e6 [default: 32000].
    #[arg(long, value_name = "N,…", value_delimiter = ',', value_parser = particles, allow_negative_numbers = true)]
    pub n: Vec<u64>,
    /// Packing fractions of a standard scene [default: the scene's own].
    #[arg(long, value_name = "PHI,…", value_delimiter = ',', value_parser = fraction, allow_negative_numbers = true)]
    pub phi: Vec<f64>,
    /// Collisions to time, in each repeat [default: 1e6 or 2 N, the larger; of a scene file, its whole run].
    #[arg(long, value_name = "C", value_parser = collisions, allow_negative_numbers = true)]
    pub collisions: Option<u64>,
    /// Collisions per particle (each involves two) before the clock starts [default: 20; of a scene file, 0].
    /// From φ of about 0.45 on, an fcc crystal needs a few hundred to melt.
    #[arg(long, value_name = "M", value_parser = melt, allow_negative_numbers = true)]
    pub melt: Option<f64>,
    /// Number of timed repeats; the median and the spread are reported [default: 1; with --against 7].
    #[arg(long, value_name = "R", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeats: Option<u32>,
    /// Threads; all processors by default. No result depends on it but the time.
    #[arg(long, value_name = "T,…", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Vec<u16>,
    /// Seed of a standard scene.
    #[arg(long, value_name = "SEED", value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub seed: Option<u64>,
    /// Neighbor searches, as `engine.neighbors` of a scene.
    #[arg(long, value_name = "METHOD,…", value_delimiter = ',',
        value_parser = ["auto", "windows", "cells", "lists", "all_pairs"])]
    pub neighbors: Vec<String>,
    /// Vector instructions, as `engine.simd` of a scene.
    #[arg(long, value_name = "SIMD", value_parser = ["auto", "avx2", "portable"])]
    pub simd: Option<String>,
    /// Blocks whose events are taken at the same time, as `engine.blocks` of a scene. JSON has the sum of the
    /// events of the longest block of each round.
    #[arg(long, value_name = "B", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub blocks: Option<u16>,
    /// Set a key of the scene by its dotted path, the value in TOML.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Print the results as JSON on standard output: an object, or an array if there are several cells. They
    /// name the machine and the date.
    #[arg(long)]
    pub json: bool,
    /// Print the results as CSV on standard output, a row for each cell.
    #[arg(long, conflicts_with_all = ["json", "against"])]
    pub csv: bool,
    /// Another build of haff: both measure each cell in turn, --repeats times, and the median of the ratios
    /// of the rates is printed with its standard error. Above 1 this build is faster.
    #[arg(long, value_name = "PROGRAM")]
    pub against: Option<PathBuf>,
    /// Do not report the progress.
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the cell's scene instead of running it, for `haff run`, which ends in the same state.
    #[arg(long, conflicts_with_all = ["json", "csv", "against", "list"])]
    pub print_scene: bool,
    /// Name the standard scenes.
    #[arg(long)]
    pub list: bool,
    /// Measure run time against error instead, on scenes with known answers, beside other methods; and how
    /// errors grow.
    #[arg(long, conflicts_with_all = ["scene", "n", "phi", "collisions", "melt", "repeats", "threads", "seed",
        "neighbors", "simd", "blocks", "set", "csv", "against", "print_scene", "list"])]
    pub accuracy: bool,
    /// A short --accuracy: larger steps, shorter runs, fewer starts; a few seconds.
    #[arg(long, requires = "accuracy")]
    pub quick: bool,
    /// Another program to run the scenes of --accuracy; docs/accuracy.md describes its input and output.
    #[arg(long, value_name = "NAME=COMMAND", value_parser = peer, requires = "accuracy")]
    pub peer: Vec<(String, String)>,
}

#[derive(Debug, Args)]
#[command(
    after_help = "Values are TOML, separated by commas outside of brackets and quotes; lin(A, B, N) and log(A, B, N) are N
values from A to B. Several --set give all combinations, the first key varying slowest.

Examples:
  haff sweep configs/cooling.toml --set contact.restitution=0.8,0.9,0.95 --seeds 4 -o study
  haff sweep configs/cooling.toml --set 'contact.restitution=lin(0.5, 0.95, 10)' --set species.grain.count=1000,8000 -o grid
  haff sweep configs/cooling.toml --set contact.restitution=0.8,0.9 --list      # what would run
  haff sweep configs/cooling.toml --set contact.restitution=0.8,0.9 -o study --index $SLURM_ARRAY_TASK_ID

The same command again runs only what is missing, and continues stopped runs; with more values or seeds it adds
their runs and keeps the others. DIR/manifest.json lists parameters,
seed, file, status and totals of every run. A run that fails does not stop the others; the exit status is the worst."
)]
pub struct Sweep {
    /// Scene file (TOML).
    pub scene: PathBuf,
    /// A key of the scene by its dotted path, and the values it takes; repeatable.
    #[arg(long, value_name = "KEY=V1,V2,…")]
    pub set: Vec<String>,
    /// Run each combination N times, with seeds derived by a hash from the scene's seed and the parameters;
    /// without it, once with the scene's own seed.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub seeds: Option<u32>,
    /// Folder of the files and the manifest.
    #[arg(short, long, value_name = "DIR", required_unless_present = "list")]
    pub output: Option<PathBuf>,
    /// Run this member only, counted from 0: for job arrays. The manifest is updated when the whole sweep is
    /// run or listed.
    #[arg(long, value_name = "I", allow_negative_numbers = true)]
    pub index: Option<usize>,
    /// Runs at a time; as many as there are cores by default. No result depends on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), conflicts_with = "index")]
    pub jobs: Option<u16>,
    /// Threads of each run; by default the remaining cores, and all for a single member.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// List the members and their progress without running them.
    #[arg(long)]
    pub list: bool,
    /// Print only errors.
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the result as one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Parses the command line; exits on an error or after printing help.
pub fn parse() -> Arguments {
    Arguments::try_parse().unwrap_or_else(|mut error| {
        // Arguments quoted in the message are escaped as other external text.
        let given: Vec<_> = error.context().map(|(kind, value)| (kind, value.clone())).collect();
        for (kind, value) in given {
            let value = match value {
                ContextValue::String(text) => ContextValue::String(shown(text)),
                ContextValue::Strings(texts) => ContextValue::Strings(texts.iter().map(shown).collect()),
                _ => continue,
            };
            error.insert(kind, value);
        }
        error.exit()
    })
}

/// A whole number, also written as 4_000 or 1e6.
fn whole(text: &str) -> Result<u64, String> {
    let plain = text.replace('_', "");
    let value = plain.parse().ok().or_else(|| {
        let value: f64 = plain.parse().ok()?;
        // Every whole number below 2^53 is a float.
        (value >= 0.0 && value.fract() == 0.0 && value < 9e15).then_some(value as u64)
    });
    value.ok_or_else(|| "must be a whole number, such as 32000 or 1e6".to_owned())
}

fn particles(text: &str) -> Result<u64, String> {
    let count = whole(text)?;
    if count >= 2 {
        Ok(count)
    } else {
        Err("must be at least 2, otherwise there are no collisions".to_owned())
    }
}

fn collisions(text: &str) -> Result<u64, String> {
    let count = whole(text)?;
    if count >= 1 { Ok(count) } else { Err("must be at least 1".to_owned()) }
}

fn fraction(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "must be a number in (0, 1)".to_owned())?;
    if value > 0.0 && value < 1.0 { Ok(value) } else { Err("must be in (0, 1)".to_owned()) }
}

fn peer(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, command)) if !name.trim().is_empty() && !command.trim().is_empty() => {
            Ok((name.trim().to_owned(), command.trim().to_owned()))
        }
        _ => Err("must be NAME=COMMAND".to_owned()),
    }
}

fn melt(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "must be a number of collisions per particle".to_owned())?;
    if (0.0..=1e9).contains(&value) { Ok(value) } else { Err("must be in [0, 1e9]".to_owned()) }
}

/// Arguments of a command that is written in Python.
#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub struct Python {
    /// Passed on to `python -m haff`; use `--help` after the command.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    pub arguments: Vec<OsString>,
}
