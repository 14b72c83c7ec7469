//! Packings: no overlap, exact counts, all particles inside, independent of the number of threads.

use glam::DVec3;
use haff_engine::{Boundary, System};
use haff_scene::{NoStates, Scene, parse};

fn scene(text: &str) -> Scene {
    parse("test.toml", &format!("run = {{ until = 1.0 }}\n{text}"), &[], &NoStates)
        .unwrap_or_else(|errors| panic!("{errors}\n{text}"))
}

fn refused(text: &str) -> String {
    match parse("test.toml", &format!("run = {{ until = 1.0 }}\n{text}"), &[], &NoStates) {
        Ok(_) => panic!("accepted: {text}"),
        Err(errors) => errors.to_string(),
    }
}

/// Largest overlap over contact distance, all pairs and walls, by brute force with an independent image rule.
fn worst(system: &System) -> f64 {
    let radius = |k: usize| system.classes[system.bodies[k].class as usize].radius;
    let n = system.bodies.len();
    let mut worst = f64::NEG_INFINITY;
    for i in 0..n {
        let p = system.bodies[i].position;
        for wall in &system.walls {
            worst = worst.max((radius(i) - (p - wall.point).dot(wall.normal)) / radius(i));
        }
        for j in i + 1..n {
            let mut d = system.bodies[j].position - p;
            for axis in 0..3 {
                if system.domain.boundary[axis] == Boundary::Periodic {
                    let length = system.domain.size[axis];
                    d[axis] -= length * (d[axis] / length).round();
                }
            }
            let contact = radius(i) + radius(j);
            worst = worst.max((contact - d.length()) / contact);
        }
    }
    worst
}

fn assert_sound(scene: &Scene, count: usize, what: &str) {
    assert_eq!(scene.system.bodies.len(), count, "{what}");
    for body in &scene.system.bodies {
        for axis in 0..scene.system.dimension.count() {
            let (x, length) = (body.position[axis], scene.system.domain.size[axis]);
            let inside = match scene.system.domain.boundary[axis] {
                Boundary::Periodic => (0.0..length).contains(&x),
                Boundary::Wall => (0.0..=length).contains(&x),
                Boundary::Open => true,
            };
            assert!(inside, "{what}: {} outside", body.position);
        }
    }
    let overlap = worst(&scene.system);
    assert!(overlap <= 1e-12, "{what}: overlap {overlap:.2e} of contact, allowed 1e-12");
}

fn gas(domain: &str, count: usize, positions: &str, extra: &str) -> String {
    format!(
        "domain = {domain}\ninitial = {{ positions = \"{positions}\" }}\n\
         species = [{{ name = \"a\", count = {count}, radius = 0.5, mass = 1.0 }}]\n{extra}"
    )
}

#[test]
fn fcc_fills_a_cube_to_the_densest_packing() {
    for count in [4, 32, 108, 500, 1372] {
        let text = gas("{ packing_fraction = 0.7404804 }", count, "fcc", "");
        assert_sound(&scene(&text), count, "densest fcc");
    }
    // The exact limit: all neighbors touch.
    let text = gas("{ packing_fraction = 0.740480489693061 }", 500, "fcc", "");
    assert_sound(&scene(&text), 500, "touching fcc");
}

#[test]
fn lattices_hold_any_count_in_any_box() {
    for count in [1, 2, 3, 5, 17, 100, 333] {
        for domain in [
            "{ packing_fraction = 0.25 }",
            "{ size = [40.0, 10.0, 4.0] }",
            "{ size = [9.0, 9.0, 9.0], boundary = [\"wall\", \"wall\", \"wall\"] }",
            "{ size = [9.0, 12.0, 9.0], boundary = [\"periodic\", \"wall\", \"open\"] }",
        ] {
            assert_sound(&scene(&gas(domain, count, "lattice", "")), count, domain);
        }
    }
}

