//! `haff compare`: the means of two files, or of two sweeps run by run, side by side with z-scores.

use std::path::Path;

use haff_engine::{Mean, significant};
use serde_json::{Map, Value, json};

use super::{
    info::rounded,
    sweep::{CompleteRun, complete_runs},
};
use crate::{
    arguments::Compare,
    terminal::{
        failure::{Failure, Status, file_failure},
        numbers::counted,
        output::{self, shown},
        table,
    },
};

/// A z-score beyond this is marked.
const FAR: f64 = 3.0;

/// A mean with its standard error.
#[derive(Debug, Clone, Copy)]
struct Estimate {
    mean: f64,
    error: f64,
    drifts: bool,
}

/// Means by the names of their observables.
type Means = Vec<(String, Estimate)>;

/// The means of all runs of one side with the same parameters.
struct Runs {
    parameters: Map<String, Value>,
    means: Means,
}

/// The means of a file.
fn of_file(path: &Path) -> Result<Means, Failure> {
    let means = haff_record::means(path).map_err(|error| file_failure(&error))?;
    if means.is_empty() {
        let text = format!("{}: no observables with a mean", output::path(path));
        return Err(Failure::new(Status::File, text));
    }
    let estimate = |found: haff_record::NamedMean| {
        let Mean { mean, error, drifts, .. } = found.mean;
        (found.name, Estimate { mean, error, drifts })
    };
    Ok(means.into_iter().map(estimate).collect())
}

/// One side: a file, or the complete runs of a sweep, those that differ in their seeds together.
fn side(path: &Path) -> Result<Vec<Runs>, Failure> {
    if !path.is_dir() {
        return Ok(vec![Runs { parameters: Map::new(), means: of_file(path)? }]);
    }
    let mut groups: Vec<(Map<String, Value>, Vec<Means>)> = Vec::new();
    for CompleteRun { parameters, file } in complete_runs(path)? {
        let means = of_file(&file)?;
        match groups.iter_mut().find(|(known, _)| *known == parameters) {
            Some((_, runs)) => runs.push(means),
            None => groups.push((parameters, vec![means])),
        }
    }
    let runs = groups.into_iter().map(|(parameters, runs)| Runs { parameters, means: over_runs(&runs) });
    Ok(runs.collect())
}

/// The means over independent runs.
fn over_runs(runs: &[Means]) -> Means {
    let Some(first) = runs.first() else { return Vec::new() };
    let over = |(name, _): &(String, Estimate)| {
        let of = |run: &Means| run.iter().find(|(other, _)| other == name).map(|found| found.1);
        let all: Vec<Estimate> = runs.iter().map(of).collect::<Option<_>>()?;
        let count = all.len() as f64;
        let squared: f64 = all.iter().map(|one| one.error * one.error).sum();
        let mean = all.iter().map(|one| one.mean).sum::<f64>() / count;
        let drifts = all.iter().any(|one| one.drifts);
        Some((name.clone(), Estimate { mean, error: squared.sqrt() / count, drifts }))
    };
    first.iter().filter_map(over).collect()
}

/// One observable of both sides.
struct Line {
    name: String,
    sides: [Estimate; 2],
}

impl Line {
    /// B − A, and its standard error.
    fn difference(&self) -> [f64; 2] {
        let [a, b] = self.sides;
        let difference = b.mean - a.mean;
        let rounded = difference.abs() <= Mean::ROUNDING * a.mean.abs().max(b.mean.abs());
        [if rounded { 0.0 } else { difference }, a.error.hypot(b.error)]
    }

    /// The difference in its standard errors; `None` without errors.
    fn z(&self) -> Option<f64> {
        let [difference, error] = self.difference();
        (error > 0.0).then_some(difference / error)
    }

    fn drifts(&self) -> bool {
        self.sides.iter().any(|side| side.drifts)
    }

    fn cells(&self) -> [String; 5] {
        let [a, b] = self.sides.map(|side| rounded(side.mean, side.error));
        let [difference, error] = self.difference();
        let mark = match self.z() {
            Some(z) if z.abs() > FAR => " *",
            _ => "",
        };
        let drifts = if self.drifts() { " drifts" } else { "" };
        let z = self.z().map_or_else(|| "–".to_owned(), |z| significant(z, 2));
        [self.name.replace('_', " "), a, b, rounded(difference, error), format!("{z}{mark}{drifts}")]
    }

    fn json(&self) -> Value {
        let one = |side: Estimate| json!({ "mean": side.mean, "error": side.error, "drifts": side.drifts });
        let [difference, error] = self.difference();
        json!({
            "a": one(self.sides[0]), "b": one(self.sides[1]),
            "difference": difference, "error": error, "z": self.z(),
        })
    }
}

/// The observables that both have.
fn common(a: &Runs, b: &Runs) -> Vec<Line> {
    let line = |(name, of_a): &(String, Estimate)| {
        let (_, of_b) = b.means.iter().find(|(other, _)| other == name)?;
        Some(Line { name: name.clone(), sides: [*of_a, *of_b] })
    };
    a.means.iter().filter_map(line).collect()
}

/// Prints the means of two files or sweeps side by side.
pub fn compare(options: &Compare) -> Result<u8, Failure> {
    let paths = [&options.a, &options.b];
    if paths[0].is_dir() != paths[1].is_dir() {
        let [a, b] = paths.map(|path| output::path(path));
        let text = format!(
            "{a} and {b}: one is a file, the other the folder of a sweep; two of a kind are compared"
        );
        return Err(Failure::new(Status::Invalid, text));
    }
    let [a, b] = [side(paths[0])?, side(paths[1])?];
    let mut pairs = Vec::new();
    for runs in &a {
        if let Some(other) = b.iter().find(|other| other.parameters == runs.parameters) {
            pairs.push((&runs.parameters, common(runs, other)));
        }
    }
    if pairs.is_empty() {
        let [a, b] = paths.map(|path| output::path(path));
        let text = format!("{a} and {b}: no complete runs of both have the same parameters");
        return Err(Failure::new(Status::Invalid, text));
    }
    let alone = [a.len() - pairs.len(), b.len() - pairs.len()];
    if options.json {
        let runs = pairs.iter().map(|(parameters, lines)| {
            let means = lines.iter().map(|line| (line.name.clone(), line.json())).collect();
            json!({ "parameters": parameters, "means": Value::Object(means) })
        });
        let report = json!({
            "a": options.a, "b": options.b, "alone": alone, "runs": runs.collect::<Vec<_>>(),
        });
        return output::line(report).map(|()| 0);
    }
    let mut text = vec![format!("A  {}\nB  {}", output::path(&options.a), output::path(&options.b))];
    for (parameters, lines) in &pairs {
        let values = parameters.iter().map(|(key, value)| shown(format_args!("{key} = {value}")));
        let label = values.collect::<Vec<_>>().join(", ");
        let mut rows = vec![[label, "A".into(), "B".into(), "B − A".into(), "z".into()]];
        rows.extend(lines.iter().map(Line::cells));
        text.push(table::aligned(&rows).trim_end().to_owned());
    }
    let far = |line: &Line| line.z().is_some_and(|z| z.abs() > FAR);
    if pairs.iter().any(|(_, lines)| lines.iter().any(far)) {
        text.push(format!("* more than {FAR} standard errors apart"));
    }
    for (name, count) in ["A", "B"].into_iter().zip(alone).filter(|&(_, count)| count > 0) {
        text.push(format!("{} of {name} without a partner", counted(count as u64, "parameter set")));
    }
    output::lines(text.join("\n\n")).map(|()| 0)
}
