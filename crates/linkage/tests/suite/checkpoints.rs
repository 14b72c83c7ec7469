//! Checkpoints with impossible values are refused with a message that names the value; valid checkpoints are
//! accepted.

use glam::DVec3;
use haff_engine::{Checkpoint, Silent, Until};
use haff_linkage::{LinkageError, Simulation, SpringEnd, Tether};
use haff_testing::Random;

use crate::common::Scene;

/// Pendulums on a string and a rod, a dumbbell, a spring, balls that stick together, and one that bounces to
/// rest.
fn scene() -> Scene {
    let mut scene = Scene::new(0.6);
    scene.gravity = -DVec3::Z * 9.81;
    let floor = scene.wall([0.0; 3], [0.0, 0.0, 1.0]);
    let bobs = [
        scene.particle([0.0, 0.0, 4.0], [0.0; 3], 1.0, 0.1),
        scene.particle([1.0, 0.0, 5.0], [0.0; 3], 2.0, 0.1),
    ];
    scene.pendulum(DVec3::new(0.0, 0.0, 5.0), 1.0, bobs[0], Tether::Rod);
    scene.pendulum(DVec3::new(0.0, 0.0, 5.0), 1.0, bobs[1], Tether::String);
    let (a, b) = (
        scene.particle([4.0, 0.0, 2.0], [0.0, 0.0, 1.0], 1.0, 0.2),
        scene.particle([5.0, 0.0, 2.0], [0.0, 0.0, -1.0], 1.0, 0.2),
    );
    scene.rod(a, b, 1.0);
    let hung = scene.particle([8.0, 0.0, 3.0], [0.0; 3], 1.0, 0.1);
    scene.spring(SpringEnd::Particle(hung), SpringEnd::Point(DVec3::new(8.0, 0.0, 5.0)), 30.0, 1.5);
    let sticky = [
        scene.particle([12.0, 0.0, 2.0], [1.0, 0.0, 2.0], 1.0, 0.2),
        scene.particle([14.0, 0.0, 2.0], [-1.0, 0.0, 2.0], 2.0, 0.2),
    ];
    scene.joints.sticking.push(sticky.map(|i| i as u32));
    scene.particle([20.0, 0.0, 0.6], [0.0; 3], 1.0, 0.1);
    let sticking = scene.particle([22.0, 0.0, 0.6], [0.3, 0.0, 0.0], 1.0, 0.1);
    scene.joints.sticking_to_walls.push([sticking as u32, floor as u32]);
    scene
}

fn advanced(time: f64) -> Simulation {
    let mut simulation = scene().start();
    simulation.advance(Until { time, ..Until::default() }, &mut Silent).expect("the run continues");
    simulation.sample();
    simulation.measure_overlap().unwrap();
    simulation
}

fn restore(checkpoint: &Checkpoint) -> Result<Simulation, LinkageError> {
    let (system, joints) = scene().build();
    Simulation::restore(system, joints, checkpoint)
}

fn scalar<'a>(checkpoint: &'a mut Checkpoint, name: &str) -> &'a mut u64 {
    let found = checkpoint.scalars.iter_mut().find(|(found, _)| found == name);
    &mut found.unwrap_or_else(|| panic!("no {name}")).1
}

#[test]
fn valid_checkpoints_are_accepted_at_any_time() {
    for time in [0.0, 0.1, 0.35, 0.5, 1.0, 2.5, 7.0, 20.0, 60.0] {
        let simulation = advanced(time);
        let checkpoint = simulation.checkpoint();
        let restored = restore(&checkpoint).unwrap_or_else(|error| panic!("t = {time}: {error}"));
        assert_eq!((restored.checkpoint(), restored.state_hash()), (checkpoint, simulation.state_hash()));
    }
    // One entry at a time, so that some checkpoints are taken while a series of bounces is pending.
    let mut simulation = scene().start();
    let mut pending = 0;
    for _ in 0..400 {
        simulation.advance(Until { entries: 1, ..Until::default() }, &mut Silent).expect("the run continues");
        let checkpoint = simulation.checkpoint();
        pending += usize::from(checkpoint.scalars.iter().any(|(name, _)| name.starts_with("rest.")));
        let time = simulation.time();
        let restored = restore(&checkpoint).unwrap_or_else(|error| panic!("t = {time}: {error}"));
        assert_eq!(restored.checkpoint(), checkpoint);
    }
    assert!(pending > 0, "no checkpoint with a pending series");
}

