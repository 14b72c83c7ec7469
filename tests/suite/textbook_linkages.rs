//! The scenes of pendulums, springs and rods in `configs/textbook` against their closed forms (physics.md,
//! section 5), with changed parameters.

use glam::DVec3;
use haff_engine::{EventKind, EventRecord, Until};
use haff_linkage::{Simulation, complete_elliptic_integral};

use crate::common::textbook::{Log, close, scene};

/// Starts a scene with overrides.
fn start(name: &str, set: &[String]) -> Simulation {
    let scene = scene(name, set);
    assert!(!scene.joints.is_empty());
    Simulation::new(scene.system, scene.joints).unwrap_or_else(|error| panic!("{error}"))
}

fn run(simulation: &mut Simulation, time: f64) -> Vec<EventRecord> {
    let mut log = Log::default();
    simulation
        .advance(Until { time, ..Until::default() }, &mut log)
        .unwrap_or_else(|error| panic!("{error}"));
    log.0
}

#[test]
fn pendulums_rise_to_the_angle_beta() {
    for e in [0.0, 0.4, 1.0] {
        for alpha in [0.1_f64, std::f64::consts::FRAC_PI_3, 1.4] {
            for (scene, ma, mb) in
                [("pendulums", 1.0, 1.0), ("pendulums_unequal", 2.0, 3.0), ("pendulums_unequal", 0.5, 4.0)]
            {
                let mut simulation = start(
                    scene,
                    &[
                        format!("contact.restitution={e:?}"),
                        format!("pendulum.0.angle={:?}", -alpha),
                        format!("particle.0.mass={ma:?}"),
                        format!("particle.1.mass={mb:?}"),
                    ],
                );
                let quarter =
                    |cos: f64| (1.0_f64 / 9.81).sqrt() * complete_elliptic_integral(0.5 * (1.0 + cos));
                let factor: f64 = (1.0 + e) * ma / (ma + mb);
                let cos_beta = 1.0 - factor * factor * (1.0 - alpha.cos());
                let hit = quarter(alpha.cos());
                let events = run(&mut simulation, hit + quarter(cos_beta));
                assert_eq!(events[0].kind, EventKind::Collision);
                close("time", events[0].time, hit, hit);
                let found = 1.0 - simulation.frame().position[1].z;
                close("cos β", found, cos_beta, 1.0 - cos_beta);
                let measured = (ma + mb) / ma * ((1.0 - found) / (1.0 - alpha.cos())).sqrt() - 1.0;
                close("e from α and β", measured, e, 1.0);
            }
        }
    }
}

#[test]
fn the_spring_stores_the_kinetic_energy_left_after_the_impact() {
    for (m, v, k) in [(1.0, 6.0, 60.0), (0.3, 2.0, 500.0), (50.0, 0.4, 9.0)] {
        let mut set: Vec<String> = (0..3).map(|i| format!("particle.{i}.mass={m:?}")).collect();
        set.push(format!("particle.0.velocity=[{v:?}, 0.0]"));
        set.push(format!("spring.0.stiffness={k:?}"));
        let mut simulation = start("spring_impact", &set);
        let (hit, omega) = (0.6 / v, (1.5_f64 * k / m).sqrt());
        run(&mut simulation, hit + 0.5 * std::f64::consts::PI / omega);
        let x = simulation.frame().position;
        let compression = v * (m / (6.0 * k)).sqrt();
        close("compression", 1.0 - (x[2].x - x[1].x), compression, compression);
        let leave = hit + std::f64::consts::PI / omega;
        let free = std::f64::consts::PI * (m / (2.0_f64 * k)).sqrt();
        let events = run(&mut simulation, leave + 2.0 * free);
        assert_eq!(events.len(), 1, "{events:?}");
        assert_eq!(events[0].kind, EventKind::Release);
        close("1 leaves 2", events[0].time, leave, leave);
        let w = simulation.frame().velocity;
        close("v1", w[0].x, v / 6.0, v);
        close("centre of 2-3", 0.5 * (w[1].x + w[2].x), 5.0 * v / 12.0, v);
        close("T2min", 0.5 * m * w[1].x.powi(2), m * v * v / 72.0, m * v * v / 72.0);
        close("T3max", 0.5 * m * w[2].x.powi(2), 2.0 * m * v * v / 9.0, m * v * v);
        assert!(simulation.ledger().residual.abs() < 1e-12);
    }
}

#[test]
fn rods_rotate_as_in_the_closed_form_after_sticking_and_elastic_impacts() {
    for theta in [0.0_f64, 0.3, 1.2, std::f64::consts::FRAC_PI_2] {
        for (v, m) in [(3.0, 1.0), (0.02, 7.0)] {
            for (scene, e) in [
                ("stick_to_rod", 0.0),
                ("elastic_rod_end", 1.0),
                ("elastic_rod_end", 0.35),
                ("elastic_rod_end", 0.7),
            ] {
                let mut set: Vec<String> = (0..3).map(|i| format!("particle.{i}.mass={m:?}")).collect();
                set.push(format!("particle.0.velocity=[{v:?}, 0.0]"));
                set.push(format!("rod.0.angle={theta:?}"));
                if scene == "elastic_rod_end" {
                    set.push(format!("contact.restitution={e:?}"));
                }
                let mut simulation = start(scene, &set);
                let events = run(&mut simulation, 1.7 / v);
                assert_eq!(events.len(), 1);
                close("time", events[0].time, 1.0 / v, 1.0 / v);
                let frame = simulation.frame();
                let arm = frame.position[2] - frame.position[1];
                let spin = arm.cross(frame.velocity[2] - frame.velocity[1]).z / 4.0;
                close("length", arm.length(), 2.0, 2.0);
                if scene == "stick_to_rod" {
                    let center = frame.velocity.iter().sum::<DVec3>() / 3.0;
                    close("v_cm", (center - DVec3::X * (v / 3.0)).length(), 0.0, v);
                    close("ω", spin, v * theta.sin() / 4.0, v);
                    assert_eq!(events[0].energy_loss, events[0].carnot_energy);
                } else {
                    let impulse = (1.0 + e) * 2.0 * m * v / (3.0 + theta.sin().powi(2));
                    close("J", events[0].impulse, impulse, impulse);
                    close("v1'", frame.velocity[0].x, v - impulse / m, v);
                    let center = 0.5 * (frame.velocity[1] + frame.velocity[2]);
                    close("v_cm", center.x, impulse / (2.0 * m), v);
                    close("ω", spin, impulse * theta.sin() / (2.0 * m), v);
                }
                assert!(simulation.ledger().residual.abs() < 1e-12);
            }
        }
    }
}

#[test]
fn the_cradle_raises_as_many_balls_as_were_released() {
    for count in 1..5 {
        let set: Vec<String> = (0..count).map(|k| format!("pendulum.{k}.angle=-0.6")).collect();
        let mut simulation = start("newtons_cradle", &set);
        let quarter = (1.0_f64 / 9.81).sqrt() * complete_elliptic_integral(0.3_f64.cos().powi(2));
        run(&mut simulation, 2.0 * quarter);
        for (k, x) in simulation.frame().position.iter().enumerate() {
            let expected = if k + count >= 5 { 1.0 - 0.6_f64.cos() } else { 0.0 };
            close(&format!("height of {k}"), x.z, expected, 1.0);
        }
    }
}
