//! `haff bench --accuracy`: run time against error, method by method, and the growth of errors.

mod plan;
mod report;

use std::cell::RefCell;

use haff_accuracy::{Error, methods::Program};
use serde_json::json;

use crate::{
    arguments::{Bench, VERSION},
    commands::run::set_threads,
    terminal::{
        failure::{Failure, Status, simulation_failure},
        output,
        signals::Signals,
    },
};

/// Measures everything; tables go to standard output, or to standard error beside `--json`.
pub fn accuracy(options: &Bench) -> Result<u8, Failure> {
    // Every other method runs on one thread.
    set_threads(Some(1))?;
    let signals = Signals::watch()?;
    let peers: Vec<Program> = options
        .peer
        .iter()
        .map(|(name, command)| Program::start(name, command))
        .collect::<Result<_, _>>()
        .map_err(|error| failure(&error))?;
    let unprinted = RefCell::new(None);
    let announce = |text: &str| match (options.json, options.quiet) {
        (false, _) => {
            if let Err(failure) = output::lines(text) {
                unprinted.replace(Some(failure));
            }
        }
        (true, false) => output::message(text),
        (true, true) => (),
    };
    let stopped = || signals.received().is_some() || unprinted.borrow().is_some();
    let size = if options.quick { &plan::QUICK } else { &plan::FULL };
    let measured = measure(size, &peers, &announce, &stopped);
    if let Some(failure) = unprinted.take() {
        return Err(failure);
    }
    match measured {
        Ok(report) if options.json => output::line(report).map(|()| 0),
        Ok(_) => Ok(0),
        // The signal may have ended a peer first.
        Err(error) => match signals.received() {
            Some(signal) => Ok(128 + signal as u8),
            None => Err(failure(&error)),
        },
    }
}

fn measure(
    size: &plan::Size,
    peers: &[Program],
    announce: &dyn Fn(&str),
    stopped: &dyn Fn() -> bool,
) -> Result<serde_json::Value, Error> {
    let scenes = plan::scenes(size, peers, announce, stopped)?;
    let statistics = plan::statistics(size, peers, announce, stopped)?;
    let growth = plan::growth(size, announce, stopped)?;
    Ok(json!({
        "scenes": scenes,
        "statistics": statistics,
        "growth": growth,
        "peers": peers.iter().map(Program::name).collect::<Vec<_>>(),
        "threads": 1,
        "version": VERSION,
        "trajectory_version": haff_engine::TRAJECTORY_VERSION,
    }))
}

fn failure(error: &Error) -> Failure {
    match error {
        Error::Engine(error) => simulation_failure(&error.clone().into()),
        Error::Peer { .. } | Error::Unsupported { .. } | Error::Interrupted => {
            Failure::new(Status::Invalid, output::shown(error))
        }
    }
}
