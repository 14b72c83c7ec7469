//! No input makes the scene crate panic: mutations of valid scenes, scenes of extreme values, and noise.
//!
//! Each test run tries about 20,000 inputs; `HAFF_FUZZ_INPUTS=1000000 cargo test --release -p haff-scene
//! fuzz` tries more.

mod words;

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::assemble::{CHANGEABLE, Limits, Start, assemble, assemble_changed};
use crate::model::present::Present;
use crate::model::scene::Scene;
use crate::model::state::{State, StateSource};
use crate::source::error::{SceneError, SceneErrors};
use crate::source::text;
use glam::DVec3;
use haff_engine::{Boundary, Domain, Instant, Wall};
use haff_placement::random::{Purpose, Stream};
use words::{CHANGES, KEYS, SCENES, VALUES};

/// Few particles, so that one input takes little time.
const LIMITS: Limits = Limits { particles: 300, memory: 1 << 28 };

/// A state file with arbitrary numbers.
struct AnyState(State);

impl StateSource for AnyState {
    fn state(&self, path: &std::path::Path, _index: i64) -> Result<State, String> {
        if path.as_os_str().len().is_multiple_of(3) { Err("unreadable".into()) } else { Ok(self.0.clone()) }
    }
}

/// More unknown keys than errors are kept.
fn many_keys(random: &mut Stream) -> String {
    let lines = (0..random.below(60))
        .map(|k| [pick(random, KEYS), &k.to_string(), " = ", pick(random, VALUES), "\n"].concat());
    lines.collect()
}

fn pick<'t>(random: &mut Stream, from: &[&'t str]) -> &'t str {
    from[random.below(from.len())]
}

/// One line `key = value` replaced, doubled, dropped or given another value; or bytes changed.
fn mutate(text: &mut String, random: &mut Stream) {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    if lines.is_empty() {
        return;
    }
    let k = random.below(lines.len());
    match random.below(7) {
        0 => {
            lines.remove(k);
        }
        1 => lines.insert(k, lines[k].clone()),
        2 | 3 => {
            if let Some((key, _)) = lines[k].split_once('=') {
                lines[k] = format!("{key}= {}", pick(random, VALUES));
            }
        }
        4 => {
            let other = random.below(lines.len());
            lines.swap(k, other);
        }
        5 => lines.insert(k, format!("{} = {}", pick(random, KEYS), pick(random, VALUES))),
        _ => {
            let mut chars: Vec<char> = lines[k].chars().collect();
            let at = random.below(chars.len() + 1);
            let wild = ['[', ']', '{', '}', '"', '=', '.', ',', '-', '0', '9', 'e', '#', '\u{0}', '∞', ' '];
            chars.insert(at, wild[random.below(wild.len())]);
            lines[k] = chars.into_iter().collect();
        }
    }
    *text = lines.join("\n");
}

fn wild_number(random: &mut Stream) -> f64 {
    match random.below(8) {
        0 => f64::from_bits((random.unit() * 1.8e19) as u64),
        1 => f64::NAN,
        2 => -1.0,
        _ => random.between(0.0, 6.0),
    }
}

fn input(case: u64) -> (String, Vec<String>, AnyState) {
    let mut random = Stream::new(case, Purpose::Mixing, "fuzz", 0);
    let mut text = match random.below(10) {
        0 => {
            // Noise made of TOML's own characters.
            let alphabet = "[]{}\"'=.,-_+0123456789einfatrus#\n\t \\é";
            let chars: Vec<char> = alphabet.chars().collect();
            (0..random.below(80)).map(|_| chars[random.below(chars.len())]).collect()
        }
        1 => {
            let line = |random: &mut Stream| format!("{} = {}", pick(random, KEYS), pick(random, VALUES));
            let lines: Vec<String> = (0..random.below(12)).map(|_| line(&mut random)).collect();
            lines.join("\n")
        }
        _ => pick(&mut random, SCENES).to_owned(),
    };
    if random.below(20) == 0 {
        text = many_keys(&mut random) + &text;
    }
    for _ in 0..random.below(4) {
        mutate(&mut text, &mut random);
    }
    let overrides = (0..random.below(3))
        .map(|_| format!("{}={}", pick(&mut random, KEYS), pick(&mut random, VALUES)))
        .collect();
    let n = [33, 33, 33, 20, 60, 0, 5][random.below(7)];
    let sane = random.below(2) == 0;
    let mut number = |scale: f64| if sane { random.between(0.0, scale) } else { wild_number(&mut random) };
    let mut state = State { size: Some(DVec3::splat(6.0)), ..State::default() };
    for k in 0..n {
        state.position.push(DVec3::new(number(6.0), number(6.0), number(6.0)));
        let velocity = DVec3::new(number(1.0), number(1.0), number(1.0));
        state.velocity.get_or_insert_default().push(velocity);
        state.image.get_or_insert_default().push([0; 3]);
        state.radius.push(if k < 3 { 0.5 } else { number(0.2) });
        state.mass.get_or_insert_default().push(1.0);
    }
    (text, overrides, AnyState(state))
}

