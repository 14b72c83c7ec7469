//! Checkpoints with impossible values are refused with a message that names the value; valid checkpoints are
//! accepted.

use glam::DVec3;
use haff_engine::{
    Boundary, Checkpoint, Dimension, EngineError, Options, Silent, Simulation, System, Until, Wall,
};
use haff_mechanics::Restitution;

use crate::common::{Random, add, class, gas, scatter, set_restitution, system};

/// Grains that fall on an oblique floor and come to rest, in a box with one periodic axis.
fn heap() -> System {
    let boundary = [Boundary::Periodic, Boundary::Wall, Boundary::Wall];
    let mut scene = system(Dimension::Three, DVec3::new(5.0, 4.0, 30.0), boundary);
    scene.domain.gravity = DVec3::new(0.0, 0.0, -1.0);
    scene.walls.push(Wall {
        name: "ramp".into(),
        point: DVec3::ZERO,
        normal: DVec3::new(0.0, 0.6, 0.8),
        motion: haff_engine::WallMotion::Fixed,
        shape: None,
    });
    scene.contacts.wall.push((Restitution::Constant(1.0)).into());
    set_restitution(&mut scene, 0.4);
    scene.contacts.rest_speed = 0.05;
    let (small, large) = (class(&mut scene, 0.3, 0.5), class(&mut scene, 0.4, 1.0));
    let mut random = Random(11);
    for (class, radius, count) in [(small, 0.3, 14), (large, 0.4, 12)] {
        for _ in 0..count {
            let layer = scene.bodies.len() as f64;
            let place =
                DVec3::new(random.uniform(0.0, 5.0), random.uniform(radius, 4.0 - radius), 4.0 + 0.9 * layer);
            add(&mut scene, class, place, DVec3::new(random.normal(), random.normal(), 0.0) * 0.3);
        }
    }
    scene
}

/// Disks in a box with a fixed disk and a moving wall.
fn disks() -> System {
    let mut scene = system(Dimension::Two, DVec3::new(20.0, 20.0, 1.0), [Boundary::Wall; 3]);
    set_restitution(&mut scene, 0.9);
    let (grain, post) = (class(&mut scene, 0.5, 1.0), class(&mut scene, 1.0, f64::INFINITY));
    add(&mut scene, post, DVec3::new(10.0, 10.0, 0.0), DVec3::ZERO);
    scatter(&mut scene, grain, 40, 1.0, &mut Random(5));
    scene.walls[0].motion = (DVec3::X * 0.01).into();
    scene
}

/// Spheres in open space.
fn open() -> System {
    let mut scene = system(Dimension::Three, DVec3::splat(10.0), [Boundary::Open; 3]);
    let ball = class(&mut scene, 0.5, 1.0);
    scatter(&mut scene, ball, 30, 1.0, &mut Random(3));
    scene
}

fn advanced(scene: &System, time: f64) -> Simulation {
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    simulation.advance(Until { time, ..Until::default() }, &mut Silent).unwrap();
    simulation.sample();
    simulation
}

fn restore(scene: &System, checkpoint: &Checkpoint) -> Result<Simulation, EngineError> {
    Simulation::restore(scene.clone(), Options::default(), checkpoint)
}

fn scalar<'a>(checkpoint: &'a mut Checkpoint, name: &str) -> &'a mut u64 {
    let found = checkpoint.scalars.iter_mut().find(|(found, _)| found == name);
    &mut found.unwrap_or_else(|| panic!("no {name}")).1
}

#[test]
fn valid_checkpoints_are_accepted_at_any_time() {
    for (scene, times) in [
        (heap(), &[0.0, 0.5, 3.0, 9.0, 12.0, 40.0, 500.0][..]),
        (disks(), &[0.0, 1.0, 30.0, 300.0]),
        (open(), &[0.0, 1.0, 100.0, 3000.0]),
        (gas(5, 0.3, 0.8, 1), &[0.0, 5.0, 100.0, 3000.0]),
    ] {
        for &time in times {
            let simulation = advanced(&scene, time);
            let checkpoint = simulation.checkpoint();
            let restored = restore(&scene, &checkpoint).unwrap_or_else(|error| panic!("t = {time}: {error}"));
            assert_eq!(restored.state_hash(), simulation.state_hash(), "t = {time}");
            assert_eq!(restored.checkpoint(), checkpoint, "t = {time}");
        }
    }
}

