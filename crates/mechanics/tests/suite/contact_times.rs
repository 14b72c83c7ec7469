//! Properties of contact times that need no reference: symmetries, limits, and contacts that must not repeat
//! without end.

use glam::DVec3;
use haff_mechanics::{
    drift, free_flight, free_flight_velocity, is_rounding_noise, resolve_pair, resolve_wall, time_to_contact,
    time_to_contact_accelerated, time_to_face, time_to_plane,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

const EPS: f64 = f64::EPSILON;

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 4000,
        rng_seed: RngSeed::Fixed(7),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn vector() -> impl Strategy<Value = DVec3> {
    [-4.0..4.0f64, -4.0..4.0f64, -4.0..4.0f64].prop_map(DVec3::from)
}

fn decades(low: f64, high: f64) -> impl Strategy<Value = f64> {
    (low..high).prop_map(|log| 10f64.powf(log))
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn powers_of_two_as_units_scale_times_exactly(
        r in vector(), v in vector(), a in vector(), sigma in 0.1..2.0f64, length in -300..300i32, time in -150..150i32,
    ) {
        let (l, t) = (2f64.powi(length), 2f64.powi(time));
        // In two steps, because a factor of 2^±1023 would overflow.
        let (v1, a1) = (v * l / t, a * l / t / t);
        prop_assert_eq!(
            time_to_contact(r * l, v1, sigma * l),
            time_to_contact(r, v, sigma).map(|x| x * t)
        );
        prop_assert_eq!(
            time_to_contact_accelerated(r * l, v1, a1, sigma * l),
            time_to_contact_accelerated(r, v, a, sigma).map(|x| x * t)
        );
        prop_assert_eq!(time_to_plane(r.x * l, v1.x, a1.x), time_to_plane(r.x, v.x, a.x).map(|x| x * t));
        prop_assert_eq!(time_to_face(r.x * l, v1.x, a1.x), time_to_face(r.x, v.x, a.x).map(|x| x * t));
    }

    #[test]
    fn head_on_spheres_touch_at_the_time_of_a_sphere_and_a_plane(
        gap in decades(-12.0, 3.0), s in -3.0..3.0f64, a in prop_oneof![Just(0.0), -3.0..3.0f64],
    ) {
        // Along an axis the quartic is the plane's quadratic.
        let sigma = 1.0;
        let (r, v, acc) = (DVec3::Z * (sigma + gap), DVec3::Z * s, DVec3::Z * a);
        let d = r.z - sigma;
        let plane = time_to_plane(d, s, a);
        let sphere = time_to_contact_accelerated(r, v, acc, sigma);
        let near_grazing = (s * s - 2.0 * a * d).abs() <= 1e-9 * (s * s + (a * d).abs());
        prop_assume!(!near_grazing);
        match (plane, sphere) {
            (Some(x), Some(y)) => {
                // Condition number: an ulp of r moves the contact by an ulp over the closing speed.
                let closing = (s + a * x).abs();
                let bound = 16.0 * EPS * (x + (r.z + sigma + (s * x).abs() + (a * x * x).abs()) / closing);
                prop_assert!((x - y).abs() <= bound, "plane {x}, sphere {y}, bound {bound:e}");
            }
            (x, y) => prop_assert_eq!(x, y),
        }
    }

    #[test]
    fn a_bounce_of_any_size_lasts_twice_its_rise(
        s in decades(-150.0, 1.0), g in decades(-2.0, 2.0), axis in 0..3usize,
    ) {
        let up = DVec3::AXES[axis];
        let expected = 2.0 * s / g;
        let floor = time_to_plane(0.0, s, -g).expect("returns");
        prop_assert!((floor - expected).abs() <= 2.0 * EPS * expected, "plane: {floor:e} against {expected:e}");
        let ball = time_to_contact_accelerated(up, up * s, up * -g, 1.0).expect("returns");
        prop_assert!((ball - expected).abs() <= 8.0 * EPS * expected, "sphere: {ball:e} against {expected:e}");
    }

    #[test]
    fn a_crossing_into_a_cell_is_followed_by_the_crossing_back(
        d in decades(-16.0, 1.0), s in decades(-8.0, 1.0), turn in -1e-14..1.0f64,
    ) {
        // From the lower cell the face is at distance d; gravity returns the flight inside the upper cell, or
        // just before it. In the upper cell the numbers have the opposite sign.
        let g = s * s / (2.0 * d) * (1.0 - turn);
        let up = time_to_face(d, -s, g);
        let back = time_to_face(-d, s, -g).expect("gravity ends every rise");
        if let Some(up) = up {
            prop_assert!(back >= up * (1.0 - 4.0 * EPS), "up at {up:e}, back at {back:e}");
        }
    }

    #[test]
    fn spheres_at_their_contact_are_one_diameter_apart(r in vector(), v in vector(), sigma in 0.1..2.0f64) {
        if let Some(t) = time_to_contact(r, v, sigma) && r.length() > sigma {
            let distance = drift(r, v, t).length();
            let bound = 8.0 * EPS * (r.length() + v.length() * t);
            prop_assert!((distance - sigma).abs() <= bound, "{distance} against {sigma}");
        }
    }

    #[test]
    fn repeated_plastic_contacts_end(
        w1 in vector(), w2 in vector(), n in vector(), log_ratio in -6.0..6.0f64, depth in 0.0..4.0f64,
    ) {
        // Resolved, then predicted and resolved again as long as the predicted contact time is zero.
        prop_assume!(n.length() > 0.1);
        let n = n.normalize();
        let r = n * (1.0 - depth * EPS);
        let (mut w1, mut w2) = (w1, w2);
        let mut contacts = 0;
        while time_to_contact(r, w2 - w1, 1.0) == Some(0.0)
            && !is_rounding_noise(r, w2 - w1, w1.length().max(w2.length()))
        {
            (w1, w2, _) = resolve_pair(w1, w2, 1.0, 10f64.powf(log_ratio), n, 0.0);
            contacts += 1;
            // A pair with a common velocity keeps 2⁻⁵² of its approach speed each time, until f64 ends at
            // 2⁻¹⁰⁷⁴.
            prop_assert!(contacts <= 22, "{contacts} contacts, {w1} against {w2}");
        }
    }

    #[test]
    fn approach_faster_than_rounding_is_not_noise(r in vector(), w in vector(), log in -14.0..0.0f64) {
        prop_assume!(r.length() > 0.1 && w.length() > 0.1);
        let v = -r.normalize() * (w.length() * 10f64.powf(log));
        prop_assert!(!is_rounding_noise(r, v, w.length()));
        prop_assert!(is_rounding_noise(r, -v, w.length()), "separating pairs do not approach");
    }

    #[test]
    fn every_finite_or_infinite_argument_gives_a_time_or_none(
        x in prop::array::uniform3(any::<f64>()), y in prop::array::uniform3(any::<f64>()),
        z in prop::array::uniform3(any::<f64>()), sigma in any::<f64>(),
    ) {
        let (r, v, a) = (DVec3::from(x), DVec3::from(y), DVec3::from(z));
        for t in [
            time_to_contact(r, v, sigma),
            time_to_contact_accelerated(r, v, a, sigma),
            time_to_plane(r.x, v.x, a.x),
            time_to_face(r.x, v.x, a.x),
        ].into_iter().flatten() {
            prop_assert!(t >= 0.0 && t.is_finite(), "{t}");
        }
    }
}

#[test]
fn arguments_that_are_not_numbers_give_no_contact() {
    let (r, v, a) = (DVec3::X * 3.0, DVec3::NEG_X, DVec3::NEG_X);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for axis in 0..3 {
            let spoil = |mut x: DVec3| {
                x[axis] = bad;
                x
            };
            assert_eq!(time_to_contact(spoil(r), v, 1.0), None);
            assert_eq!(time_to_contact(r, spoil(v), 1.0), None);
            assert_eq!(time_to_contact_accelerated(spoil(r), v, a, 1.0), None);
            assert_eq!(time_to_contact_accelerated(r, spoil(v), a, 1.0), None);
            assert_eq!(time_to_contact_accelerated(r, v, spoil(a), 1.0), None);
        }
        assert_eq!(time_to_contact(r, v, bad), None);
        assert_eq!(time_to_contact_accelerated(r, v, a, bad), None);
    }
    for kernel in [time_to_plane, time_to_face] {
        assert_eq!(kernel(f64::NAN, 1.0, -1.0), None);
        assert_eq!(kernel(1.0, f64::NAN, -1.0), None);
        assert_eq!(kernel(1.0, 1.0, f64::NAN), None);
        assert_eq!(kernel(f64::INFINITY, -1.0, -1.0), None);
    }
}

