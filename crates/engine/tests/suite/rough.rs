//! Rough particles: conservation, independence of the search, thermal walls, and friction on floors.

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, EventKind, NeighborChoice, Options, Silent, Simulation, Spin, System, Term,
    ThermalWall, Until, WallLaw,
};
use haff_mechanics::{Restitution, Roughness};

use crate::common::{Log, Random, add, check_independence, class, gas, scatter, set_restitution, system};

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn law(tangential_restitution: f64, friction: f64) -> Roughness {
    Roughness { tangential_restitution, friction }
}

/// Gives a scene one rough law for all contacts, and spins of this size.
fn roughen(scene: &mut System, law: Roughness, spin: f64, seed: u64) {
    let mut random = Random(seed);
    let flat = scene.dimension == Dimension::Two;
    let mut component = |used: bool| if used { spin * random.normal() } else { 0.0 };
    let angular_velocity = (0..scene.bodies.len())
        .map(|_| DVec3::new(component(!flat), component(!flat), component(true)))
        .collect();
    scene.spin = Some(Spin {
        inertia: vec![if flat { 0.5 } else { 0.4 }; scene.groups.len()],
        angular_velocity,
        pair: vec![law; scene.contacts.pair.len()],
        wall: vec![law; scene.contacts.wall.len()],
    });
}

const FREE: f64 = f64::INFINITY;

#[test]
fn smooth_contacts_with_spin_have_the_trajectory_of_smooth_particles() {
    let mut scene = gas(8, 0.3, 0.9, 3);
    let run = |scene: &System| {
        let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
        simulation.advance(Until { collisions: 20_000, ..Until::default() }, &mut Silent).unwrap();
        simulation
    };
    let smooth = run(&scene);
    roughen(&mut scene, Roughness::SMOOTH, 2.0, 4);
    let rough = run(&scene);
    let (a, b) = (smooth.frame(), rough.frame());
    assert_eq!((a.position, a.velocity), (b.position, b.velocity));
    assert_eq!(b.angular_velocity, scene.spin.unwrap().angular_velocity);
    assert_eq!(smooth.ledger().dissipated, rough.ledger().dissipated);
    assert!(smooth.state_hash() != rough.state_hash(), "the hash contains the spins");
}

#[test]
fn trajectory_of_rough_particles_is_independent_of_search_slices_and_resumption() {
    let boundary = [Boundary::Wall, Boundary::Periodic, Boundary::Wall];
    for (dimension, gravity, beta, mu) in [
        (Dimension::Three, 0.0, 0.3, 0.4),
        (Dimension::Two, 0.0, -0.5, FREE),
        (Dimension::Three, -0.5, 0.8, 0.2),
        (Dimension::Two, -0.5, 0.0, FREE),
    ] {
        let edge = if dimension == Dimension::Two { 40.0 } else { 12.0 };
        let mut scene = system(dimension, DVec3::splat(edge), boundary);
        let (small, large) = (class(&mut scene, 0.4, 1.0), class(&mut scene, 0.6, 2.0));
        scatter(&mut scene, small, 150, 1.0, &mut Random(5));
        scatter(&mut scene, large, 100, 1.0, &mut Random(6));
        set_restitution(&mut scene, 0.7);
        scene.domain.gravity.x = gravity;
        *scene.contacts.wall.last_mut().unwrap() = WallLaw::Thermal(ThermalWall {
            temperature: 0.5,
            accommodation: 0.6,
            restitution: Restitution::Constant(0.8),
        });
        roughen(&mut scene, law(beta, mu), 1.0, 7);
        let reference = check_independence(&scene, &[0.5, 2.0, 6.0]);
        assert!(reference.ledger().rotational > 0.0);
    }
}

