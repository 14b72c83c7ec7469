//! Laws of every impact of smooth bodies, for random bodies with mass ratios up to 10¹².

use glam::DVec3;
use haff_mechanics::{
    approach_speed, impact, reduced_mass, resolve_pair, resolve_sticking, resolve_wall, work_of_moving_body,
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
    [-10.0..10.0f64, -10.0..10.0f64, -10.0..10.0f64].prop_map(DVec3::from)
}

fn normal() -> impl Strategy<Value = DVec3> {
    vector().prop_filter("too short for a direction", |v| v.length() > 0.1).prop_map(DVec3::normalize)
}

fn mass() -> impl Strategy<Value = f64> {
    (-6.0..6.0f64).prop_map(|log| 10f64.powf(log))
}

fn restitution() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), Just(1.0), 0.0..=1.0f64]
}

fn kinetic(m: f64, w: DVec3) -> f64 {
    0.5 * m * w.length_squared()
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn a_pair_conserves_momentum_and_separates_at_e_times_the_approach_speed(
        w1 in vector(), w2 in vector(), m1 in mass(), m2 in mass(), n in normal(), e in restitution(),
    ) {
        let (u1, u2, hit) = resolve_pair(w1, w2, 1.0 / m1, 1.0 / m2, n, e);
        let approach = approach_speed(w1, w2, n);
        if approach <= 0.0 {
            prop_assert_eq!((u1, u2, hit.impulse), (w1, w2, 0.0));
            return Ok(());
        }
        // Each velocity is rounded at its own size.
        let speed = w1.length().max(w2.length());
        let drift = ((u1 - w1) * m1 + (u2 - w2) * m2).length();
        let allowed = 8.0 * EPS * (hit.impulse + (m1 + m2) * speed);
        prop_assert!(drift <= allowed, "momentum changes by {drift:e}, rounding {allowed:e}");
        let separation = -approach_speed(u1, u2, n);
        prop_assert!(
            (separation - e * approach).abs() <= 32.0 * EPS * speed,
            "separates at {separation}, e v_n = {}", e * approach
        );
        let tangential = ((u1 - w1) - n * n.dot(u1 - w1)).length();
        prop_assert!(tangential <= 16.0 * EPS * speed, "tangential velocity changes by {tangential:e}");
    }

    #[test]
    fn energy_loss_and_carnot_energy_match_their_definitions(
        w1 in vector(), w2 in vector(), m1 in mass(), m2 in mass(), n in normal(), e in restitution(),
    ) {
        let (u1, u2, hit) = resolve_pair(w1, w2, 1.0 / m1, 1.0 / m2, n, e);
        let before = kinetic(m1, w1) + kinetic(m2, w2);
        let lost = before - kinetic(m1, u1) - kinetic(m2, u2);
        let largest = before + hit.carnot_energy;
        prop_assert!(
            (lost - hit.energy_loss).abs() <= 32.0 * EPS * largest,
            "T − T' = {lost}, ΔT = {} (2.16)", hit.energy_loss
        );
        // Velocities up to 17 are rounded to 17 ε, whatever the change.
        let (d1, d2) = (u1 - w1, u2 - w2);
        let of_changes = kinetic(m1, d1) + kinetic(m2, d2);
        let rounding = 64.0 * EPS * 17.4 * (m1 * d1.length() + m2 * d2.length()) + 64.0 * EPS * hit.carnot_energy
            + (m1 + m2) * (64.0 * EPS * 17.4).powi(2);
        prop_assert!(
            (of_changes - hit.carnot_energy).abs() <= rounding,
            "Σ ½ m Δw² = {of_changes}, E'_c = {} (2.31)", hit.carnot_energy
        );
    }

    #[test]
    fn carnots_theorem_holds_for_any_restitution(v in 1e-9..1e9f64, e in restitution(), lambda in mass()) {
        let hit = impact(v, e, lambda);
        let carnot = hit.carnot_energy * (1.0 - e) / (1.0 + e);
        prop_assert!((hit.energy_loss - carnot).abs() <= 8.0 * EPS * carnot, "{} against {carnot}", hit.energy_loss);
        let parts = hit.compression_impulse + hit.restitution_impulse;
        prop_assert!((hit.impulse - parts).abs() <= 2.0 * EPS * parts, "J = {}, J_c + J_r = {parts}", hit.impulse);
        let from_impulse = 0.5 * lambda * hit.impulse * hit.impulse;
        prop_assert!((hit.carnot_energy - from_impulse).abs() <= 8.0 * EPS * from_impulse, "E'_c = J²/(2μ)");
    }

    #[test]
    fn impacts_do_not_depend_on_the_order_of_the_bodies(
        w1 in vector(), w2 in vector(), m1 in mass(), m2 in mass(), n in normal(), e in restitution(),
    ) {
        let (u1, u2, hit) = resolve_pair(w1, w2, 1.0 / m1, 1.0 / m2, n, e);
        let (x2, x1, mirrored) = resolve_pair(w2, w1, 1.0 / m2, 1.0 / m1, -n, e);
        prop_assert_eq!((u1, u2, hit), (x1, x2, mirrored));
    }

    #[test]
    fn a_smooth_pair_conserves_angular_momentum(
        w1 in vector(), w2 in vector(), m1 in 0.1..10.0f64, m2 in 0.1..10.0f64, n in normal(), e in restitution(),
        r1 in vector(), sigma in 0.1..3.0f64,
    ) {
        let r2 = r1 + n * sigma;
        let (u1, u2, _) = resolve_pair(w1, w2, 1.0 / m1, 1.0 / m2, n, e);
        let about_origin = |a: DVec3, b: DVec3| r1.cross(a) * m1 + r2.cross(b) * m2;
        let change = (about_origin(u1, u2) - about_origin(w1, w2)).length();
        let size = (r1.length() + r2.length()) * (m1 + m2) * 17.4;
        prop_assert!(change <= 16.0 * EPS * size, "ΔH = {change:e} (2.26), rounding {:e}", EPS * size);
    }

    #[test]
    fn work_of_a_moving_wall_closes_the_energy_balance(
        w in vector(), wall in vector(), m in mass(), n in normal(), e in restitution(),
    ) {
        let (after, hit) = resolve_wall(w, wall, 1.0 / m, n, e);
        let gain = kinetic(m, after) - kinetic(m, w);
        let balance = work_of_moving_body(hit.impulse, n, wall) - hit.energy_loss;
        let size = m * (w.length() + 2.0 * wall.length()).powi(2);
        prop_assert!((gain - balance).abs() <= 32.0 * EPS * size, "T' − T = {gain}, W − ΔT = {balance}");
        // A wall is a body of infinite mass.
        let (pair, unmoved, same) = resolve_pair(w, wall, 1.0 / m, 0.0, n, e);
        prop_assert_eq!((pair, unmoved, same), (after, wall, hit));
    }

    #[test]
    fn sticking_bodies_conserve_momentum_and_lose_all_relative_motion(
        w1 in vector(), w2 in vector(), m1 in mass(), m2 in mass(),
    ) {
        let (common, hit) = resolve_sticking(w1, w2, 1.0 / m1, 1.0 / m2);
        let momentum = (common * (m1 + m2) - w1 * m1 - w2 * m2).length();
        prop_assert!(momentum <= 16.0 * EPS * 17.4 * (m1 + m2), "momentum changes by {momentum:e}");
        let energy = 0.5 * reduced_mass(m1, m2) * (w1 - w2).length_squared();
        prop_assert!((hit.energy_loss - energy).abs() <= 16.0 * EPS * energy, "{} against {energy}", hit.energy_loss);
        // Never less than the smooth plastic impact along any normal.
        let smooth = impact((w1 - w2).dot(DVec3::X), 0.0, 1.0 / m1 + 1.0 / m2);
        prop_assert!(smooth.energy_loss <= hit.energy_loss * (1.0 + 16.0 * EPS));
    }
}

