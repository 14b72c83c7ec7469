//! The reference agrees with closed forms, and the engine and other methods are compared with the reference.

use glam::DVec3;
use haff_accuracy::{
    big, closed, growth,
    methods::{Engine, Method, SoftSpheres, Stepper},
    reference::{Reference, Rounding},
    scenes,
    trial::Solution,
};
use haff_engine::Boundary;

/// The reference solution of 64 spheres in a cube, from a state after ten collisions of each sphere.
fn by_reference(boundary: Boundary, phi: f64, collisions: u32) -> Solution {
    let system = scenes::melted(&scenes::gas(4, phi, boundary, 1.0, 5), 10.0).expect("a gas melts");
    Solution::by_reference("gas", "", system, collisions, 2, 256).expect("the reference supports the scene")
}

#[test]
fn reference_agrees_with_closed_forms_to_its_precision() {
    for closed_form in closed::all() {
        for (bits, bound) in [(128, 2f64.powi(-110)), (256, 2f64.powi(-230))] {
            let error = closed_form.reference_error(bits).unwrap();
            // About ten bits for a thousand bounces, and a few for sizes and times above 1.
            assert!(error < bound, "{}: {error:e} with {bits} bits, bound {bound:e}", closed_form.name);
        }
    }
}

#[test]
fn engine_is_within_rounding_of_closed_forms() {
    // Rounding errors of each event, half an ulp of the box each, without chaos: the billiard of 1,000
    // bounces lasts 40 times as long as a crossing, and errors of the direction of its velocity do not grow.
    for (closed_form, bound) in closed::all().into_iter().zip([1e-14, 1e-11, 1e-14, 1e-13]) {
        let solution = Solution::from(closed_form);
        let error = solution.measure(&Engine::default()).unwrap().error[0];
        println!("{}: {error:.1e} diameters", solution.name);
        assert!(error < bound, "{}: {error:e} diameters, bound {bound:e}", solution.name);
    }
}

#[test]
fn stepper_is_of_first_order() {
    // A bounce is delayed by a random part of a step, so the error is averaged over many slightly different
    // step lengths: the mean is of first order.
    let solution = Solution::from(closed::oblique_impact(0.8));
    let mean = |dt: f64| {
        let errors = (0..20)
            .map(|k| solution.measure(&Stepper { dt: dt * (1.0 - 0.017 * f64::from(k)) }).unwrap().error[0]);
        errors.sum::<f64>() / 20.0
    };
    let (coarse, fine) = (mean(1e-2), mean(1e-4));
    let order = (coarse / fine).log10() / 2.0;
    assert!((order - 1.0).abs() < 0.15, "order {order}: {coarse:e}, {fine:e}");
}

#[test]
fn error_of_soft_spheres_is_of_first_order_in_the_contact_time() {
    // Only elastic spheres: the jumps of a dashpot's force cause an error of e that does not decrease with
    // the contact time.
    for closed_form in [closed::oblique_impact(1.0), closed::chain(10)] {
        let expected = 1.0;
        let solution = Solution::from(closed_form);
        // With this many steps, only the error due to softness remains.
        let error = |contact_time| {
            solution.measure(&SoftSpheres { contact_time, steps_per_contact: 200.0 }).unwrap().error[0]
        };
        let (coarse, fine) = (error(1e-2), error(1e-3));
        let order = (coarse / fine).log10();
        assert!((order - expected).abs() < 0.15, "{}: order {order}: {coarse:e}, {fine:e}", solution.name);
    }
}

#[test]
fn velocity_verlet_is_of_second_order_for_elastic_springs() {
    // Compared with its own limit at fixed stiffness: an elastic impact.
    let mut system = scenes::empty(DVec3::splat(16.0), [Boundary::Open; 3], 1.0, 1.0);
    scenes::add_sphere(&mut system, 0.5, 1.0, DVec3::new(4.0, 8.0, 8.0), DVec3::X);
    scenes::add_sphere(&mut system, 0.5, 1.0, DVec3::new(6.0, 8.3, 8.1), -DVec3::X);
    let end = |steps_per_contact: f64| {
        SoftSpheres { contact_time: 0.2, steps_per_contact }.run(&system, &[1.2]).unwrap().states[0].position
            [0]
    };
    let limit = end(51_200.0);
    // The phase of the contact within a step differs each time: averaged over many steps.
    let error = |steps: f64| {
        (0..16).map(|k| (end(steps * (1.0 + 0.013 * f64::from(k))) - limit).length()).sum::<f64>() / 16.0
    };
    let (coarse, fine) = (error(20.0), error(200.0));
    let order = (coarse / fine).log10();
    assert!((order - 2.0).abs() < 0.3, "order {order}: {coarse:e}, {fine:e}");
}

