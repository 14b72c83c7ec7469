//! Sides, normals and bounds of shapes; what contacts in edges and on axes are.

use std::f64::consts::FRAC_PI_4;

use glam::DVec3;
use haff_mechanics::{Oscillation, RelativeFlight, Surface, Swing, Waveform};
use haff_surfaces::{Rectangle, Revolution, Side, Sphere};
use haff_testing::Random;

fn shapes() -> Vec<(&'static str, Box<dyn Surface>)> {
    let (point, axis) = (DVec3::new(0.5, -0.3, -1.0), DVec3::new(0.2, 0.1, 1.0));
    let mut shapes: Vec<(&'static str, Box<dyn Surface>)> = Vec::new();
    for side in [Side::Inside, Side::Outside, Side::Both] {
        shapes.push(("sphere", Box::new(Sphere { center: point, radius: 1.5, side })));
        shapes.push(("cylinder", Box::new(Revolution::cylinder(point, axis, 1.5, side))));
        shapes.push(("closed cylinder", Box::new(Revolution::finite_cylinder(point, axis, 1.5, 2.5, side))));
        shapes.push(("cone", Box::new(Revolution::cone(point, axis, 0.5, [0.0, f64::INFINITY], side))));
        shapes.push(("frustum", Box::new(Revolution::cone(point, axis, 0.5, [0.5, 2.0], side))));
    }
    let along = [DVec3::X, DVec3::Y];
    shapes.push((
        "rectangle",
        Box::new(Rectangle { center: point, normal: DVec3::Z, along, half: [1.0, 2.0] }),
    ));
    shapes
}

#[test]
fn distances_change_by_at_most_the_path_and_normals_are_their_gradients() {
    let mut random = Random(3);
    for (name, shape) in shapes() {
        for _ in 0..20_000 {
            let mut point = |size: f64| DVec3::from_array([0; 3].map(|_| random.uniform(-size, size)));
            let (a, b) = (point(3.0), point(3.0));
            let [near, far] = [a, b].map(|x| shape.distance(x));
            // Across a surface with two sides the sign changes at zero.
            assert!((near - far).abs() <= (a - b).length() * (1.0 + 1e-12) + 1e-12, "{name} {a} {b}");
            assert!((shape.approach(a, b).0 - near.abs()).abs() < 1e-12, "{name}");
            assert!(shape.is_near(a, near.abs()), "{name}");
            let (center, extent) = shape.bounds();
            if extent.is_finite() {
                assert!((a - center).length() <= extent + near.abs() + 1e-12, "{name} {a}");
            }
            if near < 1e-3 {
                continue;
            }
            let normal = shape.normal(a);
            assert!((normal.length() - 1.0).abs() < 1e-14, "{name}");
            // Towards the nearest point the distance falls as the path.
            let closer = a - normal * (0.5 * near);
            assert!((shape.distance(closer) - 0.5 * near).abs() < 1e-12, "{name} {a}");
            if near < 0.0 {
                continue;
            }
            let contact = shape.contact_normal(a, -normal, near * (1.0 + 1e-9));
            assert!(contact.dot(normal) > 1.0 - 1e-6, "{name}");
        }
    }
}

#[test]
fn a_sphere_on_the_axis_of_a_cone_touches_all_around() {
    let cone = Revolution::cone(DVec3::ZERO, DVec3::Z, FRAC_PI_4, [0.0, f64::INFINITY], Side::Inside);
    let sqrt2 = 2.0_f64.sqrt();
    let start = DVec3::Z * 5.0;
    for gravity in [DVec3::ZERO, -DVec3::Z] {
        let flight = RelativeFlight::new(start, -DVec3::Z, gravity);
        let time = cone.time_to_contact(&flight, 1.0, 1e3).unwrap();
        assert!((flight.at(time).z - sqrt2).abs() < 1e-14, "{time}");
    }
    // Beside the axis by less than rounding, across it, and just past it.
    for offset in [1e-300, 1e-17, 1e-9] {
        for speed in [0.0, 1e-9, 1.0] {
            let x = DVec3::new(offset, 0.0, 5.0);
            let flight = RelativeFlight::new(x, DVec3::new(-speed, 1e-12, -1.0), DVec3::ZERO);
            let time = cone.time_to_contact(&flight, 1.0, 1e3).unwrap();
            assert!((cone.distance(flight.at(time)) - 1.0).abs() < 1e-14, "{offset} {speed}: {time}");
        }
    }
    // The tight pipe: nearly no room around the axis.
    let pipe = Revolution::cylinder(DVec3::ZERO, DVec3::Z, 1.0 + 1e-9, Side::Inside);
    let flight = RelativeFlight::new(DVec3::ZERO, DVec3::new(1.0, 0.0, 3.0), DVec3::ZERO);
    let time = pipe.time_to_contact(&flight, 1.0, 1e3).unwrap();
    assert!((time / 1e-9 - 1.0).abs() < 1e-6, "{time}");
}

#[test]
fn in_an_edge_the_contact_is_with_the_part_that_is_approached() {
    let can = Revolution::finite_cylinder(DVec3::ZERO, DVec3::Z, 2.0, 4.0, Side::Inside);
    // In the edge of side and bottom.
    let edge = DVec3::new(1.5, 0.0, 0.5);
    let reach = 0.5 + 1e-12;
    assert_eq!(can.contact_normal(edge, DVec3::new(1.0, 0.0, 0.5), reach), -DVec3::X);
    assert_eq!(can.contact_normal(edge, DVec3::new(-1.0, 0.0, -0.5), reach), DVec3::Z);
    for (velocity, normal) in
        [(DVec3::new(1.0, 0.0, 0.1), -DVec3::X), (DVec3::new(-0.1, 0.0, -1.0), DVec3::Z)]
    {
        let flight = RelativeFlight::new(edge, velocity, DVec3::ZERO);
        assert_eq!(can.time_to_contact(&flight, 0.5, 1e3), Some(0.0));
        assert!((can.contact_normal(edge, velocity, reach) - normal).length() < 1e-15);
    }
    // Away from both.
    let flight = RelativeFlight::new(edge, DVec3::new(-1.0, 0.0, 0.0), DVec3::ZERO);
    assert!((can.time_to_contact(&flight, 0.5, 1e3).unwrap() - 3.0).abs() < 1e-15);
}

#[test]
fn surfaces_that_swing_are_met_where_they_are() {
    let mut random = Random(8);
    let (mut hits, mut fast) = (0, 0);
    for k in 0..20_000 {
        let waveform = if k % 2 == 0 { Waveform::Sine } else { Waveform::Triangle };
        let oscillation = Oscillation {
            waveform,
            amplitude: random.uniform(0.01, 0.5),
            frequency: random.uniform(0.05, 3.0),
        };
        let mut vector = |size: f64| DVec3::from_array([0; 3].map(|_| random.uniform(-size, size)));
        let (position, velocity, direction) = (vector(2.0), vector(1.0), vector(1.0).normalize());
        let gravity = if k % 3 == 0 { DVec3::NEG_Z } else { DVec3::ZERO };
        let swing = Some(Swing { direction, oscillation, cycles: random.uniform(0.0, 1.0) });
        let flight = RelativeFlight { position, velocity, acceleration: gravity, swing, growth: 0.0 };
        let surface = Revolution::finite_cylinder(-DVec3::Z, DVec3::Z, 2.0, 2.0, Side::Inside);
        let radius = 0.2;
        if surface.distance(flight.at(0.0)) < radius {
            continue;
        }
        let time = surface.time_to_contact(&flight, radius, 100.0).unwrap();
        assert!(time < 100.0);
        hits += 1;
        fast += usize::from(flight.velocity_at(time).length() > velocity.length());
        for step in 0..200 {
            let at = time * f64::from(step) / 200.0;
            assert!(surface.distance(flight.at(at)) > radius - 1e-12, "{flight:?} at {at} of {time}");
        }
        let (distance, rate) = surface.approach(flight.at(time), flight.velocity_at(time));
        assert!((distance - radius).abs() < 1e-13 && rate < 0.0, "{flight:?}: {time} {distance} {rate}");
    }
    assert!(hits > 5_000 && fast > 1_000, "{hits} {fast}");
}

#[test]
fn containers_are_in_their_boxes_and_reach_their_sides() {
    let mut random = Random(8);
    for (name, shape) in shapes() {
        let Some([low, high]) = shape.enclosure() else { continue };
        let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for _ in 0..200_000 {
            let position = DVec3::from_array([0; 3].map(|_| random.uniform(-4.0, 4.0)));
            if shape.distance(position) > 0.0 {
                assert!(position.cmpge(low).all() && position.cmple(high).all(), "{name}: {position}");
                (least, most) = (least.min(position), most.max(position));
            }
        }
        for axis in (0..3).filter(|&axis| high[axis].is_finite()) {
            let edge = high[axis] - low[axis];
            let gaps = [least[axis] - low[axis], high[axis] - most[axis]];
            assert!(gaps.iter().all(|gap| *gap < 0.2 * edge), "{name}, axis {axis}: {gaps:?} of {edge}");
        }
    }
    let held = |shape: &dyn Surface| shape.enclosure().is_some();
    let closed = |side| Revolution::finite_cylinder(DVec3::ZERO, DVec3::Z, 1.0, 2.0, side);
    assert!(held(&closed(Side::Inside)) && !held(&closed(Side::Outside)) && !held(&closed(Side::Both)));
    assert!(held(&Revolution::cylinder(DVec3::ZERO, DVec3::Z, 1.0, Side::Inside)));
    assert!(!held(&Revolution::cone(DVec3::ZERO, DVec3::Z, 0.5, [0.0, f64::INFINITY], Side::Inside)));
}
