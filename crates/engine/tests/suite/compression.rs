//! Boxes whose edges become shorter or longer: growth of particles, work of the flow, and observables.

use glam::DVec3;
use haff_engine::{
    Boundary, Compression, Dimension, NeighborChoice, Options, Silent, Simulation, System, Term, Until,
};
use haff_mechanics::Roughness;

use crate::common::{
    self, Random, check_independence, class, disks, gas, polydisperse, set_restitution, system,
};

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

/// Compresses the box of a scene, with the flow of the box, and without momentum.
fn compress(scene: &mut System, rates: DVec3) {
    scene.domain.compression = Some(Compression { rates, inside: 1.0 });
    let mass = |body: &haff_engine::Body| scene.classes[body.class as usize].mass;
    let total: f64 = scene.bodies.iter().map(mass).sum();
    let drift = scene.bodies.iter().map(|body| body.velocity * mass(body)).sum::<DVec3>() / total;
    let periodic = scene.domain.boundary.map(|boundary| f64::from(u8::from(boundary == Boundary::Periodic)));
    for body in &mut scene.bodies {
        body.velocity -= rates * DVec3::from_array(periodic) * body.position + drift;
    }
}

/// Gives all contacts one rough law, and particles spins.
fn roughen(scene: &mut System, beta: f64, mu: f64) {
    let mut random = Random(11);
    let law = Roughness { tangential_restitution: beta, friction: mu };
    scene.spin = Some(haff_engine::Spin {
        inertia: vec![0.4],
        angular_velocity: (0..scene.bodies.len())
            .map(|_| DVec3::new(random.normal(), random.normal(), random.normal()))
            .collect(),
        pair: vec![law],
        wall: vec![law; scene.walls.len()],
    });
}

#[test]
#[ignore = "long: scripts/test all"]
fn trajectory_under_compression_is_independent_of_search_slices_and_resumption() {
    for (rates, seed) in [
        (DVec3::splat(0.05), 1),
        (DVec3::new(0.1, 0.0, 0.0), 2),
        (DVec3::new(-0.3, 0.08, 0.08), 3),
        (DVec3::splat(-2.0), 4),
    ] {
        let mut scene = gas(5, 0.1, 0.8, seed);
        compress(&mut scene, rates);
        check_independence(&scene, &[0.5, 3.0]);
        let mut scene = polydisperse(7, 0.05, seed);
        set_restitution(&mut scene, 0.9);
        roughen(&mut scene, 0.4, 0.3);
        compress(&mut scene, rates);
        scene.measure.stress = true;
        check_independence(&scene, &[0.5, 3.0]);
    }
    let mut scene = disks(9, 0.3, 7);
    set_restitution(&mut scene, 0.8);
    compress(&mut scene, DVec3::new(0.05, -0.02, 0.0));
    let kind = haff_engine::DriveKind::Rescale { temperature: 1.0, interval: 0.3 };
    scene.drives = vec![haff_engine::Drive { kind, species: vec![0], rotational: false }];
    check_independence(&scene, &[0.5, 3.0]);
}

/// Particles whose diameters grow as 1 + γ t in a fixed box, without the engine: every pair with all images
/// near it, contact times by the quadratic formula. With x = r/(1 + γ t) and τ = t/(1 + γ t) it is the
/// compressed box.
struct Growing {
    position: Vec<DVec3>,
    velocity: Vec<DVec3>,
    size: DVec3,
    rate: f64,
    e: f64,
    time: f64,
}