#[test]
fn resting_pairs_and_separating_pairs_never_touch() {
    assert_eq!(time_to_contact(DVec3::X, DVec3::ZERO, 1.0), None);
    assert_eq!(time_to_contact(DVec3::X * 0.5, DVec3::X, 1.0), None);
    assert_eq!(time_to_contact_accelerated(DVec3::X * 2.0, DVec3::ZERO, DVec3::X, 1.0), None);
    // At rest in contact on top of a fixed sphere, gravity downwards: in contact at once.
    assert_eq!(time_to_contact_accelerated(DVec3::Z, DVec3::ZERO, DVec3::NEG_Z, 1.0), Some(0.0));
    // At rest in contact below it: falls off.
    assert_eq!(time_to_contact_accelerated(DVec3::NEG_Z, DVec3::ZERO, DVec3::NEG_Z, 1.0), None);
}

#[test]
fn a_ball_leaves_the_top_of_a_fixed_sphere_above_the_critical_speed() {
    // Horizontal speed s at the top: the parabola leaves the sphere for s² ≥ g σ, otherwise it enters it at
    // once.
    let g = DVec3::new(0.0, 0.0, -1.0);
    assert_eq!(time_to_contact_accelerated(DVec3::Z, DVec3::X * 0.99, g, 1.0), Some(0.0));
    assert_eq!(time_to_contact_accelerated(DVec3::Z, DVec3::X * 1.01, g, 1.0), None);
}