#[test]
fn hexagonal_lattice_is_dense() {
    // 2 × 2√3 per four disks: the densest packing in a box that fits it.
    let size = format!("{{ size = [20.0, {}] }}", 10.0 * 3.0_f64.sqrt() * (1.0 + 1e-14));
    let text = format!("dimension = 2\n{}", gas(&size, 400, "hexagonal", ""));
    let packed = scene(&text);
    assert_sound(&packed, 400, "densest disks");
    assert!((packed.packing_fraction - 0.906_899_68).abs() < 1e-6, "φ = {}", packed.packing_fraction);
    let text = format!("dimension = 2\n{}", gas("{ packing_fraction = 0.85 }", 1000, "hexagonal", ""));
    assert_sound(&scene(&text), 1000, "disks at 0.85 in a square");
}

#[test]
fn lattices_omit_sites_blocked_by_walls_and_bodies() {
    let extra = "particle = [{ position = [6.0, 6.0, 6.0], radius = 2.5, mass = inf }]\n\
                 wall = [{ name = \"slope\", plane = { point = [6.0, 6.0, 2.0], normal = [1.0, 0.0, 2.0] } }]";
    let text = gas(
        "{ size = [12.0, 12.0, 12.0], boundary = [\"wall\", \"periodic\", \"wall\"] }",
        300,
        "fcc",
        extra,
    );
    assert_sound(&scene(&text), 301, "blocked lattice");
    let small = "particle = [{ position = [3.0, 3.0, 3.0], radius = 0.01, mass = 1.0 }]";
    let text = gas("{ size = [6.0, 6.0, 6.0] }", 200, "fcc", small);
    assert_sound(&scene(&text), 201, "a speck in a lattice");
    assert!(refused(&gas("{ size = [6.0, 6.0, 6.0] }", 306, "fcc", "")).contains("the lattice has room for"));
}

#[test]
fn random_packings_reach_a_packing_fraction_of_one_half() {
    for (fraction, count) in [(0.05, 500), (0.3, 1000), (0.45, 1000), (0.5, 2000)] {
        let text = gas(&format!("{{ packing_fraction = {fraction} }}"), count, "random", "");
        assert_sound(&scene(&text), count, &format!("random at {fraction}"));
    }
    let text = format!("dimension = 2\n{}", gas("{ packing_fraction = 0.7 }", 1000, "random", ""));
    assert_sound(&scene(&text), 1000, "random disks at 0.7");
    let walls = "{ size = [11.0, 11.0, 11.0], boundary = [\"wall\", \"wall\", \"wall\"] }";
    let extra = "particle = [{ position = [5.0, 5.0, 5.0], radius = 2.0, mass = inf }]\n\
                 wall = [{ name = \"slope\", plane = { point = [5.0, 5.0, 1.0], normal = [1.0, 0.0, 3.0] } }]";
    assert_sound(&scene(&gas(walls, 800, "random", extra)), 801, "random between walls");
}

#[test]
fn random_packings_of_many_sizes_have_no_overlap() {
    for radius in [
        "{ uniform = [0.2, 0.8] }",
        "{ normal = [0.5, 0.1], min = 0.3, max = 0.8 }",
        "{ uniform = [0.01, 1.0] }",
    ] {
        let text = format!(
            "domain = {{ packing_fraction = 0.5 }}\ninitial = {{ positions = \"random\" }}\n\
             species = [{{ name = \"a\", count = 1000, radius = {radius}, density = 1.0 }}, \
             {{ name = \"b\", count = 5, radius = 2.0, density = 1.0 }}]"
        );
        assert_sound(&scene(&text), 1005, radius);
    }
}

#[test]
fn packings_are_independent_of_threads() {
    let text = gas("{ packing_fraction = 0.48 }", 1500, "random", "");
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| scene(&text)).system
    };
    assert!(on(1) == on(2), "one and two threads differ");
    assert!(on(2) == on(5), "two and five threads differ");
}

