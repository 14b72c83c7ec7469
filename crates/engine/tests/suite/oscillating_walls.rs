//! Oscillating walls: bifurcations of a bouncing ball, work, and a trajectory that is independent of the
//! search.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, EngineError, EventKind, Options, Oscillating, Simulation, System, Term, Until,
    WallMotion,
};
use haff_mechanics::{Oscillation, Waveform};

use crate::common::{Log, Random, check_independence, class, scatter, set_restitution, system};

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn oscillating(waveform: Waveform, amplitude: f64, frequency: f64, cycles: f64) -> WallMotion {
    WallMotion::Oscillating(Oscillating {
        oscillation: Oscillation { waveform, amplitude, frequency },
        cycles,
    })
}

#[test]
fn trajectory_with_oscillating_walls_is_independent_of_search_slices_and_resumption() {
    let boundary = [Boundary::Wall, Boundary::Periodic, Boundary::Wall];
    for (dimension, gravity) in [(Dimension::Three, -0.5), (Dimension::Two, 0.0), (Dimension::Three, 0.0)] {
        let edge = if dimension == Dimension::Two { 40.0 } else { 12.0 };
        let mut scene = system(dimension, DVec3::splat(edge), boundary);
        let kind = class(&mut scene, 0.5, 2.0);
        scatter(&mut scene, kind, 300, 1.0, &mut Random(5));
        set_restitution(&mut scene, 0.9);
        scene.domain.gravity.x = gravity;
        // The walls reach the box, but do not enter it, where particles are placed.
        scene.walls[0].motion = oscillating(Waveform::Sine, 0.3, 0.7, 0.5);
        scene.walls[0].point.x = -0.3;
        scene.walls[1].motion = oscillating(Waveform::Triangle, 0.2, 1.3, 0.1);
        scene.walls[1].point.x += 0.2;
        let reference = check_independence(&scene, &[0.5, 2.0, 6.0]);
        assert!(reference.counters().wall_collisions > 30, "{:?}", reference.counters());
        let ledger = reference.ledger();
        assert!(ledger.term(Term::WallWork) > 0.0, "{ledger:?}");
    }
}

/// A ball of restitution e under gravity 1 over a sine plate of frequency 1 with Γ = A ω²/g.
fn ball(e: f64, gamma: f64, height: f64, speed: f64, cycles: f64) -> System {
    let mut scene = system(Dimension::Three, DVec3::splat(4.0), [Boundary::Open; 3]);
    let kind = class(&mut scene, 0.01, 1.0);
    scene.bodies.push(haff_engine::Body {
        position: DVec3::new(0.0, 0.0, height + 0.01),
        velocity: DVec3::Z * speed,
        image: [0; 3],
        class: kind,
        species: 0,
    });
    scene.walls.push(haff_engine::Wall {
        name: "plate".into(),
        point: DVec3::ZERO,
        normal: DVec3::Z,
        motion: oscillating(Waveform::Sine, gamma / (TAU * TAU), 1.0, cycles),
        shape: None,
    });
    scene.contacts.wall.push(haff_mechanics::Restitution::Constant(e).into());
    scene.domain.gravity = -DVec3::Z;
    scene
}

/// Times of the first `count` impacts of a ball that starts with the takeoff of period one, delayed by
/// `shift` cycles.
fn impacts(e: f64, gamma: f64, shift: f64, count: usize) -> Vec<f64> {
    let first = PI * (1.0 - e) / (1.0 + e);
    // The plate's speed at the impact is (g T/2)(1 − e)/(1 + e), its largest speed g Γ/ω.
    let cycles = libm::acos((first / gamma).min(1.0)) / TAU + shift;
    let plate = Oscillation { waveform: Waveform::Sine, amplitude: gamma / (TAU * TAU), frequency: 1.0 };
    let mut simulation =
        Simulation::new(ball(e, gamma, plate.shift(cycles), 0.5, cycles), Options::default()).unwrap();
    let mut log = Log::default();
    // Without a periodic orbit the bounces may become shorter and shorter.
    let end = simulation.advance(until(count as f64), &mut log);
    assert!(end.is_ok() || matches!(end, Err(EngineError::Collapse { .. })), "{end:?}");
    log.0.iter().filter(|event| event.kind == EventKind::Wall).map(|event| event.time).collect()
}

/// Γ₁ = π(1 − e)/(1 + e), and Γ₂² = Γ₁² + 4[(1 + e²)/(1 + e)²]², to 10⁻³.
#[test]
fn a_ball_on_a_sine_plate_has_its_bifurcations_at_the_theoretical_accelerations() {
    for e in [0.3, 0.5, 0.6, 0.7, 0.8] {
        let first = PI * (1.0 - e) / (1.0 + e);
        let doubling = first.hypot(2.0 * (1.0 + e * e) / ((1.0 + e) * (1.0 + e)));
        // Above Γ₁ the orbit exists and is kept for as long as its rounding error is not amplified.
        let kept = impacts(e, first * 1.001, 0.0, 20);
        assert!(kept.len() >= 19, "e = {e}: {} impacts in 20 periods", kept.len());
        for (k, time) in kept.iter().enumerate() {
            assert!((time - (k + 1) as f64).abs() < 1e-6, "e = {e}: impact {k} at {time}");
        }
        // Below it no takeoff leads to the next impact a period later.
        let lost = impacts(e, first * 0.999, 0.0, 60);
        let last = lost[lost.len() - 1] - lost[lost.len() - 2];
        assert!((last - 1.0).abs() > 1e-3, "e = {e}: still periodic below Γ₁, {last}");
        // Below Γ₂ small displacements die out, above they grow to a cycle of two.
        let spread = |gamma: f64| {
            let times = impacts(e, gamma, 1e-4, 20_000);
            let interval = |k: usize| times[k + 1] - times[k];
            let n = times.len() - 3;
            (interval(n) - interval(n - 1)).abs()
        };
        let (below, above) = (spread(doubling * 0.999), spread(doubling * 1.001));
        assert!(below < 1e-9, "e = {e}: {below:e} below Γ₂ = {doubling}");
        assert!(above > 1e-3, "e = {e}: {above:e} above Γ₂ = {doubling}");
    }
}
