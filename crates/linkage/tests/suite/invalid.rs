//! Invalid joints are refused with a message that describes the error.

use glam::DVec3;
use haff_linkage::{SpringEnd, Tether};

use crate::common::Scene;

/// Two unit spheres at distance 3.
fn pair() -> Scene {
    let mut scene = Scene::new(0.5);
    scene.particle([0.0; 3], [0.0; 3], 1.0, 0.5);
    scene.particle([3.0, 0.0, 0.0], [0.0; 3], 1.0, 0.5);
    scene
}

#[track_caller]
fn refused(scene: &Scene, with: &str) {
    let message = match scene.try_start() {
        Ok(_) => panic!("accepted, expected an error with: {with}"),
        Err(error) => error.to_string(),
    };
    assert!(message.contains(with), "{message:?} does not contain {with:?}");
}

#[test]
fn invalid_joints_are_refused_with_their_error() {
    let mut scene = pair();
    scene.pendulum(DVec3::new(0.0, 0.0, 2.0), 1.5, 0, Tether::String);
    refused(&scene, "pendulum 0: its ends are 2 apart, its length is 1.5");
    scene.joints.pendulums[0].length = 2.5;
    refused(&scene, "or nearer with slack = true");
    scene.joints.pendulums[0].slack = true;
    assert!(scene.try_start().is_ok());
    scene.joints.pendulums[0].tether = Tether::Rod;
    refused(&scene, "a rod keeps its bob at its length");
    scene.joints.pendulums[0].length = 0.0;
    refused(&scene, "length = 0 must be positive");
    scene.joints.pendulums[0].bob = 7;
    scene.joints.pendulums[0].length = 2.0;
    refused(&scene, "there is no particle 7; there are 2");

    let mut scene = pair();
    scene.rod(0, 1, 2.0);
    refused(&scene, "rod 0: its ends are 3 apart, its length is 2");
    scene.joints.rods[0].length = 3.0;
    scene.particles[0].1 = DVec3::X;
    refused(&scene, "rod 0: its ends separate at -1");
    scene.particles[0].1 = DVec3::ZERO;
    scene.rod(1, 0, 3.0);
    refused(&scene, "rod 1 holds what other pendulums and rods hold already");
    scene.joints.rods[1].ends = [1, 1];
    refused(&scene, "its two ends are the same");

    let mut scene = pair();
    scene.spring(SpringEnd::Particle(0), SpringEnd::Particle(1), -4.0, 1.0);
    refused(&scene, "spring 0: stiffness = -4 must be positive");
    scene.joints.springs[0].stiffness = 4.0;
    scene.joints.springs[0].natural_length = f64::NAN;
    refused(&scene, "length = NaN must be zero or positive");
    scene.joints.springs[0].natural_length = 1.0;
    scene.joints.springs[0].ends = [SpringEnd::Point(DVec3::ZERO), SpringEnd::Point(DVec3::ONE)];
    refused(&scene, "neither of its ends can move");

    let mut scene = pair();
    scene.joints.sticking = vec![[0, 1], [1, 0]];
    refused(&scene, "declared to stick twice");

    let mut scene = pair();
    scene.pendulum(DVec3::new(0.0, 0.0, 2.0), 2.0, 0, Tether::String);
    scene.particles[0].1 = DVec3::new(0.0, 0.0, -1.0);
    refused(&scene, "pendulum 0: its ends separate at 1");
    // A string goes slack if its bob moves towards the pivot.
    scene.particles[0].1 = DVec3::new(0.0, 0.0, 1.0);
    assert!(!scene.start().is_taut(0));
}