/// Checks of every result.
fn check(case: u64) -> Result<bool, String> {
    let (text, overrides, state) = input(case);
    let result = catch_unwind(AssertUnwindSafe(|| {
        assemble("fuzz.toml", &text, &overrides, &state, Start::Scene, LIMITS)
    }));
    let show = || format!("case {case}, overrides {overrides:?}, scene:\n{text}");
    match result {
        Err(_) => Err(format!("panic: {}", show())),
        Ok(Err(errors)) if errors.errors.is_empty() || errors.to_string().is_empty() => {
            Err(format!("refused without a reason: {}", show()))
        }
        Ok(Err(errors)) => {
            let message = errors.to_string();
            let lines: Vec<&str> = message.lines().collect();
            let expected = errors.errors.len() + usize::from(errors.more > 0);
            if lines.len() != expected || text::escaped_lines(&message) != message {
                return Err(format!("text of the scene forges a line: {message:?}: {}", show()));
            }
            let mut one_each: Vec<&SceneError> = Vec::new();
            for error in &errors.errors {
                if one_each.contains(&error) {
                    return Err(format!("reported twice: {error}: {}", show()));
                }
                one_each.push(error);
            }
            if errors.errors.len() > SceneErrors::MOST
                || errors.more > 0 && errors.errors.len() < SceneErrors::MOST
            {
                return Err(format!(
                    "{} errors listed, {} counted: {}",
                    errors.errors.len(),
                    errors.more,
                    show()
                ));
            }
            Ok(false)
        }
        Ok(Ok(scene)) => {
            let system = &scene.system;
            let numbers =
                system.bodies.iter().all(|body| body.position.is_finite() && body.velocity.is_finite());
            if system.bodies.is_empty()
                || !numbers
                || scene.run.until.is_none() && scene.run.collisions.is_none()
            {
                return Err(format!("accepted nonsense: {}", show()));
            }
            let Domain { size, boundary, .. } = system.domain;
            let tilted =
                |wall: &Wall| (0..3).any(|k| boundary[k] == Boundary::Periodic && wall.normal[k] != 0.0);
            if system.walls.iter().any(tilted) {
                return Err(format!("accepted a wall that is not its own image: {}", show()));
            }
            let names = system.species.iter().chain(system.walls.iter().map(|wall| &wall.name));
            if names.chain([&scene.title]).any(|name| name.contains('\0')) {
                return Err(format!("accepted what files cannot store: {}", show()));
            }
            let axes = 0..system.dimension.count();
            let largest =
                axes.filter(|&k| boundary[k] != Boundary::Open).map(|k| size[k]).fold(0.0, f64::max);
            if system.classes.iter().any(|class| class.radius < 1e-13 * largest) {
                return Err(format!("accepted a radius below the rounding of coordinates: {}", show()));
            }
            let bodies = system.bodies_at_start();
            let position: Vec<DVec3> = bodies.iter().map(|body| body.position).collect();
            let radius: Vec<f64> =
                bodies.iter().map(|body| system.classes[body.class as usize].radius).collect();
            let periods = haff_placement::grid::Periods::new(&system.domain);
            if let Some(pair) =
                haff_placement::grid::overlaps(&position, &radius, periods, 1e-12, &|_, _| false).first()
            {
                return Err(format!("accepted an overlap {pair:?}: {}", show()));
            }
            match assemble("fuzz.toml", &scene.resolved, &[], &state, Start::Scene, LIMITS) {
                Ok(again)
                    if again.system == scene.system
                        && again.run == scene.run
                        && again.output == scene.output =>
                {
                    goes_on(case, &scene, &state).map_err(|why| format!("{why}: {}", show()))
                }
                Ok(_) => Err(format!("the resolved scene differs: {}\n{}", show(), scene.resolved)),
                Err(errors) => {
                    Err(format!("the resolved scene is refused: {errors}\n{}\n{}", show(), scene.resolved))
                }
            }
        }
    }
}

