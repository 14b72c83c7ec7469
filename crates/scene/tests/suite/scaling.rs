//! States of files in a box of another size.

use std::path::Path;

use glam::DVec3;
use haff_scene::{Code, Scene, SceneErrors, State, StateSource};

/// Two particles in a box of 4 × 6 × 8.
struct Two;

impl StateSource for Two {
    fn state(&self, _path: &Path, _index: i64) -> Result<State, String> {
        Ok(State {
            size: Some(DVec3::new(4.0, 6.0, 8.0)),
            position: vec![DVec3::new(1.0, 2.0, 3.0), DVec3::new(3.0, 4.5, 5.0)],
            velocity: Some(vec![DVec3::X, DVec3::Y]),
            radius: vec![0.5; 2],
            mass: Some(vec![1.0; 2]),
            ..State::default()
        })
    }
}

fn scene(scale_to: &str, more: &str) -> Result<Scene, SceneErrors> {
    let text = format!(
        "schema = 1\ninitial.positions = {{ file = \"a.h5\", scale_to = {scale_to} }}\nrun.until = 1.0\n{more}\n\
         [[species]]\nname = \"grain\"\ncount = 2\nradius = 1.25\nmass = 3.0\n"
    );
    haff_scene::parse("scaled.toml", &text, &[], &Two)
}

#[test]
fn positions_and_radii_are_scaled_with_the_box() {
    let system = scene("[10.0, 15.0, 20.0]", "").unwrap().system;
    assert_eq!(system.domain.size, DVec3::new(10.0, 15.0, 20.0));
    assert_eq!(system.bodies[0].position, DVec3::new(2.5, 5.0, 7.5));
    assert_eq!(system.bodies[1].position, DVec3::new(7.5, 11.25, 12.5));
    assert_eq!([0, 1].map(|row| system.bodies[row].velocity), [DVec3::X, DVec3::Y]);
    let class = &system.classes[system.bodies[0].class as usize];
    assert_eq!((class.radius, class.mass), (1.25, 3.0), "the mass is that of the scene");
    // The same box is the same state.
    assert!(scene("[10.0, 15.0, 20.0]", "domain.size = [10.0, 15.0, 20.0]").is_ok());
}

#[test]
fn edges_that_are_not_those_of_the_file_times_one_factor_are_refused() {
    for (scale_to, more, key, code, message) in [
        ("[10.0, 15.0]", "", "initial.positions.scale_to", Code::Value, "must have 3 numbers"),
        (
            "[10.0, 15.0, -1.0]",
            "",
            "initial.positions.scale_to.2",
            Code::Value,
            "must be a positive finite number",
        ),
        (
            "[10.0, 15.0, 21.0]",
            "",
            "initial.positions.scale_to",
            Code::Value,
            "edges of the box of the file, [4, 6, 8]",
        ),
        ("\"twice\"", "", "initial.positions.scale_to", Code::Type, "must be an array, not a string"),
        // Radii that are not those of the species; a box that is another one.
        ("[8.0, 12.0, 16.0]", "", "initial.positions", Code::Conflict, "particle 0 of the file has radius 1"),
        ("[10.0, 15.0, 20.0]", "domain.size = [10.0, 15.0, 30.0]", "initial.positions", Code::Conflict, "20"),
    ] {
        let errors = scene(scale_to, more).unwrap_err();
        let error = &errors.errors[0];
        assert_eq!((error.path.as_str(), error.code), (key, code), "{errors}");
        assert!(error.message.contains(message), "{errors}");
    }
}
