//! The scenes of impacts in `configs/textbook` against their closed forms (physics.md, sections 1, 2 and 5),
//! with changed parameters.

use glam::DVec3;
use haff_engine::{EventKind, EventRecord, Frame, Simulation, Until};

use crate::common::textbook::{Log, close, scene};

/// Runs a scene to a time; returns its events and its last frame.
fn run(name: &str, set: &[String], time: f64) -> (Vec<EventRecord>, Frame) {
    let scene = scene(name, set);
    assert!(scene.joints.is_empty());
    let mut simulation =
        Simulation::new(scene.system, scene.options).unwrap_or_else(|error| panic!("{error}"));
    let mut log = Log::default();
    simulation
        .advance(Until { time, ..Until::default() }, &mut log)
        .unwrap_or_else(|error| panic!("{error}"));
    let frame = simulation.frame();
    let residual = simulation.ledger().residual;
    assert!(residual.abs() < 1e-13, "ledger residual {residual:e}");
    (log.0, frame)
}

fn masses(m1: f64, m2: f64) -> Vec<String> {
    vec![format!("particle.0.mass={m1:?}"), format!("particle.1.mass={m2:?}")]
}

/// Checks velocities afterwards, impulse, loss and Carnot energy by (2.14), (2.16), (2.19), (2.20), (2.31).
fn check_impact(event: &EventRecord, frame: &Frame, m: [f64; 2], w: [DVec3; 2], n: DVec3, e: f64) {
    let reduced = m[0] * m[1] / (m[0] + m[1]);
    let approach = (w[0] - w[1]).dot(n);
    let impulse = (1.0 + e) * reduced * approach;
    assert_eq!(event.kind, EventKind::Collision);
    close("v_n", event.approach_speed, approach, approach);
    close("J", event.impulse, impulse, impulse);
    let (loss, carnot) =
        (0.5 * reduced * approach * approach * (1.0 - e * e), impulse * impulse / (2.0 * reduced));
    close("ΔT", event.energy_loss, loss, carnot);
    close("E'_c", event.carnot_energy, carnot, carnot);
    close("Carnot's theorem", event.energy_loss, event.carnot_energy * (1.0 - e) / (1.0 + e), carnot);
    let speed = w[0].length() + w[1].length();
    let expected = [w[0] - n * (impulse / m[0]), w[1] + n * (impulse / m[1])];
    for (k, expected) in expected.into_iter().enumerate() {
        close(&format!("w{}'", k + 1), (frame.velocity[k] - expected).length(), 0.0, speed);
    }
}

#[test]
fn direct_impacts_follow_the_closed_form_over_e_and_masses() {
    for e in [0.0, 0.3, 0.9, 1.0] {
        for (m1, m2) in [(2.0, 1.0), (1.0, 1.0), (1e-3, 7.0), (50.0, 0.2)] {
            for v in [3.0, 0.01] {
                let mut set = masses(m1, m2);
                set.push(format!("contact.restitution={e:?}"));
                set.push(format!("particle.0.velocity=[{v:?}, 0.0, 0.0]"));
                let (events, frame) = run("direct_impact", &set, 4.0 / v);
                close("time", events[0].time, 3.0 / v, 3.0 / v);
                check_impact(&events[0], &frame, [m1, m2], [DVec3::X * v, DVec3::ZERO], DVec3::X, e);
            }
        }
    }
}

#[test]
fn oblique_impacts_follow_the_closed_form_over_e_masses_and_normal_angle() {
    let (w1, w2) = (DVec3::new(30.0, 10.0, 0.0), DVec3::new(-10.0, -30.0, 0.0));
    for e in [0.0, 0.5, 1.0] {
        for (m1, m2) in [(1.0, 1.0), (3.0, 0.4)] {
            for angle in [-0.7_f64, 0.0, 0.5, 1.3] {
                // Initial positions from which they touch with the normal at this angle.
                let n = DVec3::new(angle.cos(), angle.sin(), 0.0);
                let (x1, x2) = (-n * 0.5 - w1 * 0.05, n * 0.5 - w2 * 0.05);
                let mut set = masses(m1, m2);
                set.push(format!("contact.restitution={e:?}"));
                set.push(format!("particle.0.position=[{:?}, {:?}]", x1.x, x1.y));
                set.push(format!("particle.1.position=[{:?}, {:?}]", x2.x, x2.y));
                let (events, frame) = run("oblique_pair", &set, 0.1);
                close("time", events[0].time, 0.05, 0.05);
                close("normal", (events[0].normal - n).length(), 0.0, 1.0);
                check_impact(&events[0], &frame, [m1, m2], [w1, w2], n, e);
            }
        }
    }
}

