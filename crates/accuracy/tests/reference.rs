//! The high-precision engine is judged by closed forms, and the engine and its rivals by it.

use glam::DVec3;
use haff_accuracy::{
    big, closed, growth,
    methods::{Engine, Method, SoftSpheres, Stepper},
    reference::{Reference, Rounding},
    scenes,
    trial::Answer,
};
use haff_engine::Boundary;

/// 64 spheres in a periodic cube after ten collisions each, then followed.
fn followed(boundary: Boundary, phi: f64, collisions: u32) -> Answer {
    let system = scenes::melted(&scenes::gas(4, phi, boundary, 1.0, 5), 10.0).expect("a gas melts");
    Answer::followed("gas", "", system, collisions, 2, 256).expect("the reference knows all of it")
}

#[test]
fn reference_agrees_with_closed_forms_to_its_precision() {
    for known in closed::all() {
        for (bits, bound) in [(128, 2f64.powi(-110)), (256, 2f64.powi(-230))] {
            let error = known.reference_error(bits).unwrap();
            // Some ten bits for a thousand bounces, and some for sizes and times above 1.
            assert!(error < bound, "{}: {error:e} with {bits} bits, bound {bound:e}", known.name);
        }
    }
}

#[test]
fn engine_is_within_rounding_of_closed_forms() {
    // Roundings of each event, half an ulp of the box each, on their way to the end without chaos: the billiard of 1,000
    // bounces lasts 40 times as long as a crossing, and errors of its velocity's direction do not grow.
    for (known, bound) in closed::all().into_iter().zip([1e-14, 1e-11, 1e-14, 1e-13]) {
        let answer = Answer::from(known);
        let error = answer.judge(&Engine::default()).unwrap().error[0];
        println!("{}: {error:.1e} diameters", answer.name);
        assert!(error < bound, "{}: {error:e} diameters, bound {bound:e}", answer.name);
    }
}

#[test]
fn stepper_is_of_first_order() {
    // A bounce is late by any part of a step: the mean over many steps of slightly different length is of first order.
    let answer = Answer::from(closed::oblique_impact(0.8));
    let mean = |dt: f64| {
        let errors = (0..20)
            .map(|k| answer.judge(&Stepper { dt: dt * (1.0 - 0.017 * f64::from(k)) }).unwrap().error[0]);
        errors.sum::<f64>() / 20.0
    };
    let (coarse, fine) = (mean(1e-2), mean(1e-4));
    let order = (coarse / fine).log10() / 2.0;
    assert!((order - 1.0).abs() < 0.15, "order {order}: {coarse:e}, {fine:e}");
}

#[test]
fn soft_spheres_tend_to_hard_ones_with_the_contact_time() {
    // Elastic ones: the jumps of a dashpot's force leave an error of e that does not fall with the contact time.
    for known in [closed::oblique_impact(1.0), closed::chain(10)] {
        let expected = 1.0;
        let answer = Answer::from(known);
        // So many steps that the softness is all that is left of the error.
        let error = |contact_time| {
            answer.judge(&SoftSpheres { contact_time, steps_per_contact: 200.0 }).unwrap().error[0]
        };
        let (coarse, fine) = (error(1e-2), error(1e-3));
        let order = (coarse / fine).log10();
        assert!((order - expected).abs() < 0.15, "{}: order {order}: {coarse:e}, {fine:e}", answer.name);
    }
}

#[test]
fn velocity_verlet_is_of_second_order_for_elastic_springs() {
    // Against its own limit at fixed stiffness: an elastic head-on impact.
    let mut system = scenes::empty(DVec3::splat(16.0), [Boundary::Open; 3], 1.0, 1.0);
    scenes::add_sphere(&mut system, 0.5, 1.0, DVec3::new(4.0, 8.0, 8.0), DVec3::X);
    scenes::add_sphere(&mut system, 0.5, 1.0, DVec3::new(6.0, 8.3, 8.1), -DVec3::X);
    let end = |steps_per_contact: f64| {
        SoftSpheres { contact_time: 0.2, steps_per_contact }.run(&system, &[1.2]).unwrap().states[0].position
            [0]
    };
    let limit = end(51_200.0);
    // The phase of the contact within a step is different each time: many steps, averaged.
    let error = |steps: f64| {
        (0..16).map(|k| (end(steps * (1.0 + 0.013 * f64::from(k))) - limit).length()).sum::<f64>() / 16.0
    };
    let (coarse, fine) = (error(20.0), error(200.0));
    let order = (coarse / fine).log10();
    assert!((order - 2.0).abs() < 0.3, "order {order}: {coarse:e}, {fine:e}");
}

#[test]
fn soft_spheres_have_the_restitution_asked_for() {
    for e in [0.3, 0.7, 1.0] {
        let mut system = scenes::empty(DVec3::splat(16.0), [Boundary::Open; 3], e, 1.0);
        scenes::add_sphere(&mut system, 0.5, 1.0, DVec3::new(4.0, 8.0, 8.0), DVec3::X);
        scenes::add_sphere(&mut system, 0.5, 3.0, DVec3::new(5.5, 8.0, 8.0), -DVec3::X);
        let run = SoftSpheres { contact_time: 0.05, steps_per_contact: 2000.0 }.run(&system, &[1.0]).unwrap();
        let [first, second] = [run.states[0].velocity[0], run.states[0].velocity[1]];
        let found = (second - first).x / 2.0;
        // The dashpot's force jumps at both ends of the contact: first order in the step.
        assert!((found - e).abs() < 2e-3, "e = {found}, asked {e}");
    }
}

#[test]
fn engine_follows_a_gas_for_a_few_collisions_to_the_rounding_that_chaos_leaves() {
    for (boundary, phi) in [(Boundary::Periodic, 0.05), (Boundary::Wall, 0.05), (Boundary::Periodic, 0.3)] {
        let answer = followed(boundary, phi, 4);
        let trial = answer.judge(&Engine::default()).unwrap();
        // 2^-50 diameters at the start, and at most 5 bits for each collision.
        for (error, collisions) in trial.error.iter().zip(&answer.collisions) {
            let bound = 2f64.powf(-50.0 + 5.0 * collisions);
            assert!(*error < bound, "{boundary:?}, {phi}: {error:e} after {collisions}, bound {bound:e}");
        }
        assert!(answer.judge(&Stepper { dt: 1e-3 }).unwrap().error[7] > 1e-5, "the stepper cannot follow");
    }
}

#[test]
fn reference_run_does_not_depend_on_its_precision() {
    let answer = followed(Boundary::Periodic, 0.05, 6);
    let deviation = growth::deviations(&answer, &answer.system, 320, Rounding::None).unwrap();
    // 256 bits less five bits for each of six collisions.
    assert!(deviation[11] < 2f64.powi(-200), "{:e}", deviation[11]);
    assert!(deviation[11] > 0.0, "256 and 320 bits differ somewhere");
}

#[test]
fn reference_keeps_energy_and_distances() {
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
fn all_machineries_give_one_trajectory_that_errs_like_a_rounded_state() {
    let answer = followed(Boundary::Periodic, 0.05, 5);
    let growth = growth::measure(&answer, 256, 1).unwrap();
    assert!(growth.machineries.len() >= 4, "{:?}", growth.machineries);
    assert!(growth.identical, "{:?}", growth.machineries);
    let beyond = growth.engine.bits_beyond(&growth.rounded).unwrap();
    // One start: scatter of a bit or two, and the roundings of prediction and impact.
    assert!(beyond.abs() < 4.0, "{beyond} bits beyond rounding of the state");
    assert!(growth.nudged.slope().unwrap() > 1.0, "chaos");
}
