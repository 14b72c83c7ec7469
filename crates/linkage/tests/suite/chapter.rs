//! The worked systems of the chapter against their closed forms (physics.md, section 5), over grids of their
//! parameters.

use glam::DVec3;
use haff_engine::EventKind;
use haff_linkage::{SpringEnd, Tether, complete_elliptic_integral};

use crate::common::{Scene, close, near, run};

const G: f64 = 9.81;

fn down(g: f64) -> DVec3 {
    DVec3::new(0.0, 0.0, -g)
}

/// Two pendulums whose bobs touch when both hang; the first is released at α.
fn pendulums(e: f64, alpha: f64, m: [f64; 2], length: f64, g: f64, radius: f64, tether: Tether) -> Scene {
    let mut scene = Scene::new(e);
    scene.gravity = down(g);
    let pivots = [DVec3::ZERO, DVec3::new(2.0 * radius, 0.0, 0.0)];
    let bob = pivots[0] + DVec3::new(-alpha.sin(), 0.0, -alpha.cos()) * length;
    let a = scene.particle(bob.to_array(), [0.0; 3], m[0], radius);
    let b = scene.particle((pivots[1] - DVec3::Z * length).to_array(), [0.0; 3], m[1], radius);
    scene.pendulum(pivots[0], length, a, tether);
    scene.pendulum(pivots[1], length, b, tether);
    scene
}

#[test]
fn problem_2_3_two_pendulums_collide() {
    for e in [0.0, 0.3, 0.8, 1.0] {
        for alpha in [0.01_f64, 0.5, 1.2, 1.57, 2.9] {
            for (length, g, radius) in [(1.0, G, 0.05), (0.37, 1.62, 0.1), (40.0, 274.0, 0.001)] {
                for tether in [Tether::String, Tether::Rod] {
                    // A string does not hold a bob above its pivot.
                    if tether == Tether::String && alpha > 1.6 {
                        continue;
                    }
                    let scene = pendulums(e, alpha, [2.0, 2.0], length, g, radius, tether);
                    let mut simulation = scene.start();
                    let quarter =
                        (length / g).sqrt() * complete_elliptic_integral((0.5 * alpha).cos().powi(2));
                    let log = run(&mut simulation, quarter * (1.0 + 1e-9));
                    let hits = log.of(EventKind::Collision);
                    assert_eq!(hits.len(), 1, "e {e}, α {alpha}");
                    close("time of impact", hits[0].time, quarter, 1e-12);
                    let fall = 2.0 * length * g * (1.0 - alpha.cos());
                    let v = fall.sqrt();
                    close("approach speed", hits[0].approach_speed, v, 1e-12);
                    close("impulse", hits[0].impulse, (1.0 + e) * v, 1e-12);
                    near("loss", hits[0].energy_loss, 0.5 * (1.0 - e * e) * v * v, 1e-12 * v * v);
                    close("Carnot", hits[0].carnot_energy, 0.5 * (1.0 + e).powi(2) * v * v, 1e-12);
                    let frame = simulation.frame();
                    // At the lowest point, after another 1e-9 of a quarter period.
                    let speed = 0.5 * (1.0 + e) * v;
                    close("v2'", frame.velocity[1].length(), speed, 1e-7);
                    // Highest point of the second bob: β, at its own quarter period after the impact.
                    let cos_beta = 1.0 - (1.0 + e).powi(2) * (1.0 - alpha.cos()) / 4.0;
                    let rise = (length / g).sqrt() * complete_elliptic_integral(0.5 * (1.0 + cos_beta));
                    run(&mut simulation, quarter + rise);
                    let frame = simulation.frame();
                    let found = -(frame.position[1].z) / length;
                    near("cos β", found, cos_beta, 1e-12);
                    near("speed at β", frame.velocity[1].length(), 0.0, 1e-7 * v);
                    // Relative to the sum of both potentials, of opposite sign.
                    assert!(simulation.ledger().residual.abs() < 1e-13, "{:?}", simulation.ledger());
                    assert_eq!(simulation.flight_of(1), Some("pendulum"));
                }
            }
        }
    }
}

