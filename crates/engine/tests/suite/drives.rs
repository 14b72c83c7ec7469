//! Drives: the temperatures they maintain, independence of the trajectory of the search and of resumptions,
//! and the balance of energies.

use glam::DVec3;
use haff_engine::{
    Boundary, Change, Dimension, Drive, DriveKind, EngineError, EventKind, EventRecord, Grid, GridAxis,
    KickTimes, NeighborChoice, Options, Silent, Simulation, Stop, System, Term, Until,
};
use haff_mechanics::Restitution;

use crate::common::{Log, Random, check_independence, class, scatter, set_restitution, system};

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn gas(dimension: Dimension, count: usize, e: f64, kind: DriveKind) -> System {
    let mut random = Random(3);
    let edge = (6.0 * count as f64).powf(1.0 / dimension.count() as f64);
    let mut scene = system(dimension, DVec3::splat(edge), [Boundary::Periodic; 3]);
    let (light, heavy) = (class(&mut scene, 0.5, 1.0), class(&mut scene, 0.4, 3.0));
    scatter(&mut scene, light, count / 2, 1.0, &mut random);
    scatter(&mut scene, heavy, count - count / 2, 1.0, &mut random);
    set_restitution(&mut scene, e);
    scene.drives = vec![Drive { kind, species: vec![0], rotational: false }];
    scene.seed = 11;
    scene
}

const NOISE: [DriveKind; 2] = [
    DriveKind::WhiteNoise { strength: 0.4, kicks: KickTimes::Poisson { rate: 3.0 } },
    DriveKind::WhiteNoise { strength: 0.4, kicks: KickTimes::Regular { interval: 0.25 } },
];

fn kinds() -> [DriveKind; 5] {
    [
        NOISE[0],
        NOISE[1],
        DriveKind::Rescale { temperature: 2.5, interval: 0.25 },
        DriveKind::Hold { temperature: 2.5, longest: 0.25 },
        DriveKind::Andersen { temperature: 2.5, rate: 0.7 },
    ]
}

#[test]
#[ignore = "long: scripts/test all"]
fn trajectory_of_a_driven_gas_is_independent_of_search_threads_slices_and_resumption() {
    for kind in kinds() {
        for dimension in [Dimension::Three, Dimension::Two] {
            let scene = gas(dimension, 300, 0.9, kind);
            let reference = check_independence(&scene, &[0.1, 1.0, 1.3, 4.0]);
            assert!(reference.ledger().term(Term::DriveWork) != 0.0, "{kind:?}");
        }
    }
}

/// A gas between walls with e = 0: grains are at rest at a wall, until a kick drives some of them into it.
fn gas_at_plastic_walls(dimension: Dimension, kind: DriveKind) -> System {
    let mut random = Random(8);
    let count = 240;
    let edge = (4.0 * f64::from(count)).powf(1.0 / dimension.count() as f64);
    let boundary = [Boundary::Wall, Boundary::Periodic, Boundary::Periodic];
    let mut scene = system(dimension, DVec3::splat(edge), boundary);
    let grain = class(&mut scene, 0.5, 1.0);
    scatter(&mut scene, grain, count as usize, 1.0, &mut random);
    set_restitution(&mut scene, 0.9);
    scene.contacts.wall.fill(Restitution::Constant(0.0).into());
    scene.drives = vec![Drive { kind, species: vec![0], rotational: false }];
    scene
}