impl Growing {
    fn next(&self) -> (f64, usize, usize, DVec3) {
        let (sigma, growth) = (1.0 + self.rate * self.time, self.rate);
        let mut best = (f64::INFINITY, 0, 0, DVec3::ZERO);
        let count = self.position.len();
        for (i, j) in (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j))) {
            let d = self.position[j] - self.position[i];
            let nearest = -(d / self.size).round();
            let v = self.velocity[j] - self.velocity[i];
            for k in 0..125 {
                let image =
                    nearest + DVec3::new(f64::from(k % 5), f64::from(k / 5 % 5), f64::from(k / 25)) - 2.0;
                let r = d + image * self.size;
                // |r + v t|² = (σ + growth t)²
                let a = v.length_squared() - growth * growth;
                let b = r.dot(v) - growth * sigma;
                let c = (r.length_squared() - sigma * sigma).max(0.0);
                let root = b * b - a * c;
                if b < 0.0 && root > 0.0 {
                    let t = c / (-b + root.sqrt());
                    if t < best.0 {
                        best = (t, i, j, image);
                    }
                }
            }
        }
        best
    }

    /// Returns the pair.
    fn step(&mut self) -> [u32; 2] {
        let (delay, i, j, image) = self.next();
        for (position, velocity) in self.position.iter_mut().zip(&self.velocity) {
            *position += *velocity * delay;
        }
        self.time += delay;
        let n = (self.position[j] + image * self.size - self.position[i]).normalize();
        // The surfaces of the two approach by γ σ₀ more.
        let approach = (self.velocity[i] - self.velocity[j]).dot(n) + self.rate;
        let impulse = 0.5 * (1.0 + self.e) * approach;
        self.velocity[i] -= n * impulse;
        self.velocity[j] += n * impulse;
        [i as u32, j as u32]
    }

    /// Time in the compressed box.
    fn projected(&self) -> f64 {
        self.time / (1.0 + self.rate * self.time)
    }
}

#[test]
fn growing_particles_have_the_collisions_of_the_compressed_box() {
    for (seed, rate, e) in [(1, 0.05, 1.0), (2, 0.3, 0.8), (3, 0.05, 0.8), (4, 1.0, 1.0)] {
        let size = DVec3::new(5.3, 5.0, 5.6);
        let mut scene = system(Dimension::Three, size, [Boundary::Periodic; 3]);
        set_restitution(&mut scene, e);
        let grain = class(&mut scene, 0.5, 1.0);
        common::scatter(&mut scene, grain, 60, 1.0, &mut Random(seed));
        let mut growing = Growing {
            position: scene.bodies.iter().map(|body| body.position).collect(),
            velocity: scene.bodies.iter().map(|body| body.velocity).collect(),
            size,
            rate,
            e,
            time: 0.0,
        };
        // At time 0 w = dx/dτ = v − γ r: the velocity of the lab in the compressed box.
        scene.domain.compression = Some(Compression { rates: DVec3::splat(rate), inside: 1.0 });
        for body in &mut scene.bodies {
            body.velocity -= rate * body.position;
        }
        let mut simulation = Simulation::new(scene, Options::default()).unwrap();
        let mut log = common::Log::default();
        for collisions in 1..=100 {
            let pair = growing.step();
            simulation.advance(Until { collisions, ..Until::default() }, &mut log).unwrap();
            let row = log.0.last().unwrap();
            assert_eq!([row.i, row.j], pair, "{seed}: collision {collisions}");
            let late = (simulation.time() - growing.projected()).abs();
            assert!(late < 1e-10, "{seed}: collision {collisions} is {late:e} late");
        }
    }
}

/// Work and mean pressure: with a box that is compressed along one axis −∫ V P : G dt is −a V₀ ∫ P_xx dt.
#[test]
fn work_of_a_compression_along_one_axis_is_the_integral_of_the_normal_stress() {
    for (rates, rough) in [(DVec3::new(0.02, 0.0, 0.0), false), (DVec3::new(0.0, -0.5, 0.0), true)] {
        let mut scene = gas(6, 0.2, 0.85, 9);
        if rough {
            roughen(&mut scene, 0.5, f64::INFINITY);
        }
        compress(&mut scene, rates);
        scene.measure.stress = true;
        let volume = scene.domain.size.x.powi(3);
        let axis = usize::from(rough);
        let power = |stress: &[f64; 9]| rates[axis] * volume * stress[4 * axis];
        let work = common::check_stress_power(scene, Term::DriveWork, 5.0, power);
        assert!(work * rates[axis] > 0.0);
    }
}