/// Without walls, the sum of orbital and intrinsic angular momentum is conserved.
#[test]
fn rough_impacts_conserve_momentum_and_angular_momentum() {
    let mut scene = system(Dimension::Three, DVec3::splat(12.0), [Boundary::Open; 3]);
    let (small, large) = (class(&mut scene, 0.4, 1.0), class(&mut scene, 0.6, 5.0));
    scatter(&mut scene, small, 80, 1.0, &mut Random(5));
    scatter(&mut scene, large, 60, 1.0, &mut Random(6));
    // Towards the middle, so that there are many impacts before the particles fly apart.
    for body in &mut scene.bodies {
        body.velocity -= 2.0 * (body.position - DVec3::splat(6.0));
    }
    set_restitution(&mut scene, 0.6);
    roughen(&mut scene, law(0.3, 0.5), 3.0, 8);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let before = simulation.sample();
    simulation.advance(until(4.0), &mut Silent).unwrap();
    let after = simulation.sample();
    let spin_changes = (after.ledger.rotational - before.ledger.rotational).abs();
    assert!(after.collisions > 150 && spin_changes > 1.0, "{} impacts", after.collisions);
    let change = (after.angular_momentum.unwrap() - before.angular_momentum.unwrap()).length();
    // Each impact rounds r × p, of about 60, once or twice.
    assert!(change < 60.0 * f64::EPSILON * after.collisions as f64, "{change:e}");
    assert!((after.momentum - before.momentum).length() < 1e-12);
    assert!(after.ledger.residual.abs() < 1e-13, "{:?}", after.ledger);
}

/// e = β = 1: a million impacts conserve the energy, which is shared equally by all degrees of freedom.
#[test]
#[ignore = "long: scripts/test all"]
fn perfectly_rough_elastic_spheres_conserve_energy_and_reach_equipartition() {
    let mut scene = gas(8, 0.2, 1.0, 3);
    roughen(&mut scene, law(1.0, FREE), 0.0, 4);
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    let energy = |simulation: &Simulation| simulation.ledger().kinetic + simulation.ledger().rotational;
    let start = energy(&simulation);
    let (mut ratios, blocks, impacts) = (Vec::new(), 40, 1_000_000);
    for k in 1..=blocks {
        let collisions = k * impacts / blocks;
        simulation.advance(Until { collisions, ..Until::default() }, &mut Silent).unwrap();
        let sample = simulation.sample();
        // In the frame of the center of mass there are 3(N − 1) translations and 3N rotations.
        ratios.push(sample.rotational_temperature / (sample.temperature * 512.0 / 511.0));
    }
    let walk = (energy(&simulation) / start - 1.0).abs();
    // A walk of up to 6 ε T an impact (impact_drift.rs of haff-mechanics), of 3·512 T in all; four times
    // its root mean square.
    assert!(walk < 4.0 * 6.0 * f64::EPSILON / 1536.0 * 1000.0, "{walk:e}");
    assert_eq!(simulation.ledger().dissipated, 0.0);
    ratios.drain(..2);
    let n = ratios.len() as f64;
    let mean = ratios.iter().sum::<f64>() / n;
    let variance = ratios.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let z = (mean - 1.0) / (variance / n).sqrt();
    assert!(z.abs() < 4.0, "T_rot/T = {mean}: z = {z}");
}

#[test]
#[ignore = "long: scripts/test all"]
fn thermal_walls_set_the_spin() {
    for (dimension, q) in [(Dimension::Three, 0.4), (Dimension::Two, 0.5)] {
        let (count, temperature, mass, radius) = (20, 1.7, 2.0, 0.3);
        let mut scene = system(dimension, DVec3::splat(4.0), [Boundary::Wall; 3]);
        let kind = class(&mut scene, radius, mass);
        scatter(&mut scene, kind, count, 1.0, &mut Random(5));
        roughen(&mut scene, law(0.5, FREE), 0.0, 4);
        // Pairs that lose nothing: in equilibrium the walls give what the scene has, T.
        scene.spin.as_mut().unwrap().pair.fill(law(1.0, FREE));
        let thermal =
            ThermalWall { temperature, accommodation: 1.0, restitution: Restitution::Constant(1.0) };
        scene.contacts.wall.fill(WallLaw::Thermal(thermal));
        scene.seed = 11;
        let mut simulation = Simulation::new(scene, Options::default()).unwrap();
        let (mut sum, states) = (0.0, 1500);
        for k in 1..=states {
            simulation.advance(until(20.0 * f64::from(k)), &mut Silent).unwrap();
            sum += simulation.sample().rotational_temperature;
        }
        let axes = if dimension == Dimension::Two { 1.0 } else { 3.0 };
        let samples = f64::from(states) * count as f64 * axes;
        let z = (sum / f64::from(states) / temperature - 1.0) / (2.0 / samples).sqrt();
        assert!(z.abs() < 4.0, "{dimension:?}, q = {q}: T_rot, z = {z}");
        let ledger = simulation.ledger();
        assert!(ledger.residual.abs() < 1e-12 && ledger.term(Term::WallHeat) != 0.0, "{ledger:?}");
    }
}