/// At the time of a kick, the kick comes first, then all impacts that follow from it at once, then
/// measurements, samples and frames: with every search and any number of blocks.
#[test]
fn impacts_that_follow_from_a_kick_at_once_come_before_measurements_and_stops() {
    for kind in [DriveKind::Rescale { temperature: 1.0, interval: 1.0 }, NOISE[1]] {
        for dimension in [Dimension::Two, Dimension::Three] {
            let scene = gas_at_plastic_walls(dimension, kind);
            check_independence(&scene, &[1.0, 2.0, 2.5, 3.0, 6.0]);
        }
    }
    let mut scene =
        gas_at_plastic_walls(Dimension::Two, DriveKind::Rescale { temperature: 1.0, interval: 1.0 });
    let size = scene.domain.size.x;
    let axes = vec![GridAxis { axis: 0, low: 0.0, high: size, bins: 1 }];
    scene.measure.profiles =
        vec![Grid { axes, interval: 1.0, samples: 1, spread: false, species: Vec::new() }];
    for (neighbors, blocks) in [
        (NeighborChoice::AllPairs, None),
        (NeighborChoice::Cells, None),
        (NeighborChoice::Lists, Some(2)),
        (NeighborChoice::Windows, Some(1)),
        (NeighborChoice::Windows, Some(2)),
    ] {
        let options = Options { neighbors, blocks, ..Options::default() };
        let mut simulation = Simulation::new(scene.clone(), options).unwrap();
        let mut log = Log::default();
        let mut at_once = 0;
        for k in 1..=6 {
            let time = f64::from(k);
            simulation.advance(until(time), &mut log).unwrap();
            at_once += log.0.iter().filter(|event| event.time == time).count();
            let frame = simulation.frame();
            let momentum = frame.velocity.iter().map(|v| v.x).sum::<f64>();
            let profile = log.1.last().unwrap();
            assert_eq!(profile.time, time);
            let measured = profile.velocity[0].x * frame.velocity.len() as f64;
            assert!((measured - momentum).abs() < 1e-12, "{neighbors:?}: {measured}, frame {momentum}");
        }
        assert!(at_once > 20, "{neighbors:?}: {at_once} impacts at the times of kicks");
    }
}

/// Whether the losses of all collisions are those of the TC model: none if one of the partners has had a
/// contact within `tc` before. Returns the numbers of elastic and of inelastic collisions.
fn check_contact_duration(log: &[EventRecord], bodies: usize, tc: f64) -> [usize; 2] {
    let mut last = vec![f64::NEG_INFINITY; bodies];
    let mut counts = [0; 2];
    for event in log {
        let partners = match event.kind {
            EventKind::Collision => vec![event.i, event.j],
            EventKind::Wall => vec![event.i],
            _ => continue,
        };
        let age = partners.iter().map(|&i| event.time - last[i as usize]).fold(f64::INFINITY, f64::min);
        let is_lossless = event.energy_loss == 0.0;
        // Times in the log are rounded.
        if (age - tc).abs() > 1e-12 * event.time {
            assert_eq!(is_lossless, age < tc, "{event:?} {age} after the last contact");
        }
        counts[usize::from(!is_lossless)] += 1;
        for i in partners {
            last[i as usize] = event.time;
        }
    }
    counts
}

/// The contact duration counts from the last contact. Kicks, whether of all particles or of one, and changes
/// from outside set anchors, but are no contacts.
#[test]
#[ignore = "long: scripts/test all"]
fn the_contact_duration_counts_from_the_last_contact_whatever_else_happens_to_a_particle() {
    let tc = 0.05;
    let mut drives = kinds().map(Some).to_vec();
    drives.push(None);
    for kind in drives {
        let mut scene = gas(Dimension::Two, 120, 0.5, NOISE[0]);
        scene.contacts.tc = tc;
        // Far more kicks than contacts.
        scene.drives = kind
            .map(|kind| match kind {
                DriveKind::WhiteNoise { kicks: KickTimes::Poisson { .. }, .. } => {
                    DriveKind::WhiteNoise { strength: 0.4, kicks: KickTimes::Poisson { rate: 50.0 } }
                }
                DriveKind::WhiteNoise { .. } => {
                    DriveKind::WhiteNoise { strength: 0.4, kicks: KickTimes::Regular { interval: tc / 3.0 } }
                }
                DriveKind::Hold { temperature, .. } => DriveKind::Hold { temperature, longest: tc / 3.0 },
                DriveKind::Rescale { temperature, .. } => {
                    DriveKind::Rescale { temperature, interval: tc / 3.0 }
                }
                DriveKind::Andersen { temperature, .. } => DriveKind::Andersen { temperature, rate: 50.0 },
                DriveKind::Named(_) => kind,
            })
            .map(|kind| Drive { kind, species: vec![0], rotational: false })
            .into_iter()
            .collect();
        check_independence(&scene, &[0.3, 0.7]);
        let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
        let mut log = Log::default();
        for k in 1..=40 {
            simulation.advance(until(0.1 * f64::from(k)), &mut log).unwrap();
            if kind.is_none() {
                let velocities = Some(simulation.frame().velocity.iter().map(|v| v * 1.01).collect());
                simulation.change(&Change { velocities, ..Change::default() }, &mut log).unwrap();
            }
        }
        let counts = check_contact_duration(&log.0, scene.bodies.len(), tc);
        assert!(counts.iter().all(|&count| count > 5), "{kind:?}: {counts:?}");
    }
}

