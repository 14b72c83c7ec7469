//! `haff check`.

use haff_engine::{Boundary, Dimension, hopping_walls, significant};
use haff_record::FileSize;
use haff_scene::{Scene, Schedule, Times, UntilOf};
use serde_json::{Value, json};

use crate::{
    arguments::Check,
    running::{estimate, states::States, ties::first_tie, warnings::warnings},
    terminal::{
        failure::{Failure, scene_failure},
        numbers::counted,
        output::{self, bytes, shown},
    },
};

/// Number of records of a schedule up to a time or a number of collisions, including the first and the last.
fn records(schedule: Schedule, until: f64, collisions: f64) -> u64 {
    if !until.is_finite() {
        return 2;
    }
    match schedule {
        Schedule::Off => 2,
        Schedule::Collisions(count) => (collisions / count as f64) as u64 + 2,
        Schedule::Every(interval) => (until / interval).ceil() as u64 + 1,
        Schedule::Log { .. } => {
            let mut times = Times::after(schedule, 0.0);
            let mut count = 2;
            while times.next() < until && count < 1_000_000 {
                times.take(times.next());
                count += 1;
            }
            count
        }
    }
}

/// Edges \[length\] and packing fraction of a box that is compressed, at a time.
fn compressed(scene: &Scene, time: f64) -> Option<(Vec<f64>, f64)> {
    let (system, axes) = (&scene.system, scene.system.dimension.count());
    let size = system.domain.size;
    let edges = system.domain.compression?.edges(size, time).to_array()[..axes].to_vec();
    let shrinks: f64 = (0..axes).map(|axis| edges[axis] / size[axis]).product();
    Some((edges, scene.packing_fraction / shrinks))
}

/// What becomes of a box that is compressed, as a line and as JSON.
fn deformation(scene: &Scene) -> Option<(String, Value)> {
    scene.system.domain.compression?;
    let Some((until, (edges, fraction))) = scene.run.until.and_then(|t| Some((t, compressed(scene, t)?)))
    else {
        return Some(("the box expands until the run ends".to_owned(), Value::Null));
    };
    let lengths: Vec<String> = edges.iter().map(|&edge| significant(edge, 6)).collect();
    let at = significant(until, 9);
    let box_then = format!("edges {}", lengths.join(" × "));
    let fraction_then = if fraction.is_nan() {
        String::new()
    } else {
        format!(", packing fraction {}", significant(fraction, 6))
    };
    let text = match (scene.run.until_of, &scene.box_limit) {
        (UntilOf::Box, Some(limit)) => {
            format!("{box_then}{fraction_then} at most, at t = {at}: {}", limit.why)
        }
        _ => format!("{box_then}{fraction_then} at the end, t = {at}"),
    };
    Some((text, json!({ "time": until, "edges": edges, "packing_fraction": fraction })))
}

/// The searches that can run a scene, one line each, and why the others cannot; none for linkages.
fn searches(scene: &Scene) -> Vec<String> {
    if !scene.joints.is_empty() {
        return Vec::new();
    }
    let Ok(found) = haff_engine::searches(&scene.system, scene.options) else { return Vec::new() };
    let lines = found.into_iter().map(|search| {
        let what = match (search.refuses, search.serial) {
            (Some(why), _) => format!("no: {why}"),
            (None, Some(why)) => format!("yes, on one thread: {why}"),
            (None, None) => "yes, on several threads".to_owned(),
        };
        let chosen = if search.chosen { " (auto)" } else { "" };
        format!("{:<20}{what}{chosen}", search.name)
    });
    std::iter::once("searches that can run it (engine.neighbors)".to_owned()).chain(lines).collect()
}