/// A ball on a floor, with gravity −10 along z, and along x as given.
fn ball(velocity: DVec3, spin: DVec3, slope: f64, law: Roughness) -> System {
    let boundary = [Boundary::Open, Boundary::Open, Boundary::Wall];
    let mut scene = system(Dimension::Three, DVec3::splat(4.0), boundary);
    let kind = class(&mut scene, 0.5, 2.0);
    add(&mut scene, kind, DVec3::new(0.0, 0.0, 0.5), velocity);
    set_restitution(&mut scene, 0.5);
    scene.domain.gravity = DVec3::new(slope, 0.0, -10.0);
    roughen(&mut scene, law, 0.0, 1);
    scene.spin.as_mut().unwrap().angular_velocity[0] = spin;
    scene
}

/// Runs a scene to a time. Returns position, velocity and spin of the ball, and the rows.
fn run(scene: &System, time: f64) -> (DVec3, DVec3, DVec3, Log) {
    let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
    let mut log = Log::default();
    simulation.sample();
    for k in 1..=10 {
        simulation.advance(until(time * 0.1 * f64::from(k)), &mut log).unwrap();
        let sample = simulation.sample();
        assert!(sample.ledger.residual.abs() < 1e-14, "{:?}", sample.ledger);
    }
    let sample = simulation.sample();
    let change = sample.momentum - 2.0 * scene.bodies[0].velocity - sample.external_impulse;
    assert!(change.length() < 1e-12, "{change}");
    let frame = simulation.frame();
    (frame.position[0], frame.velocity[0], frame.angular_velocity[0], log)
}

fn assert_near(a: DVec3, b: DVec3, what: &str) {
    assert!((a - b).length() < 1e-12 * (1.0 + b.length()), "{what}: {a}, expected {b}");
}

#[test]
fn a_sliding_ball_rolls_at_five_sevenths_of_its_speed() {
    let (v, mu, g) = (7.0, 0.25, 10.0);
    let scene = ball(DVec3::X * v, DVec3::ZERO, 0.0, law(0.5, mu));
    let end = 2.0 * v / (7.0 * mu * g);
    let (_, velocity, spin, log) = run(&scene, 2.0);
    assert_near(velocity, DVec3::X * (5.0 * v / 7.0), "velocity");
    assert_near(spin, DVec3::Y * (10.0 * v / 7.0), "spin");
    let slides: Vec<_> = log.0.iter().filter(|row| row.kind == EventKind::Slide).collect();
    assert_eq!(slides.len(), 1);
    assert!((slides[0].time - end).abs() < 1e-14, "{}, expected {end}", slides[0].time);
    // Of ½ m v², 2/7 are lost.
    assert!((slides[0].energy_loss - v * v * 2.0 / 7.0).abs() < 1e-12);
    assert_near(slides[0].impulse_vector, DVec3::X * (2.0 * 2.0 * v / 7.0), "impulse on the floor");
    let (position, velocity, _, _) = run(&scene, 0.5 * end);
    assert_near(velocity, DVec3::X * (v * 6.0 / 7.0), "velocity half-way");
    assert_near(position - DVec3::Z * 0.5, DVec3::X * (v * 13.0 / 14.0 * 0.5 * end), "position half-way");
}

#[test]
fn a_ball_with_backspin_returns() {
    // ω > 5 v/(2 R): it rolls back.
    let (v, backspin) = (1.0, 20.0);
    let scene = ball(DVec3::new(v, 0.0, 0.0), DVec3::new(0.0, -backspin, 3.0), 0.0, law(0.5, 0.3));
    let (_, velocity, spin, _) = run(&scene, 5.0);
    // v' = v − 2/7 s with the slip s = v + R ω.
    let after = v - (v + 0.5 * backspin) * 2.0 / 7.0;
    assert!(after < 0.0);
    assert_near(velocity, DVec3::X * after, "velocity");
    assert_near(spin, DVec3::new(0.0, after / 0.5, 3.0), "spin, that about the normal unchanged");
}

#[test]
fn without_a_bound_of_friction_a_ball_rolls_at_once() {
    let (_, velocity, spin, log) = run(&ball(DVec3::X * 7.0, DVec3::ZERO, 0.0, law(0.5, FREE)), 1.0);
    assert_near(velocity, DVec3::X * 5.0, "velocity");
    assert_near(spin, DVec3::Y * 10.0, "spin");
    let loss: f64 = log.0.iter().map(|row| row.energy_loss).sum();
    assert!((loss - 14.0).abs() < 1e-12, "{loss}");
}

