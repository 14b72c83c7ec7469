//! Temperature, pressure and pressure tensor of samples against the states and events of the same runs: the
//! kinetic term as an integral over states between the events, by Gauss's rule, and the collisional one from
//! the impulses of the events. On which axes the velocity of the center of mass counts is stated for each
//! system.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::DVec3;
use haff_engine::{
    Boundary, Change, Correlations, Dimension, Drive, DriveKind, EventRecord, Exchange, Frame, Hole,
    KickTimes, Measure, NeighborChoice, Observer, Options, Oscillating, Partition, Partner, Sample, Shape,
    Shear, Silent, Simulation, Spin, System, ThermalWall, Until, Wall, WallLaw, WallMotion,
    conserved_momentum,
};
use haff_mechanics::{Oscillation, Restitution, Roughness, Waveform};

use crate::common::{Random, add, class, gas, scatter, set_restitution, system};

const PERIODIC: Boundary = Boundary::Periodic;
const WALLS: Boundary = Boundary::Wall;

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn start(system: &System) -> Simulation {
    Simulation::new(system.clone(), Options::default()).unwrap()
}

/// Times of all events and kicks, and Σ r ⊗ J of the contacts of particles with their times.
#[derive(Default)]
struct Events {
    times: Vec<f64>,
    virials: Vec<(f64, [f64; 9])>,
}

impl Observer for Events {
    fn wants_events(&self) -> bool {
        true
    }

    fn event(&mut self, event: &EventRecord) {
        self.times.push(event.time);
    }

    fn exchange(&mut self, exchange: &Exchange) {
        self.times.push(exchange.time);
        if let Partner::Particle { branch, .. } = exchange.partner {
            let change = exchange.changes[0];
            let impulse = -change.mass * (change.after - change.before);
            self.virials.push((exchange.time, product(branch, impulse)));
        }
    }
}

fn product(a: DVec3, b: DVec3) -> [f64; 9] {
    std::array::from_fn(|k| a[k / 3] * b[k % 3])
}

/// The masses of the particles; infinite ones are those of fixed and driven bodies.
fn masses(system: &System) -> Vec<f64> {
    system.bodies.iter().map(|body| system.classes[body.class as usize].mass).collect()
}

/// The velocities of a frame relative to the flow, and less the velocity V of the center of mass along these
/// axes; V, and the momentum relative to the flow.
fn thermal(system: &System, frame: &Frame, conserved: [bool; 3]) -> (Vec<(f64, DVec3)>, DVec3, DVec3) {
    let mut bodies: Vec<(f64, DVec3)> = masses(system)
        .into_iter()
        .zip(frame.velocity.iter().zip(&frame.position))
        .filter(|(mass, _)| mass.is_finite())
        .map(|(mass, (&velocity, position))| {
            let flow = system.domain.shear.map_or(DVec3::ZERO, |shear| {
                DVec3::AXES[shear.flow] * (shear.rate * position[shear.gradient])
            });
            (mass, velocity - flow)
        })
        .collect();
    let mass: f64 = bodies.iter().map(|(mass, _)| mass).sum();
    let momentum: DVec3 = bodies.iter().map(|(mass, velocity)| *mass * *velocity).sum();
    let common = DVec3::from_array([0, 1, 2].map(|k| if conserved[k] { momentum[k] / mass } else { 0.0 }));
    for (_, velocity) in &mut bodies {
        *velocity -= common;
    }
    (bodies, common, momentum)
}

/// Σ m c ⊗ c.
fn kinetic(bodies: &[(f64, DVec3)]) -> [f64; 9] {
    let mut sum = [0.0; 9];
    for (mass, c) in bodies {
        for (sum, term) in sum.iter_mut().zip(product(*c, *c)) {
            *sum += mass * term;
        }
    }
    sum
}

/// Nodes and weights of Gauss's rule with five points on [−1, 1].
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// A system, the axes on which momentum is conserved, and the times of its samples.
struct Case {
    name: &'static str,
    system: System,
    conserved: [bool; 3],
    times: Vec<f64>,
    /// Longest step of the quadrature: motions that are no polynomials need short ones.
    step: f64,
}

