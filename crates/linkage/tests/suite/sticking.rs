//! Particles that stick to bodies of infinite mass and walls that move: they are carried, and the carrier
//! does the work.

use glam::DVec3;
use haff_engine::{EventKind, EventRecord};
use haff_linkage::{LinkageError, Simulation, SpringEnd, Tether};

use crate::common::{Scene, close, near, run};

const G: f64 = 9.81;

fn falling() -> Scene {
    let mut scene = Scene::new(0.5);
    scene.gravity = -DVec3::Z * G;
    scene
}

/// Time in which a falling body closes a gap, with this initial closing speed.
fn contact_time(gap: f64, closing: f64) -> f64 {
    2.0 * gap / (closing + (closing * closing + 2.0 * G * gap).sqrt())
}

#[test]
fn a_driven_sphere_carries_a_particle_that_sticks_to_it() {
    for (m, lift) in [(2.0, 1.5), (0.3, -0.7), (40.0, 0.0)] {
        let mut scene = falling();
        let driver = scene.particle([0.0; 3], [0.4, 0.0, lift], f64::INFINITY, 0.3);
        let ball = scene.particle([0.0, 0.0, 1.5], [0.4, 0.0, -2.0], m, 0.2);
        scene.joints.sticking.push([driver as u32, ball as u32]);
        let mut simulation = scene.start();
        let hit = contact_time(1.0, 2.0 + lift);
        let log = run(&mut simulation, 3.0);
        let stick = log.of(EventKind::Stick);
        assert_eq!(log.0.len(), 1, "{:?}", log.0);
        close("time", stick[0].time, hit, 1e-13);
        let approach = 2.0 + G * hit + lift;
        close("approach", stick[0].approach_speed, approach, 1e-13);
        close("impulse", stick[0].impulse, m * approach, 1e-13);
        close("loss", stick[0].energy_loss, 0.5 * m * approach * approach, 1e-13);
        assert_eq!(stick[0].energy_loss, stick[0].carnot_energy);
        let frame = simulation.frame();
        near(
            "driver",
            (frame.position[driver] - DVec3::new(1.2, 0.0, 3.0 * lift)).length(),
            0.0,
            1e-14 * 10.0,
        );
        let seat = frame.position[ball] - frame.position[driver];
        near("it is carried on top", (seat - DVec3::Z * 0.5).length(), 0.0, 1e-13);
        // Work of the impact and of the weight: J V + m g V t.
        let work = m * approach * lift + m * G * lift * (3.0 - hit);
        near(
            "work",
            simulation.ledger().term(haff_engine::Term::WallWork),
            work,
            1e-13 * m * approach * approach,
        );
        assert!(simulation.ledger().residual.abs() < 1e-14, "{:?}", simulation.ledger());
        let (impulse, _) = simulation.external_impulse();
        near("(2.25)", (impulse - DVec3::Z * (m * (lift + 2.0))).length(), 0.0, 1e-12 * m);
    }
}

#[test]
fn a_driven_sphere_keeps_its_velocity_in_an_impact() {
    let mut scene = Scene::new(1.0);
    scene.particle([0.0; 3], [1.0, 0.0, 0.0], f64::INFINITY, 0.5);
    scene.particle([2.0, 0.0, 0.0], [0.0; 3], 1.0, 0.5);
    scene.particle([5.0, 3.0, 0.0], [0.0, -0.5, 0.0], 1.0, 0.5);
    scene.spring(SpringEnd::Particle(2), SpringEnd::Point(DVec3::new(50.0, 50.0, 50.0)), 1e-30, 0.0);
    let mut simulation = scene.start();
    let log = run(&mut simulation, 4.0);
    close("hit", log.0[0].time, 1.0, 1e-14);
    let frame = simulation.frame();
    near("driver", frame.position[0].x, 4.0, 1e-14);
    near("leaves at twice its speed", frame.velocity[1].x, 2.0, 1e-14);
}

#[test]
fn a_moving_wall_carries_a_particle_that_sticks_to_it() {
    for lift in [0.8, 0.0, -1.1] {
        let m = 1.7;
        let mut scene = falling();
        let floor = scene.wall([0.0; 3], [0.0, 0.0, 1.0]);
        scene.walls[floor].motion = (DVec3::new(-0.3, 0.0, lift)).into();
        let ball = scene.particle([0.0, 0.0, 1.1], [0.5, 0.0, 0.0], m, 0.1);
        scene.joints.sticking_to_walls.push([ball as u32, floor as u32]);
        let mut simulation = scene.start();
        let hit = contact_time(1.0, lift);
        let log = run(&mut simulation, 2.0);
        assert_eq!(log.0.len(), 1);
        assert_eq!(log.0[0].kind, EventKind::Wall);
        close("time", log.0[0].time, hit, 1e-13);
        let lost = DVec3::new(-0.8, 0.0, lift + G * hit);
        close("approach", log.0[0].approach_speed, lost.z, 1e-13);
        close("impulse", log.0[0].impulse, m * lost.length(), 1e-13);
        close("loss", log.0[0].energy_loss, 0.5 * m * lost.length_squared(), 1e-13);
        let frame = simulation.frame();
        near(
            "it moves with the wall",
            (frame.velocity[ball] - scene.walls[floor].motion.velocity(DVec3::Z, haff_engine::Instant::ZERO))
                .length(),
            0.0,
            0.0,
        );
        near("height", frame.position[ball].z, 0.1 + 2.0 * lift, 1e-13);
        near("along", frame.position[ball].x, 0.5 * hit - 0.3 * (2.0 - hit), 1e-13);
        let work = m * lost.dot(scene.walls[floor].motion.velocity(DVec3::Z, haff_engine::Instant::ZERO))
            + m * G * lift * (2.0 - hit);
        near("work", simulation.ledger().term(haff_engine::Term::WallWork), work, 1e-12);
        assert!(simulation.ledger().residual.abs() < 1e-14, "{:?}", simulation.ledger());
    }
}