#[test]
fn a_smooth_ball_slides_on() {
    let (_, velocity, spin, _) = run(&ball(DVec3::X * 7.0, DVec3::Y, 0.0, Roughness::SMOOTH), 1.0);
    assert_near(velocity, DVec3::X * 7.0, "velocity");
    assert_near(spin, DVec3::Y, "spin");
}

/// Down a slope a ball rolls with 5/7 of the acceleration of gravity along it, if 2/7 of it need no more
/// friction than μ allows; otherwise it slides with a − μ g.
#[test]
fn a_ball_rolls_or_slides_down_a_slope() {
    let time = 2.0;
    let (position, velocity, spin, _) = run(&ball(DVec3::ZERO, DVec3::ZERO, 3.0, law(0.0, 0.2)), time);
    assert_near(velocity, DVec3::X * (3.0 * 5.0 / 7.0 * time), "rolling");
    assert_near(position, DVec3::new(3.0 * 2.5 / 7.0 * time * time, 0.0, 0.5), "place");
    assert_near(spin, DVec3::Y * (3.0 * 10.0 / 7.0 * time), "spin");
    let (_, velocity, spin, _) = run(&ball(DVec3::ZERO, DVec3::ZERO, 8.0, law(0.0, 0.2)), time);
    assert_near(velocity, DVec3::X * (6.0 * time), "sliding");
    assert_near(spin, DVec3::Y * (2.0 / (0.4 * 0.5) * time), "spin");
    // Upwards first: it slides until the slip has ended, then rolls up and down.
    let scene = ball(DVec3::X * -7.0, DVec3::ZERO, 3.0, law(0.0, 0.2));
    let (_, velocity, _, log) = run(&scene, 6.0);
    let end = 7.0 / (3.0 + 0.2 * 10.0 * 3.5);
    let rolling = -7.0 + (3.0 + 2.0) * end;
    assert_near(velocity, DVec3::X * (rolling + 3.0 * 5.0 / 7.0 * (6.0 - end)), "rolling");
    let slide = log.0.iter().find(|row| row.kind == EventKind::Slide).unwrap();
    assert!((slide.time - end).abs() < 1e-13);
}

/// A slip oblique to the slope turns towards it. Its rate, ds/dt = a − k s/|s|, is integrated by many steps
/// of the classical method of Runge and Kutta.
#[test]
fn an_oblique_slide_on_a_slope_turns() {
    let (mu, slope, v, time) = (0.2, 3.0, 4.0, 0.5);
    let (position, velocity, spin, log) = run(&ball(DVec3::Y * v, DVec3::ZERO, slope, law(0.0, mu)), time);
    let friction = |slip: DVec3| slip.normalize() * (-mu * 10.0);
    let (along, steps) = (DVec3::X * slope, 100_000);
    let h = time / f64::from(steps);
    let rate = |slip: DVec3| along + friction(slip) * 3.5;
    let (mut slip, mut speed, mut place) = (DVec3::Y * v, DVec3::Y * v, DVec3::ZERO);
    for _ in 0..steps {
        let a = rate(slip);
        let b = rate(slip + a * (0.5 * h));
        let c = rate(slip + b * (0.5 * h));
        let d = rate(slip + c * h);
        let next = slip + (a + 2.0 * b + 2.0 * c + d) * (h / 6.0);
        // The velocity follows from the slip: dv/dt = a + (ds/dt − a)/3.5.
        let change = along * h + (next - slip - along * h) / 3.5;
        place += speed * h + change * (0.5 * h);
        speed += change;
        slip = next;
    }
    let error = (velocity - speed).length() / v;
    assert!(error < 1e-6, "velocity {velocity}, expected {speed}: {error:e}");
    assert!((position - DVec3::Z * 0.5 - place).length() < 1e-6, "{position}, expected {place}");
    assert!((slip - (velocity - 0.5 * spin.cross(DVec3::Z))).length() < 2e-6 * v);
    assert!(log.0.iter().all(|row| row.kind != EventKind::Slide), "one slide, that goes on");
}