impl Case {
    fn new(name: &'static str, system: System, conserved: [bool; 3]) -> Self {
        // Intervals of all lengths, which end in the middle of flights.
        Self { name, system, conserved, times: vec![0.013, 0.9, 1.0, 2.6, 4.1], step: f64::INFINITY }
    }

    /// The mean of Σ m c ⊗ c over an interval by quadrature between the events; `simulation` is at its start.
    /// Between an axis on which momentum is conserved and another one, V and the momentum count with their
    /// means: that differs only where kicks change V.
    fn quadrature(&self, simulation: &mut Simulation, (from, to): (f64, f64), events: &[f64]) -> [f64; 9] {
        let mut breaks = vec![from];
        breaks.extend(events.iter().copied().filter(|&time| from < time && time < to));
        breaks.push(to);
        let (mut sum, mut product_of_both) = ([0.0; 9], [0.0; 9]);
        let (mut velocity, mut momentum) = (DVec3::ZERO, DVec3::ZERO);
        for pair in breaks.windows(2).filter(|pair| pair[1] > pair[0]) {
            let steps = ((pair[1] - pair[0]) / self.step).ceil().max(1.0);
            let width = (pair[1] - pair[0]) / steps;
            for step in 0..steps as usize {
                let middle = pair[0] + width * (step as f64 + 0.5);
                for (node, weight) in GAUSS {
                    simulation.advance(until(middle + 0.5 * width * node), &mut Silent).unwrap();
                    let (bodies, common, total) = thermal(&self.system, &simulation.frame(), self.conserved);
                    let weight = 0.5 * width * weight / (to - from);
                    sum.iter_mut().zip(kinetic(&bodies)).for_each(|(sum, term)| *sum += weight * term);
                    let terms = product(common, total);
                    product_of_both.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
                    velocity += weight * common;
                    momentum += weight * total;
                }
            }
        }
        simulation.advance(until(to), &mut Silent).unwrap();
        let of_means = product(velocity, momentum);
        let kicked = self.system.drives.iter().any(|drive| {
            matches!(drive.kind, DriveKind::WhiteNoise { kicks: KickTimes::Poisson { .. }, .. })
        });
        for (a, b) in [0, 1, 2].iter().flat_map(|&a| [0, 1, 2].map(|b| (a, b))) {
            if self.conserved[a] && !self.conserved[b] {
                let covariance = product_of_both[3 * a + b] - of_means[3 * a + b];
                assert!(kicked || covariance.abs() < 1e-12, "{covariance:e}");
                sum[3 * a + b] += covariance;
                sum[3 * b + a] += covariance;
            }
        }
        sum
    }