/// A dumbbell on a spring moves towards a moving wall; its first body sticks to it.
fn spring_on_a_wall() -> (Scene, f64) {
    let mut scene = Scene::new(0.5);
    let wall = scene.wall([0.0; 3], [-1.0, 0.0, 0.0]);
    scene.walls[wall].motion = (DVec3::X * -0.5).into();
    let a = scene.particle([-1.1, 0.0, 0.0], [1.0, 0.0, 0.0], 1.0, 0.1);
    let b = scene.particle([-3.1, 0.0, 0.0], [1.0, 0.0, 0.0], 2.0, 0.1);
    scene.spring(SpringEnd::Particle(a), SpringEnd::Particle(b), 18.0, 2.0);
    scene.joints.sticking_to_walls.push([a as u32, wall as u32]);
    (scene, 1.0 / 1.5)
}

#[test]
fn a_spring_oscillates_on_a_body_that_sticks_to_a_wall() {
    let (scene, hit) = spring_on_a_wall();
    let mut simulation = scene.start();
    for t in [0.3, 1.0, 7.0] {
        let log = run(&mut simulation, hit + t);
        assert!(log.0.len() <= 1);
        let frame = simulation.frame();
        near("sticks", frame.position[0].x, -0.1 - 0.5 * (hit + t), 1e-13);
        // In the frame of the wall: a mass of 2 on k = 18, ω = 3, with the initial speed 1.5.
        let stretch = frame.position[0].x - frame.position[1].x - 2.0;
        near("stretch", stretch, -0.5 * (3.0 * t).sin(), 1e-12);
        assert!(simulation.ledger().residual.abs() < 1e-12, "{:?}", simulation.ledger());
    }
}

#[test]
fn a_body_that_sticks_to_a_wall_is_restored_from_a_checkpoint() {
    let (scene, hit) = spring_on_a_wall();
    let mut through = scene.start();
    run(&mut through, hit + 3.0);
    let mut simulation = scene.start();
    for t in [0.5 * hit, hit + 0.1, hit + 1.5] {
        run(&mut simulation, t);
        let (system, joints) = scene.build();
        simulation = Simulation::restore(system, joints, &simulation.checkpoint()).expect("its own");
    }
    run(&mut simulation, hit + 3.0);
    assert_eq!(simulation.state_hash(), through.state_hash());
    assert_eq!(simulation.ledger(), through.ledger());
}

#[test]
fn a_pendulum_stops_at_a_wall_that_it_sticks_to() {
    let mut scene = falling();
    let wall = scene.wall([0.1, 0.0, 0.0], [-1.0, 0.0, 0.0]);
    let bob = scene.particle([-1.0, 0.0, 0.0], [0.0; 3], 1.0, 0.1);
    scene.pendulum(DVec3::ZERO, 1.0, bob, Tether::Rod);
    scene.joints.sticking_to_walls.push([bob as u32, wall as u32]);
    let mut simulation = scene.start();
    let log = run(&mut simulation, 5.0);
    assert_eq!(log.0.len(), 1);
    // The potential energy of a fall of one length.
    close("loss", log.0[0].energy_loss, G, 1e-12);
    let frame = simulation.frame();
    near("it hangs", (frame.position[bob] + DVec3::Z).length(), 0.0, 1e-12);
    near("at rest", frame.velocity[bob].length(), 0.0, 0.0);
}

#[test]
fn particles_with_fixed_joints_must_not_stick_to_moving_walls() {
    let mut scene = falling();
    let wall = scene.wall([2.0, 0.0, 0.0], [-1.0, 0.0, 0.0]);
    let bob = scene.particle([-1.0, 0.0, 0.0], [0.0; 3], 1.0, 0.1);
    let other = scene.particle([-1.0, 3.0, 0.0], [0.0; 3], 1.0, 0.1);
    scene.joints.sticking.push([bob as u32, other as u32]);
    scene.joints.sticking_to_walls.push([other as u32, wall as u32]);
    scene.pendulum(DVec3::ZERO, 1.0, bob, Tether::String);
    assert!(scene.try_start().is_ok(), "the wall is at rest");
    scene.walls[wall].motion = (DVec3::X * -0.1).into();
    let error = scene.try_start().expect_err("the wall carries the bob");
    assert!(matches!(error, LinkageError::Ends { element: "pendulum", index: 0, .. }), "{error}");
    scene.joints.pendulums.clear();
    scene.spring(SpringEnd::Particle(bob), SpringEnd::Point(DVec3::ZERO), 1.0, 1.0);
    let error = scene.try_start().expect_err("the wall stretches the spring");
    assert!(matches!(error, LinkageError::Ends { element: "spring", index: 0, .. }), "{error}");
}

