//! Triangle meshes: trees, sides, and which triangles are no mesh.

use glam::DVec3;
use haff_mechanics::{RelativeFlight, Surface};
use haff_surfaces::{Mesh, MeshError, Part, Rectangle, Side};
use haff_testing::Random;

/// The triangles of a box with this lower corner and these edges; each face has 2 n² of them.
pub fn cuboid(low: DVec3, size: DVec3, n: usize) -> Vec<[DVec3; 3]> {
    let mut triangles = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0.0, 1.0] {
            let corner = |a: usize, b: usize| {
                let mut x = [0.0; 3];
                (x[axis], x[u], x[v]) = (side, a as f64 / n as f64, b as f64 / n as f64);
                low + size * DVec3::from_array(x)
            };
            for a in 0..n {
                for b in 0..n {
                    let square = [corner(a, b), corner(a + 1, b), corner(a + 1, b + 1), corner(a, b + 1)];
                    triangles.push([square[0], square[1], square[2]]);
                    triangles.push([square[0], square[2], square[3]]);
                }
            }
        }
    }
    triangles
}

#[test]
fn the_tree_finds_what_all_triangles_do() {
    let mut random = Random(4);
    let mut point = |size: f64| DVec3::from_array([0; 3].map(|_| random.uniform(-size, size)));
    let soup: Vec<[DVec3; 3]> = (0..500)
        .map(|_| {
            let center = point(3.0);
            [center + point(0.4), center + point(0.4), center + point(0.4)]
        })
        .collect();
    let mesh = Mesh::new(&soup, Side::Both).unwrap();
    assert_eq!(mesh.triangles().len(), 500);
    let alone: Vec<Mesh> = soup.iter().map(|&triangle| Mesh::new(&[triangle], Side::Both).unwrap()).collect();
    let mut contacts = 0;
    for k in 0..3_000 {
        let position = point(5.0);
        let least = |x: DVec3| {
            mesh.triangles().iter().map(|one| one.offset(x).length()).fold(f64::INFINITY, f64::min)
        };
        let distance = least(position);
        assert_eq!(mesh.distance(position), distance);
        // True in case of doubt, which is less than the diagonal of a cell of bounds.
        assert!(mesh.is_near(position, distance * (1.0 + 1e-12)));
        assert!(!mesh.is_near(position, distance - 0.5));
        let radius = 0.1;
        if distance < radius {
            continue;
        }
        let gravity = if k % 2 == 0 { DVec3::ZERO } else { point(1.0) };
        let flight = RelativeFlight::new(position, point(2.0), gravity);
        let found = mesh.time_to_contact(&flight, radius, 20.0).filter(|&time| time <= 20.0);
        let one_by_one = alone
            .iter()
            .filter_map(|alone| alone.time_to_contact(&flight, radius, 20.0).filter(|&time| time <= 20.0));
        let expected = one_by_one.reduce(f64::min);
        match (found, expected) {
            (Some(found), Some(expected)) => {
                contacts += 1;
                assert!((found - expected).abs() <= 1e-13 * (1.0 + expected), "{k}: {found} {expected}");
            }
            (None, None) => {}
            other => panic!("{k}: {other:?}"),
        }
    }
    assert!(contacts > 500, "{contacts}");
}

#[test]
fn a_box_of_triangles_has_the_sides_and_the_contacts_of_six_planes() {
    let (low, size) = (DVec3::new(-1.0, -2.0, 0.5), DVec3::new(3.0, 4.0, 2.0));
    let high = low + size;
    let triangles = cuboid(low, size, 3);
    let inside = Mesh::new(&triangles, Side::Inside).unwrap();
    let outside = Mesh::new(&triangles, Side::Outside).unwrap();
    assert!(inside.is_closed() && (inside.volume() - 24.0).abs() < 1e-12);
    let mut random = Random(5);
    for k in 0..20_000 {
        let x = DVec3::new(random.uniform(-3.0, 4.0), random.uniform(-4.0, 4.0), random.uniform(-1.0, 4.0));
        let depth = (x - low).min(high - x);
        let is_inside = depth.min_element() > 0.0;
        assert_eq!(inside.contains(x), is_inside, "{x}");
        let distance = inside.distance(x);
        assert_eq!(outside.distance(x), -distance);
        assert_eq!(distance > 0.0, is_inside);
        let radius = 0.25;
        if depth.min_element() < radius {
            continue;
        }
        assert!((distance - depth.min_element()).abs() < 1e-15);
        let v = DVec3::new(random.normal(), random.normal(), random.normal());
        let gravity = if k % 2 == 0 { DVec3::ZERO } else { DVec3::NEG_Z };
        let found = inside.time_to_contact(&RelativeFlight::new(x, v, gravity), radius, 1e3).unwrap();
        let planes = (0..3).flat_map(|axis| {
            let [below, above] = [x[axis] - low[axis], high[axis] - x[axis]].map(|room| room - radius);
            [
                haff_mechanics::time_to_plane(below, v[axis], gravity[axis]),
                haff_mechanics::time_to_plane(above, -v[axis], -gravity[axis]),
            ]
        });
        let expected = planes.flatten().fold(f64::INFINITY, f64::min);
        assert!((found - expected).abs() <= 1e-14 * (1.0 + expected / v.length()), "{found} {expected}");
    }
}

