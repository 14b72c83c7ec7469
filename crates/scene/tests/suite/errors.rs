//! Errors name the line, the key, the value and the allowed values; overrides apply to every key.

use std::path::Path;

use glam::DVec3;
use haff_mechanics::Restitution;
use haff_scene::{ErrorKind, NoStates, Place, Scene, SceneErrors, Schedule, State, StateSource, load, parse};

const SCENE: &str = r#"schema = 1

[domain]
size = [20.0, 20.0, 20.0]
boundary = ["wall", "wall", "periodic"]

[[species]]
name = "grain"
count = 100
radius = 0.5
mass = 1.0

[[particle]]
name = "ball"
position = [10.0, 10.0, 10.0]
radius = 1.0
mass = inf

[contact]
restitution = 0.9
wall_restitution = 0.8
pair = [
  { between = ["grain", "ball"], restitution = 0.5 },
  { between = ["x+", "grain"], restitution = 0.1 },
]

[[wall]]
name = "floor"
plane = { point = [0, 0.5, 0], normal = [0, 3, 0] }
restitution = 0.7

[run]
until = 10.0
"#;

fn with(overrides: &[&str]) -> Result<Scene, SceneErrors> {
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    parse("scene.toml", SCENE, &overrides, &NoStates)
}

fn refused(overrides: &[&str]) -> String {
    with(overrides).map(|_| ()).expect_err("the scene must be refused").to_string()
}

#[test]
fn every_error_is_found_and_located() {
    let text = SCENE
        .replace("restitution = 0.9", "restitution = 1.2")
        .replace("radius = 0.5", "radius = -0.5")
        .replace("until = 10.0", "untill = 10.0")
        .replace("count = 100", "count = \"many\"");
    let errors = parse("scene.toml", &text, &[], &NoStates).expect_err("broken in four places");
    let expected = [
        "scene.toml:9: species.0.count = \"many\": must be an integer, not a string",
        "scene.toml:10: species.0.radius = -0.5: must be a positive finite number",
        "scene.toml:20: contact.restitution = 1.2: must be in [0, 1]",
        "scene.toml:33: run.untill = 10.0: unknown key; did you mean `until`? (allowed: until, collisions, \
         collisions_per_particle, wall_time)",
    ];
    // No error that the run has no end: a misspelled key may set it.
    assert_eq!(errors.to_string(), expected.join("\n"));
    let Place::File { line, column, span } = &errors.errors[2].place else { panic!("not in the file") };
    assert_eq!((*line, *column, &errors.source[span.clone()]), (20, 1, "restitution"));
}

#[test]
fn overrides_apply_to_scalars_elements_and_names() {
    let scene = with(&[
        "contact.restitution=0.25",
        "species.grain.count=50",
        "species.0.radius={ uniform = [0.3, 0.4] }",
        "particle.ball.velocity=[1, 0, 0]",
        "particle.0.position.2=5",
        "engine.neighbors=lists",
        "output.frames=false",
        "output.observables = { log = [0.1, 2] }",
        "title=a bare title",
        "seed=12",
    ])
    .unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(scene.system.bodies.len(), 51);
    assert_eq!(scene.system.bodies[50].velocity, DVec3::X);
    assert_eq!(scene.system.bodies[50].position, DVec3::new(10.0, 10.0, 5.0));
    assert_eq!(scene.options.neighbors, haff_engine::NeighborChoice::Lists);
    assert_eq!(scene.output.frames, Schedule::Off);
    assert_eq!(scene.output.observables, Schedule::Log { first: 0.1, factor: 2.0 });
    assert_eq!((scene.title.as_str(), scene.seed), ("a bare title", 12));
    assert_eq!(scene.system.contacts.pair[0], Restitution::Constant(0.25));
}