/// A part of the expected message, and the change of the checkpoint.
type Damage = (&'static str, fn(&mut Checkpoint));

#[test]
fn errors_name_the_impossible_value() {
    let real = |name: &'static str, value: f64| (name, value.to_bits());
    let damages: [Damage; 17] = [
        ("position[4] = DVec3(1e300", |c| c.position[4].x = 1e300),
        ("velocity[2] = DVec3(0.0, NaN", |c| c.velocity[2] = DVec3::new(0.0, f64::NAN, 0.0)),
        ("the bob of pendulum 1 would be", |c| c.position[1].z += 0.5),
        ("the ends of rod 0 would be", |c| c.position[2].x -= 0.5),
        ("overlap", |c| c.position[7].z -= 3.0),
        ("energies do not balance", |c| c.velocity[4].z += 50.0),
        ("anchor[0] = 5", |c| c.anchor[0] = 5),
        ("image[1] = [0, 1, 0]", |c| c.image[1][1] = 1),
        ("it has [9, 9, 9, 9, 8, 9]", |c| c.count.truncate(8)),
        ("body.3 = 2: body 3 is in 1 flights and must be in 0", |c| *scalar(c, "body.3") = 2),
        ("body.3 = 99 must be less than 9", |c| *scalar(c, "body.3") = 99),
        ("clings.0", |c| *scalar(c, "clings.0") = 2),
        ("taut.1", |c| *scalar(c, "taut.1") = 7),
        ("collisions = 18446744073709551615", |c| *scalar(c, "collisions") = u64::MAX),
        ("flight.0.hint = -1", |c| *scalar(c, "flight.0.hint") = (-1_f64).to_bits()),
        ("flight.0.body", |c| *scalar(c, "flight.0.body.0") = 1),
        ("link", |c| *scalar(c, "flight.0.row.0") = 5 << 60),
    ];
    let good = advanced(0.3).checkpoint();
    restore(&good).expect("a valid checkpoint");
    let message = |bad: &Checkpoint, expected: &str| {
        let error = restore(bad).map(|_| ()).expect_err(expected);
        assert!(matches!(error, LinkageError::Checkpoint(_)), "{expected}: {error}");
        error.to_string()
    };
    for (expected, damage) in damages {
        let mut bad = good.clone();
        damage(&mut bad);
        let error = message(&bad, expected);
        assert!(error.contains(expected), "{expected}: {error}");
    }
    for (name, bits) in [
        real("now.high", f64::NAN),
        real("now.high", -1.0),
        real("now.low", 1.0),
        real("clock.time", 9.0),
        real("initial_kinetic", -1.0),
        real("initial_potential", f64::INFINITY),
        real("max_overlap", f64::NAN),
        real("sampled_at", 1e9),
        real("carnot.high", -1e9),
        real("dissipated.low", f64::NAN),
        real("impulse.z.high", f64::INFINITY),
        real("offset.0.x", 1.0),
        real("flight.0.start.high", 1e9),
    ] {
        let mut bad = good.clone();
        *scalar(&mut bad, name) = bits;
        let error = message(&bad, name);
        let part = name.trim_end_matches(".high").trim_end_matches(".low").trim_end_matches(".x");
        assert!(error.contains(part), "{name}: {error}");
    }
}

/// Another value of the same 64 bits.
fn change(random: &mut Random, old: u64) -> u64 {
    match random.index(5) {
        0 => random.bits(),
        1 => old ^ (1 << random.index(64)),
        2 => [0, 1, 2, u64::MAX, 1 << 63, 1 << 60][random.index(6)],
        3 => [f64::NAN, f64::INFINITY, -1e300, 1e300][random.index(4)].to_bits(),
        _ => (f64::from_bits(old) * (random.index(1000) as f64 / 250.0 - 2.0)).to_bits(),
    }
}

/// Random changes of one to three values: the checkpoint is refused, or the simulation continues without a
/// panic. `HAFF_MUTATIONS` sets their number.
#[test]
fn randomly_changed_checkpoints_never_panic() {
    let mutations: usize =
        std::env::var("HAFF_MUTATIONS").ok().and_then(|text| text.parse().ok()).unwrap_or(300);
    let mut random = Random(4);
    let mut refused = 0;
    let states = [0.0, 0.3, 1.0, 20.0].map(|time| (time, advanced(time).checkpoint()));
    for k in 0..mutations {
        let (time, good) = &states[k % states.len()];
        let mut bad = good.clone();
        for _ in 0..=random.index(2) {
            let (i, axis) = (random.index(bad.position.len()), random.index(3));
            match random.index(6) {
                0 => {
                    bad.position[i][axis] =
                        f64::from_bits(change(&mut random, bad.position[i][axis].to_bits()));
                }
                1 => {
                    bad.velocity[i][axis] =
                        f64::from_bits(change(&mut random, bad.velocity[i][axis].to_bits()));
                }
                _ => {
                    let scalar = random.index(bad.scalars.len());
                    bad.scalars[scalar].1 = change(&mut random, bad.scalars[scalar].1);
                }
            }
        }
        match restore(&bad) {
            Ok(mut simulation) => {
                let until = Until { time: time + 0.5, entries: 1000, ..Until::default() };
                let _ = simulation.advance(until, &mut Silent);
                simulation.sample();
            }
            Err(LinkageError::Checkpoint(_)) => refused += 1,
            Err(error) => panic!("{error}"),
        }
    }
    assert!(3 * refused > mutations, "{refused} of {mutations} were refused: too little was changed");
}