    fn check(&mut self) {
        let Self { name, .. } = *self;
        assert_eq!(conserved_momentum(&self.system), self.conserved, "{name}");
        self.system.measure = Measure {
            stress: true,
            correlations: Correlations {
                stress: true,
                interval: 0.37,
                tracers: 1,
                ..Correlations::default()
            },
            ..Measure::default()
        };
        let d = self.system.dimension.count();
        let volume: f64 = self.system.domain.size.to_array()[..d].iter().product();
        let mut events = Events::default();
        let mut simulation = start(&self.system);
        let mut found = vec![simulation.sample()];
        for &time in &self.times {
            simulation.advance(until(time), &mut events).unwrap();
            found.push(simulation.sample());
        }
        events.times.sort_by(f64::total_cmp);

        // Without the tensor, only the trace is summed.
        let plain = System { measure: Measure::default(), ..self.system.clone() };
        let mut other = start(&plain);
        other.sample();
        let mut states = start(&self.system);
        let mut from = 0.0;
        for sample in &found[1..] {
            // The run may have ended at rest.
            let to = sample.time;
            if to == from {
                break;
            }
            let mean = self.quadrature(&mut states, (from, to), &events.times);
            let (bodies, ..) = thermal(&self.system, &states.frame(), self.conserved);
            let trace = mean[0] + mean[4] + mean[8];
            // The sums of some thousand terms, whose partial sums are of the order of the result; the states
            // are those of the nearest ticks.
            let rounding = 1e-12 * trace.max(1e-3);
            let stress = sample.stress.unwrap();
            let mut virial = [0.0; 9];
            let inside = |time: f64| from < time && time <= to;
            for (_, term) in events.virials.iter().filter(|(time, _)| inside(*time)) {
                virial.iter_mut().zip(term).for_each(|(sum, term)| *sum += term);
            }
            for k in 0..9 {
                let kinetic = stress.kinetic[k] * volume;
                assert!(
                    (kinetic - mean[k]).abs() <= rounding,
                    "{name}, {from} to {to}: kinetic part {k} {kinetic:e}, from states {:e}, off by {:e}",
                    mean[k],
                    kinetic - mean[k]
                );
                let collisional = stress.collisional[k] * volume * (to - from);
                let scale = virial[0].abs() + virial[4].abs() + virial[8].abs();
                assert!(
                    (collisional - virial[k]).abs() <= 1e-12 * scale,
                    "{name}, {from} to {to}: collisional part {k} {collisional:e}, from events {:e}",
                    virial[k]
                );
            }
            let pressure = (trace + (virial[0] + virial[4] + virial[8]) / (to - from)) / (d as f64 * volume);
            other.advance(until(to), &mut Silent).unwrap();
            for found in [sample.pressure, other.sample().pressure] {
                let found = found.unwrap();
                let off = (found - pressure).abs() * d as f64 * volume;
                assert!(
                    off <= 2.0 * rounding,
                    "{name}, {from} to {to}: pressure {found:e}, expected {pressure:e}"
                );
            }
            let temperature = trace_of(&kinetic(&bodies)) / (d * bodies.len()) as f64;
            let (off, expected) = (sample.temperature - temperature, temperature.max(1e-3));
            assert!(
                off.abs() <= 1e-13 * expected,
                "{name}, t = {to}: temperature {}, of the frame {temperature}",
                sample.temperature
            );
            from = to;
        }
        self.check_resumed(&found);
    }

    /// The same samples to the last bit from a run that was resumed in the middle of intervals.
    fn check_resumed(&self, expected: &[Sample]) {
        let mut simulation = start(&self.system);
        simulation.sample();
        let mut from = 0.0;
        for (&to, expected) in self.times.iter().zip(&expected[1..]) {
            simulation.advance(until(0.5 * (from + to)), &mut Silent).unwrap();
            let checkpoint = simulation.checkpoint();
            simulation = Simulation::restore(self.system.clone(), Options::default(), &checkpoint).unwrap();
            assert_eq!(simulation.checkpoint(), checkpoint, "{}", self.name);
            simulation.advance(until(to), &mut Silent).unwrap();
            let found = simulation.sample();
            if found.time == from {
                break;
            }
            let of = |sample: &Sample| {
                let stress = sample.stress.unwrap();
                (stress.kinetic, stress.collisional, sample.pressure, sample.temperature)
            };
            assert_eq!(of(&found), of(expected), "{}, resumed before {to}", self.name);
            from = found.time;
        }
    }
}

fn trace_of(tensor: &[f64; 9]) -> f64 {
    tensor[0] + tensor[4] + tensor[8]
}

/// Particles of two sizes and masses with a common velocity.
fn moving(dimension: Dimension, boundary: [Boundary; 3], e: f64, seed: u64) -> System {
    let mut scene = system(dimension, DVec3::new(6.0, 7.0, 8.0), boundary);
    let (small, large) = (class(&mut scene, 0.4, 1.0), class(&mut scene, 0.6, 3.0));
    scatter(&mut scene, small, 7, 1.0, &mut Random(seed));
    scatter(&mut scene, large, 4, 0.5, &mut Random(seed + 1));
    let flat = dimension == Dimension::Two;
    for body in &mut scene.bodies {
        body.velocity += DVec3::new(0.7, -0.4, if flat { 0.0 } else { 0.3 });
    }
    set_restitution(&mut scene, e);
    scene
}