#[test]
fn errors_quote_invalid_overrides_as_given() {
    for (text, expected) in [
        ("contact.restitution=1.2", "--set contact.restitution=1.2: must be in [0, 1]"),
        ("contact.restituton=0.2", "unknown key; did you mean `restitution`?"),
        ("species.sand.count=5", "nothing in `species` is named `sand`; take a name (grain) or an index"),
        ("species.4.count=5", "`species` has 1 elements, counted from 0"),
        ("contact.restitution", "must read KEY=VALUE"),
        ("=3", "is not a dotted key"),
        ("domain.size=[1, 2", "not a TOML value"),
        ("run.until=soon", "--set run.until=soon: must be a number, not a string"),
        ("contact.restitution.model=cutoff", "`contact.restitution` is a number, not a table"),
        (
            "species.0.radius={ uniform = [-1, 2] }",
            "species.0.radius.uniform = [-1, 2]: must be a positive finite number",
        ),
    ] {
        let found = refused(&[text]);
        assert!(found.contains(expected), "--set {text}\n  expected: {expected}\n  found: {found}");
        assert!(found.starts_with("--set "), "{found}");
    }
}

#[test]
fn last_override_of_a_key_applies() {
    assert_eq!(with(&["run.until=2", "run.until=3"]).map(|scene| scene.run.until), Ok(Some(3.0)));
}

#[test]
fn restitution_follows_precedence_of_rules() {
    let scene = with(&[]).unwrap_or_else(|errors| panic!("{errors}"));
    let system = &scene.system;
    let names: Vec<&str> = system.walls.iter().map(|wall| wall.name.as_str()).collect();
    assert_eq!(names, ["x-", "x+", "y-", "y+", "floor"]);
    let [grain, ball] = [0, 1];
    let pair = |i: usize, j: usize| system.contacts.pair[2 * i + j];
    let wall = |i: usize, w: usize| system.contacts.wall[5 * i + w].restitution();
    let e = Restitution::Constant;
    assert_eq!((pair(grain, grain), pair(ball, ball)), (e(0.9), e(0.9)));
    assert_eq!(
        (pair(grain, ball), pair(ball, grain)),
        (e(0.5), e(0.5)),
        "contact.pair beats contact.restitution"
    );
    assert_eq!((wall(grain, 0), wall(ball, 1)), (e(0.8), e(0.8)), "wall_restitution beats restitution");
    assert_eq!(wall(grain, 4), e(0.7), "the wall's own beats wall_restitution");
    assert_eq!(wall(grain, 1), e(0.1), "contact.pair beats all");
    assert_eq!(system.walls[4].normal, DVec3::Y, "normals are made unit vectors");
    assert_eq!(system.walls[1].point, DVec3::new(20.0, 0.0, 0.0));
    assert_eq!(system.walls[1].normal, DVec3::NEG_X);
}

#[test]
fn collisions_per_particle_count_each_collision_for_both_partners() {
    let scene = with(&["run={ collisions_per_particle = 7 }"]).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(scene.run.collisions, Some(354), "101 particles, 7 each: 353.5 collisions, rounded up");
}

#[test]
fn default_schedules_depend_on_the_length_of_the_run() {
    let scene = with(&[]).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(scene.output.frames, Schedule::Every(0.1));
    assert_eq!(scene.output.observables, Schedule::Every(0.01));
    assert_eq!(scene.output.checkpoint, Some(1.0));
    assert_eq!((scene.output.file, scene.output.events, scene.output.compressed), (None, Vec::new(), true));
    // An inelastic gas without `until` slows down without bound: logarithmic in time.
    let scene = with(&["run={ collisions = 1000 }"]).unwrap_or_else(|errors| panic!("{errors}"));
    assert!(matches!(scene.output.frames, Schedule::Log { .. }), "{:?}", scene.output.frames);
}

