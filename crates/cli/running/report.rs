//! The result of a run, as JSON and as text.

use std::path::PathBuf;

use haff_engine::{EngineError, TRAJECTORY_VERSION, Term, counts, energies, residual_warning, significant};
use haff_linkage::AnySimulationError;
use serde_json::{Value, json};

use crate::{
    arguments::VERSION,
    running::{
        parts::Parts,
        session::{Ending, Outcome},
    },
    terminal::{
        memory::peak_memory,
        numbers::{counted, duration},
        output::{self, shown},
        threads,
        words::say,
    },
};

/// Data of the report beside the simulation itself.
pub struct Context {
    pub title: String,
    pub seed: u64,
    pub file: Option<PathBuf>,
    pub resumed_from: Option<f64>,
    /// The file that a run with changed keys goes on from.
    pub continues: Option<PathBuf>,
    /// The parts of the run before this one.
    pub parts: Parts,
}

impl Context {
    /// All parts of the run, with this one.
    pub fn parts_with(&self, outcome: &Outcome) -> Parts {
        let mut parts = self.parts.clone();
        let collisions = outcome.simulation.counters().collisions;
        parts.push(outcome.simulation.time(), collisions, Some(outcome.wall.as_secs_f64()));
        parts
    }
}

/// The run as one JSON object.
pub fn report(outcome: &Outcome, context: &Context) -> Value {
    let simulation = &outcome.simulation;
    let counters = simulation.counters();
    let ledger = simulation.ledger();
    let parts = context.parts_with(outcome);
    let known = parts.known();
    let mut report = json!({
        "title": context.title,
        "stopped": outcome.ending.word(),
        "particles": simulation.rows(),
        "simulated_time": simulation.time(),
        "wall_seconds": known.wall_seconds,
        "collisions_per_second": known.rate(),
        "parts": parts.json(),
        "max_overlap": simulation.max_overlap(),
        "peak_memory_bytes": peak_memory(),
        "threads": rayon::current_num_threads(),
        "blocks": blocks(outcome),
        "neighbors": simulation.search(),
        "seed": context.seed,
        "version": VERSION,
        "trajectory_version": TRAJECTORY_VERSION,
        "state_hash": simulation.state_hash(),
        "counters": {
            "predictions": counters.predictions,
            "stale": counters.stale,
            "dropped": counters.dropped,
            "transfers": counters.transfers,
            "candidates": counters.candidates,
            "windows": counters.windows,
            "epochs": counters.epochs,
        },
        "file": context.file.as_ref().map(|file| file.display().to_string()),
    });
    let mut warnings = simulation.warnings();
    warnings.extend(residual_warning(ledger.residual));
    report["warnings"] = json!(warnings);
    for (name, count) in counts(&counters) {
        report[name] = json!(count);
    }
    if let Some([entered, left]) = simulation.passages() {
        report["particles_present"] = json!(simulation.particles());
        report["particles_in"] = json!(entered);
        report["particles_out"] = json!(left);
    }
    for (name, energy) in energies(&ledger) {
        report[name] = json!(energy);
    }
    if let Some(from) = context.resumed_from {
        report["resumed_from"] = json!(from);
    }
    if let Some(file) = &context.continues {
        report["continues"] = json!(file.display().to_string());
    }
    if let Ending::Failed(error) = &outcome.ending {
        report["error"] = json!(outcome.told(&error.to_string()));
    }
    report
}

/// How many threads have taken the events.
fn blocks(outcome: &Outcome) -> Value {
    let counters = outcome.simulation.counters();
    let (counts, reason) = outcome.simulation.blocks();
    threads::report(&counts, counters.collisions + counters.wall_collisions, reason)
}

