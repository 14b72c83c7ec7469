//! Drives of spins: the temperatures that they give, and independence of the trajectory of the search.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, Drive, DriveKind, KickTimes, Options, Silent, Simulation, Spin, System, Term, Until,
};
use haff_mechanics::Roughness;

use crate::common::{Random, check_independence, class, scatter, set_restitution, system};

const RATE: f64 = 3.0;
const STRENGTH: f64 = 0.4;
const TEMPERATURE: f64 = 2.5;
/// q = I/(m R²) of the grains.
const INERTIA: f64 = 0.3;
const RADIUS: f64 = 0.5;
const MASS: f64 = 1.5;

fn kinds() -> [DriveKind; 4] {
    [
        DriveKind::WhiteNoise { strength: STRENGTH, kicks: KickTimes::Poisson { rate: RATE } },
        DriveKind::WhiteNoise { strength: STRENGTH, kicks: KickTimes::Regular { interval: 0.25 } },
        DriveKind::Andersen { temperature: TEMPERATURE, rate: RATE },
        DriveKind::Rescale { temperature: TEMPERATURE, interval: 0.25 },
    ]
}

/// Grains that turn slowly at the start, with this coefficient of tangential restitution.
fn gas(dimension: Dimension, count: usize, beta: f64, kind: DriveKind) -> System {
    let mut random = Random(17);
    let edge = (6.0 * count as f64).powf(1.0 / dimension.count() as f64);
    let mut scene = system(dimension, DVec3::splat(edge), [Boundary::Periodic; 3]);
    let grain = class(&mut scene, RADIUS, MASS);
    scatter(&mut scene, grain, count, 1.0, &mut random);
    set_restitution(&mut scene, 0.9);
    let mut spins = || DVec3::new(random.normal(), random.normal(), random.normal());
    let spins: Vec<DVec3> = (0..count).map(|_| 0.1 * spins()).collect();
    let angular_velocity = if dimension == Dimension::Two {
        spins.into_iter().map(|spin| DVec3::Z * spin.z).collect()
    } else {
        spins
    };
    scene.spin = Some(Spin {
        inertia: vec![INERTIA],
        angular_velocity,
        pair: vec![Roughness { tangential_restitution: beta, friction: f64::INFINITY }],
        wall: Vec::new(),
    });
    scene.drives = vec![Drive { kind, species: vec![0], rotational: true }];
    scene.seed = 5;
    scene
}

#[test]
#[ignore = "long: scripts/test all"]
fn the_trajectory_is_independent_of_search_threads_slices_and_resumption() {
    for kind in kinds() {
        for dimension in [Dimension::Three, Dimension::Two] {
            let reference = check_independence(&gas(dimension, 200, 0.5, kind), &[0.1, 1.0, 1.3, 3.0]);
            assert!(reference.ledger().term(Term::DriveWork) > 0.0, "{kind:?}");
        }
    }
}

/// With smooth contacts a drive alone changes spins: their temperature after a time is known.
#[test]
fn spins_get_as_much_as_the_velocities() {
    let (count, time) = (2000, 4.0);
    let moment = INERTIA * MASS * RADIUS * RADIUS;
    for kind in kinds() {
        for (dimension, axes) in [(Dimension::Three, 3.0), (Dimension::Two, 1.0)] {
            let scene = gas(dimension, count, -1.0, kind);
            let start = scene.spin.as_ref().unwrap().angular_velocity.clone();
            let expected = match kind {
                DriveKind::WhiteNoise { .. } => MASS * STRENGTH * time,
                _ => TEMPERATURE,
            };
            let mut simulation = Simulation::new(scene, Options::default()).unwrap();
            simulation.advance(Until { time, ..Until::default() }, &mut Silent).unwrap();
            let frame = simulation.frame();
            let spins = frame.angular_velocity;
            let n = count as f64;
            let z = if let DriveKind::WhiteNoise { kicks, .. } = kind {
                // Of the changes: sums of normal numbers, at Poisson times a random number of them.
                let each =
                    spins.iter().zip(&start).map(|(after, before)| (*after - *before).length_squared());
                let found = moment * each.sum::<f64>() / (n * axes);
                let of_counts =
                    if let KickTimes::Poisson { rate } = kicks { 1.0 / (rate * time) } else { 0.0 };
                // Per particle: 2/axes of the squares of normal numbers, more with a random number of kicks.
                let variance = (2.0 / axes) * (1.0 + of_counts) + of_counts;
                (found / expected - 1.0) / (variance / n).sqrt()
            } else {
                let found = moment * spins.iter().map(|spin| spin.length_squared()).sum::<f64>() / (n * axes);
                if matches!(kind, DriveKind::Rescale { .. }) {
                    assert!((found / expected - 1.0).abs() < 1e-12, "{found}");
                    0.0
                } else {
                    // e^(−12) of the grains have not been kicked.
                    (found / expected - 1.0) / (2.0 / (axes * n)).sqrt()
                }
            };
            assert!(z.abs() < 4.0, "{kind:?}, {dimension:?}: z = {z}");
            assert!(simulation.ledger().residual.abs() < 1e-12, "{:?}", simulation.ledger());
            if dimension == Dimension::Two {
                assert!(spins.iter().all(|spin| (spin.x, spin.y) == (0.0, 0.0)));
            }
        }
    }
}

/// Without `rotational` a drive leaves spins alone.
#[test]
fn other_drives_do_not_change_spins() {
    for kind in kinds() {
        let mut scene = gas(Dimension::Three, 100, -1.0, kind);
        scene.drives[0].rotational = false;
        let start = scene.spin.as_ref().unwrap().angular_velocity.clone();
        let mut simulation = Simulation::new(scene, Options::default()).unwrap();
        simulation.advance(Until { time: 1.0, ..Until::default() }, &mut Silent).unwrap();
        assert_eq!(simulation.frame().angular_velocity, start);
    }
}