#[test]
fn particles_stick_to_a_carried_particle() {
    // A ball sticks to a driven sphere from above, and another ball to the first.
    let (m, lift) = (1.5, 0.6);
    let mut scene = falling();
    let driver = scene.particle([0.0; 3], [0.0, 0.0, lift], f64::INFINITY, 0.3);
    let first = scene.particle([0.0, 0.0, 1.5], [0.0; 3], m, 0.2);
    let second = scene.particle([0.0, 0.0, 5.0], [0.0; 3], 2.0 * m, 0.1);
    scene.joints.sticking = vec![[driver as u32, first as u32], [first as u32, second as u32]];
    let mut simulation = scene.start();
    let log = run(&mut simulation, 4.0);
    let times: Vec<f64> = log.of(EventKind::Stick).iter().map(|event| event.time).collect();
    assert_eq!(times.len(), 2, "{:?}", log.0);
    close("first", times[0], contact_time(1.0, lift), 1e-13);
    // Its height above its final position on the first, 0.5 + 0.2 + 0.1 above the driver.
    close("second", times[1], contact_time(5.0 - 0.8, lift), 1e-13);
    let frame = simulation.frame();
    near("first", frame.position[first].z, 0.5 + 4.0 * lift, 1e-13);
    near("second", frame.position[second].z, 0.8 + 4.0 * lift, 1e-13);
    let work: f64 = [(m, times[0]), (2.0 * m, times[1])]
        .iter()
        .map(|(m, t)| m * lift * ((lift + G * t) + G * (4.0 - t)))
        .sum();
    close("work", simulation.ledger().term(haff_engine::Term::WallWork), work, 1e-13);
    assert!(simulation.ledger().residual.abs() < 1e-14, "{:?}", simulation.ledger());
}

/// Counters and energies are sums over the rows of the log. Contacts of two particles are collisions, whether
/// they bounce or stick; contacts with walls are wall collisions; ends of completed series are rests.
#[test]
fn counters_and_energies_are_sums_over_the_event_log() {
    let mut kinds = [0; EventKind::ALL.len()];
    for e in [0.0, 0.3, 0.8] {
        let mut scene = falling();
        scene.restitution = e;
        scene.wall_restitution = e;
        let floor = scene.wall([0.0; 3], [0.0, 0.0, 1.0]);
        let bob = scene.particle([1.0, 0.0, 3.0], [-1.0, 0.2, 0.0], 1.3, 0.1);
        scene.pendulum(DVec3::new(1.0, 0.0, 3.4), 0.4, bob, Tether::String);
        scene.joints.pendulums[0].length = 0.6;
        scene.joints.pendulums[0].slack = true;
        let balls: Vec<usize> = (0..4)
            .map(|k| {
                let x = 0.35 * f64::from(k);
                scene.particle([x, 0.0, 0.4 + x], [0.3 - 0.2 * f64::from(k), 0.0, 0.0], 1.0 + x, 0.15)
            })
            .collect();
        let sticking = scene.particle([3.0, 0.0, 0.7], [0.4, 0.0, 0.0], 0.8, 0.2);
        scene.joints.sticking_to_walls.push([sticking as u32, floor as u32]);
        scene.joints.sticking.push([balls[0] as u32, balls[1] as u32]);
        let mut simulation = scene.start();
        let log = run(&mut simulation, 6.0);
        let (counters, ledger) = (simulation.counters(), simulation.ledger());
        let rows = |kind: EventKind| log.of(kind).len() as u64;
        assert_eq!(rows(EventKind::Collision) + rows(EventKind::Stick), counters.collisions, "e = {e}");
        assert_eq!(rows(EventKind::Wall), counters.wall_collisions, "e = {e}");
        assert_eq!(rows(EventKind::Rest) + rows(EventKind::Settle), counters.rests, "e = {e}");
        assert_eq!(simulation.frame().step, counters.collisions + counters.wall_collisions);
        let sum = |column: fn(&EventRecord) -> f64| log.0.iter().map(column).sum::<f64>();
        close(
            "losses",
            sum(|row| row.energy_loss),
            ledger.dissipated + ledger.term(haff_engine::Term::Rest),
            1e-12,
        );
        close("Carnot energies", sum(|row| row.carnot_energy), ledger.carnot, 1e-12);
        EventKind::ALL.into_iter().zip(&mut kinds).for_each(|(kind, seen)| *seen += rows(kind));
    }
    let seen = |kind: EventKind| kinds[kind as usize] > 0;
    for kind in [EventKind::Collision, EventKind::Wall, EventKind::Stick, EventKind::Taut, EventKind::Rest] {
        assert!(seen(kind), "{kind:?} in {kinds:?}");
    }
}