/// Sets the restitution of the particles with each other.
fn set_pairs(scene: &mut System, e: f64) {
    scene.contacts.pair.fill(Restitution::Constant(e));
}

fn add_wall(scene: &mut System, name: &str, point: DVec3, normal: DVec3, law: impl Into<WallLaw>) {
    let wall = Wall { name: name.into(), point, normal, motion: WallMotion::Fixed, shape: None };
    scene.walls.push(wall);
    // One contact group.
    scene.contacts.wall.push(law.into());
}

fn sine(amplitude: f64, frequency: f64, waveform: Waveform) -> WallMotion {
    let oscillation = Oscillation { waveform, amplitude, frequency };
    WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.15 })
}

#[test]
fn without_acceleration() {
    let all = [PERIODIC; 3];
    for dimension in [Dimension::Two, Dimension::Three] {
        let third = dimension == Dimension::Three;
        Case::new("periodic", moving(dimension, all, 0.8, 1), [true, true, third]).check();
        let mixed = [WALLS, PERIODIC, PERIODIC];
        Case::new("walls on x", moving(dimension, mixed, 0.9, 3), [false, true, third]).check();
        Case::new("walls", moving(dimension, [WALLS; 3], 0.9, 5), [false; 3]).check();
    }
    let mut fixed = moving(Dimension::Three, all, 0.9, 7);
    fixed.classes[1].mass = f64::INFINITY;
    fixed.bodies.truncate(8);
    fixed.bodies[7].velocity = DVec3::ZERO;
    Case::new("fixed body", fixed, [false; 3]).check();

    let mut one = system(Dimension::Two, DVec3::splat(5.0), [WALLS, PERIODIC, PERIODIC]);
    let grain = class(&mut one, 0.5, 2.0);
    add(&mut one, grain, DVec3::new(2.0, 2.0, 0.0), DVec3::new(1.0, 0.6, 0.0));
    Case::new("one particle", one, [false, true, false]).check();
}

#[test]
fn with_walls_that_are_not_those_of_the_box() {
    let elastic = Restitution::Constant(1.0);
    let all = [PERIODIC; 3];
    let mut piston = moving(Dimension::Three, [WALLS, PERIODIC, PERIODIC], 0.9, 21);
    piston.walls[0].motion = DVec3::new(-0.2, 5.0, 0.0).into();
    Case::new("piston", piston, [false, true, true]).check();

    let mut oblique = moving(Dimension::Three, [WALLS, WALLS, PERIODIC], 0.9, 23);
    oblique.bodies.retain(|body| body.position.x + body.position.y < 8.0);
    let corner = DVec3::new(6.0, 4.0, 0.0);
    add_wall(&mut oblique, "oblique", corner, -DVec3::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0), elastic);
    Case::new("oblique wall", oblique, [false, false, true]).check();

    let mut partition = moving(Dimension::Three, all, 0.9, 25);
    partition.bodies.retain(|body| body.position.y > 0.7 && body.position.y < 6.3);
    let (point, normal) = (DVec3::ZERO, DVec3::Y);
    add_wall(&mut partition, "two sides", point, normal, elastic);
    partition.walls[0].shape = Some(Shape::Partition(Partition { point, normal, hole: None }));
    Case::new("partition", partition.clone(), [true, false, true]).check();
    let hole = Hole { center: DVec3::new(3.0, 0.0, 4.0), radius: 1.5 };
    partition.walls[0].shape = Some(Shape::Partition(Partition { point, normal, hole: Some(hole) }));
    Case::new("partition with a hole", partition, [false; 3]).check();

    let mut thermal = moving(Dimension::Three, [PERIODIC, PERIODIC, WALLS], 0.9, 27);
    let law = |accommodation| ThermalWall { temperature: 2.0, accommodation, restitution: elastic };
    thermal.contacts.wall[1] = WallLaw::Thermal(law(0.5));
    Case::new("thermal wall", thermal.clone(), [false; 3]).check();
    thermal.contacts.wall[1] = WallLaw::Thermal(law(0.0));
    Case::new("thermal wall that reflects all", thermal, [true, true, false]).check();
}

