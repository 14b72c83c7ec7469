//! The command `haff` as a function, for programs that add laws, surfaces, drives and probes of their own.
//!
//! The whole program of the command is
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     haff_cli::main_with(haff_cli::Plugins::new())
//! }
//! ```
//!
//! With [`Plugins`] that are not empty, scenes may name what they add: `haff run`, `check`, `sweep`, `bench`
//! and `schema` know it, and resumed runs find it by the scene in the file.
//!
//! | to add | implement | add it by | in scenes |
//! |---|---|---|---|
//! | a law of contact | [`ContactLaw`] | [`Plugins::law`] | `restitution = { model = "name", parameters = { … } }` |
//! | a surface | [`Surface`] | [`Plugins::surface`] | `[[wall]]`, `surface = "name"`, `parameters = { … }` |
//! | a drive | [`Action`] | [`Plugins::drive`] | `[[drive]]`, `kind = "name"`, `parameters = { … }` |
//! | a measurement | [`Probe`] | [`Plugins::probe`] | `[[measure.probes]]`, `kind = "name"`, `parameters = { … }` |
//!
//! `examples/plugin` of the repository is a whole crate with one of each.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod terminal;

mod arguments;

mod running;

mod commands;

use std::process::ExitCode;

pub use haff_scene::{
    Action, Column, ContactLaw, DVec3, DrivenParticles, Exchange, NormalContact, Parameters, Particles,
    Partner, PluginError, Plugins, Probe, RelativeFlight, Surface, VelocityChange,
};

use arguments::Command;
use commands::{bench, check, compare, info, init, manual, pack, run, sweep};
use running::python;
use terminal::{failure::Status, log, memory, output, signals, words};

#[global_allocator]
static ALLOCATOR: memory::ReportingAllocator = memory::ReportingAllocator;

/// Runs the command with the arguments of the process, and with these plug-ins. Returns its exit status.
#[must_use]
pub fn main_with(plugins: Plugins) -> ExitCode {
    // Now: a message about memory must not allocate, and not need more stack.
    words::words();
    memory::take_stack();
    signals::handle_file_size_limit();
    if let Err(error) = plugins.install() {
        output::message(format_args!("error: plug-ins of this program: {error}"));
        return ExitCode::from(Status::Invalid as u8);
    }
    let arguments = arguments::parse();
    log::start(arguments.verbose);
    let json = arguments.command.is_json();
    let result = match arguments.command {
        Command::Run(options) => run::run(&options, arguments.verbose > 0),
        Command::Check(options) => check::check(&options, arguments.verbose > 0),
        Command::Init(options) => init::init(&options),
        Command::Schema => init::schema(),
        Command::Info(options) => info::info(&options),
        Command::Compare(options) => compare::compare(&options),
        Command::Bench(options) => bench::bench(&options),
        Command::Plot(options) => python::run("plot", &options.arguments),
        Command::Export(options) => python::run("export", &options.arguments),
        Command::View(options) => python::run("view", &options.arguments),
        Command::Table(options) => python::run("table", &options.arguments),
        Command::Man(options) => manual::man(&options),
        Command::Completions(options) => manual::completions(&options),
        Command::Pack(options) => pack::pack(&options, arguments.verbose > 0),
        Command::Sweep(options) => sweep::sweep(&options),
    };
    match result {
        Ok(code) => ExitCode::from(code),
        Err(failure) => {
            if json && !output::has_begun() && failure.status != Status::Unread {
                // A second error, of standard output, would hide the first one.
                let _ = output::line(failure.json());
            }
            for line in failure.message.lines() {
                output::message(format_args!("error: {line}"));
            }
            ExitCode::from(failure.status as u8)
        }
    }
}
