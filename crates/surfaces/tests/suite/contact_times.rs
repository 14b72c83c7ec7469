//! Contact times with every shape against 400-bit arithmetic, with and without gravity: up to 10⁵ random
//! flights each.

use glam::DVec3;
use haff_mechanics::{RelativeFlight, Surface};
use haff_surfaces::{Mesh, Rectangle, Revolution, Side, Sphere};
use haff_testing::Random;

use crate::big::{Big, Vector, big, flight, from_profile, from_triangle, nearest};

/// Flights of each shape, half of them under gravity: before a commit, and in all tests.
const FEW: usize = 5_000;
const FLIGHTS: usize = 100_000;
/// Within these times contacts are wanted.
const WITHIN: f64 = 30.0;
/// The largest error of a time by its tolerance.
const BOUND: f64 = 8.0;

fn direction(random: &mut Random) -> DVec3 {
    DVec3::new(random.normal(), random.normal(), random.normal()).normalize()
}

/// What was found of one shape.
#[derive(Debug, Default)]
struct Found {
    contacts: usize,
    misses: usize,
    /// Contacts whose exact time is off by more than 10⁻¹² of it: all are grazing or short.
    beyond: usize,
    worst: f64,
}

/// Flies past a shape from everywhere around it, and compares the times with the exact distances.
fn check(
    flights: usize,
    name: &str,
    seed: u64,
    surface: &dyn Surface,
    exact: impl Fn(&Vector) -> Big,
    size: f64,
) -> Found {
    let mut random = Random(seed);
    let mut found = Found::default();
    while found.contacts + found.misses < flights {
        let radius = 0.3 * 10_f64.powf(random.uniform(-1.5, 0.5));
        let position = DVec3::from_array([0; 3].map(|_| random.uniform(-size, size)));
        if surface.distance(position) < radius {
            continue;
        }
        let velocity = direction(&mut random) * 10_f64.powf(random.uniform(-1.0, 1.0));
        let is_accelerated = (found.contacts + found.misses) % 2 == 1;
        let gravity =
            if is_accelerated { direction(&mut random) * random.uniform(0.1, 3.0) } else { DVec3::ZERO };
        let path = RelativeFlight::new(position, velocity, gravity);
        let time = surface.time_to_contact(&path, radius, WITHIN).filter(|&time| time <= WITHIN);
        let end = time.unwrap_or(WITHIN);
        // No earlier contact: the sphere moves by less than a part of its radius between two samples.
        for k in 0..100 {
            let at = end * f64::from(k) / 100.0;
            let distance = surface.approach(path.at(at), DVec3::ZERO).0;
            assert!(distance > radius * (1.0 - 1e-12) - 1e-13, "{name}: {path:?} {radius} at {at} of {end}");
        }
        let Some(time) = time else {
            found.misses += 1;
            continue;
        };
        found.contacts += 1;
        let gap = nearest(&(exact(&flight(position, velocity, gravity, time)) - big(radius)));
        let rate = surface.approach(path.at(time), path.velocity_at(time)).1;
        let scale = position.length()
            + velocity.length() * time
            + 0.5 * gravity.length() * time * time
            + radius
            + size;
        // One rounding of the terms of the position, by the closing speed, and of the time.
        let tolerance = f64::EPSILON * (scale / rate.abs() + time);
        let error = gap / rate;
        if error.abs() > 1e-12 * time {
            found.beyond += 1;
            assert!(tolerance > 1e-14 * time, "{name}: {path:?} {radius}: {time} is off by {error:e}");
        }
        // A contact that only grazes by rounding has no closing speed.
        let error = (error.abs() / tolerance).min(gap.abs() / (f64::EPSILON * scale));
        found.worst = found.worst.max(error);
        assert!(error < BOUND, "{name}: {path:?} {radius}: {time} is off by {error} tolerances");
    }
    println!("{name:34} {found:?}");
    assert!(found.contacts > flights / 20, "{name}: {found:?}");
    assert!(found.beyond < found.contacts / 50, "{name}: {found:?}");
    found
}

#[test]
fn spheres() {
    past_spheres(FEW);
}

#[test]
#[ignore = "long: scripts/test all"]
fn spheres_in_many_flights() {
    past_spheres(FLIGHTS);
}

fn past_spheres(flights: usize) {
    let center = DVec3::new(0.3, -0.2, 0.1);
    for side in [Side::Inside, Side::Outside, Side::Both] {
        let sphere = Sphere { center, radius: 2.0, side };
        let exact = |x: &Vector| {
            let height = x.minus(&Vector::of(center)).length() - big(2.0);
            if height < Big::ZERO { -height } else { height }
        };
        check(flights, &format!("sphere, {side:?}"), 11, &sphere, exact, 4.0);
    }
}