#[test]
fn set_2_1_restitution_follows_from_the_angles_of_unequal_pendulums() {
    for e in [0.0, 0.55, 1.0] {
        for (ma, mb) in [(1.0, 3.0), (0.2, 0.1), (5.0, 0.01)] {
            for alpha in [0.2_f64, 0.9] {
                let scene = pendulums(e, alpha, [ma, mb], 1.3, G, 0.04, Tether::Rod);
                let mut simulation = scene.start();
                let quarter = (1.3 / G).sqrt() * complete_elliptic_integral((0.5 * alpha).cos().powi(2));
                let first = run(&mut simulation, quarter * (1.0 + 1e-10));
                assert_eq!(first.of(EventKind::Collision).len(), 1);
                let factor = (1.0 + e) * ma / (ma + mb);
                let one_minus_cos_beta = factor * factor * (1.0 - alpha.cos());
                let m1 = 1.0 - 0.5 * one_minus_cos_beta;
                if m1 <= 0.0 {
                    continue; // full rotation
                }
                run(&mut simulation, quarter + (1.3 / G).sqrt() * complete_elliptic_integral(m1));
                let cos_beta = -simulation.frame().position[1].z / 1.3;
                let found = (ma + mb) / ma * ((1.0 - cos_beta) / (1.0 - alpha.cos())).sqrt() - 1.0;
                near("e from the angles", found, e, 2e-11);
            }
        }
    }
}

#[test]
fn problem_2_4_three_bodies_and_a_spring_follow_the_closed_form() {
    for (m, v, k, natural, radius) in
        [(1.0, 3.0, 50.0, 1.0, 0.1), (0.02, 0.5, 7.0, 0.4, 0.05), (300.0, 11.0, 4e4, 10.0, 0.5)]
    {
        let mut scene = Scene::new(0.0);
        let gap = 0.7;
        scene.particle([-gap - 2.0 * radius, 0.0, 0.0], [v, 0.0, 0.0], m, radius);
        let b = scene.particle([0.0; 3], [0.0; 3], m, radius);
        let c = scene.particle([natural, 0.0, 0.0], [0.0; 3], m, radius);
        scene.spring(SpringEnd::Particle(b), SpringEnd::Particle(c), k, natural);
        let mut simulation = scene.start();
        let hit = gap / v;
        let log = run(&mut simulation, hit);
        let impact = log.of(EventKind::Collision)[0];
        close("impact", impact.time, hit, 1e-14);
        close("loss", impact.energy_loss, 0.25 * m * v * v, 1e-14);
        let frame = simulation.frame();
        close("v1", frame.velocity[0].x, 0.5 * v, 1e-14);
        close("v2", frame.velocity[1].x, 0.5 * v, 1e-14);
        assert!(simulation.in_contact(0, 1));
        assert_eq!(simulation.flight_of(2), Some("normal modes"));
        // Bodies 1 and 2 move against 3 with the reduced mass 2m/3.
        let omega = (1.5 * k / m).sqrt();
        run(&mut simulation, hit + 0.5 * std::f64::consts::PI / omega);
        let frame = simulation.frame();
        let compression = natural - (frame.position[2].x - frame.position[1].x);
        close("largest compression", compression, v * (m / (6.0 * k)).sqrt(), 1e-12);
        let leave = hit + std::f64::consts::PI / omega;
        let log = run(&mut simulation, leave * (1.0 + 1e-6));
        let release = log.of(EventKind::Release);
        assert_eq!(release.len(), 1, "{:?}", log.0);
        close("1 leaves 2", release[0].time, leave, 1e-12);
        assert!(!simulation.in_contact(0, 1));
        let frame = simulation.frame();
        close("v1 after", frame.velocity[0].x, v / 6.0, 1e-12);
        let centre = |frame: &haff_engine::Frame| 0.5 * (frame.velocity[1].x + frame.velocity[2].x);
        close("centre of 2-3", centre(&frame), 5.0 / 12.0 * v, 1e-12);
        // T3 is largest at the release; T2 smallest half a period of 2-3 later, as it is when the spring is
        // unstressed.
        let free = (2.0 * k / m).sqrt();
        let half = std::f64::consts::PI / free;
        run(&mut simulation, leave + half);
        let frame = simulation.frame();
        close("T2min or T3", 0.5 * m * frame.velocity[2].x.powi(2), m * v * v / 72.0, 1e-9);
        run(&mut simulation, leave + 2.0 * half);
        let frame = simulation.frame();
        close("T3max", 0.5 * m * frame.velocity[2].x.powi(2), 2.0 / 9.0 * m * v * v, 1e-11);
        close("T2min", 0.5 * m * frame.velocity[1].x.powi(2), m * v * v / 72.0, 1e-11);
        let later = run(&mut simulation, leave + 200.0 * half);
        assert!(later.0.is_empty(), "{:?}", later.0);
        assert!(simulation.ledger().residual.abs() < 1e-14, "{:?}", simulation.ledger());
    }
}

