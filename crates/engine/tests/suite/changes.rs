//! Changes of the state from outside: balances of energy and momentum, independence of the search, and
//! changes that are not possible.

use glam::DVec3;
use haff_engine::{
    Boundary, Change, Dimension, Drive, DriveKind, EngineError, EventKind, Hole, KickTimes, NeighborChoice,
    NewParticle, Options, Oscillating, Partition, Shape, Silent, Simulation, System, Term, Until, Wall,
    WallMotion,
};
use haff_mechanics::{Oscillation, Waveform};

use crate::common::{Log, Random, add, class, gas, scatter_within_room, set_restitution, system};

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn start(system: &System) -> Simulation {
    Simulation::new(system.clone(), Options::default()).unwrap()
}

fn velocities(simulation: &Simulation, change: impl Fn(DVec3) -> DVec3) -> Change {
    let velocities = simulation.frame().velocity.into_iter().map(change).collect();
    Change { velocities: Some(velocities), ..Change::default() }
}

fn new(position: DVec3, velocity: DVec3) -> NewParticle {
    NewParticle { position, velocity, angular_velocity: DVec3::ZERO, radius: 0.5, mass: 1.0, species: 0 }
}

/// Grains that fall, rest and bounce between walls, with a drive and everything measured.
fn busy() -> System {
    let mut system = system(Dimension::Three, DVec3::splat(8.0), [Boundary::Wall; 3]);
    system.domain.gravity = DVec3::new(0.0, 0.0, -5.0);
    let grain = class(&mut system, 0.5, 1.0);
    scatter_within_room(&mut system, grain, 40, 1.0, &mut Random(4));
    set_restitution(&mut system, 0.8);
    let noise = DriveKind::WhiteNoise { strength: 0.1, kicks: KickTimes::Poisson { rate: 1.0 } };
    system.drives.push(Drive { kind: noise, species: vec![0], rotational: false });
    system.measure.stress = true;
    system.measure.wall_forces = true;
    system
}

#[test]
fn balances_of_energy_and_momentum_hold_across_changes() {
    let mut simulation = start(&busy());
    let first = simulation.sample();
    for k in 1..=8 {
        simulation.advance(until(f64::from(k)), &mut Silent).unwrap();
        let change = match k % 4 {
            0 => velocities(&simulation, |v| 1.5 * v),
            1 => velocities(&simulation, |v| DVec3::new(v.x, v.y, 2.0)),
            2 => Change { remove: vec![k as u32, 3 * k as u32], ..Change::default() },
            _ => {
                let place = simulation.frame().position[0];
                let free = DVec3::new(8.0 - place.x, 8.0 - place.y, 7.4);
                Change { add: vec![new(free, DVec3::new(0.0, 1.0, -1.0))], ..Change::default() }
            }
        };
        let (before, ledger) = (simulation.time(), simulation.ledger());
        simulation.change(&change, &mut Silent).unwrap();
        assert_eq!(simulation.time(), before);
        let now = simulation.ledger();
        assert!(now.residual.abs() < 1e-13, "{k}: {:e}", now.residual);
        let given = now.term(Term::Change) - ledger.term(Term::Change);
        let gained = now.kinetic + now.potential - ledger.kinetic - ledger.potential;
        assert!((given - gained).abs() < 1e-9 + 1e-12 * gained.abs(), "{k}: {given} and {gained}");
    }
    simulation.advance(until(9.0), &mut Silent).unwrap();
    let sample = simulation.sample();
    assert!(sample.ledger.residual.abs() < 1e-12, "{:e}", sample.ledger.residual);
    let off = sample.momentum - first.momentum - sample.external_impulse;
    assert!(off.length() < 1e-10, "{off}");
}