#[test]
fn cylinders() {
    past_cylinders(FEW);
}

#[test]
#[ignore = "long: scripts/test all"]
fn cylinders_in_many_flights() {
    past_cylinders(FLIGHTS);
}

fn past_cylinders(flights: usize) {
    let (point, axis) = (DVec3::new(0.1, 0.2, -1.3), DVec3::new(0.3, -0.4, 1.2));
    let radius = 1.7;
    let line = |a: [f64; 2], b: [f64; 2], limited| (a.map(big), b.map(big), limited);
    for side in [Side::Inside, Side::Outside, Side::Both] {
        let whole = [line([radius, 0.0], [radius, 1.0], false)];
        let exact = |x: &Vector| from_profile(x, point, axis, &whole);
        check(
            flights,
            &format!("cylinder, {side:?}"),
            12,
            &Revolution::cylinder(point, axis, radius, side),
            exact,
            4.0,
        );

        let length = 3.0;
        let mut lines = vec![line([radius, 0.0], [radius, length], true)];
        if side != Side::Both {
            lines.push(line([0.0, 0.0], [radius, 0.0], true));
            lines.push(line([0.0, length], [radius, length], true));
        }
        let surface = Revolution::finite_cylinder(point, axis, radius, length, side);
        let exact = |x: &Vector| from_profile(x, point, axis, &lines);
        check(flights, &format!("cylinder of finite length, {side:?}"), 13, &surface, exact, 4.0);
    }
}

#[test]
fn cones() {
    past_cones(FEW);
}

#[test]
#[ignore = "long: scripts/test all"]
fn cones_in_many_flights() {
    past_cones(FLIGHTS);
}

fn past_cones(flights: usize) {
    let (apex, axis, angle) = (DVec3::new(0.1, 0.2, -2.3), DVec3::new(0.3, -0.4, 1.2), 0.6_f64);
    // The shape has the rounded sine and cosine of the angle.
    let (sin, cos) = angle.sin_cos();
    for side in [Side::Inside, Side::Outside, Side::Both] {
        for [start, end] in [[0.0, f64::INFINITY], [0.0, 4.0], [1.0, 4.0]] {
            let surface = Revolution::cone(apex, axis, angle, [start, end], side);
            let far = if end.is_finite() { end } else { 1e9 };
            let at = |z: f64| {
                let s = big(z / cos);
                [&s * big(sin), &s * big(cos)]
            };
            let mut lines = vec![(at(start), at(far), true)];
            if side != Side::Both {
                let ends = [start, end].into_iter().filter(|&z| z > 0.0 && z.is_finite());
                lines.extend(ends.map(|z| ([big(0.0), big(z)], [big(z * (sin / cos)), big(z)], true)));
            }
            let exact = |x: &Vector| from_profile(x, apex, axis, &lines);
            check(flights, &format!("cone from {start} to {end}, {side:?}"), 14, &surface, exact, 4.0);
        }
    }
}

#[test]
fn rectangles_and_meshes() {
    past_rectangles_and_meshes(FEW);
}

#[test]
#[ignore = "long: scripts/test all"]
fn rectangles_and_meshes_in_many_flights() {
    past_rectangles_and_meshes(FLIGHTS);
}

fn past_rectangles_and_meshes(flights: usize) {
    let rectangle = Rectangle {
        center: DVec3::new(0.1, 0.2, 0.3),
        normal: DVec3::Z,
        along: [DVec3::X, DVec3::Y],
        half: [1.5, 0.75],
    };
    let corner = |x: f64, y: f64| rectangle.center + DVec3::new(1.5 * x, 0.75 * y, 0.0);
    let triangles = [
        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
        [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
    ];
    let exact = |x: &Vector| from_triangle(x, triangles[0]).min(from_triangle(x, triangles[1]));
    check(flights, "rectangle", 15, &rectangle, exact, 3.0);
    check(flights, "two triangles", 16, &Mesh::new(&triangles, Side::Both).unwrap(), exact, 3.0);

    // An octahedron, from both sides: faces, edges and corners, convex and concave.
    let tip = |k: usize, side: f64| {
        DVec3::from_array(std::array::from_fn(|l| if l == k { 2.0 * side } else { 0.0 }))
    };
    let mut faces = Vec::new();
    for x in [-1.0, 1.0] {
        for y in [-1.0, 1.0] {
            for z in [-1.0, 1.0] {
                faces.push([tip(0, x), tip(1, y), tip(2, z)]);
            }
        }
    }
    let exact = |x: &Vector| faces.iter().map(|&face| from_triangle(x, face)).reduce(Ord::min).unwrap();
    for side in [Side::Inside, Side::Outside, Side::Both] {
        check(flights, &format!("octahedron, {side:?}"), 17, &Mesh::new(&faces, side).unwrap(), exact, 3.0);
    }
}