#[test]
fn equal_elastic_spheres_exchange_their_normal_velocities() {
    let (w1, w2) = (DVec3::new(3.0, 1.0, 0.0), DVec3::new(-5.0, 2.0, 0.0));
    let (u1, u2, hit) = resolve_pair(w1, w2, 0.5, 0.5, DVec3::X, 1.0);
    assert_eq!(u1, DVec3::new(-5.0, 1.0, 0.0));
    assert_eq!(u2, DVec3::new(3.0, 2.0, 0.0));
    assert_eq!(hit.energy_loss, 0.0);
}

#[test]
fn energy_loss_against_a_body_at_rest_follows_the_mass_ratio() {
    // (2.18): ΔT/T = 1/(1 + m1/m2) for m2 at rest and e = 0, from the impact itself.
    for (m1, m2, fraction) in [(99.0, 1.0, 0.01), (1.0, 99.0, 0.99), (1.0, 1.0, 0.5)] {
        let hit = impact(3.0, 0.0, 1.0 / m1 + 1.0 / m2);
        let lost = hit.energy_loss / (0.5 * m1 * 9.0);
        assert!((lost - fraction).abs() <= 4.0 * EPS, "m1/m2 = {}: lost {lost}, (2.18) {fraction}", m1 / m2);
    }
}

#[test]
fn two_fixed_bodies_exert_no_impulse() {
    let (w1, w2) = (DVec3::X, DVec3::NEG_X);
    let (u1, u2, hit) = resolve_pair(w1, w2, 0.0, 0.0, DVec3::X, 0.5);
    assert_eq!((u1, u2, hit.impulse), (w1, w2, 0.0));
    assert_eq!(reduced_mass(f64::INFINITY, f64::INFINITY), f64::INFINITY);
    let (common, sticking) = resolve_sticking(w1, w2, 0.0, 0.0);
    assert_eq!((common, sticking.impulse), (w1, DVec3::ZERO));
}

#[test]
fn losses_of_nearly_elastic_impacts_are_accurate() {
    // 1 − e² = 2⁻⁴⁹ (1 − 2⁻⁵¹): a difference of squares would keep only three bits.
    let e = 1.0 - 2f64.powi(-50);
    let exact = 0.5 * 0.5 * (2f64.powi(-49) - 2f64.powi(-100));
    let loss = impact(1.0, e, 2.0).energy_loss;
    assert!((loss - exact).abs() <= EPS * exact, "{loss:e} against {exact:e}");
}

#[test]
fn the_small_common_velocity_with_a_heavy_body_at_rest_is_accurate() {
    let (heavy, w) = (3e12, DVec3::new(0.7, -0.3, 0.1));
    for (common, _) in [
        resolve_sticking(DVec3::ZERO, w, 1.0 / heavy, 1.0),
        resolve_sticking(w, DVec3::ZERO, 1.0, 1.0 / heavy),
    ] {
        let expected = w / (1.0 + heavy);
        assert!((common - expected).length() <= 8.0 * EPS * expected.length(), "{common} against {expected}");
    }
}