#[test]
fn soft_spheres_have_the_given_restitution() {
    for e in [0.3, 0.7, 1.0] {
        let mut system = scenes::empty(DVec3::splat(16.0), [Boundary::Open; 3], e, 1.0);
        scenes::add_sphere(&mut system, 0.5, 1.0, DVec3::new(4.0, 8.0, 8.0), DVec3::X);
        scenes::add_sphere(&mut system, 0.5, 3.0, DVec3::new(5.5, 8.0, 8.0), -DVec3::X);
        let run = SoftSpheres { contact_time: 0.05, steps_per_contact: 2000.0 }.run(&system, &[1.0]).unwrap();
        let [first, second] = [run.states[0].velocity[0], run.states[0].velocity[1]];
        let found = (second - first).x / 2.0;
        // The dashpot's force jumps at both ends of the contact: first order in the step.
        assert!((found - e).abs() < 2e-3, "e = {found}, expected {e}");
    }
}

#[test]
#[ignore = "long: scripts/test all"]
fn error_of_the_engine_in_a_gas_is_rounding_amplified_by_chaos() {
    for (boundary, phi) in [(Boundary::Periodic, 0.05), (Boundary::Wall, 0.05), (Boundary::Periodic, 0.3)] {
        let solution = by_reference(boundary, phi, 4);
        let trial = solution.measure(&Engine::default()).unwrap();
        // 2^-50 diameters at the start, and at most 5 bits for each collision.
        for (error, collisions) in trial.error.iter().zip(&solution.collisions) {
            let bound = 2f64.powf(-50.0 + 5.0 * collisions);
            assert!(*error < bound, "{boundary:?}, {phi}: {error:e} after {collisions}, bound {bound:e}");
        }
        assert!(
            solution.measure(&Stepper { dt: 1e-3 }).unwrap().error[7] > 1e-5,
            "the stepper has a large error"
        );
    }
}

#[test]
fn reference_run_is_independent_of_its_precision() {
    let solution = by_reference(Boundary::Periodic, 0.05, 6);
    let deviation = growth::deviations(&solution, &solution.system, 320, Rounding::None).unwrap();
    // 256 bits minus five bits for each of six collisions.
    assert!(deviation[11] < 2f64.powi(-200), "{:e}", deviation[11]);
    assert!(deviation[11] > 0.0, "256 and 320 bits differ somewhere");
}

#[test]
fn reference_conserves_energy() {
    let system = scenes::gas(3, 0.1, Boundary::Periodic, 1.0, 3);
    let mut reference = Reference::new(&system, 256, Rounding::None).unwrap();
    let energy =
        |reference: &Reference| reference.velocity().iter().map(|v| v.dot(v)).reduce(|a, b| a + b).unwrap();
    let before = energy(&reference);
    let time = reference.run_to_collision(60);
    reference.run_to(&big(time, 256));
    let lost = (energy(&reference) / before - big(1.0, 256)).to_f64().value();
    assert!(lost.abs() < 1e-70, "relative change of energy {lost:e}");
    assert_eq!(reference.collisions(), 60);
}

#[test]
#[ignore = "long: scripts/test all"]
fn all_searches_give_one_trajectory_with_the_error_of_a_rounded_state() {
    let solution = by_reference(Boundary::Periodic, 0.05, 5);
    let growth = growth::measure(&solution, 256, 1).unwrap();
    assert!(growth.configurations.len() >= 4, "{:?}", growth.configurations);
    assert!(growth.identical, "{:?}", growth.configurations);
    let beyond = growth.engine.bits_beyond(&growth.rounded).unwrap();
    // Allowed for a single initial state: scatter of one or two bits, and the rounding of prediction and
    // impact.
    assert!(beyond.abs() < 4.0, "{beyond} bits more than rounding of the state");
    assert!(growth.perturbed.slope().unwrap() > 1.0, "chaos");
}
