//! Flights beyond the chapter: strings that go slack, rotation, coupled linkages, contacts that slide and
//! open.

use glam::DVec3;
use haff_engine::{EventKind, Silent, Until};
use haff_linkage::{SpringEnd, Tether, complete_elliptic_integral};

use crate::common::{self, Scene, close, near, run};

const G: f64 = 9.81;

fn single(angle: f64, speed: f64, tether: Tether) -> Scene {
    let mut scene = Scene::new(0.5);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    let position = DVec3::new(angle.sin(), 0.0, -angle.cos());
    let velocity = DVec3::new(angle.cos(), 0.0, angle.sin()) * speed;
    let bob = scene.particle(position.to_array(), velocity.to_array(), 1.5, 0.1);
    scene.pendulum(DVec3::ZERO, 1.0, bob, tether);
    scene
}

#[test]
fn a_string_goes_slack_at_zero_tension_and_loses_the_radial_velocity_when_taut() {
    // From the bottom with v² between 2gl and 5gl it leaves the circle at cos θ = −(v²/gl − 2)/3 and follows
    // a parabola.
    for ratio in [2.1_f64, 3.0, 4.0, 4.9] {
        let v = (ratio * G).sqrt();
        let mut simulation = single(0.0, v, Tether::String).start();
        let log = run(&mut simulation, 3.0);
        let slack = log.of(EventKind::Slack)[0];
        let up = (ratio - 2.0) / 3.0;
        // The state at that time.
        let mut again = single(0.0, v, Tether::String).start();
        run(&mut again, slack.time);
        let frame = again.frame();
        near("height", frame.position[0].z, up, 1e-12);
        close("speed² = g l up", frame.velocity[0].length_squared(), G * up, 1e-11);
        // Intersection of parabola and circle, by independent bisection.
        let (x, w) = (frame.position[0], frame.velocity[0]);
        let at = |t: f64| x + w * t - DVec3::Z * (0.5 * G * t * t);
        let outside = |t: f64| at(t).length_squared() - 1.0;
        let (mut low, mut high) = (1e-3, 1e-3);
        while outside(high) < 0.0 {
            high += 1e-3;
        }
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if outside(middle) < 0.0 { low = middle } else { high = middle }
        }
        let catch = log.of(EventKind::Taut)[0];
        close("taut", catch.time - slack.time, high, 1e-10);
        let velocity = w - DVec3::Z * (G * high);
        let radial = velocity.dot(at(high));
        close("radial speed", catch.approach_speed, radial, 1e-9);
        close("loss", catch.energy_loss, 0.75 * radial * radial, 1e-9);
        assert_eq!(catch.energy_loss, catch.carnot_energy);
        assert!(simulation.ledger().residual.abs() < 1e-13, "{:?}", simulation.ledger());
        // A rod carries the opposite force.
        let mut rod = single(0.0, v, Tether::Rod).start();
        assert!(run(&mut rod, 3.0).0.is_empty());
    }
    // Above 5gl it rotates; below 2gl it swings.
    for ratio in [5.001_f64, 30.0, 1.999, 0.3] {
        let mut simulation = single(0.0, (ratio * G).sqrt(), Tether::String).start();
        assert!(run(&mut simulation, 20.0).0.is_empty());
        assert!(simulation.ledger().residual.abs() < 1e-14);
    }
}

#[test]
fn period_of_full_rotation_is_that_of_the_elliptic_integral() {
    // T = 2 K(1/m)/(√m ω₀) for a whole turn, m = v²/(4 g l) > 1.
    for m in [1.000_001_f64, 1.5, 40.0] {
        let v = (4.0 * G * m).sqrt();
        let mut simulation = single(0.0, v, Tether::Rod).start();
        let period = 2.0 * complete_elliptic_integral(1.0 - 1.0 / m) / (m * G).sqrt();
        run(&mut simulation, 7.0 * period);
        let frame = simulation.frame();
        near("back at the bottom", frame.position[0].x, 0.0, 1e-12 * v * period / (1.0 - 1.0 / m).sqrt());
        close("speed", frame.velocity[0].x, v, 1e-12);
    }
}

