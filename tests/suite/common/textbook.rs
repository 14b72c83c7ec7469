//! Shared by the tests of the chapter's scenes.

use haff_engine::{EventRecord, Observer};
use haff_scene::{NoStates, Scene};

/// Stores all events.
#[derive(Default)]
pub struct Log(pub Vec<EventRecord>);

impl Observer for Log {
    fn wants_events(&self) -> bool {
        true
    }
    fn event(&mut self, event: &EventRecord) {
        self.0.push(*event);
    }
}

/// A scene of `configs/textbook`, with overridden keys.
pub fn scene(name: &str, set: &[String]) -> Scene {
    let path = super::root().join(format!("configs/textbook/{name}.toml"));
    haff_scene::load(&path, set, &NoStates).unwrap_or_else(|errors| panic!("{errors}"))
}

/// Asserts that two numbers agree to 10⁻¹⁰ of a scale.
#[track_caller]
pub fn close(what: &str, found: f64, expected: f64, scale: f64) {
    let error = (found - expected).abs() / scale;
    assert!(error <= 1e-10, "{what}: {found}, expected {expected}, off by {error:.1e}");
}