#[test]
fn energy_given_by_a_law_that_is_no_more_is_accepted() {
    let mut scene = disks();
    scene.contacts.pair.fill(Restitution::Constant(0.9).with_added_speed(0.5));
    let mut simulation = advanced(&scene, 20.0);
    set_restitution(&mut scene, 0.9);
    simulation.change_system(scene.clone(), &mut Silent).unwrap();
    assert!(simulation.ledger().dissipated < -1.0, "{:?}", simulation.ledger());
    let restored = restore(&scene, &simulation.checkpoint()).unwrap();
    assert_eq!(restored.checkpoint(), simulation.checkpoint());
}

/// With this many walls the code of a set of three walls has more than 30 bits.
#[test]
fn grains_in_a_corner_of_the_last_of_many_walls_stay_there() {
    let mut scene = system(Dimension::Three, DVec3::splat(9.0), [Boundary::Open; 3]);
    scene.domain.gravity = DVec3::new(-1.0, -1.0, -1.0);
    for k in (0..1500).rev() {
        let normal = DVec3::AXES[k % 3];
        let point = -normal * (k / 3) as f64;
        scene.walls.push(Wall {
            name: format!("w{k}"),
            point,
            normal,
            motion: haff_engine::WallMotion::Fixed,
            shape: None,
        });
    }
    scene.contacts.wall = vec![(Restitution::Constant(0.0)).into(); scene.walls.len()];
    let ball = class(&mut scene, 0.5, 1.0);
    add(&mut scene, ball, DVec3::splat(0.75), DVec3::ZERO);
    let simulation = advanced(&scene, 10.0);
    let checkpoint = simulation.checkpoint();
    let restored = restore(&scene, &checkpoint).unwrap();
    assert_eq!(restored.checkpoint(), checkpoint);
    assert_eq!(simulation.frame().velocity[0], DVec3::ZERO);
    let mut bad = checkpoint.clone();
    *scalar(&mut bad, "support.0") = 1501 * 1501 * 1501;
    let error = restore(&scene, &bad).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("support[0] = "), "{error}");
}