/// A superball: with e = β = 1 the horizontal motion and the spin reverse in turn, so that it comes back.
#[test]
fn a_superball_comes_back() {
    let mut scene = ball(DVec3::new(2.0, 0.0, 0.0), DVec3::ZERO, 0.0, law(1.0, FREE));
    set_restitution(&mut scene, 1.0);
    scene.bodies[0].position.z = 1.75;
    let mut simulation = Simulation::new(scene, Options::default()).unwrap();
    // The slip s = v − R ω reverses: v' = v − 4/7 s, R ω' = R ω + 10/7 s. It falls for 0.5.
    let (mut v, mut turning) = (2.0, 0.0);
    for k in 0..6 {
        simulation.advance(until(0.75 + f64::from(k)), &mut Silent).unwrap();
        let slip = v - turning;
        (v, turning) = (v - slip * 4.0 / 7.0, turning + slip * 10.0 / 7.0);
        let frame = simulation.frame();
        assert!((frame.velocity[0].x - v).abs() < 1e-13, "bounce {k}: {}, expected {v}", frame.velocity[0].x);
        assert!((0.5 * frame.angular_velocity[0].y - turning).abs() < 1e-13);
    }
    assert_eq!(simulation.ledger().dissipated, 0.0);
}

/// Slides and their ends are the same with every search, in slices and after a resumption in the middle of
/// them.
#[test]
fn grains_that_slide_and_roll_on_a_floor_are_independent_of_search_and_resumption() {
    let boundary = [Boundary::Periodic, Boundary::Wall, Boundary::Wall];
    for (dimension, mu, gravity) in [
        (Dimension::Three, 0.3, DVec3::new(0.0, 0.0, -1.0)),
        (Dimension::Three, FREE, DVec3::new(0.0, 0.0, -1.0)),
        (Dimension::Three, 0.1, DVec3::new(0.0, -0.4, -1.0)),
        (Dimension::Two, 0.2, DVec3::new(0.0, -1.0, 0.0)),
    ] {
        let flat = dimension == Dimension::Two;
        let size = if flat { DVec3::new(40.0, 5.0, 1.0) } else { DVec3::new(12.0, 12.0, 5.0) };
        let mut scene = system(dimension, size, boundary);
        let kind = class(&mut scene, 0.5, 1.0);
        // One layer: without the TC model, a grain on top of others would collide without end.
        let mut random = Random(5);
        for k in 0..16 {
            let (x, y) = (1.5 + 2.0 * f64::from(k % 4), 1.5 + 2.0 * f64::from(k / 4));
            let (vx, vy) = (random.normal(), random.normal());
            if flat {
                add(&mut scene, kind, DVec3::new(2.0 * f64::from(k) + 1.0, 0.6, 0.0), DVec3::X * vx);
            } else {
                add(&mut scene, kind, DVec3::new(x, y, 0.6), DVec3::new(vx, vy, 0.0));
            }
        }
        set_restitution(&mut scene, 0.6);
        scene.domain.gravity = gravity;
        roughen(&mut scene, law(0.2, mu), 2.0, 7);
        let reference = check_independence(&scene, &[1.0, 2.5, 4.0, 6.0]);
        assert!(reference.counters().rests > 12, "{:?}", reference.counters());
    }
}

#[test]
fn a_reversed_slide_and_a_changed_spin_go_on() {
    let scene = ball(DVec3::X * 7.0, DVec3::ZERO, 0.0, law(0.5, 0.25));
    let options = Options { neighbors: NeighborChoice::Cells, ..Options::default() };
    let mut simulation = Simulation::new(scene, options).unwrap();
    simulation.advance(until(0.3), &mut Silent).unwrap();
    simulation.reverse();
    simulation.advance(until(5.0), &mut Silent).unwrap();
    let spin = simulation.frame().angular_velocity[0];
    let rolling = simulation.frame().velocity[0];
    assert_near(rolling, DVec3::X * (0.5 * spin.y), "rolling");
    assert!(simulation.ledger().residual.abs() < 1e-14);
    let change = haff_engine::Change {
        angular_velocities: Some(vec![DVec3::new(1.0, 2.0, 3.0)]),
        ..haff_engine::Change::default()
    };
    simulation.change(&change, &mut Silent).unwrap();
    assert_eq!(simulation.frame().angular_velocity[0], DVec3::new(1.0, 2.0, 3.0));
    simulation.advance(until(9.0), &mut Silent).unwrap();
    assert!(simulation.ledger().residual.abs() < 1e-14, "{:?}", simulation.ledger());
}
