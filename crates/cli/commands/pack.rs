//! `haff pack`: a packing of equal or unequal particles by growth, in a file of its own.

use std::{f64::consts::PI, fmt::Write};

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
/// The box around a container is larger by this part.
const AROUND: f64 = 1e-3;
/// Usual length of a cylinder [its diameter].
const ASPECT: f64 = 2.0;
/// Packing fraction at which particles are placed only to sum their volumes.
const DILUTE: f64 = 1e-3;

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
    let room = Room::of(options, start)?;
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
         {}\n\
         boundary = [{}]\n\n\
         {}\n\
         [contact]\n\
         restitution = 1.0\n\n\
         [growth]\n\
         rate = {rate:?}\n\
         temperature = 1.0\n\
         {end}\n\n\
         [output]\n\
         frames = {:?}\n\
         observables = {rows:?}\n\
         {}",
        options.seed,
        options.dimension,
        room.size,
        room.boundary,
        grains(options),
        long / FRAMES,
        room.wall,
    );
    Ok(text)
}

/// The tables of the particles.
fn grains(options: &Pack) -> String {
    format!(
        "[[species]]\n\
         name = \"grain\"\n\
         count = {}\n\
         radius = {}\n\
         mass = 1.0\n\n\
         [initial]\n\
         positions = \"random\"\n\
         temperature = 1.0\n",
        options.count,
        options.sizes.as_deref().unwrap_or("0.5"),
    )
}

/// The box, and the container in it.
struct Room {
    /// Its key and value.
    size: String,
    boundary: String,
    /// The entry of `[[wall]]`; empty without one.
    wall: String,
}

impl Room {
    /// A room in which the particles have a packing fraction.
    fn of(options: &Pack, start: f64) -> Result<Self, Failure> {
        let d = usize::from(options.dimension);
        let boundaries =
            |names: &[&str]| names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
        let has_length = d == 3 && matches!(options.container, Container::Cylinder | Container::Tube);
        if options.aspect.is_some() && !has_length {
            let name = say("--aspect", "aspect");
            return Err(Failure::new(
                Status::Invalid,
                format!("{name}: is for cylinders and tubes of spheres"),
            ));
        }
        if matches!(options.container, Container::Periodic | Container::Box) {
            let boundary = if options.container == Container::Box { "wall" } else { "periodic" };
            return Ok(Self {
                size: format!("packing_fraction = {start:?}"),
                boundary: boundaries(&vec![boundary; d]),
                wall: String::new(),
            });
        }
        let aspect = options.aspect.unwrap_or(ASPECT);
        if !(aspect > 0.0 && aspect < 1e6) {
            let name = say("--aspect", "aspect");
            return Err(Failure::new(Status::Invalid, format!("{name}: must be above 0 and below 1000000")));
        }
        if d == 2 && options.container == Container::Tube {
            let why = "a tube has no length in two dimensions: take the cylinder, a circle";
            return Err(Failure::new(Status::Invalid, format!("{}: {why}", say("--container", "container"))));
        }
        let volume = filled(options)? / start;
        // Nothing touches the walls of the box around it.
        let around = |length: f64| length * (1.0 + AROUND);
        let (radius, length) = match (options.container, d) {
            (_, 2) => ((volume / PI).sqrt(), 0.0),
            (Container::Sphere, _) => ((0.75 * volume / PI).cbrt(), 0.0),
            _ => {
                let radius = (volume / (2.0 * PI * aspect)).cbrt();
                (radius, 2.0 * aspect * radius)
            }
        };
        let width = around(2.0 * radius);
        let middle = 0.5 * width;
        let sides = [width, width, if length > 0.0 { length } else { width }];
        let (mut sides, mut boundary) = (sides[..d].to_vec(), vec!["wall"; d]);
        let shape = match (options.container, d) {
            (Container::Sphere, 3) => {
                format!("sphere = {{ center = [{middle:?}, {middle:?}, {middle:?}], radius = {radius:?} }}")
            }
            (_, 2) => format!("cylinder = {{ point = [{middle:?}, {middle:?}], radius = {radius:?} }}"),
            (container, _) => {
                let (mut low, mut ends) = (0.0, String::new());
                if container == Container::Tube {
                    boundary[2] = "periodic";
                } else {
                    sides[2] = around(length);
                    low = 0.5 * (sides[2] - length);
                    ends = format!(", length = {length:?}");
                }
                format!(
                    "cylinder = {{ point = [{middle:?}, {middle:?}, {low:?}], axis = [0, 0, 1], radius = {radius:?}{ends} }}"
                )
            }
        };
        Ok(Self {
            size: format!("size = {sides:?}"),
            boundary: boundaries(&boundary),
            wall: format!("\n[[wall]]\nname = \"container\"\n{shape}\n"),
        })
    }
}

/// The volume of all particles, in two dimensions the area [length^d].
fn filled(options: &Pack) -> Result<f64, Failure> {
    let boundary = vec!["\"periodic\""; usize::from(options.dimension)].join(", ");
    // Radii depend on the seed, the species and the number alone.
    let text = format!(
        "seed = {}\ndimension = {}\n[domain]\npacking_fraction = {DILUTE:?}\nboundary = [{boundary}]\n\
         {}[run]\nuntil = 1.0\n",
        options.seed,
        options.dimension,
        grains(options),
    );
    let scene =
        haff_scene::parse("haff pack", &text, &[], &States).map_err(|errors| scene_failure(&errors))?;
    Ok(scene.packing_fraction * scene.system.domain.volume(scene.system.dimension, 0.0))
}
