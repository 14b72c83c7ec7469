//! Sheared boxes: the profile of the flow at the start, and states from files.

use std::path::Path;

use glam::DVec3;
use haff_engine::{Options, Silent, Simulation, Until};
use haff_scene::{Scene, SceneErrors, State, StateSource, parse};

/// One state, for every file.
struct Recorded(State);

impl StateSource for Recorded {
    fn state(&self, _path: &Path, _index: i64) -> Result<State, String> {
        Ok(self.0.clone())
    }
}

const EDGE: f64 = 8.0;

/// 64 spheres on a lattice whose coordinates are sums of few powers of two: shifts by edges are exact.
fn state() -> State {
    let site = |k: usize| {
        let cell = [k % 4, k / 4 % 4, k / 16].map(|c| 2.0 * c as f64 + 0.5);
        let jitter = [k % 3, k % 5, k % 7].map(|c| c as f64 / 64.0);
        DVec3::from_array(cell) + DVec3::from_array(jitter)
    };
    let velocity = |k: usize| DVec3::new((k % 11) as f64 - 5.0, (k % 13) as f64 - 6.0, (k % 7) as f64 - 3.0);
    State {
        size: Some(DVec3::splat(EDGE)),
        position: (0..64).map(site).collect(),
        velocity: Some((0..64).map(velocity).collect()),
        radius: vec![0.5; 64],
        ..State::default()
    }
}

fn scene(shear: &str, initial: &str, state: State) -> Result<Scene, SceneErrors> {
    let text = format!(
        "schema = 1\n[domain]\nsize = [8.0, 8.0, 8.0]\n{shear}\n[[species]]\nname = \"grain\"\ncount = 64\nradius = 0.5\n\
         mass = 1.0\n[initial]\n{initial}\n[contact]\nrestitution = 0.9\n[run]\nuntil = 1.0\n"
    );
    parse("sheared.toml", &text, &[], &Recorded(state))
}

const FROM_FILE: &str = "positions = { file = \"state.h5\" }";
const SHEAR: &str = "shear = { flow = \"x\", gradient = \"y\", rate = 0.5 }";

fn hash(scene: &Scene) -> String {
    let mut simulation = Simulation::new(scene.system.clone(), Options::default()).unwrap();
    simulation.advance(Until { collisions: 500, ..Until::default() }, &mut Silent).unwrap();
    simulation.measure_overlap().unwrap();
    simulation.state_hash()
}

#[test]
fn multiples_of_the_box_added_to_all_positions_change_no_bit() {
    let at_rest = hash(&scene(SHEAR, FROM_FILE, state()).unwrap());
    for shift in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-3.0, 5.0, 2.0], [0.0, -4.0, 0.0]] {
        let mut moved = state();
        for position in &mut moved.position {
            *position += DVec3::from_array(shift) * EDGE;
        }
        assert_eq!(hash(&scene(SHEAR, FROM_FILE, moved).unwrap()), at_rest, "{shift:?}");
    }
    // Another shift is another system.
    let mut moved = state();
    moved.position.iter_mut().for_each(|position| position.y += 0.25);
    assert_ne!(hash(&scene(SHEAR, FROM_FILE, moved).unwrap()), at_rest);
}

#[test]
fn velocities_start_from_a_linear_profile() {
    for (flow, gradient, text) in [(0, 1, "\"x\", gradient = \"y\""), (2, 0, "\"z\", gradient = \"x\"")] {
        let shear = format!("shear = {{ flow = {text}, rate = -3.0 }}");
        let scene = scene(&shear, "temperature = 2.0", State::default()).unwrap();
        let peculiar =
            |body: &haff_engine::Body| body.velocity + DVec3::AXES[flow] * (3.0 * body.position[gradient]);
        let sum: DVec3 = scene.system.bodies.iter().map(peculiar).sum();
        assert!(sum.length() < 1e-12, "{sum}");
        let energy: f64 = scene.system.bodies.iter().map(|body| peculiar(body).length_squared()).sum();
        assert!((energy / (3.0 * 64.0) - 2.0).abs() < 1e-13, "{energy}");
    }
    // Those of a file are velocities already.
    let from_file = scene(SHEAR, FROM_FILE, state()).unwrap();
    let velocities: Vec<DVec3> = from_file.system.bodies.iter().map(|body| body.velocity).collect();
    assert_eq!(Some(velocities), state().velocity);
}

#[test]
fn a_particle_that_rounding_has_put_on_the_upper_face_keeps_its_velocity_relative_to_the_flow() {
    let found = |precision: f64, y: f64| {
        let mut state = State { precision, ..state() };
        state.position[0].y = y;
        let body = scene(SHEAR, FROM_FILE, state.clone()).unwrap().system.bodies[0];
        (body.position.y, body.velocity.x - state.velocity.unwrap()[0].x)
    };
    // In single precision, at the coordinate of the face: it was just below it.
    assert_eq!(found(6e-8, EDGE), (0.0, -0.5 * EDGE));
    // An image in the next box has the velocity that it has in the box.
    assert_eq!(found(6e-8, EDGE + 0.5), (0.5, 0.0));
    assert_eq!(found(0.0, EDGE), (0.0, 0.0));
}

/// Images that the file has displaced by `offset` along axis `column` for axis `row`.
fn tilted(row: usize, column: usize, offset: f64) -> State {
    let mut edges = [0, 1, 2].map(|axis| DVec3::AXES[axis] * EDGE);
    edges[row][column] = offset;
    State { sheared_edges: Some(edges), ..state() }
}

#[test]
fn the_displacement_of_images_comes_from_the_file() {
    let scene_of = |shear: &str, state| scene(shear, FROM_FILE, state);
    let found = scene_of(SHEAR, tilted(1, 0, 1.75)).unwrap();
    assert_eq!(found.system.domain.shear.unwrap().offset, 1.75);
    // The resolved scene has it: a resumed run does not read the file.
    assert!(found.resolved.contains("offset = 1.75"), "{}", found.resolved);
    // A position beyond the upper face is displaced with its image.
    let mut moved = tilted(1, 0, 1.75);
    for position in &mut moved.position {
        *position += DVec3::new(1.75, EDGE, 0.0);
    }
    assert_eq!(hash(&scene_of(SHEAR, moved).unwrap()), hash(&found));
    for (shear, state, expected) in [
        ("", tilted(1, 0, 1.75), "the box of the file is sheared: the scene needs domain.shear"),
        (SHEAR, tilted(2, 0, 1.75), "sheared along other axes"),
        (SHEAR, tilted(0, 1, 1.75), "sheared along other axes"),
        // Particles that touch across the faces because the images are displaced.
        (&SHEAR.replace("rate = 0.5", "rate = 0.5, offset = 1.0"), touching(), "particle 0 overlaps"),
    ] {
        let error = scene_of(shear, state).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

/// Two particles that overlap only with an image that is displaced by 1.
fn touching() -> State {
    let mut state = state();
    state.position[0] = DVec3::new(1.5, 7.5, 1.5);
    state.position[1] = DVec3::new(0.5, 0.25, 1.5);
    state
}