#[test]
fn event_log_has_the_requested_columns_and_the_time() {
    use haff_engine::EventColumn::{self, EnergyLoss, I, J, Time};
    let events = |value: &str| with(&[&format!("output.events={value}")]).map(|scene| scene.output.events);
    let sound = |value: &str| events(value).unwrap_or_else(|errors| panic!("{errors}"));
    // All but those of rough contacts and thermal walls.
    assert_eq!(sound("true"), EventColumn::ALL[..10]);
    let rough = with(&["output.events=true", "contact.tangential_restitution=0.5"]);
    assert_eq!(rough.unwrap_or_else(|errors| panic!("{errors}")).output.events, EventColumn::ALL);
    assert_eq!(sound("false"), []);
    // In the order of files, independent of the order in the scene.
    assert_eq!(sound(r#"{ columns = ["energy_loss", "j", "i"] }"#), [Time, I, J, EnergyLoss]);
    assert_eq!(sound(r#"{ columns = ["time"] }"#), [Time]);
    for (value, expected) in [
        ("1", "must be true, false or { columns = […] }"),
        ("{}", "must name columns"),
        ("{ columns = [] }", "must name columns"),
        (r#"{ columns = ["i", "i"] }"#, "must name each column once"),
        (r#"{ columns = ["energy"] }"#, "must be one of \"time\", \"kind\""),
        (r#"{ columns = ["i"], level = 1 }"#, "unknown key"),
    ] {
        let errors = events(value).expect_err(value).to_string();
        assert!(errors.contains(expected), "{value}: {errors}");
    }
    // For every column of the engine there is a name in scenes, and the resolved scene holds it.
    for column in EventColumn::ALL {
        let text = format!(r#"{{ columns = ["{}"] }}"#, column.name());
        assert!(sound(&text).contains(&column), "{text}");
    }
    let scene = with(&[r#"output.events={ columns = ["i"] }"#, r#"output.compression="none""#]);
    let scene = scene.unwrap_or_else(|errors| panic!("{errors}"));
    assert!(!scene.output.compressed);
    let again =
        parse("resolved.toml", &scene.resolved, &[], &NoStates).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(again.output, scene.output);
}

#[test]
fn missing_scene_file_is_unreadable_not_invalid() {
    let errors = load(Path::new("no/such/scene.toml"), &[], &NoStates).expect_err("there is none");
    assert_eq!(errors.kind(), ErrorKind::Unreadable);
    assert!(errors.to_string().starts_with("no/such/scene.toml: cannot read the scene"), "{errors}");
}

struct Recorded(State);

impl StateSource for Recorded {
    fn state(&self, _: &Path, _: i64) -> Result<State, String> {
        Ok(self.0.clone())
    }
}

fn recorded() -> State {
    let position: Vec<DVec3> = (0..3).map(|k| DVec3::new(1.0 + 2.0 * f64::from(k), 3.0, 3.0)).collect();
    let velocity = vec![DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO, DVec3::NEG_X];
    let (radius, mass) = (vec![0.5, 0.6, 0.7], vec![1.0; 3]);
    State {
        size: Some(DVec3::splat(10.0)),
        sheared_edges: None,
        position,
        velocity: Some(velocity),
        angular_velocity: None,
        image: Some(vec![[0, 1, 2]; 3]),
        radius,
        mass: Some(mass),
        precision: 0.0,
    }
}

const FROM_FILE: &str = "species = [{ name = \"a\", count = 3, radius = { uniform = [0.4, 0.8] }, mass = 1.0 }]\n\
                         run = { until = 1.0 }\n[initial]\npositions = { file = \"state.h5\" }\n";

#[test]
fn recorded_state_sets_positions_velocities_radii_and_box() {
    let state = recorded();
    let scene =
        parse("s.toml", FROM_FILE, &[], &Recorded(state.clone())).unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(Some(scene.system.domain.size), state.size);
    let velocities = state.velocity.clone().unwrap();
    for (k, body) in scene.system.bodies.iter().enumerate() {
        assert_eq!((body.position, body.velocity, body.image), (state.position[k], velocities[k], [0, 1, 2]));
        assert_eq!(scene.system.classes[body.class as usize].radius, state.radius[k]);
    }
    let warmed = parse("s.toml", FROM_FILE, &["initial.temperature=2".into()], &Recorded(state));
    let bodies = warmed.unwrap_or_else(|errors| panic!("{errors}")).system.bodies;
    let momentum: DVec3 = bodies.iter().map(|body| body.velocity).sum();
    let temperature = bodies.iter().map(|body| body.velocity.length_squared()).sum::<f64>() / 9.0;
    assert!(momentum.length() < 1e-14, "momentum {momentum}");
    assert!((temperature - 2.0).abs() < 1e-14, "T = {temperature}, expected 2");
}

#[test]
fn recorded_state_that_does_not_fit_the_scene_is_refused() {
    type Change = fn(&mut State);
    let cases: [(Change, &str); 10] = [
        (
            |s| {
                s.position.pop();
            },
            "the file holds 2 positions but other numbers",
        ),
        (|s| s.radius[1] = 0.9, "particle 1 of the file has radius 0.9, species \"a\" wants 0.4 to 0.8"),
        (|s| s.mass = Some(vec![1.0, 1.0, 2.0]), "particle 2 of the file has mass 2, species \"a\" wants 1"),
        (|s| s.position[1].x = 1.9, "particles 0 and 1 overlap by 2.0e-1"),
        (
            |s| s.velocity = Some(vec![DVec3::NAN; 3]),
            "has the velocity NaN along x: it must be a finite number",
        ),
        (
            |s| s.velocity = Some(vec![DVec3::new(0.0, 1e200, 0.0); 3]),
            "particle 0 of the file has the velocity 1e200 along y: it must be a finite number, at most 1e50 in size",
        ),
        (
            |s| s.angular_velocity = Some(vec![DVec3::splat(1e200); 3]),
            "no angular velocity up to 1e50 in size",
        ),
        (|s| s.size = Some(DVec3::new(10.0, 10.0, 0.0)), "the file has no box"),
        (|s| s.size = None, "the file has no box"),
        (|s| s.velocity = None, "the file has no velocities: give initial.temperature"),
    ];
    for (change, expected) in cases {
        let mut state = recorded();
        change(&mut state);
        let errors = parse("s.toml", FROM_FILE, &[], &Recorded(state)).expect_err(expected);
        assert!(errors.to_string().contains(expected), "expected: {expected}\nfound: {errors}");
    }
    let text = FROM_FILE.replace("count = 3", "count = 4");
    let errors = parse("s.toml", &text, &[], &Recorded(recorded())).expect_err("three are not four");
    assert!(errors.to_string().contains("the file holds 3 particles, the species ask for 4"), "{errors}");
    let errors = parse(
        "s.toml",
        &format!("domain = {{ size = [9, 10, 10] }}\n{FROM_FILE}"),
        &[],
        &Recorded(recorded()),
    );
    let errors = errors.expect_err("another box");
    assert!(
        errors.to_string().contains("the box of the file is 10 long along x, that of the scene 9"),
        "{errors}"
    );
}

#[test]
fn overlaps_are_found_at_any_size_ratio() {
    let text = "run = { until = 1.0 }\n[domain]\nsize = [100.0, 100.0, 100.0]\n\
                [[particle]]\nposition = [50, 50, 50]\nradius = 40.0\nmass = 1.0\n\
                [[particle]]\nposition = [90.0005, 50, 50]\nradius = 0.001\nmass = 1.0\n";
    let errors = parse("s.toml", text, &[], &NoStates).expect_err("they overlap");
    assert_eq!(
        errors.to_string(),
        "s.toml:9: particle.1.position = [90.0005, 50, 50]: particles 0 and 1 overlap by 5.0e-4"
    );
    assert!(parse("s.toml", &text.replace("90.0005", "90.001"), &[], &NoStates).is_ok(), "touching is fine");
}