#[test]
fn rescaling_sets_the_temperature_and_keeps_the_momentum() {
    let kind = DriveKind::Rescale { temperature: 2.5, interval: 0.25 };
    let mut simulation = Simulation::new(gas(Dimension::Three, 200, 0.8, kind), Options::default()).unwrap();
    let momentum = simulation.sample().momentum;
    for k in 1..=20 {
        simulation.advance(until(0.25 * f64::from(k)), &mut Silent).unwrap();
        let sample = simulation.sample();
        assert!((sample.temperature / 2.5 - 1.0).abs() < 1e-13, "{}", sample.temperature);
        assert!((sample.momentum - momentum).length() < 1e-11, "{}", sample.momentum);
        assert!(sample.ledger.residual.abs() < 1e-13, "{}", sample.ledger.residual);
    }
    // If only half of the gas is driven, the other half keeps its temperature, apart from collisions.
    let mut scene = gas(Dimension::Three, 200, 1.0, kind);
    scene.species.push("other".into());
    scene.bodies.iter_mut().skip(100).for_each(|body| body.species = 1);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let before = simulation.sample().species_temperature[1];
    simulation.advance(until(0.25), &mut Silent).unwrap();
    assert!((simulation.sample().species_temperature[1] / before - 1.0).abs() < 0.2);
}

/// The velocities of an Andersen gas are Maxwellian: the kinetic energy of a particle has the mean d/2 T and
/// the variance d/2 T², so its mean over independent states has a known error.
#[test]
fn an_andersen_gas_has_the_maxwell_distribution_of_its_temperature() {
    let (count, temperature) = (400, 2.5);
    let kind = DriveKind::Andersen { temperature, rate: 2.0 };
    for dimension in [Dimension::Three, Dimension::Two] {
        let d = dimension.count() as f64;
        let mut scene = gas(dimension, count, 1.0, kind);
        scene.bodies.iter_mut().for_each(|body| body.velocity = DVec3::ZERO);
        let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
        let (mut energy, mut square, mut states) = (0.0, 0.0, 0.0);
        // Between two states each particle gets 6 new velocities on average, and keeps the old one with the
        // probability e⁻⁶.
        for k in 2..60 {
            simulation.advance(until(3.0 * f64::from(k)), &mut Silent).unwrap();
            for (velocity, body) in simulation.frame().velocity.iter().zip(&scene.bodies) {
                let mass = scene.classes[body.class as usize].mass;
                let of_one = 0.5 * mass * velocity.length_squared() / temperature;
                energy += of_one;
                square += of_one * of_one;
                states += 1.0;
            }
        }
        let z = (energy / states - d / 2.0) / (d / 2.0 / states).sqrt();
        assert!(z.abs() < 4.0, "d = {d}: mean energy {}, z = {z}", energy / states);
        // A gamma distribution has ⟨E²⟩ = d(d + 2)/4 and ⟨E⁴⟩ = d(d + 2)(d + 4)(d + 6)/16.
        let (second, fourth) = (d * (d + 2.0) / 4.0, d * (d + 2.0) * (d + 4.0) * (d + 6.0) / 16.0);
        let z = (square / states - second) / ((fourth - second * second) / states).sqrt();
        assert!(z.abs() < 4.0, "d = {d}: mean square {}, z = {z}", square / states);
        assert!(simulation.ledger().residual.abs() < 1e-13, "{:?}", simulation.ledger());
    }
}