#[test]
fn new_species_does_not_change_random_numbers_of_the_others() {
    let one = "domain = { size = [40.0, 40.0, 40.0] }\ninitial = { positions = \"random\" }\n\
               species = [{ name = \"a\", count = 50, radius = { uniform = [0.4, 0.6] }, density = 1.0 }";
    let alone = scene(&format!("{one}]"));
    let more = scene(&format!("{one}, {{ name = \"b\", count = 9, radius = 0.1, mass = 1.0 }}]"));
    for k in 0..50 {
        let radius = |scene: &Scene| scene.system.classes[scene.system.bodies[k].class as usize].radius;
        assert_eq!(radius(&alone), radius(&more), "radius of particle {k}");
        assert_eq!(
            alone.system.bodies[k].position, more.system.bodies[k].position,
            "position of particle {k}"
        );
    }
}

#[test]
fn velocities_have_zero_momentum_and_the_exact_temperature() {
    for (dimension, d) in [(2, 2.0), (3, 3.0)] {
        let text = format!(
            "dimension = {dimension}\ndomain = {{ packing_fraction = 0.2 }}\ninitial = {{ temperature = 2.5 }}\n\
             species = [{{ name = \"a\", count = 300, radius = 0.5, mass = 1.0 }}, \
             {{ name = \"b\", count = 100, radius = 0.5, mass = 7.0 }}, \
             {{ name = \"fixed\", count = 10, radius = 0.5, mass = inf }}]"
        );
        let system = scene(&text).system;
        let mass = |k: usize| system.classes[system.bodies[k].class as usize].mass;
        let finite: Vec<usize> = (0..410).filter(|&k| mass(k).is_finite()).collect();
        let momentum: DVec3 = finite.iter().map(|&k| system.bodies[k].velocity * mass(k)).sum();
        let energy: f64 = finite.iter().map(|&k| mass(k) * system.bodies[k].velocity.length_squared()).sum();
        let temperature = energy / (d * 400.0);
        assert!(momentum.length() < 1e-10, "momentum {momentum}");
        assert!((temperature / 2.5 - 1.0).abs() < 1e-13, "T = {temperature}, expected 2.5");
        assert!(system.bodies[400..].iter().all(|body| body.velocity == DVec3::ZERO), "fixed bodies move");
    }
}

#[test]
fn packing_fraction_is_that_of_the_box() {
    for (dimension, fraction) in [(2, 0.37), (3, 0.21)] {
        let text = format!(
            "dimension = {dimension}\n{}",
            gas(&format!("{{ packing_fraction = {fraction} }}"), 777, "lattice", "")
        );
        let found = scene(&text).packing_fraction;
        assert!((found / fraction - 1.0).abs() < 1e-13, "φ = {found}, expected {fraction}");
    }
}

#[test]
fn expected_collision_rate_is_that_of_kinetic_theory() {
    // One species: ω = 4 n σ² g₀ √(πT/m) with Carnahan–Starling's g₀, 2 n σ g₀ √(πT/m) with Henderson's.
    let n: f64 = 4000.0;
    let pi = std::f64::consts::PI;
    let eta = 0.3;
    let text = gas("{ packing_fraction = 0.3 }", 4000, "fcc", "");
    let expected =
        4.0 * (6.0 * eta / pi) * (1.0 - eta / 2.0) / (1.0_f64 - eta).powi(3) * pi.sqrt() * (n - 1.0) / n;
    let found = scene(&text).collision_rate;
    assert!((found / expected - 1.0).abs() < 1e-12, "ω = {found}, theory {expected}");
    let text = format!("dimension = 2\n{text}");
    let text = text.replace("fcc", "lattice");
    let expected =
        2.0 * (4.0 * eta / pi) * (1.0 - 7.0 * eta / 16.0) / (1.0 - eta).powi(2) * pi.sqrt() * (n - 1.0) / n;
    let found = scene(&text).collision_rate;
    assert!((found / expected - 1.0).abs() < 1e-12, "ω = {found}, theory {expected}");
}