/// A box that was large enough for lists becomes smaller: lists are made again for the present density, with
/// thin skins, as long as they can run it.
#[test]
fn lists_are_used_while_a_box_becomes_small() {
    let mut scene = gas(4, 0.3, 1.0, 5);
    compress(&mut scene, DVec3::splat(0.1));
    let options = Options { neighbors: NeighborChoice::Lists, ..Options::default() };
    let mut simulation = Simulation::new(scene, options).expect("lists can run the box");
    // To a packing fraction of 0.51.
    for step in 1..=8 {
        simulation.advance(until(0.2 * f64::from(step)), &mut Silent).expect("the box is not jammed");
        assert_eq!(simulation.neighbors(), NeighborChoice::Lists, "edge {}", simulation.edges()[0].x);
    }
}

/// Lists and windows have the trajectory of cells, in dilute and dense boxes.
#[test]
#[ignore = "long: scripts/test all"]
fn all_searches_have_one_trajectory_while_a_box_becomes_dense() {
    for (n, packing, rates, e) in [
        (12, 0.02, DVec3::splat(0.01), 0.9),
        (9, 0.2, DVec3::splat(0.08), 1.0),
        (9, 0.4, DVec3::splat(0.01), 0.9),
        (16, 0.3, DVec3::new(0.1, 0.0, 0.0), 0.8),
        (16, 0.3, DVec3::new(-0.4, 0.1, 0.1), 0.9),
        (10, 0.45, DVec3::splat(-0.3), 1.0),
    ] {
        let mut scene = gas(n, packing, e, 3);
        compress(&mut scene, rates);
        let run = |neighbors| {
            let options = Options { neighbors, ..Options::default() };
            let mut simulation = Simulation::new(scene.clone(), options).unwrap();
            assert_eq!(simulation.neighbors(), neighbors);
            let mut hashes = Vec::new();
            for collisions in [2_000, 20_000, 60_000] {
                simulation.advance(Until { collisions, ..Until::default() }, &mut Silent).unwrap();
                simulation.measure_overlap().unwrap();
                hashes.push((simulation.state_hash(), simulation.ledger().terms, simulation.time()));
            }
            hashes
        };
        let cells = run(NeighborChoice::Cells);
        assert_eq!(run(NeighborChoice::Lists), cells, "{rates}");
        assert_eq!(run(NeighborChoice::Windows), cells, "{rates}");
    }
}

/// T V^{2/3} of a dilute gas, in two dimensions T V, at any rate: peculiar velocities change as 1/s. What
/// collisions add is 4 φ of it, in two dimensions 2 φ, per unit of ln V.
#[test]
fn a_dilute_gas_is_compressed_adiabatically() {
    for (dimension, rate) in [(Dimension::Three, 0.002), (Dimension::Three, 0.1), (Dimension::Two, 0.01)] {
        let d = dimension.count();
        let mut scene = system(dimension, DVec3::splat(120.0), [Boundary::Periodic; 3]);
        let grain = class(&mut scene, 0.5, 1.0);
        let count = if d == 3 { 300 } else { 4 };
        common::scatter(&mut scene, grain, count, 1.0, &mut Random(3));
        compress(&mut scene, DVec3::new(rate, rate, if d == 3 { rate } else { 0.0 }));
        let mut simulation = Simulation::new(scene, Options::default()).unwrap();
        let before = simulation.sample();
        simulation.advance(until(0.3 / rate), &mut Silent).unwrap();
        let after = simulation.sample();
        let invariant =
            |sample: &haff_engine::Sample| sample.temperature * sample.box_volume.powf(2.0 / d as f64);
        let ratio = invariant(&after) / invariant(&before);
        assert!((ratio - 1.0).abs() < 1e-3, "{dimension:?}, {rate}: {ratio}");
        let work = after.ledger.term(Term::DriveWork);
        let gained = after.ledger.kinetic - before.ledger.kinetic;
        assert!((work / gained - 1.0).abs() < 1e-12, "{work} {gained}");
    }
}