#[test]
fn a_body_leaves_a_fixed_sphere_at_two_thirds_of_its_height() {
    let mut scene = Scene::new(0.0);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    scene.particle([0.0; 3], [0.0; 3], f64::INFINITY, 0.9);
    let start = 0.05_f64;
    scene.particle([start.sin(), 0.0, start.cos()], [0.0; 3], 2.0, 0.1);
    let mut simulation = scene.start();
    assert!(simulation.in_contact(0, 1));
    let log = run(&mut simulation, 10.0);
    let release = log.of(EventKind::Release)[0];
    let mut again = scene.start();
    run(&mut again, release.time);
    close("height of leaving", again.frame().position[1].z, 2.0 / 3.0 * start.cos(), 1e-11);
    assert!(simulation.ledger().residual.abs() < 1e-13);
}

/// Fourth-order Runge–Kutta with many steps, the independent reference of all numerical motions here.
fn rk4(state: &mut [f64], time: f64, steps: usize, f: impl Fn(&[f64]) -> Vec<f64>) {
    let h = time / steps as f64;
    let at = |y: &[f64], k: &[f64], s: f64| -> Vec<f64> { y.iter().zip(k).map(|(y, k)| y + s * k).collect() };
    for _ in 0..steps {
        let a = f(state);
        let b = f(&at(state, &a, 0.5 * h));
        let c = f(&at(state, &b, 0.5 * h));
        let d = f(&at(state, &c, h));
        for i in 0..state.len() {
            state[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
        }
    }
}

#[test]
fn a_spring_pendulum_agrees_with_an_independent_integration() {
    let mut scene = Scene::new(0.5);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    let bob = scene.particle([0.8, 0.0, -0.3], [0.1, 0.5, 0.0], 0.7, 0.05);
    scene.spring(SpringEnd::Point(DVec3::ZERO), SpringEnd::Particle(bob), 60.0, 0.6);
    let mut simulation = scene.start();
    run(&mut simulation, 3.0);
    assert_eq!(simulation.flight_of(bob), Some("numerical"));
    let mut y = vec![0.8, 0.0, -0.3, 0.1, 0.5, 0.0];
    rk4(&mut y, 3.0, 60_000, |y| {
        let r = DVec3::new(y[0], y[1], y[2]);
        let a = -r * (60.0 / 0.7 * (1.0 - 0.6 / r.length())) - DVec3::Z * G;
        vec![y[3], y[4], y[5], a.x, a.y, a.z]
    });
    let frame = simulation.frame();
    let expected = DVec3::new(y[0], y[1], y[2]);
    near("position", (frame.position[0] - expected).length(), 0.0, 2e-12);
    near("ledger", simulation.ledger().residual, 0.0, 1e-12);
    run(&mut simulation, 200.0);
    near("ledger after 200", simulation.ledger().residual, 0.0, 1e-11);
}

#[test]
fn a_double_pendulum_agrees_with_its_equations_in_angles() {
    let mut scene = Scene::new(0.5);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    let (a0, b0) = (1.0_f64, 0.4_f64);
    let first = DVec3::new(a0.sin(), 0.0, -a0.cos());
    let second = first + DVec3::new(b0.sin(), 0.0, -b0.cos()) * 0.8;
    let a = scene.particle(first.to_array(), [0.0; 3], 1.0, 0.01);
    let b = scene.particle(second.to_array(), [0.0; 3], 0.5, 0.01);
    scene.pendulum(DVec3::ZERO, 1.0, a, Tether::Rod);
    scene.rod(a, b, 0.8);
    let mut simulation = scene.start();
    run(&mut simulation, 3.0);
    let mut y = vec![a0, b0, 0.0, 0.0];
    let (m1, m2, l1, l2) = (1.0, 0.5, 1.0, 0.8);
    rk4(&mut y, 3.0, 40_000, |y| {
        let (d, w1, w2) = (y[0] - y[1], y[2], y[3]);
        // The equations of motion: (m1 + m2) l1 α1 + m2 l2 α2 cos d = −m2 l2 w2² sin d − (m1 + m2) g sin θ1,
        // and l1 α1 cos d + l2 α2 = l1 w1² sin d − g sin θ2.
        let (c, s) = (d.cos(), d.sin());
        let p = -m2 * l2 * w2 * w2 * s - (m1 + m2) * G * y[0].sin();
        let q = l1 * w1 * w1 * s - G * y[1].sin();
        let alpha1 = (p - m2 * c * q) / (l1 * (m1 + m2 - m2 * c * c));
        let alpha2 = (q - l1 * c * alpha1) / l2;
        vec![w1, w2, alpha1, alpha2]
    });
    let frame = simulation.frame();
    near("first", frame.position[0].x, y[0].sin(), 1e-10);
    near("second", frame.position[1].x - frame.position[0].x, 0.8 * y[1].sin(), 1e-10);
    close("length", (frame.position[1] - frame.position[0]).length(), 0.8, 1e-13);
    near("ledger", simulation.ledger().residual, 0.0, 1e-12);
}

#[test]
fn a_numerical_pendulum_agrees_with_the_closed_form() {
    // An almost planar swing is integrated numerically; its motion in the plane is that of the closed form.
    let mut closed = single(2.0, 0.0, Tether::Rod).start();
    let mut scene = single(2.0, 0.0, Tether::Rod);
    scene.particles[0].1.y = 1e-9;
    let mut numeric = scene.start();
    run(&mut closed, 5.0);
    run(&mut numeric, 5.0);
    assert_eq!((closed.flight_of(0), numeric.flight_of(0)), (Some("pendulum"), Some("numerical")));
    let difference = closed.frame().position[0] - numeric.frame().position[0];
    near("in the plane", difference.x.hypot(difference.z), 0.0, 1e-11);
}

#[test]
fn springs_on_a_line_in_gravity_follow_their_normal_modes() {
    // A mass hung on a spring: z = −(mg/k)(1 − cos ωt) below its natural length.
    let mut scene = Scene::new(0.5);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    let a = scene.particle([0.3, 0.0, -1.0], [0.0; 3], 0.4, 0.05);
    scene.spring(SpringEnd::Point(DVec3::new(0.3, 0.0, 0.0)), SpringEnd::Particle(a), 80.0, 1.0);
    // And two in free fall with a spring between them, one with an initial velocity.
    let b = scene.particle([5.0, 0.0, 0.0], [0.0, 0.0, 1.0], 1.0, 0.05);
    let c = scene.particle([5.0, 0.0, 1.5], [0.0; 3], 3.0, 0.05);
    scene.spring(SpringEnd::Particle(b), SpringEnd::Particle(c), 25.0, 1.5);
    let mut simulation = scene.start();
    for t in [0.01, 0.5, 1.0, 17.0] {
        run(&mut simulation, t);
        let frame = simulation.frame();
        let omega = (80.0_f64 / 0.4).sqrt();
        near("hung", frame.position[a].z, -1.0 - 0.4 * G / 80.0 * (1.0 - (omega * t).cos()), 1e-13);
        let center = (frame.position[b] + frame.position[c] * 3.0).z / 4.0;
        near("center falls", center, 1.5 * 0.75 + 0.25 * t - 0.5 * G * t * t, 1e-13 * G * t * t + 1e-14);
        let beat = (25.0_f64 / 0.75).sqrt();
        let stretch = frame.position[c].z - frame.position[b].z - 1.5;
        near("stretch", stretch, -(beat * t).sin() / beat, 1e-12 * (1.0 + t));
    }
    assert_eq!(simulation.flight_of(a), Some("normal modes"));
    assert_eq!(simulation.flight_of(b), Some("normal modes"));
}

#[test]
fn a_spring_whose_ends_pass_through_each_other_reverses() {
    // One mass on a spring to a point, moving through the point: the force is k(|x| − l) on both sides.
    let mut scene = Scene::new(0.5);
    let a = scene.particle([-1.0, 0.0, 0.0], [20.0, 0.0, 0.0], 1.0, 0.05);
    scene.spring(SpringEnd::Point(DVec3::ZERO), SpringEnd::Particle(a), 30.0, 1.0);
    let mut simulation = scene.start();
    let mut y = vec![-1.0, 20.0];
    run(&mut simulation, 1.0);
    rk4(&mut y, 1.0, 400_000, |y| vec![y[1], -30.0 * (y[0].abs() - 1.0) * y[0].signum()]);
    near("position", simulation.frame().position[0].x, y[0], 1e-4);
    run(&mut simulation, 40.0);
    assert!(simulation.ledger().residual.abs() < 1e-13, "{:?}", simulation.ledger());
    // By symmetry the extremes are equal on both sides: ½ 400 + 0 = ½ 30 (x − 1)².
    let reach = 1.0 + (400.0_f64 / 30.0).sqrt();
    let mut farthest = 0.0_f64;
    for k in 0..20_000 {
        run(&mut simulation, 40.0 + 1e-3 * f64::from(k));
        farthest = farthest.max(simulation.frame().position[0].x.abs());
    }
    near("reach", farthest, reach, 1e-4);
}

#[test]
fn a_spinning_rod_bouncing_on_a_floor_conserves_energy_and_length() {
    let mut scene = Scene::new(1.0);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    scene.wall([0.0; 3], [0.0, 0.0, 1.0]);
    let a = scene.particle([0.0, 0.0, 2.0], [0.5, 0.0, 3.0], 1.0, 0.1);
    let b = scene.particle([1.0, 0.0, 2.0], [0.5, 0.0, -2.0], 2.5, 0.1);
    scene.rod(a, b, 1.0);
    let mut simulation = scene.start();
    let log = run(&mut simulation, 100.0);
    assert!(log.of(EventKind::Wall).len() > 50, "{}", log.0.len());
    assert!(log.0.iter().all(|event| event.approach_speed > 0.0));
    assert!(simulation.ledger().residual.abs() < 1e-13, "{:?}", simulation.ledger());
    let frame = simulation.frame();
    close("length", (frame.position[0] - frame.position[1]).length(), 1.0, 1e-13);
    // No end is below the floor, at any time.
    let mut again = scene.start();
    for k in 0..5000 {
        run(&mut again, 0.01 * f64::from(k));
        assert!(again.frame().position.iter().all(|x| x.z > 0.1 - 1e-12));
    }
    assert_eq!(again.flight_of(a), Some("rod"));
}

#[test]
fn energy_momentum_and_angular_momentum_balance_over_many_events() {
    // Pendulums, a rod and free spheres in a box, elastic: 10⁴ events and more, mostly closed forms.
    let mut scene = Scene::new(1.0);
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut point = [0.0; 3];
            let mut normal = [0.0; 3];
            point[axis] = 3.0 * side;
            normal[axis] = -side;
            scene.wall(point, normal);
        }
    }
    let a = scene.particle([1.0, 0.2, 0.0], [0.0, 0.0, 7.0], 1.0, 0.2);
    scene.pendulum(DVec3::new(0.0, 0.2, 0.0), 1.0, a, Tether::Rod);
    let b = scene.particle([-1.5, -1.0, 0.1], [3.0, 1.0, -2.0], 0.5, 0.3);
    let c = scene.particle([-0.5, -1.0, 0.1], [3.0, 4.0, 1.0], 0.8, 0.3);
    scene.rod(b, c, 1.0);
    scene.particle([2.0, 2.0, 2.0], [-9.0, 4.0, 5.0], 0.7, 0.4);
    scene.particle([-2.0, 2.0, 2.0], [2.0, -8.0, 3.0], 1.7, 0.5);
    let mut simulation = scene.start();
    let start = simulation.sample();
    let log = run(&mut simulation, 1300.0);
    assert!(log.0.len() > 10_000, "{}", log.0.len());
    let ledger = simulation.ledger();
    assert!(ledger.residual.abs() < 1e-13, "{ledger:?}");
    let sample = simulation.sample();
    let (impulse, moment) = simulation.external_impulse();
    let scale = log.0.iter().map(|event| event.impulse).sum::<f64>();
    near("(2.25)", (sample.momentum - start.momentum - impulse).length(), 0.0, 1e-14 * scale);
    let gained = sample.angular_momentum.unwrap() - start.angular_momentum.unwrap();
    near("(2.26)", (gained - moment).length(), 0.0, 1e-14 * scale * 5.0);
}