/// A particle that moves along x towards the end of a rod at angle θ to x.
fn rod_target(e: f64, theta: f64, v: f64, m: f64, length: f64, radius: f64) -> Scene {
    let mut scene = Scene::new(e);
    let end = DVec3::ZERO;
    let other = DVec3::new(theta.cos(), theta.sin(), 0.0) * length;
    scene.particle([-2.0 * radius - 0.3, 0.0, 0.0], [v, 0.0, 0.0], m, radius);
    let a = scene.particle(end.to_array(), [0.0; 3], m, radius);
    let b = scene.particle(other.to_array(), [0.0; 3], m, radius);
    scene.rod(a, b, length);
    scene
}

#[test]
fn set_2_2_a_particle_sticks_to_the_end_of_a_rod() {
    for theta in [0.0_f64, 0.3, 0.9, std::f64::consts::FRAC_PI_2, 2.0] {
        for (v, m, length, radius) in [(1.0, 1.0, 1.0, 0.01), (7.0, 0.3, 2.5, 0.2), (0.01, 40.0, 0.3, 0.0)] {
            let mut scene = rod_target(0.5, theta, v, m, length, radius);
            scene.joints.sticking.push([0, 1]);
            let mut simulation = scene.start();
            let hit = 0.3 / v;
            let log = run(&mut simulation, hit * (1.0 + 1e-9));
            let stick = log.of(EventKind::Stick);
            assert_eq!(stick.len(), 1);
            close("time", stick[0].time, hit, 1e-11);
            assert!(simulation.in_contact(0, 1));
            for turn in [0.1, 1.7, 9.0] {
                run(&mut simulation, hit + turn / v);
                let frame = simulation.frame();
                let center = frame.velocity.iter().sum::<DVec3>() / 3.0;
                close("v_cm", center.x, v / 3.0, 1e-13);
                near("v_cm across", center.y, 0.0, 1e-14 * v);
                let arm = frame.position[2] - frame.position[1];
                close("length", arm.length(), length, 1e-13);
                let spin = arm.cross(frame.velocity[2] - frame.velocity[1]).z / (length * length);
                near("ω", spin.abs(), v * theta.sin() / (2.0 * length), 1e-13 * v / length);
                near("stuck", (frame.velocity[0] - frame.velocity[1]).length(), 0.0, 1e-14 * v);
                let angle = arm.y.atan2(arm.x) - theta;
                let expected = v * theta.sin() / (2.0 * length) * (turn / v);
                near("angle", (0.5 * (angle - expected)).sin(), 0.0, 1e-10);
            }
            // ΔT = E'_c: all of the energy missing in the closed form.
            let (cm, spin) = (v / 3.0, v * theta.sin() / (2.0 * length));
            // Masses 2m and m at l/3 and 2l/3 from the center.
            let after = 1.5 * m * cm * cm + 0.5 * spin * spin * m * length * length * (2.0 / 9.0 + 4.0 / 9.0);
            close("loss", stick[0].energy_loss, 0.5 * m * v * v - after, 1e-12);
            assert_eq!(stick[0].energy_loss, stick[0].carnot_energy);
            assert!(simulation.ledger().residual.abs() < 1e-14, "{:?}", simulation.ledger());
            assert_eq!(simulation.flight_of(0), Some("rod"));
        }
    }
}

