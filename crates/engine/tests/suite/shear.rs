//! Simple shear: images that slide, the work of the shear, and the observables of peculiar velocities.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, Drive, DriveKind, Frame, NeighborChoice, Options, Shear, Silent, Simulation, Spin,
    System, Term, Until,
};
use haff_mechanics::Roughness;

use crate::common::{
    self, Random, check_independence, class, disks, gas, polydisperse, set_restitution, system,
};

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

/// Puts a scene under shear, with the linear profile of the flow, and without momentum.
fn shear(scene: &mut System, flow: usize, gradient: usize, rate: f64) {
    scene.domain.shear = Some(Shear { flow, gradient, rate, offset: 0.0 });
    let mass = |body: &haff_engine::Body| scene.classes[body.class as usize].mass;
    let total: f64 = scene.bodies.iter().map(mass).sum();
    let drift = scene.bodies.iter().map(|body| body.velocity * mass(body)).sum::<DVec3>() / total;
    for body in &mut scene.bodies {
        body.velocity += DVec3::AXES[flow] * (rate * body.position[gradient]) - drift;
    }
}

/// Gives all contacts one rough law, and particles spins.
fn roughen(scene: &mut System, beta: f64, mu: f64) {
    let flat = scene.dimension == Dimension::Two;
    let mut random = Random(11);
    let mut component = |used: bool| if used { random.normal() } else { 0.0 };
    let law = Roughness { tangential_restitution: beta, friction: mu };
    scene.spin = Some(Spin {
        inertia: vec![if flat { 0.5 } else { 0.4 }],
        angular_velocity: (0..scene.bodies.len())
            .map(|_| DVec3::new(component(!flat), component(!flat), component(true)))
            .collect(),
        pair: vec![law],
        wall: Vec::new(),
    });
}

#[test]
#[ignore = "long: scripts/test all"]
fn trajectory_under_shear_is_independent_of_search_slices_and_resumption() {
    for (flow, gradient, rate, seed) in [(0, 1, 0.7, 1), (2, 0, -1.3, 2), (1, 2, 20.0, 3), (0, 1, 1e-3, 4)] {
        let mut scene = gas(5, 0.2, 0.8, seed);
        shear(&mut scene, flow, gradient, rate);
        check_independence(&scene, &[0.5, 3.0]);
        let mut scene = polydisperse(7, 0.15, seed);
        set_restitution(&mut scene, 0.9);
        shear(&mut scene, flow, gradient, rate);
        roughen(&mut scene, 0.4, 0.3);
        check_independence(&scene, &[0.5, 3.0]);
    }
    for (flow, rate) in [(0, 0.5), (1, -2.0)] {
        let mut scene = disks(9, 0.4, 7);
        set_restitution(&mut scene, 0.8);
        shear(&mut scene, flow, 1 - flow, rate);
        scene.measure.stress = true;
        let kind = DriveKind::Rescale { temperature: 1.0, interval: 0.3 };
        scene.drives = vec![Drive { kind, species: vec![0], rotational: false }];
        let simulation = check_independence(&scene, &[0.5, 3.0]);
        assert!(simulation.ledger().term(Term::DriveWork) != 0.0);
    }
}

/// Boxes that are many times longer along the flow than along the gradient: images are displaced by up to
/// half of an edge, many times as far as the faces are apart.
#[test]
#[ignore = "long: scripts/test all"]
fn windows_and_lists_run_boxes_of_any_ratio() {
    for (ratio, dimension) in [(8.0, Dimension::Three), (25.0, Dimension::Three), (60.0, Dimension::Two)] {
        let size = DVec3::new(3.0 * ratio, 3.0, 3.0);
        let mut scene = system(dimension, size, [Boundary::Periodic; 3]);
        set_restitution(&mut scene, 0.9);
        let grain = class(&mut scene, 0.5, 1.0);
        common::scatter(&mut scene, grain, (6.0 * ratio) as usize, 1.0, &mut Random(7));
        shear(&mut scene, 0, 1, 0.8);
        for neighbors in [NeighborChoice::Windows, NeighborChoice::Lists] {
            let options = Options { neighbors, ..Options::default() };
            Simulation::new(scene.clone(), options).unwrap_or_else(|why| panic!("{ratio}: {why}"));
        }
        let simulation = check_independence(&scene, &[0.5, 3.0]);
        assert!(simulation.counters().collisions > 5 * ratio as u64);
    }
}

/// A frame of the lab after each collision, computed without the engine: positions without wrapping, every
/// pair of particles with all images near it, contact times by the quadratic formula.
struct Reference {
    position: Vec<DVec3>,
    velocity: Vec<DVec3>,
    size: DVec3,
    rate: f64,
    e: f64,
    time: f64,
}

impl Reference {
    /// Edge vectors of the box: the second one is that along y, displaced along x.
    fn image(&self, [x, y, z]: [i32; 3]) -> (DVec3, DVec3) {
        let [x, y, z] = [x, y, z].map(f64::from);
        let along = self.rate * self.size.y * y;
        let place = DVec3::new(x * self.size.x + along * self.time, y * self.size.y, z * self.size.z);
        (place, DVec3::new(along, 0.0, 0.0))
    }