#[test]
fn a_change_does_not_depend_on_the_search_and_is_a_row_of_the_event_log() {
    let mut ends = Vec::new();
    for neighbors in
        [NeighborChoice::AllPairs, NeighborChoice::Cells, NeighborChoice::Lists, NeighborChoice::Windows]
    {
        let options = Options { neighbors, ..Options::default() };
        let mut simulation = Simulation::new(busy(), options).unwrap();
        let mut log = Log::default();
        simulation.advance(until(1.5), &mut log).unwrap();
        let change = velocities(&simulation, |v| 30.0 * v);
        simulation.change(&change, &mut log).unwrap();
        simulation.advance(until(2.0), &mut log).unwrap();
        let rows: Vec<_> = log.0.iter().filter(|row| row.kind == EventKind::Change).collect();
        assert_eq!(rows.iter().map(|row| row.time).collect::<Vec<_>>(), [1.5]);
        assert!(log.0.windows(2).all(|pair| pair[0].time <= pair[1].time));
        ends.push((simulation.state_hash(), log.0.len()));
    }
    assert!(ends.windows(2).all(|pair| pair[0] == pair[1]), "{ends:?}");
}

#[test]
fn a_changed_run_resumes_with_the_same_bits() {
    let mut whole = start(&busy());
    whole.advance(until(1.0), &mut Silent).unwrap();
    let change = velocities(&whole, |v| -2.0 * v);
    whole.change(&change, &mut Silent).unwrap();
    let checkpoint = whole.checkpoint();
    let mut resumed = Simulation::restore(busy(), Options::default(), &checkpoint).unwrap();
    for simulation in [&mut whole, &mut resumed] {
        simulation.advance(until(3.0), &mut Silent).unwrap();
    }
    assert_eq!(whole.state_hash(), resumed.state_hash());
}

#[test]
fn moved_particles_collide_where_they_are() {
    let mut system = system(Dimension::Three, DVec3::splat(20.0), [Boundary::Periodic; 3]);
    let grain = class(&mut system, 0.5, 1.0);
    add(&mut system, grain, DVec3::splat(1.0), DVec3::X);
    add(&mut system, grain, DVec3::splat(10.0), DVec3::ZERO);
    let mut simulation = start(&system);
    simulation.advance(until(1.0), &mut Silent).unwrap();
    // Beyond the upper face: wrapped, and counted as an image.
    let positions = vec![DVec3::new(25.0, 5.0, 5.0), DVec3::new(8.0, 5.0, 5.0)];
    simulation.change(&Change { positions: Some(positions), ..Change::default() }, &mut Silent).unwrap();
    let frame = simulation.frame();
    assert_eq!((frame.position[0], frame.image[0]), (DVec3::splat(5.0), [1, 0, 0]));
    let mut log = Log::default();
    simulation.advance(until(4.0), &mut log).unwrap();
    assert_eq!(log.0.len(), 1);
    assert!((log.0[0].time - 3.0).abs() < 1e-12, "{}", log.0[0].time);
}

#[test]
fn the_pressure_tensor_and_the_pressure_agree_across_changes() {
    let mut system = gas(6, 0.2, 0.9, 5);
    system.measure.stress = true;
    let mut simulation = start(&system);
    simulation.sample();
    simulation.advance(until(0.5), &mut Silent).unwrap();
    let change = velocities(&simulation, |v| 2.0 * v);
    simulation.change(&change, &mut Silent).unwrap();
    simulation.advance(until(0.8), &mut Silent).unwrap();
    simulation.change(&Change { remove: vec![5, 17], ..Change::default() }, &mut Silent).unwrap();
    simulation.advance(until(1.0), &mut Silent).unwrap();
    let sample = simulation.sample();
    let (stress, pressure) = (sample.stress.unwrap().total(), sample.pressure.unwrap());
    let trace = (stress[0] + stress[4] + stress[8]) / 3.0;
    assert!((trace - pressure).abs() < 1e-12 * pressure, "{trace} and {pressure}");
}