#[test]
fn triangles_that_are_no_mesh_are_refused_by_what_is_wrong() {
    let cube = cuboid(DVec3::ZERO, DVec3::ONE, 1);
    assert_eq!(Mesh::new(&[], Side::Both), Err(MeshError::Empty));
    let mut broken = cube.clone();
    broken[3][1].y = f64::NAN;
    assert!(matches!(Mesh::new(&broken, Side::Both), Err(MeshError::NotFinite { face: 3, .. })));
    let mut flat = cube.clone();
    flat[5] = [DVec3::ZERO, DVec3::ONE, DVec3::ONE * 2.0];
    assert_eq!(Mesh::new(&flat, Side::Both), Err(MeshError::Flat { face: 5 }));
    let open = &cube[1..];
    assert!(!Mesh::new(open, Side::Both).unwrap().is_closed());
    let error = Mesh::new(open, Side::Inside).unwrap_err();
    assert!(matches!(error, MeshError::Open { faces: 1, .. }), "{error}");
    // Faces in any direction are turned.
    let mut turned = cube.clone();
    for triangle in turned.iter_mut().step_by(2) {
        triangle.swap(0, 1);
    }
    assert!(Mesh::new(&turned, Side::Inside).unwrap().is_closed());
    // A strip with half a turn.
    let count = 12;
    let edge = |k: usize| {
        let angle = std::f64::consts::TAU * k as f64 / f64::from(count);
        let (sin, cos) = angle.sin_cos();
        let middle = DVec3::new(cos, sin, 0.0) * 3.0;
        let (up, out) = (0.5 * angle).sin_cos();
        let across = DVec3::new(cos * out, sin * out, up);
        [middle - across * 0.5, middle + across * 0.5]
    };
    let mut strip = Vec::new();
    for k in 0..count as usize {
        let [a, b] = edge(k);
        // The last edge is the first one, the other way round.
        let [c, d] = if k + 1 == count as usize {
            let [first, second] = edge(0);
            [second, first]
        } else {
            edge(k + 1)
        };
        strip.push([a, b, c]);
        strip.push([b, d, c]);
    }
    let error = Mesh::new(&strip, Side::Both).unwrap_err();
    assert!(matches!(error, MeshError::NotOrientable { .. }), "{error}");
    // Two cubes that share an edge: four triangles meet there.
    let mut both = cube;
    both.extend(cuboid(DVec3::new(1.0, 1.0, 0.0), DVec3::ONE, 1));
    assert!(matches!(Mesh::new(&both, Side::Inside), Err(MeshError::Open { faces: 4, .. })));
}

#[test]
fn a_rectangle_is_two_triangles() {
    let along = [DVec3::X, DVec3::Y];
    let rectangle = Rectangle { center: DVec3::ZERO, normal: DVec3::Z, along, half: [2.0, 1.0] };
    let corner = |x: f64, y: f64| DVec3::new(2.0 * x, y, 0.0);
    let triangles = [
        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
        [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
    ];
    let mesh = Mesh::new(&triangles, Side::Both).unwrap();
    let mut random = Random(6);
    for _ in 0..10_000 {
        let x = DVec3::from_array([0; 3].map(|_| random.uniform(-3.0, 3.0)));
        assert!((mesh.distance(x) - rectangle.distance(x)).abs() < 1e-15);
    }
}