    /// The next collision: its delay, the particles and the image of the second one.
    fn next(&self) -> (f64, usize, usize, [i32; 3]) {
        let mut best = (f64::INFINITY, 0, 0, [0; 3]);
        for i in 0..self.position.len() {
            for j in i + 1..self.position.len() {
                let d = self.position[j] - self.position[i];
                let up = -(d.y / self.size.y).round() as i32;
                let beside = -(d.z / self.size.z).round() as i32;
                for (y, z) in (-2..=2).flat_map(|y| (-2..=2).map(move |z| (up + y, beside + z))) {
                    let moved = (d + self.image([0, y, 0]).0).x;
                    let along = -(moved / self.size.x).round() as i32;
                    for x in along - 4..=along + 4 {
                        let (place, speed) = self.image([x, y, z]);
                        let (r, v) = (d + place, self.velocity[j] + speed - self.velocity[i]);
                        let b = r.dot(v);
                        let root = b * b - v.length_squared() * (r.length_squared() - 1.0);
                        if b < 0.0 && root > 0.0 {
                            let t = (r.length_squared() - 1.0).max(0.0) / (-b + root.sqrt());
                            if t < best.0 {
                                best = (t, i, j, [x, y, z]);
                            }
                        }
                    }
                }
            }
        }
        best
    }

    fn step(&mut self) {
        let (delay, i, j, image) = self.next();
        for (position, velocity) in self.position.iter_mut().zip(&self.velocity) {
            *position += *velocity * delay;
        }
        self.time += delay;
        let (place, speed) = self.image(image);
        let n = (self.position[j] + place - self.position[i]).normalize();
        let approach = (self.velocity[i] - self.velocity[j] - speed).dot(n);
        let impulse = 0.5 * (1.0 + self.e) * approach;
        self.velocity[i] -= n * impulse;
        self.velocity[j] += n * impulse;
    }

    /// The largest difference from a frame at the same time, in positions and velocities of images.
    fn difference(&self, frame: &Frame) -> f64 {
        let mut largest: f64 = 0.0;
        for i in 0..self.position.len() {
            let (image, speed) = self.image(frame.image[i]);
            // In the frame images are counted in a box that is displaced by at most half an edge.
            let turns = self.rate * self.size.y * self.time / self.size.x;
            let turns = turns.round() * f64::from(frame.image[i][1]) * self.size.x;
            let place = frame.position[i] + image - DVec3::new(turns, 0.0, 0.0);
            largest = largest.max((place - self.position[i]).abs().max_element());
            let velocity = frame.velocity[i] + speed;
            largest = largest.max((velocity - self.velocity[i]).abs().max_element());
        }
        largest
    }
}

#[test]
fn trajectory_equals_one_in_the_frame_of_the_lab() {
    let mut crossed = 0;
    for (seed, rate, edge) in [(1, 1.0, 3.0), (2, -0.4, 2.6), (3, 3.0, 4.0), (4, 0.1, 2.1), (5, -6.0, 5.0)] {
        let size = DVec3::new(edge, 2.7, 2.2);
        let mut scene = system(Dimension::Three, size, [Boundary::Periodic; 3]);
        set_restitution(&mut scene, 0.9);
        let grain = class(&mut scene, 0.5, 1.0);
        common::scatter(&mut scene, grain, 4, 1.0, &mut Random(seed));
        shear(&mut scene, 0, 1, rate);
        let mut reference = Reference {
            position: scene.bodies.iter().map(|body| body.position).collect(),
            velocity: scene.bodies.iter().map(|body| body.velocity).collect(),
            size,
            rate,
            e: 0.9,
            time: 0.0,
        };
        let mut simulation = Simulation::new(scene, Options::default()).unwrap();
        for collisions in 1..=14 {
            reference.step();
            simulation.advance(Until { collisions, ..Until::default() }, &mut Silent).unwrap();
            let late = (simulation.time() - reference.time).abs();
            let difference = reference.difference(&simulation.frame());
            // Differences grow by a factor of about ten at each collision of a particle.
            let bound = 1e-15 * (1.0 + 4.0 * rate.abs() * size.y) * 10.0_f64.powf(0.6 * collisions as f64);
            assert!(late < bound && difference < bound, "{seed}, {collisions}: {late:e}, {difference:e}");
        }
        crossed += usize::from(simulation.frame().image.iter().any(|image| image[1] != 0));
    }
    assert!(crossed >= 3, "{crossed} with particles across the faces of the gradient");
}

#[test]
fn shear_of_rate_zero_has_the_trajectory_without_shear() {
    let mut scene = gas(6, 0.25, 0.9, 3);
    let run = |scene: &System, neighbors| {
        let options = Options { neighbors, ..Options::default() };
        let mut simulation = Simulation::new(scene.clone(), options).unwrap();
        simulation.advance(Until { collisions: 5000, ..Until::default() }, &mut Silent).unwrap();
        simulation.state_hash()
    };
    let plain = run(&scene, NeighborChoice::Cells);
    scene.domain.shear = Some(Shear { flow: 0, gradient: 1, rate: 0.0, offset: 0.0 });
    assert_eq!(run(&scene, NeighborChoice::Cells), plain);
    assert_eq!(run(&scene, NeighborChoice::AllPairs), plain);
}