/// Validates a scene and estimates its cost; `verbose`: says which searches can run it, too.
pub fn check(options: &Check, verbose: bool) -> Result<u8, Failure> {
    let scene: Scene =
        haff_scene::load(&options.scene, &options.set, &States).map_err(|errors| scene_failure(&errors))?;
    let system = &scene.system;
    let temperature = estimate::temperature(&scene);
    // Files and memory have a place for those that come in, too.
    let (all, particles) = (system.bodies.len(), system.bodies_at_start().len());
    let axes = system.dimension.count();
    let open = system.domain.boundary[..axes].contains(&Boundary::Open);
    // Each collision involves two particles. For sizes of files a guess is enough.
    let guess = scene.collision_rate.is_finite().then(|| scene.collision_rate * particles as f64 / 2.0);
    let rate = guess.filter(|_| scene.rate_unknown.is_none());
    // Expected simulated time of the run.
    let by_collisions =
        scene.run.collisions.map(|count| estimate::duration(&scene, guess.unwrap_or(f64::NAN), count as f64));
    let until = scene.run.until.into_iter().chain(by_collisions).fold(f64::INFINITY, f64::min);
    let collisions = estimate::collisions(&scene, guess.unwrap_or(0.0), until);
    let [samples, frames] = [scene.output.observables, scene.output.frames]
        .map(|schedule| records(schedule, until, collisions.count));
    // Each frame has a row of observables at its time, which is often that of another row.
    let shared = match (scene.output.observables, scene.output.frames) {
        (Schedule::Every(rows), Schedule::Every(frames)) => (frames / rows).fract() == 0.0,
        _ => false,
    };
    let samples = if shared { samples } else { samples + frames };
    let by_rate = !scene.output.events.is_empty() || scene.run.until.is_none();
    let guessed = collisions.guessed && by_rate;
    let kept = estimate::correlations(&system.measure, all, until);
    let size = scene.output.file.as_ref().map(|_| {
        haff_record::estimate_file_size(&FileSize {
            particles: all as u64,
            frames: if scene.output.frames == Schedule::Off { 0 } else { frames },
            samples,
            events: collisions.count as u64,
            columns: &scene.output.events,
            compressed: scene.output.compressed,
            dimension: axes,
            spin: system.spin.is_some(),
            pistons: system.piston_count(),
            measured: estimate::measured(system, samples),
            kept,
            profiles: &estimate::profiles(&system.measure, until),
        })
    });
    let memory = estimate::memory(all) + kept;
    let warnings = warnings(&scene);
    let deformation = deformation(&scene);
    let tie = first_tie(&scene);
    if options.json {
        let report = json!({
            "title": scene.title, "particles": particles, "particles_to_come": all - particles, "dimension": axes,
            "packing_fraction": scene.packing_fraction, "temperature": temperature,
            "collision_rate": rate, "collision_rate_unknown": scene.rate_unknown, "mean_free_time": rate.map(|rate| particles as f64 / (2.0 * rate)),
            "memory_bytes": memory, "file_bytes": size, "file": scene.output.file,
            "hops": hopping_walls(system),
            "simultaneous": tie.map(|tie| json!({ "time": tie.time, "particle": tie.body })), "deformation": deformation.map(|(_, report)| report),
            "warnings": warnings,
        });
        return output::line(report).map(|()| 0);
    }
    let named = if scene.title.is_empty() { String::new() } else { format!(": {}", shown(&scene.title)) };
    let mut text = vec![format!("{} is valid{named}", output::path(&options.scene))];
    let kind = if system.dimension == Dimension::Two { "disk" } else { "sphere" };
    text.push(format!(
        "particles           {}, {}",
        counted(particles as u64, kind),
        counted(system.walls.len() as u64, "wall")
    ));
    if all > particles {
        let more = counted((all - particles) as u64, kind);
        text.push(format!("inlets              up to {more} more come in"));
    }
    text.push(if open {
        "packing fraction    none: an axis is open".to_owned()
    } else {
        format!("packing fraction    {}", significant(scene.packing_fraction, 6))
    });
    text.extend(deformation.map(|(line, _)| format!("deformation         {line}")));
    let hops = hopping_walls(system);
    if !hops.is_empty() {
        text.push(format!(
            "bounces             on {} they end in hops of 5e-7 radii, in which grains slide and roll;\n\
             \x20                   contact.rest_speed puts them to rest",
            hops.join(", ")
        ));
    }
    if let Some(tie) = tie {
        text.push(format!(
            "simultaneous        particle {} has two contacts at t = {}; which of them is first decides what\n\
             \x20                   follows, see docs/simultaneous.md",
            tie.body,
            significant(tie.time, 6)
        ));
    }
    text.push(format!("temperature         {}", significant(temperature, 6)));
    text.push(match rate {
        // Each collision involves two particles.
        Some(rate) => format!(
            "collision rate      {} collisions per unit time at the start, {} per particle; mean free time {},\n\
             \x20                   if homogeneous with Maxwell velocities (Enskog)",
            significant(rate, 4),
            significant(2.0 * rate / particles as f64, 3),
            significant(particles as f64 / (2.0 * rate), 4)
        ),
        None => format!("collision rate      unknown: {}", scene.rate_unknown.unwrap_or("no theory")),
    });
    text.push(format!("memory              about {}", bytes(memory)));
    text.push(match (&scene.output.file, size) {
        (Some(file), Some(size)) => {
            let at_rate = if guessed { ", if the collision rate stays that of the start" } else { "" };
            format!("output              {}, about {}{at_rate}", output::path(file), bytes(size))
        }
        _ => "output              no output file: results are not saved (output.file, or haff run -o)"
            .to_owned(),
    });
    if verbose {
        text.extend(searches(&scene));
    }
    text.extend(warnings.iter().map(|warning| format!("warning: {warning}")));
    output::lines(text.join("\n")).map(|()| 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_include_both_ends() {
        assert_eq!(records(Schedule::Every(1.0), 10.0, 0.0), 11);
        assert_eq!(records(Schedule::Log { first: 1.0, factor: 2.0 }, 8.0, 0.0), 5);
    }
}
