//! Measurements by species: they add up to those of all particles, and agree with frames.

use glam::DVec3;
use haff_engine::{
    Boundary, Correlations, Dimension, EventKind, Followed, Grid, GridAxis, Measure, Options, ProfileRow,
    Silent, Simulation, System, Until,
};

use crate::common::{Log, Random, add, check_independence, class, scatter, set_restitution, system};

const COUNTS: [usize; 3] = [80, 40, 10];

/// Three species in a box with walls across y, and a fixed body.
fn mixture(dimension: Dimension) -> System {
    let mut random = Random(21);
    let boundary = [Boundary::Periodic, Boundary::Wall, Boundary::Periodic];
    let edge = if dimension == Dimension::Two { 24.0 } else { 9.0 };
    let mut scene = system(dimension, DVec3::splat(edge), boundary);
    let fixed = class(&mut scene, 1.0, f64::INFINITY);
    let middle = if dimension == Dimension::Two { DVec3::new(12.0, 12.0, 0.0) } else { DVec3::splat(4.5) };
    add(&mut scene, fixed, middle, DVec3::ZERO);
    for (radius, mass, count, speed) in
        [(0.5, 1.0, COUNTS[0], 1.0), (0.3, 0.4, COUNTS[1], 2.0), (0.7, 5.0, COUNTS[2], 0.3)]
    {
        let kind = class(&mut scene, radius, mass);
        scatter(&mut scene, kind, count, speed, &mut random);
    }
    let kinds = [0_u32; 1].into_iter().chain((0..3).flat_map(|k| std::iter::repeat_n(k, COUNTS[k as usize])));
    for (body, kind) in scene.bodies.iter_mut().zip(kinds) {
        body.species = kind;
    }
    scene.species = ["grain", "dust", "stone"].map(str::to_owned).into();
    set_restitution(&mut scene, 0.9);
    scene
}

fn grid(scene: &System, axes: &[(usize, usize)], samples: u64, spread: bool, species: &[u32]) -> Grid {
    let axis =
        |&(axis, bins): &(usize, usize)| GridAxis { axis, low: 0.0, high: scene.domain.size[axis], bins };
    let axes = axes.iter().map(axis).collect();
    Grid { axes, interval: 1.0, samples, spread, species: species.to_vec() }
}

fn rows(scene: &System, end: f64) -> Vec<ProfileRow> {
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    let mut log = Log::default();
    simulation.advance(Until { time: end, ..Until::default() }, &mut log).unwrap();
    log.1
}

#[test]
fn fields_of_species_add_up_to_those_of_all_particles() {
    for dimension in [Dimension::Two, Dimension::Three] {
        let mut scene = mixture(dimension);
        let d = dimension.count();
        scene.measure.profiles = vec![
            grid(&scene, &[(1, 5)], 4, true, &[0, 1, 2]),
            grid(&scene, &[(0, 2), (1, 3)], 3, true, &[2, 0, 1]),
        ];
        let rows = rows(&scene, 5.0);
        assert_eq!(rows.len(), 10);
        for row in rows {
            assert_eq!(row.species.len(), 3);
            let cells = row.density.len();
            for cell in 0..cells {
                let close = |of_species: &dyn Fn(&haff_engine::CellFields) -> f64, all: f64, scale: f64| {
                    let sum: f64 = row.species.iter().map(of_species).sum();
                    assert!((sum - all).abs() <= 1e-12 * scale, "{sum} is not {all}");
                };
                let filled = |value: f64, n: f64| if n > 0.0 { value } else { 0.0 };
                let (n, rho) = (row.density[cell], row.mass_density[cell]);
                close(&|f| f.density[cell], n, n);
                close(&|f| f.mass_density[cell], rho, rho);
                let energy = filled(n * row.temperature[cell], n);
                close(&|f| filled(f.density[cell] * f.temperature[cell], f.density[cell]), energy, energy);
                for axis in 0..3 {
                    let momentum = |density: f64, v: DVec3| filled(density * v[axis], density);
                    let all = momentum(rho, row.velocity[cell]);
                    let scale = rho * (1.0 + energy.sqrt());
                    close(&|f| momentum(f.mass_density[cell], f.velocity[cell]), all, scale);
                }
                let pressure = |f: &haff_engine::CellFields, k: usize| f.pressure[cell * d * d + k];
                let trace: f64 = (0..d).map(|k| pressure(&row.all, k * (d + 1)).abs()).sum();
                for k in 0..d * d {
                    close(&|f| pressure(f, k), pressure(&row.all, k), trace);
                }
            }
        }
    }
}

