//! Two builds of the command side by side: the same cells, in turn.
//!
//! Both run once in each round, in the other order in the next one, so that what slows the machine down for a
//! while slows down both. The ratio of a round is that of two neighboring runs.

use std::path::Path;

use serde_json::{Value, json};

use super::{Bench, Cell, child, name};
use crate::{
    commands::bench::report::median,
    terminal::{
        failure::{Failure, Status},
        output::{self, shown},
        signals::Signals,
    },
};

/// Rounds if `--repeats` does not say.
const ROUNDS: u32 = 7;
/// Standard error of a median of normal values, in units of that of their mean.
const OF_MEDIAN: f64 = 1.2533;

/// Median of the ratios of rounds, and its standard error; none of a single round.
fn ratio(this: &[f64], other: &[f64]) -> (f64, Option<f64>) {
    let ratios: Vec<f64> = this.iter().zip(other).map(|(this, other)| this / other).collect();
    let count = ratios.len() as f64;
    let mean = ratios.iter().sum::<f64>() / count;
    let variance = ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (median(&ratios), (ratios.len() > 1).then(|| OF_MEDIAN * (variance / count).sqrt()))
}

/// What one build has measured.
struct Side<'a> {
    program: &'a Path,
    rates: Vec<f64>,
    last: Value,
}

impl<'a> Side<'a> {
    fn new(program: &'a Path) -> Self {
        Self { program, rates: Vec::new(), last: Value::Null }
    }

    /// Runs a cell once; an exit status other than 0 ends the measurement.
    fn run(&mut self, options: &Bench, cell: Cell<'_>, signals: &Signals) -> Result<u8, Failure> {
        let (status, report) = child(self.program, options, cell, 1, signals)?;
        if let (0, Some(report)) = (status, report) {
            let rate = report["collisions_per_second"].as_f64().ok_or_else(|| {
                let why = format!("{} gave no rate", shown(self.program.display()));
                Failure::new(Status::File, why)
            })?;
            self.rates.push(rate);
            self.last = report;
        }
        Ok(status)
    }

    fn report(&self) -> Value {
        json!({
            "program": self.program.display().to_string(),
            "version": self.last["version"],
            "collisions_per_second": median(&self.rates),
            "collisions_per_second_rounds": self.rates,
            "bytes_per_particle": self.last["bytes_per_particle"],
            "neighbors": self.last["neighbors"],
            "state_hash": self.last["state_hash"],
        })
    }
}

/// Measures all cells with this build and with another one.
pub fn against(options: &Bench, other: &Path, cells: &[Cell<'_>], signals: &Signals) -> Result<u8, Failure> {
    let this = std::env::current_exe()
        .map_err(|error| Failure::new(Status::File, format!("this program is not known: {error}")))?;
    let rounds = options.repeats.unwrap_or(ROUNDS);
    let mut reports = Vec::new();
    for &cell in cells {
        let mut sides = [Side::new(&this), Side::new(other)];
        for round in 0..rounds as usize {
            for k in [round % 2, 1 - round % 2] {
                let status = sides[k].run(options, cell, signals)?;
                if status != 0 {
                    return Ok(status);
                }
            }
        }
        let [this, other] = &sides;
        let (ratio, error) = ratio(&this.rates, &other.rates);
        let report = json!({
            "cell": name(options, cell),
            "n": this.last["n"], "phi": this.last["phi"], "threads": this.last["threads"],
            "this": this.report(), "other": other.report(),
            "ratio": ratio, "ratio_error": error, "rounds": rounds,
            "same_trajectory": this.last["state_hash"] == other.last["state_hash"],
            "machine": this.last["machine"], "date": this.last["date"],
        });
        if !options.json {
            if reports.is_empty() {
                output::line(head())?;
            }
            output::lines(line(&report))?;
        }
        reports.push(report);
    }
    if options.json {
        output::line(Value::Array(reports))?;
    }
    Ok(0)
}

fn head() -> String {
    format!("{:>11} {:>11} {:>8} {:>8}  cell", "M coll/s", "other", "ratio", "error")
}

fn line(report: &Value) -> String {
    let rate = |side: &str| report[side]["collisions_per_second"].as_f64().unwrap_or(f64::NAN) / 1e6;
    let error = report["ratio_error"].as_f64().map_or("–".to_owned(), |error| format!("{error:.4}"));
    let same = if report["same_trajectory"] == true { "" } else { "; the trajectories differ" };
    format!(
        "{:>11.4} {:>11.4} {:>8.4} {error:>8}  {}{same}",
        rate("this"),
        rate("other"),
        report["ratio"].as_f64().unwrap_or(f64::NAN),
        report["cell"].as_str().unwrap_or_default()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_those_of_rounds() {
        let (middle, error) = ratio(&[2.0, 4.0, 9.0], &[1.0, 2.0, 3.0]);
        assert_eq!(middle, 2.0);
        // Ratios 2, 2, 3: variance 1/3, of the mean 1/9.
        assert!((error.unwrap() - OF_MEDIAN / 3.0).abs() < 1e-12);
        assert_eq!(ratio(&[3.0], &[2.0]), (1.5, None));
    }
}