#[test]
fn impossible_changes_are_refused_and_change_nothing() {
    let mut system = gas(4, 0.2, 1.0, 7);
    let mut simulation = start(&system);
    simulation.advance(until(0.3), &mut Silent).unwrap();
    let before = (simulation.state_hash(), simulation.ledger());
    let place = simulation.frame().position[3];
    let rows = |vector: DVec3, count: usize| Some(vec![vector; count]);
    let added = |set: fn(&mut NewParticle)| {
        let mut particle = new(place, DVec3::X);
        set(&mut particle);
        Change { add: vec![particle], ..Change::default() }
    };
    for (change, expected) in [
        (
            Change { velocities: rows(DVec3::X, 3), ..Change::default() },
            "velocities: 3 vectors for 64 particles",
        ),
        (
            Change { velocities: rows(DVec3::NAN, 64), ..Change::default() },
            "velocities[0, 0] = NaN: must be a finite number, at most 1e50 in size",
        ),
        (
            Change { velocities: rows(DVec3::Y * 1e200, 64), ..Change::default() },
            "velocities[0, 1] = 1e200: must be",
        ),
        (Change { positions: rows(DVec3::X, 64), ..Change::default() }, "would overlap with"),
        (
            Change { positions: rows(DVec3::Z * 1e12, 64), ..Change::default() },
            "positions[0, 2] = 1e12: must be at most",
        ),
        (Change { remove: vec![1, 1], ..Change::default() }, "particle 1 is removed twice"),
        (Change { remove: vec![64], ..Change::default() }, "there is no particle 64 of 64"),
        (Change { remove: (0..64).collect(), ..Change::default() }, "no particle is left"),
        (Change { add: vec![new(place, DVec3::ZERO)], ..Change::default() }, "would overlap with particle"),
        (added(|new| new.mass = -1.0), "mass[0] = -1: must be a positive number, or inf"),
        (added(|new| new.mass = 1e60), "mass[0] = 1e60: must be between 1e-50 and 1e50"),
        (added(|new| new.radius = 0.0), "radius[0] = 0: must be a positive finite number"),
        (added(|new| new.radius = 1e-30), "radius[0] = 1e-30: must be at least"),
        (added(|new| new.radius = 90.0), "radius[0] = 90: must be at most"),
        (added(|new| new.velocity.x = -1e200), "velocities[0, 0] = -1e200: must be a finite number"),
        (
            added(|new| new.angular_velocity.z = 1e200),
            "angular_velocities[0, 2] = 1e200: must be a finite number",
        ),
        (added(|new| new.angular_velocity.z = 1.0), "the scene has no spin"),
        (added(|new| new.species = 9), "species = 9: must be one of 1"),
    ] {
        match simulation.change(&change, &mut Silent) {
            Err(EngineError::Change(why)) => assert!(why.contains(expected), "{why}, not {expected}"),
            other => panic!("{expected}: {other:?}"),
        }
        assert_eq!((simulation.state_hash(), simulation.ledger()), before, "{expected}");
    }
    system.measure.correlations = haff_engine::Correlations {
        msd: haff_engine::Followed::All,
        interval: 0.1,
        tracers: 9,
        ..Default::default()
    };
    let mut followed = start(&system);
    let refused = followed.change(&Change { remove: vec![0], ..Change::default() }, &mut Silent);
    assert!(matches!(refused, Err(EngineError::Change(why)) if why.contains("correlations follow")));
    let positions = Some(followed.frame().position);
    let refused = followed.change(&Change { positions, ..Change::default() }, &mut Silent);
    assert!(matches!(refused, Err(EngineError::Change(why)) if why.contains("mean square displacement")));
}

/// What a change of a system says that cannot be made.
fn refusal(system: &System, change: &Change) -> String {
    match start(system).change(change, &mut Silent) {
        Err(EngineError::Change(why)) => why,
        other => panic!("{other:?}"),
    }
}