/// Gives a scene spins and these rough laws of pairs and walls.
fn roughen(scene: &mut System, pair: Roughness, wall: Roughness) {
    let (flat, mut random) = (scene.dimension == Dimension::Two, Random(8));
    let mut component = |used: bool| if used { random.normal() } else { 0.0 };
    let spin =
        (0..scene.bodies.len()).map(|_| DVec3::new(component(!flat), component(!flat), component(true)));
    scene.spin = Some(Spin {
        inertia: vec![if flat { 0.5 } else { 0.4 }],
        angular_velocity: spin.collect(),
        pair: vec![pair],
        wall: vec![wall; scene.contacts.wall.len()],
    });
}

#[test]
fn rough_walls_exchange_momentum_along_them() {
    let rough = Roughness { tangential_restitution: 0.3, friction: 0.4 };
    for (wall, conserved) in [(rough, [false; 3]), (Roughness::SMOOTH, [false, true, true])] {
        let mut scene = moving(Dimension::Three, [WALLS, PERIODIC, PERIODIC], 0.9, 31);
        roughen(&mut scene, rough, wall);
        Case::new("rough", scene, conserved).check();
    }
}

#[test]
fn with_drives() {
    let drive = |kind| Drive { kind, species: vec![0], rotational: false };
    let noise = |kicks| drive(DriveKind::WhiteNoise { strength: 0.4, kicks });
    let cases = [
        ("noise at Poisson times", noise(KickTimes::Poisson { rate: 2.0 }), true),
        ("noise at intervals", noise(KickTimes::Regular { interval: 0.21 }), true),
        ("Andersen", drive(DriveKind::Andersen { temperature: 1.5, rate: 1.0 }), false),
        ("rescale", drive(DriveKind::Rescale { temperature: 1.0, interval: 0.4 }), true),
    ];
    for (name, drive, conserved) in cases {
        for dimension in [Dimension::Two, Dimension::Three] {
            let mut scene = moving(dimension, [PERIODIC; 3], 0.8, 41);
            scene.drives.push(drive.clone());
            Case::new(name, scene, [conserved, conserved, conserved && dimension == Dimension::Three])
                .check();
        }
    }
    // A bath that acts on no particle.
    let mut idle = moving(Dimension::Three, [PERIODIC; 3], 0.8, 43);
    idle.species.push("other".into());
    let kind = DriveKind::Andersen { temperature: 1.5, rate: 1.0 };
    idle.drives.push(Drive { kind, species: vec![1], rotational: false });
    Case::new("idle bath", idle, [true; 3]).check();
}

#[test]
fn in_shear() {
    for (dimension, flow, gradient) in
        [(Dimension::Two, 0, 1), (Dimension::Three, 0, 1), (Dimension::Three, 2, 0)]
    {
        let mut scene = moving(dimension, [PERIODIC; 3], 0.8, 51);
        scene.domain.shear = Some(Shear { flow, gradient, rate: 0.6, offset: 0.0 });
        let mut conserved = [true, true, dimension == Dimension::Three];
        (conserved[flow], conserved[gradient]) = (false, false);
        Case::new("shear", scene.clone(), conserved).check();
        let kicks = KickTimes::Poisson { rate: 2.0 };
        let kind = DriveKind::WhiteNoise { strength: 0.4, kicks };
        scene.drives.push(Drive { kind, species: vec![0], rotational: false });
        Case::new("shear with noise", scene, conserved).check();
    }
}