/// An elastic gas of N particles keeps all energy that it gets. A kick of variance s² per component changes
/// the energy of a particle by m v·Δ + m Δ²/2. Its mean is d m s²/2, and the mean of its square
/// m² s² v² + m² s⁴ d(d + 2)/4, with v² = d ξ₀² t on average.
#[test]
fn white_noise_heats_at_its_mean_power_and_kicks_at_intervals_keep_the_momentum() {
    let (count, time, strength) = (400_u32, 50.0, 0.4);
    for dimension in [Dimension::Three, Dimension::Two] {
        for kind in NOISE {
            let d = dimension.count() as f64;
            let mut scene = gas(dimension, count as usize, 1.0, kind);
            scene.bodies.iter_mut().for_each(|body| body.velocity = DVec3::ZERO);
            scene.classes.iter_mut().for_each(|class| class.mass = 1.0);
            let mut simulation = Simulation::new(scene, Options::default()).unwrap();
            simulation.advance(until(time), &mut Silent).unwrap();
            let sample = simulation.sample();
            let n = f64::from(count);
            // Number of kicks of a particle, s², and ⟨X²⟩ or, for a fixed number of kicks, the variance.
            let (kicks, square, fourth, share) = match kind {
                DriveKind::WhiteNoise { kicks: KickTimes::Regular { interval }, .. } => {
                    assert!(sample.momentum.length() < 1e-12 * n, "{}", sample.momentum);
                    (time / interval, strength * interval, d / 2.0, 1.0 - 1.0 / n)
                }
                DriveKind::WhiteNoise { kicks: KickTimes::Poisson { rate }, .. } => {
                    (rate * time, strength / rate, d * (d + 2.0) / 4.0, 1.0)
                }
                _ => unreachable!(),
            };
            let mean = n * kicks * d * square / 2.0 * share;
            let variance = n * kicks * (square * d * strength * time / 2.0 + fourth * square * square);
            let z = (sample.ledger.kinetic - mean) / variance.sqrt();
            assert!(z.abs() < 4.0, "{kind:?}, d = {d}: {} for {mean}, z = {z}", sample.ledger.kinetic);
            let given = sample.ledger.term(Term::DriveWork);
            assert!((given / sample.ledger.kinetic - 1.0).abs() < 1e-12, "{given}");
        }
    }
}

#[test]
fn a_driven_gas_at_rest_does_not_end_the_run() {
    let mut scene = gas(Dimension::Three, 100, 0.5, DriveKind::Andersen { temperature: 1.0, rate: 1.0 });
    scene.bodies.iter_mut().for_each(|body| body.velocity = DVec3::ZERO);
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    assert_eq!(simulation.advance(until(2.0), &mut Silent).unwrap(), Stop::Time);
    assert!(simulation.ledger().kinetic > 0.0);
    // Rescaling velocities of zero has no effect.
    scene.drives[0].kind = DriveKind::Rescale { temperature: 1.0, interval: 0.5 };
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    assert_eq!(simulation.advance(until(2.0), &mut Silent).unwrap(), Stop::Time);
    assert_eq!(simulation.ledger().kinetic, 0.0);
}

#[test]
fn damaged_states_of_drives_are_refused() {
    for kind in kinds() {
        let scene = gas(Dimension::Three, 50, 0.9, kind);
        let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
        simulation.advance(until(3.0), &mut Silent).unwrap();
        let checkpoint = simulation.checkpoint();
        for bits in [1e300_f64.to_bits(), f64::NAN.to_bits(), u64::MAX] {
            let mut damaged = checkpoint.clone();
            let drives = damaged.scalars.iter_mut().filter(|(name, _)| name.starts_with("drive."));
            drives.last().unwrap().1 = bits;
            let result = Simulation::restore(scene.clone(), Options::default(), &damaged);
            assert!(matches!(result, Err(EngineError::Checkpoint(_))), "{kind:?}, {bits:x}");
        }
    }
}