/// Goes on from an accepted scene with a changed wall: it stays where it is, and the resolved scene has it
/// there.
fn goes_on(case: u64, scene: &Scene, state: &AnyState) -> Result<bool, String> {
    let mut random = Stream::new(case, Purpose::Radius, "change", 0);
    let walls = scene.system.walls.clone();
    let at = Instant::at(random.between(0.0, 100.0));
    let present = Present { at, walls: walls.clone(), fixed: Vec::new() };
    let change = [format!("wall.{}.{}", random.below(3), CHANGES[random.below(CHANGES.len())])];
    let start = Start::Present(&present);
    let text = &scene.resolved;
    let changed = catch_unwind(AssertUnwindSafe(|| {
        assemble_changed("fuzz.toml", text, &change, &CHANGEABLE, state, start, LIMITS)
    }));
    let Ok(next) = changed.map_err(|_| format!("panic after {change:?}"))? else { return Ok(true) };
    let place = |wall: &Wall| (wall.point + wall.motion.displacement(wall.normal, at)).dot(wall.normal);
    for (before, after) in walls.iter().zip(&next.system.walls) {
        let jump = place(after) - place(before);
        if jump.abs() > 1e-13 * (1.0 + place(before).abs() + before.point.length() + after.point.length()) {
            return Err(format!("{change:?} displaces {before:?} by {jump:e} to {after:?}"));
        }
    }
    match assemble("fuzz.toml", &next.resolved, &[], state, Start::Recorded, LIMITS) {
        Ok(again) if again.system == next.system => Ok(true),
        Ok(_) => Err(format!("after {change:?} the resolved scene differs:\n{}", next.resolved)),
        Err(errors) => Err(format!("after {change:?} it is refused: {errors}\n{}", next.resolved)),
    }
}

#[test]
fn fuzz_no_input_panics_and_accepted_scenes_are_sound() {
    let inputs: u64 = std::env::var("HAFF_FUZZ_INPUTS").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000);
    let (mut accepted, mut slowest) = (0, (0.0, 0));
    for case in 0..inputs {
        let start = std::time::Instant::now();
        accepted += u64::from(check(case).unwrap_or_else(|problem| panic!("{problem}")));
        let seconds = start.elapsed().as_secs_f64();
        if seconds > slowest.0 {
            slowest = (seconds, case);
        }
    }
    println!("{inputs} inputs, {accepted} accepted, slowest {:.2} s (case {})", slowest.0, slowest.1);
    assert!(
        accepted > inputs / 50,
        "only {accepted} of {inputs} accepted: the fuzzer misses the later checks"
    );
    assert!(slowest.0 < 20.0, "case {} took {:.1} s", slowest.1, slowest.0);
}

proptest::proptest! {
    #![proptest_config(proptest::test_runner::Config { failure_persistence: None, cases: 2000, ..Default::default() })]

    #[test]
    fn fuzz_any_text_is_refused_or_accepted(text in "(?s).{0,200}", key in "(?s).{0,30}", value in "(?s).{0,30}") {
        let state = AnyState(State::default());
        let _ = assemble("fuzz.toml", &text, &[], &state, Start::Scene, LIMITS);
        let _ = assemble("fuzz.toml", SCENES[0], &[format!("{key}={value}")], &state, Start::Scene, LIMITS);
    }
}