/// W = −γ̇ V ∫ P dt over the component of the gradient and the flow, also while the whole system moves.
#[test]
fn the_work_of_the_shear_is_that_of_the_pressure_tensor() {
    let mut scene = moving(Dimension::Three, [PERIODIC; 3], 0.8, 53);
    scene.domain.shear = Some(Shear { flow: 2, gradient: 0, rate: 0.6, offset: 0.0 });
    scene.measure.stress = true;
    let volume = scene.domain.size.element_product();
    let mut simulation = start(&scene);
    simulation.sample();
    let (mut before, mut largest) = (0.0, 0.0_f64);
    for k in 1..=40 {
        simulation.advance(until(0.1 * f64::from(k)), &mut Silent).unwrap();
        let sample = simulation.sample();
        let work = sample.ledger.term(haff_engine::Term::ShearWork);
        let span = 0.1 * f64::from(k) - 0.1 * f64::from(k - 1);
        let expected = -0.6 * volume * sample.stress.unwrap().total()[2] * span;
        largest = largest.max(expected.abs());
        // The work is a difference of sums since the start.
        assert!(
            (work - before - expected).abs() < 1e-12 * largest.max(work.abs()),
            "{} {expected}",
            work - before
        );
        before = work;
    }
    assert!(largest > 0.1, "{largest}");
}

#[test]
fn under_gravity() {
    let down = DVec3::new(0.0, 0.0, -1.5);
    let mut gas = moving(Dimension::Three, [PERIODIC, PERIODIC, WALLS], 1.0, 61);
    gas.domain.gravity = down;
    Case::new("gas over a floor", gas.clone(), [true, true, false]).check();

    let noise = DriveKind::WhiteNoise { strength: 0.4, kicks: KickTimes::Poisson { rate: 2.0 } };
    gas.drives.push(Drive { kind: noise, species: vec![0], rotational: false });
    Case::new("noise and gravity", gas, [true, true, false]).check();

    // Grains whose bounces end, and which slide along the floor and into walls.
    let mut rest = moving(Dimension::Three, [PERIODIC, WALLS, WALLS], 0.3, 63);
    rest.domain.gravity = down;
    Case { times: vec![0.4, 3.0, 5.5, 9.1], ..Case::new("rest", rest, [true, false, false]) }.check();

    let mut slope = system(Dimension::Two, DVec3::splat(8.0), [WALLS; 3]);
    let grain = class(&mut slope, 0.3, 1.0);
    add(&mut slope, grain, DVec3::new(4.0, 5.5, 0.0), DVec3::new(0.3, 0.0, 0.0));
    set_restitution(&mut slope, 0.4);
    add_wall(&mut slope, "slope", DVec3::ZERO, DVec3::new(-0.6, 0.8, 0.0), Restitution::Constant(0.2));
    slope.domain.gravity = DVec3::new(0.0, -2.0, 0.0);
    Case { times: vec![1.0, 3.0, 5.5, 9.1], ..Case::new("slope", slope, [false; 3]) }.check();
}

/// Flights that go on over the end of an epoch of the clock, which moves old anchors.
#[test]
fn over_several_epochs() {
    let mut gas = system(Dimension::Three, DVec3::splat(9.0), [PERIODIC, PERIODIC, WALLS]);
    let grain = class(&mut gas, 0.2, 1.0);
    scatter(&mut gas, grain, 3, 1.0, &mut Random(65));
    gas.domain.gravity = DVec3::new(0.0, 0.0, -0.7);
    let times = vec![100.0, 350.0, 350.1, 900.0];
    Case { times, ..Case::new("gas", gas.clone(), [true, true, false]) }.check();
    let mut simulation = start(&gas);
    simulation.advance(until(900.0), &mut Silent).unwrap();
    assert!(simulation.counters().epochs > 1, "{}", simulation.counters().epochs);

    // One grain is carried for ever, one is thrown again and again; they slide along the floor.
    gas.walls[0].motion = sine(0.05, 0.6, Waveform::Sine);
    gas.bodies.truncate(1);
    gas.bodies[0].position.z = 1.0;
    set_restitution(&mut gas, 0.3);
    for (name, strength) in [("carried", -1.0), ("thrown", -0.3)] {
        gas.domain.gravity.z = strength;
        let case = Case::new(name, gas.clone(), [true, true, false]);
        Case { step: 0.1, times: vec![10.0, 10.1, 777.0, 780.0], ..case }.check();
    }
}