#[test]
fn particles_that_no_scene_can_have_are_not_added() {
    let add_one = |particle: NewParticle| Change { add: vec![particle], ..Change::default() };
    let mut sheared = gas(4, 0.05, 1.0, 7);
    let edge = sheared.domain.size.x;
    sheared.domain.shear = Some(haff_engine::Shear { flow: 0, gradient: 1, rate: 0.1, offset: 0.0 });
    let place = DVec3::splat(0.3);
    let wide = NewParticle { radius: 0.3 * edge, ..new(place, DVec3::X) };
    assert!(refusal(&sheared, &add_one(wide)).contains("radius[0] ="));
    let fixed = NewParticle { mass: f64::INFINITY, radius: 0.01, ..new(place, DVec3::ZERO) };
    assert!(refusal(&sheared, &add_one(fixed)).contains("must be finite in a box that deforms"));

    // Two bodies of infinite mass that overlap; one that an oscillating wall would sweep through.
    let mut vibrated = system(Dimension::Three, DVec3::splat(8.0), [Boundary::Wall; 3]);
    let grain = class(&mut vibrated, 0.5, f64::INFINITY);
    add(&mut vibrated, grain, DVec3::splat(4.0), DVec3::ZERO);
    let fixed = |z: f64| NewParticle { mass: f64::INFINITY, ..new(DVec3::new(4.0, 4.0, z), DVec3::ZERO) };
    assert!(
        refusal(&vibrated, &add_one(fixed(4.5)))
            .contains("particle 0 would overlap with particle 1 by 5.0e-1")
    );
    let oscillation = Oscillation { waveform: Waveform::Sine, amplitude: 0.4, frequency: 1.0 };
    vibrated.walls[4].motion = WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.0 });
    assert!(
        refusal(&vibrated, &add_one(fixed(0.8))).contains("would sweep through this body of infinite mass")
    );
    start(&vibrated).change(&add_one(fixed(1.0)), &mut Silent).unwrap();

    // A hole must be larger than every particle.
    let mut parted = system(Dimension::Three, DVec3::splat(8.0), [Boundary::Wall; 3]);
    let grain = class(&mut parted, 0.1, 1.0);
    add(&mut parted, grain, DVec3::splat(2.0), DVec3::ZERO);
    let (point, normal) = (DVec3::splat(4.0), DVec3::X);
    let hole = Some(Hole { center: point, radius: 0.4 });
    let shape = Some(Shape::Partition(Partition { point, normal, hole }));
    parted.walls.push(Wall { name: "sieve".to_owned(), point, normal, motion: WallMotion::Fixed, shape });
    let law = parted.contacts.wall[0];
    parted.contacts.wall.push(law);
    let large = NewParticle { radius: 0.4, ..new(DVec3::new(2.0, 2.0, 6.0), DVec3::ZERO) };
    assert!(refusal(&parted, &add_one(large)).contains("must be smaller than every hole"));
}

/// What a search has done up to a time, per collision: predictions, windows, epochs; and the search.
fn work(simulation: &mut Simulation, time: f64) -> ([f64; 3], NeighborChoice) {
    let before = simulation.counters();
    simulation.advance(until(time), &mut Silent).unwrap();
    let now = simulation.counters();
    let collisions = (now.collisions - before.collisions) as f64;
    let since = |now: u64, before: u64| (now - before) as f64 / collisions;
    let counts = [
        since(now.predictions, before.predictions),
        since(now.windows, before.windows),
        since(now.epochs, before.epochs),
    ];
    (counts, simulation.neighbors())
}

#[test]
fn a_removed_particle_no_longer_sets_the_search_and_the_tick() {
    let light = (Boundary::Periodic, 1e-12, DVec3::ZERO);
    let fixed = (Boundary::Wall, f64::INFINITY, DVec3::new(0.0, 0.0, -1.0));
    for (boundary, mass, gravity) in [light, fixed] {
        let mut system = system(Dimension::Three, DVec3::splat(16.0), [boundary; 3]);
        system.domain.gravity = gravity;
        let grain = class(&mut system, 0.5, 1.0);
        scatter_within_room(&mut system, grain, 400, 1.0, &mut Random(6));
        let odd = class(&mut system, 0.25, mass);
        scatter_within_room(&mut system, odd, 1, 1.0, &mut Random(7));
        // A thermostat gives a light particle a speed that the tick has to suit.
        let kind = DriveKind::Andersen { temperature: 1.0, rate: 0.1 };
        system.drives.push(Drive { kind, species: vec![0], rotational: false });
        let mut simulation = start(&system);
        let remove = Change { remove: vec![400], ..Change::default() };
        simulation.change(&remove, &mut Silent).unwrap();
        system.bodies.pop();
        system.classes.pop();
        let mut fresh = start(&system);
        let (left, without) = (work(&mut simulation, 2.0), work(&mut fresh, 2.0));
        assert_eq!(left.1, without.1, "mass {mass}");
        for (left, without) in left.0.into_iter().zip(without.0) {
            assert!(left <= 1.1 * without + 0.01, "mass {mass}: {left} per collision, {without} without it");
        }
    }
}