#[test]
fn bouncing_ball_follows_its_geometric_series() {
    // Problem 2.1: rebound k takes 2 e^k √(2H/g); the whole series T = √(2H/g) (1 + e)/(1 − e).
    let (height, g, e) = (1.25f64, 9.81, 0.8f64);
    let fall = (2.0 * height / g).sqrt();
    let (mut z, mut w, mut total) = (height, DVec3::ZERO, 0.0);
    let gravity = DVec3::new(0.0, 0.0, -g);
    let mut bounces = 0;
    while total < 0.999_999_999_999 * fall * (1.0 + e) / (1.0 - e) {
        let t = time_to_plane(z, w.z, -g).expect("falls");
        total += t;
        z = free_flight(DVec3::Z * z, w, gravity, t).z;
        w = free_flight_velocity(w, gravity, t);
        (w, _) = resolve_wall(w, DVec3::ZERO, 1.0, DVec3::NEG_Z, e);
        bounces += 1;
        let expected = e.powi(bounces) * (2.0 * g * height).sqrt();
        assert!(
            (w.z - expected).abs() <= 1e-13 * (2.0 * g * height).sqrt(),
            "bounce {bounces}: {} {expected}",
            w.z
        );
        assert!(bounces < 200, "time does not advance: {total}");
    }
    // e^k < 1e-12 of the series remains.
    assert!((110..140).contains(&bounces), "{bounces}");
}