#[test]
fn of_grains_that_roll() {
    let law = Roughness { tangential_restitution: 0.2, friction: 0.3 };
    let mut scene = system(Dimension::Two, DVec3::splat(9.0), [PERIODIC, WALLS, PERIODIC]);
    let grain = class(&mut scene, 0.4, 1.0);
    for k in 0..3 {
        let place = DVec3::new(1.5 + 2.5 * f64::from(k), 0.4 + 0.1 * f64::from(k), 0.0);
        add(&mut scene, grain, place, DVec3::new(0.1 + 0.3 * f64::from(k), 0.0, 0.0));
    }
    set_restitution(&mut scene, 0.3);
    set_pairs(&mut scene, 0.9);
    roughen(&mut scene, law, law);
    scene.domain.gravity = DVec3::new(0.0, -2.0, 0.0);
    Case::new("rolling", scene, [false; 3]).check();
}

#[test]
fn of_grains_that_are_put_to_rest() {
    let mut scene = moving(Dimension::Three, [PERIODIC, PERIODIC, WALLS], 0.5, 71);
    scene.domain.gravity = DVec3::new(0.0, 0.0, -2.0);
    scene.contacts.rest_speed = 0.05;
    Case { times: vec![2.0, 5.0, 9.0, 14.0], ..Case::new("heap", scene, [false; 3]) }.check();
}

#[test]
fn between_walls_that_oscillate() {
    for waveform in [Waveform::Sine, Waveform::Triangle] {
        let mut gas = moving(Dimension::Three, [PERIODIC, PERIODIC, WALLS], 0.8, 81);
        gas.walls[0].motion = sine(0.1, 0.8, waveform);
        gas.bodies.retain(|body| body.position.z > 0.8);
        let case = Case::new("oscillating wall", gas.clone(), [true, true, false]);
        Case { step: 0.05, ..case }.check();

        // Bounces end on the wall, which carries the grains and lets them go; they slide along it by gravity.
        gas.domain.gravity = DVec3::new(0.0, 0.0, -1.0);
        set_restitution(&mut gas, 0.2);
        set_pairs(&mut gas, 0.9);
        let case = Case::new("oscillating floor", gas.clone(), [true, true, false]);
        Case { step: 0.05, times: vec![0.4, 3.0, 5.5, 9.1, 9.2, 14.0], ..case }.check();

        let mut tilted = system(Dimension::Three, gas.domain.size, [WALLS, PERIODIC, WALLS]);
        let grain = class(&mut tilted, 0.4, 2.0);
        scatter(&mut tilted, grain, 5, 0.3, &mut Random(82));
        set_restitution(&mut tilted, 0.2);
        let floor = tilted.walls.iter().position(|wall| wall.name == "z-").unwrap();
        tilted.walls[floor].motion = sine(0.05, 0.6, waveform);
        // No series of bounces in the corners.
        tilted.contacts.wall[..2].fill(Restitution::Constant(1.0).into());
        set_pairs(&mut tilted, 0.9);
        tilted.bodies.retain(|body| body.position.z > 0.8);
        tilted.domain.gravity = DVec3::new(0.4, 0.0, -1.0);
        let case = Case::new("tilted floor", tilted, [false, true, false]);
        Case { step: 0.05, times: vec![0.4, 3.0, 5.5, 9.1, 9.2, 14.0], ..case }.check();
    }
}