/// Prints the run in a few lines.
pub fn print_summary(outcome: &Outcome, context: &Context) {
    let simulation = &outcome.simulation;
    let (counters, ledger) = (simulation.counters(), simulation.ledger());
    let why = match &outcome.ending {
        Ending::Until => "reached run.until".to_owned(),
        Ending::Collisions => "reached the number of collisions".to_owned(),
        Ending::PackingFraction => "reached growth.until_packing_fraction".to_owned(),
        Ending::Jammed(why) => why.clone(),
        Ending::ReducedPressure => "reached growth.until_reduced_pressure".to_owned(),
        Ending::Box => "the box cannot become smaller".to_owned(),
        Ending::WallTime => "run.wall_time is used up".to_owned(),
        Ending::Signal(_) => "ended by a signal".to_owned(),
        Ending::Rest => "at rest: there are no further events".to_owned(),
        Ending::Failed(_) => "the simulation cannot continue".to_owned(),
        Ending::Unwritable(_) => "the output cannot be written".to_owned(),
    };
    if !context.title.is_empty() {
        output::message(shown(&context.title));
    }
    let parts = context.parts_with(outcome);
    let particles = match simulation.passages() {
        Some(_) => format!("{} particles now", simulation.particles()),
        None => counted(simulation.particles() as u64, "particle"),
    };
    output::message(format_args!(
        "{particles} to t = {} in {}: {why}",
        significant(simulation.time(), 9),
        duration(outcome.wall.as_secs_f64()),
    ));
    output::message(format_args!(
        "{}, {}; ledger residual {}, largest overlap {}",
        collisions(counters.collisions, &parts),
        counted(counters.wall_collisions, "wall collision"),
        significant(ledger.residual, 2),
        significant(simulation.max_overlap(), 2)
    ));
    if let Some([entered, left]) = simulation.passages() {
        output::message(format_args!("{} came in, {left} taken out", counted(entered, "particle")));
    }
    output::warnings(residual_warning(ledger.residual).as_slice());
    if parts.len() > 1 {
        let all = duration(parts.known().wall_seconds.unwrap_or(0.0));
        let unknown = match parts.unknown() {
            0 => String::new(),
            count => format!(", without {} of unknown time", counted(count as u64, "part")),
        };
        output::message(format_args!("{} parts took {all}{unknown}", parts.len()));
    }
    if counters.simultaneous > 0 {
        output::message(format_args!(
            "{} at the instant of another event of the same body: their order is by rank (docs/simultaneous.md)",
            counted(counters.simultaneous, "contact")
        ));
    }
    let served = blocks(outcome);
    let text = served["text"].as_str().unwrap_or_default();
    output::message(format_args!("threads: {}; {text}", rayon::current_num_threads()));
    let rest = ledger.term(Term::Rest);
    if rest != 0.0 {
        output::message(format_args!(
            "{} at rest, {} woken; rest has removed the energy {}",
            counted(counters.rests, "time"),
            counted(counters.wakes, "time"),
            significant(rest, 4)
        ));
    }
    if let Some(file) = &context.file {
        let file = output::path(file);
        output::message(format_args!("wrote {file}"));
        match &outcome.ending {
            // It would collapse again.
            Ending::Failed(_) if outcome.jammed.is_some() => {}
            Ending::Failed(AnySimulationError::Granular(EngineError::Collapse {
                contact_duration,
                rest_speed,
                ..
            })) => {
                // Under gravity grains that have come together stay together, and only rest ends their
                // impacts.
                let change = if *rest_speed > 0.0 {
                    Some(("rest_speed", rest_speed.to_string()))
                } else if *contact_duration > 0.0 {
                    Some(("tc", format!("{contact_duration:e}")))
                } else {
                    None
                };
                let set = change.map_or_else(String::new, |(key, value)| {
                    say(format!(" --set contact.{key}={value}"), format!(", contact__{key}={value}"))
                });
                output::message(say(
                    format!("go on with: haff run --resume {file}{set} -o NEW.h5"),
                    format!("go on with: haff.resume(\"{file}\", file=\"NEW.h5\"{set})"),
                ));
            }
            ending if ending.is_final() => {}
            _ => output::message(say(
                format!("continue with: haff run --resume {file}"),
                format!("continue with: haff.resume(\"{file}\")"),
            )),
        }
    }
}

/// All collisions and their rate; of a run in several parts, also those of the last part.
fn collisions(total: u64, parts: &Parts) -> String {
    let rate = |rate: f64| format!("{} M/s", significant(rate / 1e6, 3));
    let (known, all) = (parts.known(), counted(total, "collision"));
    let Some(last) = parts.last().filter(|_| parts.len() > 1) else {
        return format!("{all} ({})", rate(known.rate()));
    };
    format!("{all}, {} of them in this part ({})", last.collisions, rate(last.rate()))
}
