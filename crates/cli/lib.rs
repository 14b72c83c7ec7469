//! The `haff` command: event-driven hard spheres from a scene file to an H5MD file.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod terminal;

mod arguments;

mod running;

mod commands;

use std::process::ExitCode;

use arguments::Command;
use commands::{bench, check, info, init, manual, run, sweep};
use running::python;
use terminal::{log, memory, output, signals};

#[global_allocator]
static ALLOCATOR: memory::ReportingAllocator = memory::ReportingAllocator;

fn main() -> ExitCode {
    signals::handle_file_size_limit();
    let arguments = arguments::parse();
    log::start(arguments.verbose);
    let result = match arguments.command {
        Command::Run(options) => run::run(&options, arguments.verbose > 0),
        Command::Check(options) => check::check(&options, arguments.verbose > 0),
        Command::Init(options) => init::init(&options),
        Command::Schema => init::schema(),
        Command::Info(options) => info::info(&options),
        Command::Bench(options) => bench::bench(&options),
        Command::Plot(options) => python::run("plot", &options.arguments),
        Command::Export(options) => python::run("export", &options.arguments),
        Command::View(options) => python::run("view", &options.arguments),
        Command::Man(options) => manual::man(&options),
        Command::Completions(options) => manual::completions(&options),
        Command::Sweep(options) => sweep::sweep(&options),
    };
    match result {
        Ok(code) => ExitCode::from(code),
        Err(failure) => {
            for line in failure.message.lines() {
                output::message(format_args!("error: {line}"));
            }
            ExitCode::from(failure.status as u8)
        }
    }
}