#[test]
fn set_2_3_elastic_impact_on_the_end_of_a_rod_follows_the_closed_form() {
    for theta in [0.0_f64, 0.4, 1.1, std::f64::consts::FRAC_PI_2] {
        for (v, m, length, radius) in [(1.0, 1.0, 1.0, 0.01), (7.0, 0.3, 2.5, 0.2), (0.01, 40.0, 0.3, 1e-6)] {
            let mut simulation = rod_target(1.0, theta, v, m, length, radius).start();
            let log = run(&mut simulation, 0.3 / v * (1.0 + 1e-12));
            let hit = log.of(EventKind::Collision)[0];
            let impulse = 4.0 * m * v / (3.0 + theta.sin().powi(2));
            close("J", hit.impulse, impulse, 1e-13);
            near("loss", hit.energy_loss, 0.0, 0.0);
            let frame = simulation.frame();
            near("v1'", frame.velocity[0].x, v - impulse / m, 1e-13 * v);
            let center = 0.5 * (frame.velocity[1] + frame.velocity[2]);
            close("v_cm", center.x, impulse / (2.0 * m), 1e-13);
            near("v_cm across", center.y, 0.0, 1e-14 * v);
            let arm = frame.position[2] - frame.position[1];
            let spin = arm.cross(frame.velocity[2] - frame.velocity[1]).z / (length * length);
            near("ω", spin.abs(), impulse * theta.sin() / (m * length), 1e-12 * v / length);
            // Energy is conserved, and so are momentum and angular momentum (2.25), (2.26) of all three.
            assert!(simulation.ledger().residual.abs() < 1e-15);
            let momentum: DVec3 = frame.velocity.iter().map(|w| *w * m).sum();
            near("momentum", (momentum - DVec3::X * m * v).length(), 0.0, 1e-15 * m * v * 4.0);
            let moment: DVec3 =
                frame.position.iter().zip(&frame.velocity).map(|(x, w)| x.cross(*w * m)).sum();
            near("angular momentum", moment.length(), 0.0, 1e-14 * m * v * length.max(1.0));
        }
    }
}

#[test]
fn problem_2_2_and_oblique_wall_impacts_follow_the_closed_form() {
    // Problem 2.2.
    let mut scene = Scene::new(0.5);
    scene.particle([-30.5, -10.0, 0.0], [30.0, 10.0, 0.0], 1.0, 0.5);
    scene.particle([10.5, 30.0, 0.0], [-10.0, -30.0, 0.0], 1.0, 0.5);
    let mut simulation = scene.start();
    run(&mut simulation, 1.0 + 1e-9);
    let frame = simulation.frame();
    near("w1'", (frame.velocity[0] - DVec3::new(0.0, 10.0, 0.0)).length(), 0.0, 1e-12);
    near("w2'", (frame.velocity[1] - DVec3::new(20.0, -30.0, 0.0)).length(), 0.0, 1e-12);
    // (2.21), (2.22) over e and α.
    for e in [0.0, 0.2, 0.9, 1.0] {
        for alpha in [0.0_f64, 0.3, 1.2] {
            let mut scene = Scene::new(e);
            scene.wall([0.0; 3], [0.0, 0.0, 1.0]);
            scene.particle([0.0, 0.0, 1.1], [alpha.sin(), 0.0, -alpha.cos()], 3.0, 0.1);
            let mut simulation = scene.start();
            let log = run(&mut simulation, 1.0 / alpha.cos() + 1.0);
            assert_eq!(log.of(EventKind::Wall).len(), 1);
            let v = simulation.frame().velocity[0];
            near("speed", v.length(), (alpha.sin().powi(2) + (e * alpha.cos()).powi(2)).sqrt(), 1e-14);
            near("loss", log.0[0].energy_loss, 1.5 * (1.0 - e * e) * alpha.cos().powi(2), 1e-13);
        }
    }
}

