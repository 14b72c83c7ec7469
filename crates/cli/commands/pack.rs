//! `haff pack`: a packing of equal or unequal particles by growth, in a file of its own.

use std::fmt::Write;

use haff_scene::{GrowthRun, Scene};

use crate::{
    arguments::{Container, Pack},
    commands::run::{set_threads, tell},
    running::{controls::Controls, single, states::States},
    terminal::{
        failure::{Failure, Status, scene_failure},
        overwrite,
        progress::Progress,
        signals::Signals,
        words::say,
    },
};

/// Rates by which sizes grow to these packing fractions, beyond them, and until they jam
/// (benches/record/packings.md).
const FAST: f64 = 0.1;
const FAST_UP_TO: [f64; 2] = [0.82, 0.60];
const SLOW: f64 = 0.01;
const JAMMING: f64 = 0.035;
/// Frames of a run.
const FRAMES: f64 = 10.0;
/// Rows of observables of a growth to a stated packing fraction: the last interval is not empty.
const ROWS: f64 = 99.5;

/// Makes a packing. `logs`: log messages go to standard error, so no progress bar is drawn there.
pub fn pack(options: &Pack, logs: bool) -> Result<u8, Failure> {
    set_threads(options.threads)?;
    let signals = Signals::watch()?;
    let progress = Progress::on_terminal(options.quiet || logs);
    let controls = Controls { signals: &signals, progress, watch: false };
    overwrite::check(&options.output, &[], options.overwrite)?;
    let scene = scene(options)?;
    tell(&single::start(scene, options.overwrite, controls)?, options.json, options.quiet)
}

/// The scene of the growth.
fn scene(options: &Pack) -> Result<Scene, Failure> {
    let text = text(options)?;
    let mut scene =
        haff_scene::parse("haff pack", &text, &[], &States).map_err(|errors| scene_failure(&errors))?;
    scene.output.file = Some(options.output.clone());
    Ok(scene)
}

/// Its text.
fn text(options: &Pack) -> Result<String, Failure> {
    let d = usize::from(options.dimension) - 2;
    let kind = if d == 0 { "disks" } else { "spheres" };
    let refuse = |what: String| Err(Failure::new(Status::Invalid, what));
    if options.packing_fraction.is_some_and(|fraction| !(fraction > 0.0 && fraction < 1.0)) {
        let name = say("--packing-fraction", "packing_fraction");
        return refuse(format!("{name}: must be above 0 and below 1"));
    }
    if options.rate.is_some_and(|rate| !(rate > 0.0 && rate < 1e3)) {
        return refuse(format!("{}: must be above 0 and below 1000", say("--rate", "rate")));
    }
    if !(options.reduced_pressure > 1.0 && options.reduced_pressure <= 1e12) {
        let name = say("--reduced-pressure", "reduced_pressure");
        return refuse(format!("{name}: must be above 1, at most 1e12"));
    }
    let (title, start, usual, end) = match options.packing_fraction {
        Some(fraction) => (
            format!("{} {kind} grown to a packing fraction of {fraction}", options.count),
            GrowthRun::FLUID[d].min(0.8 * fraction),
            if fraction <= FAST_UP_TO[d] { FAST } else { SLOW },
            format!("until_packing_fraction = {fraction:?}"),
        ),
        None => (
            format!("{} jammed {kind}", options.count),
            GrowthRun::FLUID[d],
            JAMMING,
            format!("until_reduced_pressure = {:?}", options.reduced_pressure),
        ),
    };
    let rate = options.rate.unwrap_or(usual);
    let (boundary, sizes) = (
        match options.container {
            Container::Periodic => "periodic",
            Container::Box => "wall",
        },
        options.sizes.as_deref().unwrap_or("0.5"),
    );
    let boundary = vec![format!("\"{boundary}\""); d + 2].join(", ");
    // At the rate of diameters of 1 the growth takes at most this time; for other sizes it is about right.
    let densest = [0.91, 0.75][d];
    let part = 1.0 - (start / options.packing_fraction.unwrap_or(densest)).powf(1.0 / (d as f64 + 2.0));
    let long = part / rate;
    let mut text = String::new();
    // Towards jamming rows follow the collisions.
    let rows = if options.packing_fraction.is_some() { long / ROWS } else { long };
    // Writing to a string does not fail.
    let _ = write!(
        text,
        "schema = 1\n\
         title = \"{title}\"\n\
         seed = {}\n\
         dimension = {}\n\n\
         [domain]\n\
         packing_fraction = {start:?}\n\
         boundary = [{boundary}]\n\n\
         [[species]]\n\
         name = \"grain\"\n\
         count = {}\n\
         radius = {sizes}\n\
         mass = 1.0\n\n\
         [initial]\n\
         positions = \"random\"\n\
         temperature = 1.0\n\n\
         [contact]\n\
         restitution = 1.0\n\n\
         [growth]\n\
         rate = {rate:?}\n\
         temperature = 1.0\n\
         {end}\n\n\
         [output]\n\
         frames = {:?}\n\
         observables = {rows:?}\n",
        options.seed,
        options.dimension,
        options.count,
        long / FRAMES,
    );
    Ok(text)
}