/// A row of one state has the numbers of the frame of the same time.
#[test]
fn fields_of_a_species_are_those_of_its_particles_in_a_frame() {
    let mut scene = mixture(Dimension::Three);
    scene.measure.profiles = vec![grid(&scene, &[(1, 3)], 1, false, &[1])];
    let (d, size) = (3.0, scene.domain.size);
    let volume = size.x * size.y * size.z / 3.0;
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    let mut log = Log::default();
    simulation.advance(Until { time: 2.0, ..Until::default() }, &mut log).unwrap();
    let (frame, row) = (simulation.frame(), log.1.last().unwrap());
    let mass = |i: usize| scene.classes[scene.bodies[i].class as usize].mass;
    for cell in 0..3 {
        let inside =
            |i: &usize| (frame.position[*i].y / size.y * 3.0) as usize == cell && mass(*i).is_finite();
        let all: Vec<usize> = (0..scene.bodies.len()).filter(inside).collect();
        let u = all.iter().map(|&i| mass(i) * frame.velocity[i]).sum::<DVec3>()
            / all.iter().map(|&i| mass(i)).sum::<f64>();
        let own: Vec<usize> = all.into_iter().filter(|&i| scene.bodies[i].species == 1).collect();
        let n = own.len() as f64;
        let velocity = own.iter().map(|&i| frame.velocity[i]).sum::<DVec3>() / n;
        let thermal: f64 = own.iter().map(|&i| mass(i) * (frame.velocity[i] - u).length_squared()).sum();
        let found = &row.species[0];
        assert!((found.density[cell] - n / volume).abs() < 1e-13);
        assert!((found.mass_density[cell] - 0.4 * n / volume).abs() < 1e-13);
        assert!((found.velocity[cell] - velocity).length() < 1e-12);
        assert!((found.temperature[cell] / (thermal / (d * n)) - 1.0).abs() < 1e-12);
    }
}

/// Displacements of all particles are the mean of those of the species by their numbers.
#[test]
fn curves_of_species_add_up_to_those_of_all_particles() {
    let mut scene = mixture(Dimension::Three);
    let measured = |followed: Followed, scene: &mut System| {
        let (msd, vacf) = (followed.clone(), followed);
        let correlations =
            Correlations { msd, vacf, interval: 0.1, tracers: 1000, ..Correlations::default() };
        scene.measure = Measure { correlations, ..Measure::default() };
        let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
        simulation.advance(Until { time: 20.0, ..Until::default() }, &mut Silent).unwrap();
        simulation.correlations()
    };
    let all = measured(Followed::All, &mut scene);
    let each = measured(Followed::Species(vec![2, 0, 1]), &mut scene);
    let [small, middle, large] = COUNTS.map(|count| count as f64);
    for (all, each) in all.iter().zip(&each) {
        assert_eq!((all.name, &each.species[..], &all.species[..]), (each.name, &[2, 0, 1][..], &[][..]));
        assert_eq!((&all.lag, &all.count), (&each.lag, &each.count));
        for (lag, curves) in each.value.chunks_exact(3).enumerate() {
            let mean =
                (large * curves[0] + small * curves[1] + middle * curves[2]) / (large + small + middle);
            let value = all.value[lag];
            assert!(
                (mean - value).abs() < 1e-12 * all.value[0].abs().max(value.abs()),
                "{mean} is not {value}"
            );
        }
        assert_eq!(each.error.len(), each.value.len());
    }
}

/// Rates of pairs are the rows of the log by species; contacts with the fixed body count for its species.
#[test]
fn rates_of_pairs_of_species_are_those_of_the_event_log() {
    let mut scene = mixture(Dimension::Three);
    scene.measure.pair_collisions = true;
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    assert!(simulation.sample().pair_collision_rate.iter().all(|rate| rate.is_nan()));
    for (start, end) in [(0.0, 3.0), (3.0, 7.5)] {
        let mut log = Log::default();
        simulation.advance(Until { time: end, ..Until::default() }, &mut log).unwrap();
        let sample = simulation.sample();
        let (mut counts, mut flights) = ([[0.0; 3]; 3], [0.0; 3]);
        for row in log.0.iter().filter(|row| row.kind == EventKind::Collision) {
            let [a, b] = [row.i, row.j].map(|i| scene.bodies[i as usize].species as usize);
            counts[a][b] += 1.0;
            if a != b {
                counts[b][a] += 1.0;
            }
            // Body 0 is fixed.
            for i in [row.i, row.j].into_iter().filter(|&i| i > 0) {
                flights[scene.bodies[i as usize].species as usize] += 1.0;
            }
        }
        let span = end - start;
        let expected: Vec<f64> = counts.iter().flatten().map(|count| count / span).collect();
        assert_eq!(sample.pair_collision_rate, expected);
        let all: f64 = (0..3).map(|a| expected[4 * a] + expected[3 * a..3 * a + a].iter().sum::<f64>()).sum();
        assert!((all - sample.collision_rate).abs() < 1e-12 * all);
        for a in 0..3 {
            assert_eq!(sample.species_mean_free_time[a], COUNTS[a] as f64 * span / flights[a]);
        }
    }
}

#[test]
fn measurements_by_species_are_independent_of_search_slices_and_resumption() {
    let mut scene = mixture(Dimension::Three);
    scene.measure = Measure {
        pair_collisions: true,
        profiles: vec![grid(&scene, &[(1, 4)], 5, true, &[0, 2])],
        correlations: Correlations {
            msd: Followed::Species(vec![0, 2]),
            vacf: Followed::Species(vec![1]),
            interval: 0.1,
            tracers: 20,
            ..Correlations::default()
        },
        ..Measure::default()
    };
    check_independence(&scene, &[0.7, 1.4, 3.1]);
}
