//! Results of the measurement, as JSON and as lines of tables.

use haff_accuracy::{
    growth::{Growth, LOST, Mean, Series},
    statistics::{Estimate, Quantity},
    trial::{Solution, Trial},
};
use serde_json::{Value, json};

/// A method on a scene.
pub fn trial(trial: &Trial, followed: Option<&Series>) -> Value {
    let mut value = json!({
        "method": trial.method,
        "parameter": trial.parameter,
        "value": trial.value,
        "steps": trial.steps,
        "wall_seconds": trial.seconds,
        "error": trial.error.last(),
    });
    if let Some(followed) = followed {
        value["followed"] = series(followed);
        value["lost_after"] = json!(followed.lost());
    }
    value
}

fn series(series: &Series) -> Value {
    json!({"collisions_per_particle": series.collisions, "deviation": series.deviation})
}

/// A scene with all its trials.
pub fn scene(answer: &Solution, trials: &[Value]) -> Value {
    json!({
        "name": answer.name,
        "description": answer.description,
        "particles": answer.system.bodies.len(),
        "simulated_time": answer.times.last(),
        "time_scale": answer.time_scale,
        "trials": trials,
    })
}

/// The trials' heading.
pub fn trials_head() -> String {
    format!(
        "Run time against error; errors in diameters, root mean square over the particles\n\
         {:<14} {:<14} {:>11} {:>12} {:>10} {:>12}",
        "method", "parameter", "steps", "seconds", "error", "lost after"
    )
}

/// A trial's line.
pub fn trial_line(trial: &Trial, followed: Option<&Series>) -> String {
    // Divergence is defined only for gases compared along the run.
    let lost = followed.map_or(String::new(), |followed| match followed.lost() {
        Some(lost) => format!("{lost:.1}"),
        None => format!("> {:.1}", followed.collisions.last().copied().unwrap_or(0.0)),
    });
    format!(
        "{:<14} {:<14} {:>11} {:>12.3e} {:>10.1e} {lost:>12}",
        trial.method,
        trial.parameter,
        trial.steps,
        trial.seconds,
        trial.error.last().copied().unwrap_or(f64::NAN)
    )
}

/// A method's estimate.
pub fn estimate(estimate: &Estimate) -> Value {
    json!({
        "method": estimate.method,
        "parameter": estimate.parameter,
        "value": estimate.value,
        "runs": estimate.runs,
        "wall_seconds": estimate.seconds,
        "mean": estimate.mean,
        "standard_error": estimate.standard_error,
        "relative_error": estimate.relative_error(),
        "relative_standard_error": estimate.relative_standard_error(),
    })
}

/// A quantity with all its estimates.
pub fn quantity(quantity: Quantity, budget: f64, estimates: &[Value]) -> Value {
    json!({
        "name": quantity.name(),
        "description": quantity.description(),
        "expected": quantity.expected(),
        "budget_seconds": budget,
        "estimates": estimates,
    })
}

/// The estimates' heading.
pub fn estimates_head(budget: f64) -> String {
    format!(
        "\nPressure and cooling rate from {budget} s of each method, but at least three runs of ten collisions per particle\n\
         {:<14} {:<14} {:>6} {:>9} {:>11} {:>10} {:>11} {:>7}",
        "method", "parameter", "runs", "seconds", "mean", "± ", "off by", "z"
    )
}

/// An estimate's line.
pub fn estimate_line(estimate: &Estimate) -> String {
    format!(
        "{:<14} {:<14} {:>6} {:>9.2} {:>11.6} {:>10.1e} {:>10.3} % {:>6.1}",
        estimate.method,
        estimate.parameter,
        estimate.runs,
        estimate.seconds,
        estimate.mean,
        estimate.standard_error,
        100.0 * estimate.relative_error(),
        estimate.relative_error() / estimate.relative_standard_error()
    )
}

/// One of the runs from a start.
type Kind = fn(&Growth) -> &Series;

/// A gas whose error growth was measured from several initial states.
pub fn growth(name: &str, description: &str, particles: usize, bits: usize, runs: &[Growth]) -> Value {
    let mean = |value: &dyn Fn(&Growth) -> Option<f64>| {
        let mean = Mean::of(runs.iter().map(value));
        json!({"mean": mean.mean, "standard_error": mean.standard_error})
    };
    let kinds: [(&str, Kind); 4] = [
        ("haff", |run| &run.engine),
        ("rounded_state", |run| &run.rounded),
        ("flight_rounded", |run| &run.flight),
        ("start_nudged", |run| &run.perturbed),
    ];
    let mut kind_values = serde_json::Map::new();
    for (kind, of) in kinds {
        let value = json!({
            "bits_per_collision": mean(&|run| of(run).slope()),
            "lost_after": mean(&|run| of(run).lost()),
            // Per initial state, so that differences of their Lyapunov exponents do not count.
            "haff_is_lost_earlier_by": mean(&|run| Some(of(run).lost()? - run.engine.lost()?)),
            "bits_beyond_rounded_state": mean(&|run| of(run).bits_beyond(&run.rounded)),
            "runs": runs.iter().map(|run| series(of(run))).collect::<Vec<_>>(),
        });
        kind_values.insert(kind.to_owned(), value);
    }
    let machineries: Vec<String> = runs.first().map_or(Vec::new(), |run| {
        run.configurations
            .iter()
            .map(|(neighbors, simd)| format!("{} {simd:?}", neighbors.name()).to_lowercase())
            .collect()
    });
    json!({
        "name": name,
        "description": description,
        "particles": particles,
        "starts": runs.len(),
        "reference_bits": bits,
        "lost_at": LOST,
        "kinds": kind_values,
        "machineries": machineries,
        "identical": runs.iter().all(|run| run.identical),
        "epochs": runs.iter().map(|run| run.counters.epochs).min(),
    })
}

/// The growths' heading.
pub fn growth_head() -> String {
    format!(
        "\nGrowth of errors: collisions per particle until the deviation from {}-bit arithmetic is {LOST} diameters;\n\
         the last but two: how much earlier haff gets there than exact arithmetic on rounded flights\n\
         {:<8} {:>3} {:>16} {:>16} {:>16} {:>16} {:>16} {:>19} {:>6} {:>7}",
        256,
        "gas",
        "N",
        "bits a collision",
        "haff",
        "state rounded",
        "flight rounded",
        "start nudged",
        "haff earlier by",
        "same",
        "epochs"
    )
}

/// A gas's line.
pub fn growth_line(gas: &Value) -> String {
    let mean = |value: &Value, digits: usize| {
        let number = |key: &str| value[key].as_f64().unwrap_or(f64::NAN);
        format!("{:.digits$} ± {:.digits$}", number("mean"), number("standard_error"))
    };
    let kinds = &gas["kinds"];
    let machineries = gas["machineries"].as_array().map_or(0, Vec::len);
    format!(
        "{:<8} {:>3} {:>16} {:>16} {:>16} {:>16} {:>16} {:>19} {:>6} {:>7}",
        gas["name"].as_str().unwrap_or_default(),
        gas["particles"],
        mean(&kinds["haff"]["bits_per_collision"], 2),
        mean(&kinds["haff"]["lost_after"], 2),
        mean(&kinds["rounded_state"]["lost_after"], 2),
        mean(&kinds["flight_rounded"]["lost_after"], 2),
        mean(&kinds["start_nudged"]["lost_after"], 2),
        mean(&kinds["flight_rounded"]["haff_is_lost_earlier_by"], 2),
        if gas["identical"] == true { format!("{machineries}/{machineries}") } else { "NO".to_owned() },
        gas["epochs"]
    )
}