#[test]
fn oblique_wall_impacts_follow_the_closed_form_over_e_and_alpha() {
    for e in [0.0_f64, 0.25, 0.8, 1.0] {
        for alpha in [0.0_f64, 0.4, 1.1, 1.5] {
            for m in [1.0, 40.0] {
                let (sin, cos) = alpha.sin_cos();
                let set = [
                    format!("wall.0.restitution={e:?}"),
                    format!("particle.0.mass={m:?}"),
                    format!("particle.0.velocity=[{sin:?}, {:?}]", -cos),
                ];
                let (events, frame) = run("oblique_wall", &set, 2.0 / cos + 0.01);
                close("time", events[0].time, 2.0 / cos, 2.0 / cos);
                let w = frame.velocity[0];
                close("(2.21)", w.length(), (sin * sin + e * e * cos * cos).sqrt(), 1.0);
                // (2.22): tan β = tan α / e, as sides.
                close("(2.22)", w.x * e * cos, w.y * sin, 1.0);
                close("ΔT", events[0].energy_loss, 0.5 * m * cos * cos * (1.0 - e * e), m);
            }
        }
    }
}

#[test]
fn a_bouncing_ball_follows_the_closed_form_over_e_height_and_gravity() {
    for e in [0.1, 0.5, 0.8, 0.95] {
        for (height, g) in [(1.0_f64, 9.81_f64), (0.02, 1.62), (300.0, 274.0)] {
            let set = [
                format!("wall.0.restitution={e:?}"),
                format!("domain.gravity=[0.0, 0.0, {:?}]", -g),
                format!("particle.0.position=[0.0, 0.0, {:?}]", height + 0.1),
            ];
            let fall = (2.0 * height / g).sqrt();
            let rest = fall * (1.0 + e) / (1.0 - e);
            let (events, frame) = run("bouncing_ball", &set, 1.1 * rest);
            let bounces: Vec<&EventRecord> =
                events.iter().filter(|event| event.kind == EventKind::Wall).collect();
            let mut path = 0.0;
            for (k, bounce) in bounces.iter().enumerate() {
                let rise = bounce.approach_speed.powi(2) / (2.0 * g);
                close("H_k", rise, e.powi(2 * k as i32) * height, height);
                let time = fall * (1.0 + 2.0 * (1..=k).map(|j| e.powi(j as i32)).sum::<f64>());
                close("time of bounce", bounce.time, time, rest);
                path += if k == 0 { rise } else { 2.0 * rise };
            }
            let last = events.last().expect("it comes to rest");
            assert_eq!(last.kind, EventKind::Rest);
            close("time until rest", last.time, rest, rest);
            // The series loses m g times the height before its first impact.
            path += 2.0 * last.energy_loss / g / (1.0 - e * e);
            close("path", path, height * (1.0 + e * e) / (1.0 - e * e), height);
            assert_eq!(frame.velocity[0], DVec3::ZERO);
        }
    }
}

#[test]
fn hammer_and_forging_follow_the_closed_form_over_the_mass_ratio() {
    for ratio in [1e-6, 0.01, 1.0, 20.0, 1e6] {
        for (name, v, gap) in [("hammer_and_nail", 5.0, 0.02), ("forging", 6.0, 0.3)] {
            let set = masses(ratio, 1.0);
            let (events, frame) = run(name, &set, 2.0 * gap / v);
            close("time", events[0].time, gap / v, gap / v);
            let initial = 0.5 * ratio * v * v;
            let share = 1.0 / (1.0 + ratio);
            close("(2.18)", events[0].energy_loss / initial, share, share);
            close("Carnot's theorem", events[0].carnot_energy, events[0].energy_loss, initial * share);
            let common = ratio / (1.0 + ratio) * v;
            for velocity in &frame.velocity {
                close("common velocity", velocity.length(), common, common);
            }
        }
    }
}