/// The heating of a dense fluid that is compressed slowly, d ln T = ⅔ Z d ln φ, with Z of Carnahan and
/// Starling (J. Chem. Phys. 51, 635 (1969)). A bulk viscosity adds a part in proportion to the rate, which
/// two rates remove.
#[test]
fn a_dense_fluid_is_heated_by_its_pressure() {
    let (from, to) = (0.1_f64, 0.3_f64);
    let mut scene = gas(12, from, 1.0, 5);
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    // Out of the lattice first.
    simulation.advance(Until { collisions: 20_000, ..Until::default() }, &mut Silent).unwrap();
    let frame = simulation.frame();
    for (body, (position, velocity)) in
        scene.bodies.iter_mut().zip(frame.position.iter().zip(&frame.velocity))
    {
        (body.position, body.velocity) = (*position, *velocity);
    }
    let z = |eta: f64| (1.0 + eta + eta.powi(2) - eta.powi(3)) / (1.0 - eta).powi(3);
    let steps = 1000;
    let step = (to / from).ln() / f64::from(steps);
    let expected: f64 =
        (0..steps).map(|k| 2.0 / 3.0 * step * z(from * ((f64::from(k) + 0.5) * step).exp())).sum();
    let excess = [0.008, 0.004].map(|rate| {
        let mut scene = scene.clone();
        compress(&mut scene, DVec3::splat(rate));
        let mut simulation = Simulation::new(scene, Options::default()).unwrap();
        let before = simulation.sample().temperature;
        let end = (1.0 - (from / to).cbrt()) / rate;
        simulation.advance(until(end), &mut Silent).unwrap();
        let sample = simulation.sample();
        assert!((sample.packing_fraction / to - 1.0).abs() < 1e-12);
        (sample.temperature / before).ln() - expected
    });
    // Of ln T = 1.8: the equation of state is right to 0.2 %, and the fixed momentum counts one part in
    // 1,728.
    assert!(excess[0] > excess[1] && excess[1] > 0.0, "{excess:?}");
    assert!((2.0 * excess[1] - excess[0]).abs() < 5e-3, "{excess:?}");
}

/// Reversed velocities, and edges that go back: an elastic gas retraces its path. Differences grow by a
/// factor of about ten in each collision of a particle.
#[test]
fn a_reversed_compression_returns() {
    for (rates, seed) in [(DVec3::splat(0.1), 1), (DVec3::new(0.3, -0.1, 0.05), 2)] {
        let mut scene = gas(5, 0.15, 1.0, seed);
        compress(&mut scene, rates);
        let start = scene.clone();
        let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
        simulation.advance(Until { collisions: 250, ..Until::default() }, &mut Silent).unwrap();
        let (time, frame) = (simulation.time(), simulation.frame());
        let mut back = scene;
        back.domain.size = start.domain.edges(time);
        back.domain.compression =
            Some(Compression { rates: -rates * start.domain.size / back.domain.size, inside: 1.0 });
        for (body, (position, velocity)) in
            back.bodies.iter_mut().zip(frame.position.iter().zip(&frame.velocity))
        {
            (body.position, body.velocity) = (*position, -*velocity);
        }
        let mut simulation = Simulation::new(back, Options::default()).unwrap();
        simulation.advance(until(time), &mut Silent).unwrap();
        let collisions = simulation.counters().collisions;
        assert_eq!(collisions, 250);
        let frame = simulation.frame();
        let size = start.domain.size;
        let mut largest: f64 = 0.0;
        for (body, (position, velocity)) in
            start.bodies.iter().zip(frame.position.iter().zip(&frame.velocity))
        {
            let moved = *position - body.position;
            let turns = (moved / size).round();
            largest = largest.max((moved - turns * size).length());
            // An image of another box has the flow there.
            largest = largest.max((*velocity + body.velocity - turns * rates * size).length());
        }
        assert!(largest < 1e-15 * 10.0_f64.powf(2.0 * 250.0 / 125.0), "{largest:e}");
    }
}