/// Gravity that is set while the run goes on, spins, velocities and particles that are changed from outside:
/// the means cover what was before and what is after.
#[test]
fn over_changes_from_outside() {
    let mut scene = moving(Dimension::Three, [PERIODIC, PERIODIC, WALLS], 0.9, 91);
    scene.measure.stress = true;
    let mut falling = scene.clone();
    falling.domain.gravity = DVec3::new(0.0, 0.0, -1.5);
    let mut sheared = moving(Dimension::Three, [PERIODIC; 3], 0.9, 93);
    sheared.measure.stress = true;
    sheared.domain.shear = Some(Shear { flow: 0, gradient: 1, rate: 0.6, offset: 0.0 });
    for (first, second) in
        [(&scene, &falling), (&falling, &scene), (&falling, &falling), (&scene, &scene), (&sheared, &sheared)]
    {
        // From 0.5 to 0.9 as it was, from there to 1.2 in the other system, without particle 0 and faster.
        let (mut parts, mut until_now) = ([0.0; 9], 0.5);
        let mut part = |simulation: &mut Simulation, to: f64| {
            let sample = simulation.sample();
            let stress = sample.stress.unwrap();
            for (sum, term) in parts.iter_mut().zip(stress.kinetic) {
                *sum += term * (to - until_now);
            }
            until_now = to;
        };
        let run = |divide: &mut dyn FnMut(&mut Simulation, f64)| {
            let mut simulation =
                Simulation::restore(first.clone(), Options::default(), &start_at(first, 0.5)).unwrap();
            simulation.advance(until(0.9), &mut Silent).unwrap();
            divide(&mut simulation, 0.9);
            let velocities =
                simulation.frame().velocity.iter().map(|v| *v + DVec3::new(0.5, 0.3, -0.2)).collect();
            let change = Change { velocities: Some(velocities), remove: vec![0], ..Change::default() };
            let mut system = second.clone();
            simulation.change(&change, &mut Silent).unwrap();
            system.bodies.remove(0);
            simulation.change_system(system, &mut Silent).unwrap();
            simulation.advance(until(1.2), &mut Silent).unwrap();
            divide(&mut simulation, 1.2);
            simulation
        };
        run(&mut part);
        let sample = run(&mut |_, _| {}).sample();
        let expected = parts.map(|sum| sum / 0.7);
        let scale = trace_of(&expected);
        // Not between a free axis and z: there V and the momentum count with their means.
        for k in [0, 1, 3, 4, 8] {
            let (found, expected) = (sample.stress.unwrap().kinetic[k], expected[k]);
            assert!((found - expected).abs() < 1e-13 * scale, "{found} and {expected}");
        }
        let of_tensor = trace_of(&sample.stress.unwrap().total()) / 3.0;
        let pressure = sample.pressure.unwrap();
        assert!((pressure - of_tensor).abs() < 1e-13 * of_tensor, "{pressure} and {of_tensor}");
    }
}

/// The checkpoint of a run that was sampled at the start and at this time.
fn start_at(scene: &System, time: f64) -> haff_engine::Checkpoint {
    let mut simulation = start(scene);
    simulation.sample();
    simulation.advance(until(time), &mut Silent).unwrap();
    simulation.sample();
    simulation.checkpoint()
}

/// Sums over flights do not depend on the search, nor on the blocks that several threads take.
#[test]
fn blocks_and_searches_have_the_same_bits() {
    let mut scene = gas(8, 0.1, 0.95, 5);
    scene.domain.boundary[2] = WALLS;
    let high = DVec3::Z * scene.domain.size;
    for (name, point, normal) in [("z-", DVec3::ZERO, DVec3::Z), ("z+", high, -DVec3::Z)] {
        add_wall(&mut scene, name, point, normal, Restitution::Constant(1.0));
    }
    scene.domain.gravity = DVec3::new(0.0, 0.0, -0.3);
    scene.measure.stress = true;
    let mut expected = None;
    for (neighbors, blocks) in [
        (NeighborChoice::AllPairs, None),
        (NeighborChoice::Cells, None),
        (NeighborChoice::Lists, None),
        (NeighborChoice::Windows, None),
        (NeighborChoice::Windows, Some(2)),
        (NeighborChoice::Windows, Some(4)),
    ] {
        let options = Options { neighbors, blocks, ..Options::default() };
        let mut simulation = Simulation::new(scene.clone(), options).unwrap();
        let mut found = Vec::new();
        for k in 0..6 {
            simulation.advance(until(0.3 * f64::from(k)), &mut Silent).unwrap();
            let sample = simulation.sample();
            found
                .push((sample.pressure.unwrap().to_bits(), sample.stress.unwrap().kinetic.map(f64::to_bits)));
        }
        assert_eq!(blocks.is_some(), simulation.block_counts().events() > 0, "{neighbors:?} {blocks:?}");
        assert_eq!(*expected.get_or_insert_with(|| found.clone()), found, "{neighbors:?} {blocks:?}");
    }
}
