//! What `haff check` and `haff run` warn of: scenes that cluster, and records that are always taken at the
//! same phase of something periodic.

use std::f64::consts::PI;

use haff_engine::{DriveKind, Grid, KickTimes, System, WallMotion, model::Restitution, significant};
use haff_scene::{Scene, Schedule};

/// Number of records taken into account, if the end of the run is not known.
const MANY: f64 = 1000.0;
/// Fewest records that are compared, and fewest states in the mean of a row over an oscillation.
const FEWEST: f64 = 4.0;
/// Largest mean of cos(2π phase) of records that are spread over the phases.
const SPREAD: f64 = 0.5;
/// Relative change of the temperature between two actions of a drive that is too small to matter.
const SMALL: f64 = 0.01;

/// All warnings for a scene, each without a final point.
pub fn warnings(scene: &Scene) -> Vec<String> {
    let periods = periods(scene);
    let strobed = periods.iter().filter_map(|period| strobed(scene, period));
    let few = periods.iter().filter_map(|period| few_states(&scene.system, period));
    haff_linkage::warnings(&scene.system, &scene.joints).into_iter().chain(strobed).chain(few).collect()
}

/// Something periodic.
struct Period {
    /// What it is, in words.
    of: String,
    /// Its length \[time\].
    length: f64,
}

/// The oscillations of walls, and the intervals of drives that change the temperature noticeably.
fn periods(scene: &Scene) -> Vec<Period> {
    let system = &scene.system;
    let mut found = Vec::new();
    for wall in &system.walls {
        if let WallMotion::Oscillating(motion) = wall.motion {
            let of = format!("the oscillation of wall \"{}\"", wall.name);
            found.push(Period { of, length: 1.0 / motion.oscillation.frequency });
        }
    }
    for drive in &system.drives {
        let (name, interval) = match drive.kind {
            DriveKind::Rescale { interval, .. } => ("rescale", interval),
            DriveKind::WhiteNoise { kicks: KickTimes::Regular { interval }, .. } => ("white_noise", interval),
            _ => continue,
        };
        if cooling(scene, interval) > SMALL {
            found.push(Period { of: format!("the drive \"{name}\""), length: interval });
        }
    }
    found
}

/// How much of its temperature the gas loses in a time by collisions: (1 − e²) ω t/d.
fn cooling(scene: &Scene, time: f64) -> f64 {
    let constant = |law: &Restitution| if let Restitution::Constant(e) = law { *e } else { 0.0 };
    let least = scene.system.contacts.pair.iter().map(constant).fold(1.0_f64, f64::min);
    let rate = if scene.collision_rate.is_finite() { scene.collision_rate } else { f64::INFINITY };
    (1.0 - least * least) * rate * time / scene.system.dimension.count() as f64
}

/// Whether records at multiples of `interval` have the same phases of a period all the time, or two opposite
/// ones.
fn is_strobed(interval: f64, period: f64, records: f64) -> bool {
    let mean = |harmonic: f64| {
        let turns = harmonic * interval / period;
        let off = turns - turns.round();
        let sum = if off == 0.0 { records } else { (PI * records * off).sin() / (PI * off).sin() };
        // Slower motions are followed by the records.
        turns.round() >= 1.0 && sum.abs() > SPREAD * records
    };
    records >= FEWEST && (mean(1.0) || mean(2.0))
}

/// Warns if records are always taken at the same phase.
fn strobed(scene: &Scene, period: &Period) -> Option<String> {
    let every = |schedule: Schedule| if let Schedule::Every(interval) = schedule { interval } else { 0.0 };
    let measure = &scene.system.measure;
    let mut intervals = vec![
        ("output.frames".to_owned(), every(scene.output.frames), 1.0),
        ("output.observables".to_owned(), every(scene.output.observables), 1.0),
    ];
    if measure.correlations.any() {
        intervals.push(("measure.interval".to_owned(), measure.correlations.interval, 1.0));
    }
    for (index, grid) in measure.profiles.iter().enumerate().filter(|(_, grid)| !grid.spread) {
        intervals.push((format!("measure.profiles.{index}.interval"), grid.interval, grid.samples as f64));
    }
    let until = scene.run.until.unwrap_or(f64::INFINITY);
    let met = |(_, interval, samples): &(String, f64, f64)| {
        let between = interval / samples;
        between > 0.0 && is_strobed(between, period.length, (until / between).min(MANY))
    };
    let shown: Vec<String> = intervals
        .into_iter()
        .filter(met)
        .map(|(key, interval, samples)| {
            // The golden ratio is farthest from all fractions.
            let turns = (interval / samples / period.length).round().max(1.0) - 0.382;
            format!("{key} = {}", significant(turns * period.length * samples, 3))
        })
        .collect();
    (!shown.is_empty()).then(|| {
        format!(
            "records are always taken at the same phase of {}, whose period is {}, and means over them are those \
             of this phase; take intervals that are no multiples, such as {}",
            period.of,
            significant(period.length, 6),
            shown.join(", ")
        )
    })
}

/// Warns if rows of a profile are means over too few states to be means over an oscillation.
fn few_states(system: &System, period: &Period) -> Option<String> {
    let few = |(_, grid): &(usize, &Grid)| {
        grid.spread && grid.interval >= period.length && (grid.samples as f64) < FEWEST
    };
    let (index, grid) = system.measure.profiles.iter().enumerate().find(few)?;
    Some(format!(
        "measure.profiles.{index}.samples = {}: too few states for rows that are means over {}, whose period is {}; \
         take 10 or more",
        grid.samples,
        period.of,
        significant(period.length, 6)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_at_one_phase_or_at_two_opposite_ones_are_found() {
        for (interval, strobed) in [
            (1.0, true),
            (3.0, true),
            (1.5, true),
            (0.5, true),
            (1.0001, true),
            (0.25, false),
            (0.618, false),
        ] {
            assert_eq!(is_strobed(interval, 1.0, 400.0), strobed, "{interval}");
        }
        // A tenth of a turn more every time: all phases in ten records; and a motion that the records follow.
        assert!(!is_strobed(1.1, 1.0, 400.0) && !is_strobed(1e-4, 1.0, 400.0));
        assert!(!is_strobed(1.0, 1.0, 3.0), "too few to compare");
    }
}