/// W = −γ̇ V ∫ P_yx dt, with the pressure tensor and the pressure as means over intervals of very different
/// lengths.
#[test]
fn work_of_shear_is_the_integral_of_the_shear_stress() {
    for (rate, rough) in [(0.8, false), (-2.5, true)] {
        let mut scene = gas(6, 0.2, 0.85, 9);
        shear(&mut scene, 2, 0, rate);
        if rough {
            roughen(&mut scene, 0.5, f64::INFINITY);
        }
        scene.measure.stress = true;
        let volume = scene.domain.size.x.powi(3);
        // Row: gradient, x. Column: flow, z.
        let power = |stress: &[f64; 9]| -rate * volume * stress[2];
        let work = common::check_stress_power(scene, Term::ShearWork, 11.0, power);
        assert!(work > 100.0);
    }
}

/// In a steady state the profile of velocity is linear.
#[test]
fn mean_velocity_grows_linearly_along_the_gradient() {
    use haff_engine::{Grid, GridAxis};
    let mut scene = gas(8, 0.15, 0.9, 5);
    shear(&mut scene, 0, 1, 1.5);
    let edge = scene.domain.size.y;
    let axis = GridAxis { axis: 1, low: 0.0, high: edge, bins: 4 };
    scene.measure.profiles =
        vec![Grid { axes: vec![axis], interval: 20.0, samples: 40, spread: false, species: Vec::new() }];
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let mut log = common::Log::default();
    simulation.advance(until(20.0), &mut log).unwrap();
    let row = &log.1[0];
    let sample = simulation.sample();
    for (k, (velocity, temperature)) in row.velocity.iter().zip(&row.temperature).enumerate() {
        let flow = 1.5 * edge * (k as f64 + 0.5) / 4.0;
        // 128 particles, some 40 states, correlated over a few.
        let error = 4.0 * (sample.temperature / (128.0 * 5.0)).sqrt();
        assert!((velocity.x - flow).abs() < error && velocity.y.abs() < error, "{k}: {velocity} {flow}");
        assert!((temperature / sample.temperature - 1.0).abs() < 0.3, "{temperature}");
    }
}

/// Windows follow the images over many edges, in boxes of several shapes, dilute and dense ones.
#[test]
#[ignore = "long: scripts/test all"]
fn windows_have_the_trajectory_of_cells_in_boxes_of_any_shape() {
    for (shape, packing, rate, e) in [
        ([12, 12, 12], 0.1, 1.0, 0.9),
        ([12, 12, 12], 0.4, -3.0, 0.8),
        ([30, 9, 6], 0.2, 0.5, 0.7),
        ([8, 30, 7], 0.02, 2.0, 0.9),
        ([10, 12, 14], 0.3, -40.0, 0.95),
    ] {
        let volume = std::f64::consts::PI / 6.0 / packing;
        let step = f64::cbrt(volume);
        let size = DVec3::from_array(shape.map(|n| f64::from(n) * step));
        let mut scene = system(Dimension::Three, size, [Boundary::Periodic; 3]);
        set_restitution(&mut scene, e);
        let grain = class(&mut scene, 0.5, 1.0);
        let mut random = Random(17);
        for k in 0..shape.iter().product::<i32>() {
            let site = [k % shape[0], k / shape[0] % shape[1], k / shape[0] / shape[1]];
            let position = DVec3::from_array(site.map(|c| (f64::from(c) + 0.5) * step));
            let velocity = DVec3::new(random.normal(), random.normal(), random.normal());
            common::add(&mut scene, grain, position, velocity);
        }
        shear(&mut scene, 0, 1, rate);
        let run = |neighbors| {
            let options = Options { neighbors, ..Options::default() };
            let mut simulation = Simulation::new(scene.clone(), options).unwrap();
            assert_eq!(simulation.neighbors(), neighbors);
            let mut hashes = Vec::new();
            for collisions in [10_000, 40_000] {
                simulation.advance(Until { collisions, ..Until::default() }, &mut Silent).unwrap();
                simulation.measure_overlap().unwrap();
                hashes.push((simulation.state_hash(), simulation.ledger().terms));
            }
            (hashes, simulation.time() * rate)
        };
        let (windows, strain) = run(NeighborChoice::Windows);
        let (cells, _) = run(NeighborChoice::Cells);
        assert_eq!(windows, cells, "{shape:?}, {packing}, {rate}");
        let (lists, _) = run(NeighborChoice::Lists);
        assert_eq!(lists, cells, "{shape:?}, {packing}, {rate}");
        // Images have slid by more than an edge.
        assert!((strain * size.y / size.x).abs() > 1.0, "{shape:?}: {strain}");
    }
}