#[test]
fn a_run_continues_from_a_checkpoint_with_the_same_bits() {
    let mut scene = Scene::new(0.8);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    scene.wall([0.0, 0.0, -2.0], [0.1, 0.0, 1.0]);
    let a = scene.particle([1.0, 0.0, 0.0], [0.0, 0.0, 0.0], 1.0, 0.2);
    scene.pendulum(DVec3::ZERO, 1.0, a, Tether::String);
    let b = scene.particle([-0.5, 0.0, -1.0], [0.0; 3], 0.5, 0.2);
    let c = scene.particle([-0.5, 0.4, -1.6], [0.0; 3], 0.5, 0.2);
    scene.spring(SpringEnd::Particle(b), SpringEnd::Particle(c), 90.0, 0.7);
    scene.spring(SpringEnd::Particle(b), SpringEnd::Point(DVec3::new(-0.5, 0.0, 0.5)), 40.0, 1.2);
    let d = scene.particle([0.1, 0.0, 1.0], [0.0; 3], 0.3, 0.1);
    scene.joints.sticking.push([a as u32, d as u32]);
    let mut through = scene.start();
    let reference = run(&mut through, 6.0);
    assert!(reference.0.len() > 10, "{}", reference.0.len());
    let mut simulation = scene.start();
    let mut log = common::Log::default();
    for k in 1..=40 {
        log.0.extend(run(&mut simulation, 0.15 * f64::from(k)).0);
        let (system, joints) = scene.build();
        let checkpoint = simulation.checkpoint();
        simulation = haff_linkage::Simulation::restore(system, joints, &checkpoint).expect("its own");
        assert_eq!(simulation.checkpoint(), checkpoint);
    }
    // Intermediate frames were not at the same times; the last one is.
    run(&mut through, 6.0);
    run(&mut simulation, 6.0);
    assert_eq!(through.state_hash(), simulation.state_hash());
    assert_eq!(reference.0, log.0);
    assert_eq!(through.ledger(), simulation.ledger());
}