/// A part of the expected message, and the change of the checkpoint.
type Damage = (&'static str, fn(&mut Checkpoint));

const REAL: [f64; 4] = [f64::NAN, f64::INFINITY, -1e300, 1e300];

#[test]
fn errors_name_the_impossible_value() {
    let damages: [Damage; 43] = [
        ("position[0] = DVec3(1e300", |c| c.position[0].x = 1e300),
        ("position[3] = DVec3(NaN", |c| c.position[3].x = f64::NAN),
        ("position[2][0] = 5.5 must be in [0, 5)", |c| c.position[2].x = 5.5),
        ("position[2][0] = -0.1 must be in [0, 5)", |c| c.position[2].x = -0.1),
        ("overlap by", |c| c.position[4].z = -3.0),
        ("overlap by", |c| c.position[4].y = 7.0),
        ("overlap by", |c| {
            c.position[1] = c.position[0];
            c.velocity[1] = c.velocity[0];
            c.anchor[1] = c.anchor[0];
        }),
        ("velocity[1] = DVec3(0", |c| c.velocity[1] = DVec3::new(0.0, f64::NAN, 0.0)),
        ("velocity[1] = DVec3(1e200", |c| c.velocity[1].x = 1e200),
        ("energies do not balance", |c| {
            c.velocity[1].x = 1e5;
            c.anchor[1] = *scalar(c, "clock.now") as i64;
        }),
        ("anchor[5] = ", |c| c.anchor[5] = *scalar(c, "clock.now") as i64 + 1),
        ("anchor[5] = -9223372036854775808", |c| c.anchor[5] = i64::MIN),
        ("anchor[5] = -4611686018427387905 must be in [-4611686018427387904", |c| {
            c.anchor[5] = -(1 << 62) - 1;
        }),
        ("image[6][0] = 2147483647", |c| c.image[6] = [i32::MAX, 0, 0]),
        ("image[6][0] = -2147483648", |c| c.image[6][0] = i32::MIN),
        ("image[6][2] = 1 must be 0: the axis is not periodic", |c| c.image[6][2] = 1),
        ("resting[7] = ", |c| c.resting[7] = (1 << 30) - 1),
        ("resting[7] = ", |c| c.resting[7] = 6 * 6 * 6),
        ("resting[7] = 6 must be", |c| c.resting[7] = 6),
        ("resting", |c| {
            let i = c.velocity.iter().position(|v| *v != DVec3::ZERO).unwrap();
            c.resting[i] = 1 << 31;
        }),
        ("clock.exponent = 5000 must be in [-1000, 900]", |c| *scalar(c, "clock.exponent") = 5000),
        ("clock.exponent = 4294967296", |c| *scalar(c, "clock.exponent") = 1 << 32),
        ("clock.time", |c| *scalar(c, "clock.exponent") = 10),
        ("clock.base = NaN", |c| *scalar(c, "clock.base") = f64::NAN.to_bits()),
        ("clock.base = 3.0 must be in [0.0, 0.0]", |c| *scalar(c, "clock.base") = 3_f64.to_bits()),
        ("clock.earliest = 2.0", |c| *scalar(c, "clock.earliest") = 2_f64.to_bits()),
        ("clock.base_low = 1e-10", |c| *scalar(c, "clock.base_low") = 1e-10_f64.to_bits()),
        ("clock.now = -1 must be in [0, ", |c| *scalar(c, "clock.now") = u64::MAX),
        ("clock.time = 1000000000.0 must be in", |c| *scalar(c, "clock.time") = 1e9_f64.to_bits()),
        ("collisions = 18446744073709551615 must be at most", |c| *scalar(c, "collisions") = u64::MAX),
        ("wall_collisions = 9223372036854775808", |c| *scalar(c, "wall_collisions") = 1 << 63),
        ("epochs = 18446744073709551614", |c| *scalar(c, "epochs") = u64::MAX - 1),
        ("sampled_collisions = ", |c| *scalar(c, "sampled_collisions") = 1 << 60),
        ("fixed_collisions = ", |c| *scalar(c, "fixed_collisions") = 1 << 50),
        ("sampled_flights = ", |c| *scalar(c, "sampled_flights") = 1 << 50),
        ("sampled_at = -1", |c| *scalar(c, "sampled_at") = (-1_f64).to_bits()),
        ("initial_kinetic = -1", |c| *scalar(c, "initial_kinetic") = (-1_f64).to_bits()),
        ("max_overlap = NaN", |c| *scalar(c, "max_overlap") = f64::NAN.to_bits()),
        ("carnot = -5000", |c| *scalar(c, "carnot.0") = (-5000_f64).to_bits()),
        ("energies do not balance", |c| *scalar(c, "dissipated.0") = (-5000_f64).to_bits()),
        ("force_until = ", |c| *scalar(c, "force_until") = 1e9_f64.to_bits()),
        ("settling.next = -5", |c| *scalar(c, "settling.next") = -5_i64 as u64),
        ("is given twice", |c| {
            let first = c.scalars[0].clone();
            c.scalars.push(first);
        }),
    ];
    let scene = heap();
    let good = advanced(&scene, 9.0).checkpoint();
    restore(&scene, &good).unwrap();
    for (expected, damage) in damages {
        let mut bad = good.clone();
        damage(&mut bad);
        let error = restore(&scene, &bad).map(|_| ()).expect_err(expected);
        assert!(
            matches!(error, EngineError::Checkpoint(_)) && error.to_string().contains(expected),
            "{expected}: {error}"
        );
    }
    // Every real number must be finite.
    for (name, _) in &good.scalars {
        if COUNTS.iter().any(|count| name.ends_with(count)) {
            continue;
        }
        for value in [f64::NAN, f64::INFINITY] {
            let mut bad = good.clone();
            *scalar(&mut bad, name) = value.to_bits();
            let error = restore(&scene, &bad).map(|_| ()).expect_err(name).to_string();
            assert!(error.contains(name), "{name}: {error}");
        }
    }
}

/// Ends of the names of scalars that are integers.
const COUNTS: [&str; 18] = [
    "exponent",
    "now",
    "collisions",
    "flights",
    "rests",
    "predictions",
    "dropped",
    "stale",
    "transfers",
    "candidates",
    "windows",
    "epochs",
    "wakes",
    "settling.next",
    "settling.events",
    "settling.waited",
    "settling.recent_contacts",
    "counted_since",
];

/// A checkpoint between the completion of a series of bounces and its end.
#[test]
fn pending_series_of_bounces_are_checked() {
    let mut scene = system(Dimension::Three, DVec3::splat(4.0), [Boundary::Wall; 3]);
    scene.domain.gravity = DVec3::new(0.0, 0.0, -1.0);
    set_restitution(&mut scene, 0.5);
    let ball = class(&mut scene, 0.5, 1.0);
    add(&mut scene, ball, DVec3::new(2.0, 2.0, 1.0), DVec3::ZERO);
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    let good = loop {
        simulation.advance(Until { entries: 1, ..Until::default() }, &mut Silent).unwrap();
        let checkpoint = simulation.checkpoint();
        if checkpoint.scalars.iter().any(|(name, _)| name == "rest.0.wall") {
            break checkpoint;
        }
    };
    restore(&scene, &good).unwrap();
    let damages: [Damage; 7] = [
        ("rest.0.wall = 77 must be a wall that particle 0 rests on", |c| *scalar(c, "rest.0.wall") = 77),
        ("rest.0.wall = 0 must be a wall", |c| *scalar(c, "rest.0.wall") = 0),
        ("rest.0.end = -1 must not be before now", |c| *scalar(c, "rest.0.end") = u64::MAX),
        ("rest.0.speed = -1", |c| *scalar(c, "rest.0.speed") = (-1_f64).to_bits()),
        ("rest.0.energy_loss = NaN", |c| *scalar(c, "rest.0.energy_loss") = f64::NAN.to_bits()),
        ("rest.0.wall = 4", |c| c.resting[0] = 0),
        ("rest.9", |c| {
            for (name, _) in c.scalars.iter_mut().filter(|(name, _)| name.starts_with("rest.0")) {
                *name = name.replace("rest.0", "rest.9");
            }
        }),
    ];
    for (expected, damage) in damages {
        let mut bad = good.clone();
        damage(&mut bad);
        let error = restore(&scene, &bad).map(|_| ()).expect_err(expected).to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

/// Random changes of one to three values: the checkpoint is refused, or the simulation continues without a
/// panic. `HAFF_MUTATIONS` sets their number.
#[test]
fn random_changes_of_a_checkpoint_never_panic() {
    let mutations: usize =
        std::env::var("HAFF_MUTATIONS").ok().and_then(|text| text.parse().ok()).unwrap_or(300);
    let mut random = Random(2);
    let mut refused = 0;
    for scene in [heap(), disks(), open(), gas(4, 0.3, 0.8, 1)] {
        for time in [0.0, 5.0] {
            let good = advanced(&scene, time).checkpoint();
            for _ in 0..mutations.div_ceil(8) {
                let mut bad = good.clone();
                for _ in 0..=random.index(2) {
                    mutate(&mut bad, &mut random);
                }
                match restore(&scene, &bad) {
                    Ok(mut simulation) => {
                        let until = Until { time: time + 1.0, entries: 3000, ..Until::default() };
                        let _ = simulation.advance(until, &mut Silent);
                        simulation.sample();
                        simulation.frame();
                    }
                    Err(EngineError::Checkpoint(_)) => refused += 1,
                    Err(error) => panic!("{error}"),
                }
            }
        }
    }
    assert!(2 * refused > mutations, "{refused} of {mutations} were refused: too few for a conclusion");
}

fn mutate(checkpoint: &mut Checkpoint, random: &mut Random) {
    let i = random.index(checkpoint.position.len());
    let axis = random.index(3);
    let bits = |random: &mut Random, old: u64| match random.index(5) {
        0 => random.bits(),
        1 => old ^ (1 << random.index(64)),
        2 => [0, 1, u64::MAX, 1 << 63, i64::MAX as u64, 1 << 62][random.index(6)],
        3 => REAL[random.index(4)].to_bits(),
        _ => (f64::from_bits(old) * random.uniform(-2.0, 2.0)).to_bits(),
    };
    match random.index(8) {
        0 => {
            checkpoint.position[i][axis] =
                f64::from_bits(bits(random, checkpoint.position[i][axis].to_bits()));
        }
        1 => {
            checkpoint.velocity[i][axis] =
                f64::from_bits(bits(random, checkpoint.velocity[i][axis].to_bits()));
        }
        2 => checkpoint.anchor[i] = bits(random, checkpoint.anchor[i] as u64) as i64,
        3 => checkpoint.image[i][axis] = bits(random, checkpoint.image[i][axis] as u64) as i32,
        4 => checkpoint.count[i] = bits(random, u64::from(checkpoint.count[i])) as u32,
        5 => checkpoint.resting[i] = bits(random, u64::from(checkpoint.resting[i])) as u32,
        _ => {
            let k = random.index(checkpoint.scalars.len());
            checkpoint.scalars[k].1 = bits(random, checkpoint.scalars[k].1);
        }
    }
}