/// The busy system without drives, after a while, and its system with the changes of `change`.
fn changed(change: impl Fn(&mut System)) -> (Simulation, System) {
    let mut system = busy();
    system.drives.clear();
    let mut simulation = start(&system);
    simulation.advance(until(3.0), &mut Silent).unwrap();
    change(&mut system);
    (simulation, system)
}

#[test]
#[ignore = "long: scripts/test all"]
fn a_run_goes_on_in_a_system_with_other_laws_walls_and_gravity() {
    let (mut simulation, system) = changed(|system| {
        set_restitution(system, 0.4);
        system.contacts.tc = 1e-4;
        system.domain.gravity = DVec3::new(0.0, 0.0, -2.0);
    });
    let (before, frame, mass) = (simulation.sample(), simulation.frame(), 1.0);
    let mut log = Log::default();
    simulation.change_system(system.clone(), &mut log).unwrap();
    assert_eq!((simulation.time(), log.0.last().map(|row| row.kind)), (3.0, Some(EventKind::Change)));
    let after = simulation.frame();
    assert_eq!((&frame.position, &frame.velocity), (&after.position, &after.velocity));
    // The potential energy m g z changes with g, and the ledger takes it.
    let heights: f64 = frame.position.iter().map(|position| mass * position.z).sum();
    let ledger = simulation.ledger();
    let gained = ledger.term(Term::Change);
    assert!((gained + 3.0 * heights).abs() < 1e-12 * heights, "{gained} for heights {heights}");
    assert!(ledger.residual.abs() < 1e-13, "{}", ledger.residual);
    simulation.advance(until(6.0), &mut Silent).unwrap();
    let sample = simulation.sample();
    assert!(sample.ledger.residual.abs() < 1e-13 && sample.collisions > before.collisions);
    let off = (sample.momentum - before.momentum) - (sample.external_impulse - before.external_impulse);
    assert!(off.length() < 1e-12 * sample.external_impulse.length(), "momentum is off by {off}");
    // A checkpoint belongs to the new system, and each search gives the same bits.
    let hash = simulation.state_hash();
    for neighbors in [NeighborChoice::Cells, NeighborChoice::AllPairs] {
        let options = Options { neighbors, ..Options::default() };
        let mut old = busy();
        old.drives.clear();
        let mut other = Simulation::new(old, options).unwrap();
        other.advance(until(3.0), &mut Silent).unwrap();
        other.change_system(system.clone(), &mut Silent).unwrap();
        let mut other = Simulation::restore(system.clone(), options, &other.checkpoint()).unwrap();
        other.advance(until(6.0), &mut Silent).unwrap();
        assert_eq!(other.state_hash(), hash, "{neighbors:?}");
    }
}

type Edit = fn(&mut System);

#[test]
fn systems_with_another_box_particles_drives_or_measurements_are_refused() {
    let changes: [(&str, Edit); 6] = [
        ("the box cannot change", |system| system.domain.size.x = 9.0),
        ("the box cannot change", |system| system.domain.boundary[0] = Boundary::Periodic),
        ("drives and their seed", |system| system.drives = busy().drives),
        ("measurements, and the number of walls,", |system| system.measure.stress = false),
        ("particles, their sizes and masses", |system| system.classes[0].mass = 2.0),
        ("particles, their sizes and masses", |system| system.bodies.truncate(39)),
    ];
    for (why, change) in changes {
        let (mut simulation, system) = changed(change);
        let hash = simulation.state_hash();
        let error = simulation.change_system(system, &mut Silent).unwrap_err();
        assert!(matches!(&error, EngineError::Change(text) if text.contains(why)), "{error}");
        assert_eq!(simulation.state_hash(), hash);
    }
}