/// A search covers a few timescales at a time. A resumed run has to begin its parts where the others have
/// begun, or contacts have other last bits.
#[test]
fn long_searches_go_on_after_checkpoints_with_the_same_bits() {
    let mut scene = Scene::new(0.9999);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    let a = scene.particle([0.0, 0.0, -1.0], [0.0; 3], 1.0, 0.1);
    scene.pendulum(DVec3::ZERO, 1.0, a, Tether::String);
    let b = scene.particle([0.22 + 0.6, 0.0, -0.8], [0.0; 3], 0.5, 0.1);
    scene.pendulum(DVec3::new(0.22, 0.0, 0.0), 1.0, b, Tether::String);
    let mut through = scene.start();
    let mut simulation = scene.start();
    for k in 1..=400 {
        let time = 0.37 * f64::from(k);
        run(&mut through, time);
        run(&mut simulation, time);
        let (system, joints) = scene.build();
        simulation =
            haff_linkage::Simulation::restore(system, joints, &simulation.checkpoint()).expect("its own");
        assert_eq!(through.state_hash(), simulation.state_hash(), "t = {time}");
    }
    assert!(through.counters().collisions > 100, "{:?}", through.counters());
}

#[test]
fn stacked_spheres_on_a_floor_come_to_rest() {
    let mut scene = Scene::new(0.6);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    scene.wall([0.0; 3], [0.0, 0.0, 1.0]);
    for k in 0..3 {
        scene.particle([0.0, 0.0, 0.1 + 0.35 * f64::from(k)], [0.0; 3], 1.0, 0.1);
    }
    let mut simulation = scene.start();
    let stop = simulation
        .advance(Until { time: 60.0, entries: 20_000, ..Until::default() }, &mut Silent)
        .expect("comes to rest");
    let frame = simulation.frame();
    for k in 0..3 {
        near("height", frame.position[k].z, 0.1 + 0.2 * k as f64, 1e-10);
        near("speed", frame.velocity[k].length(), 0.0, 1e-12);
    }
    assert_eq!(stop, haff_engine::Stop::Rest);
    assert!(simulation.ledger().residual.abs() < 1e-13, "{:?}", simulation.ledger());
}