#[test]
fn problem_2_1_a_bouncing_sphere_comes_to_rest_in_finite_time() {
    for e in [0.0, 0.1, 0.5, 0.9] {
        for (height, g, radius) in [(1.0, G, 0.1), (30.0, 1.6, 0.5), (1e-3, 274.0, 0.01)] {
            let mut scene = Scene::new(e);
            scene.gravity = down(g);
            scene.wall([0.0; 3], [0.0, 0.0, 1.0]);
            scene.particle([0.0, 0.0, height + radius], [0.0; 3], 2.0, radius);
            let mut simulation = scene.start();
            let first = (2.0 * height / g).sqrt();
            let rest = first * (1.0 + e) / (1.0 - e);
            for k in 1..4 {
                // Top of the k-th bounce.
                let e_k = |k: i32| if k == 0 { 1.0 } else { e.powi(k) };
                let top = first * (1.0 + 2.0 * (1..k).map(e_k).sum::<f64>() + e_k(k));
                run(&mut simulation, top);
                let found = simulation.frame().position[0].z - radius;
                near("H_k", found, e.powi(2 * k) * height, 1e-12 * height);
            }
            let log = run(&mut simulation, rest * 2.0);
            assert_eq!(simulation.flight_of(0), Some("rest"));
            if e > 0.0 {
                let end = log.0.last().expect("the event log is not empty");
                assert_eq!(end.kind, EventKind::Rest);
                close("time of rest", end.time, rest, 1e-12);
            }
            let ledger = simulation.ledger();
            close("all energy is dissipated", ledger.dissipated, 2.0 * g * height, 1e-12);
            assert!(ledger.residual.abs() < 1e-14, "{ledger:?}");
        }
    }
}

#[test]
fn newtons_cradle_of_five_raises_as_many_balls_as_were_released() {
    for swung in 1..5 {
        for tether in [Tether::String, Tether::Rod] {
            let (radius, length, alpha) = (0.05, 1.0, 0.6_f64);
            let mut scene = Scene::new(1.0);
            scene.gravity = down(G);
            for k in 0..5 {
                let pivot = DVec3::new(2.0 * radius * f64::from(k), 0.0, 0.0);
                let angle = if k < swung { alpha } else { 0.0 };
                let bob = pivot + DVec3::new(-angle.sin(), 0.0, -angle.cos()) * length;
                let bob = scene.particle(bob.to_array(), [0.0; 3], 1.0, radius);
                scene.pendulum(pivot, length, bob, tether);
            }
            let mut simulation = scene.start();
            let quarter = (length / G).sqrt() * complete_elliptic_integral((0.5 * alpha).cos().powi(2));
            // As many move out on the other side, to the same height, and back again.
            for (half, mirrored) in [(2.0, true), (4.0, false), (6.0, true)] {
                run(&mut simulation, half * quarter);
                let frame = simulation.frame();
                for k in 0..5 {
                    let out = if mirrored { k >= 5 - swung as usize } else { k < swung as usize };
                    let height = length + frame.position[k].z;
                    let expected = if out { length * (1.0 - alpha.cos()) } else { 0.0 };
                    near(&format!("height of {k} of {swung} after {half} quarters"), height, expected, 1e-12);
                }
            }
            assert!(simulation.ledger().residual.abs() < 1e-14);
        }
    }
}

#[test]
fn direct_central_impacts_of_free_spheres_follow_the_closed_form() {
    for (m1, m2) in [(1.0, 1.0), (1000.0, 1.0), (1.0, 1e6)] {
        for e in [0.0, 0.4, 1.0] {
            let mut scene = Scene::new(e);
            scene.particle([-1.2, 0.0, 0.0], [2.0, 0.0, 0.0], m1, 0.1);
            scene.particle([0.0; 3], [0.0; 3], m2, 0.1);
            let mut simulation = scene.start();
            let log = run(&mut simulation, 3.0);
            let hit = log.of(EventKind::Collision)[0];
            near("loss", hit.energy_loss, 0.5 * m1 * 4.0 * (1.0 - e * e) / (1.0 + m1 / m2), 1e-12 * m1);
            let frame = simulation.frame();
            close("v2'", frame.velocity[1].x, (1.0 + e) * 2.0 * m1 / (m1 + m2), 1e-13);
            let sample = simulation.sample();
            near(
                "momentum",
                (sample.momentum - sample.external_impulse - DVec3::X * 2.0 * m1).length(),
                0.0,
                1e-12 * m1,
            );
        }
    }
}