#[test]
fn a_rising_floor_carries_a_body_at_rest_and_does_the_work() {
    let mut scene = Scene::new(0.0);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    let floor = scene.wall([0.0; 3], [0.0, 0.0, 1.0]);
    scene.walls[floor].motion = (DVec3::Z * 2.0).into();
    scene.particle([0.0, 0.0, 0.1], [1.0, 0.0, 2.0], 3.0, 0.1);
    let mut simulation = scene.start();
    run(&mut simulation, 5.0);
    near("height", simulation.frame().position[0].z, 10.1, 1e-13);
    close("work", simulation.ledger().term(haff_engine::Term::WallWork), 3.0 * G * 10.0, 1e-13);
    assert!(simulation.ledger().residual.abs() < 1e-14);
}

#[test]
fn a_contact_that_opens_closes_again() {
    // A mass on a floor, another above it on a spring, compressed so far that its rebound lifts the first.
    let (k, natural, amplitude) = (400.0, 1.0, 0.08);
    let mut scene = Scene::new(0.0);
    scene.gravity = DVec3::new(0.0, 0.0, -G);
    scene.wall([0.0; 3], [0.0, 0.0, 1.0]);
    let low = scene.particle([0.0, 0.0, 0.1], [0.0; 3], 1.0, 0.1);
    let high = scene.particle([0.0, 0.0, 0.1 + natural - G / k - amplitude], [0.0; 3], 1.0, 0.1);
    scene.spring(SpringEnd::Particle(low), SpringEnd::Particle(high), k, natural);
    let mut simulation = scene.start();
    // It lifts where the force of the spring equals the weight: compression G/k + A cos ωt = −G/k.
    let omega = k.sqrt();
    let phase = (-2.0 * G / (k * amplitude)).acos();
    let lift = phase / omega;
    let log = run(&mut simulation, lift * (1.0 + 1e-9));
    assert_eq!(log.0.len(), 1);
    assert_eq!(log.0[0].kind, EventKind::Lift);
    close("lifts", log.0[0].time, lift, 1e-12);
    // Then the center of mass moves at half of the speed, and the stretch oscillates about 0 at √(2k/m).
    let (speed, fast) = (amplitude * omega * phase.sin(), (2.0 * k).sqrt());
    let stretch = |t: f64| G / k * (fast * t).cos() + speed / fast * (fast * t).sin();
    let height = |t: f64| 0.5 * speed * t - 0.5 * G * t * t - 0.5 * (stretch(t) - G / k);
    let mut apart = 0.01;
    while height(apart) > 0.0 {
        apart += 1e-3;
    }
    let (mut early, mut late) = (apart - 1e-3, apart);
    for _ in 0..100 {
        let middle = 0.5 * (early + late);
        if height(middle) > 0.0 { early = middle } else { late = middle }
    }
    let log = run(&mut simulation, lift + early + 1e-4);
    assert_eq!(log.of(EventKind::Wall).len(), 1, "{:?}", log.0);
    close("lands", log.0[0].time, lift + early, 1e-11);
    assert_eq!(log.0[0].energy_loss, log.0[0].carnot_energy);
    // Closed: it stays on the floor as long as it is pressed.
    near("down", simulation.frame().position[low].z, 0.1, 1e-14);
    near("at rest", simulation.frame().velocity[low].length(), 0.0, 1e-14);
    run(&mut simulation, 60.0);
    near("ledger", simulation.ledger().residual, 0.0, 1e-13);
}
