//! Measurements while a run goes on: pressure tensor, forces on walls, profiles and correlations, against the
//! frames and the event logs of the same runs.

use glam::DVec3;
use haff_engine::{
    Boundary, Correlations, Dimension, Drive, DriveKind, EngineError, Frame, Grid, GridAxis, KickTimes,
    Measure, Options, Oscillating, Sample, Silent, Simulation, System, ThermalWall, Until, WallLaw,
    WallMotion,
};
use haff_mechanics::{Oscillation, Restitution, Waveform};

use crate::common::{Log, Random, add, class, gas, set_restitution, system};

fn until(time: f64) -> Until {
    Until { time, ..Until::default() }
}

fn start(system: &System) -> Simulation {
    Simulation::new(system.clone(), Options::default()).unwrap()
}

/// A grid over whole edges of the box.
fn grid(system: &System, axes: &[(usize, usize)], interval: f64, samples: u64) -> Grid {
    let axis =
        |&(axis, bins): &(usize, usize)| GridAxis { axis, low: 0.0, high: system.domain.size[axis], bins };
    Grid { axes: axes.iter().map(axis).collect(), interval, samples, spread: false, species: Vec::new() }
}

fn correlate(interval: f64) -> Correlations {
    Correlations {
        msd: haff_engine::Followed::All,
        vacf: haff_engine::Followed::All,
        stress: true,
        interval,
        tracers: usize::MAX,
    }
}

fn trace(tensor: [f64; 9]) -> f64 {
    tensor[0] + tensor[4] + tensor[8]
}

/// A gas of this restitution with all measurements.
fn measured_gas(packing_fraction: f64, e: f64) -> System {
    let mut system = gas(6, packing_fraction, e, 3);
    system.measure = Measure {
        stress: true,
        wall_forces: true,
        pair_collisions: true,
        profiles: vec![
            grid(&system, &[(2, 7)], 0.5, 4),
            grid(&system, &[(0, 3), (1, 4), (2, 2)], 0.5, 4),
            grid(&system, &[(0, 1)], 0.5, 4),
        ],
        correlations: correlate(0.03),
        probes: Vec::new(),
    };
    system
}

#[test]
fn the_trace_of_the_pressure_tensor_is_the_pressure() {
    let mut inelastic = measured_gas(0.2, 0.8);
    let mut driven = measured_gas(0.3, 0.9);
    let noise = DriveKind::WhiteNoise { strength: 0.5, kicks: KickTimes::Poisson { rate: 5.0 } };
    driven.drives.push(Drive { kind: noise, species: vec![0], rotational: false });
    let elastic = measured_gas(0.49, 1.0);
    for system in [&mut inelastic, &mut driven, &mut elastic.clone()] {
        let mut simulation = start(system);
        assert!(simulation.sample().stress.is_some_and(|stress| stress.kinetic[0].is_nan()));
        for k in 1..4 {
            simulation.advance(until(f64::from(k)), &mut Silent).unwrap();
            let Sample { stress, pressure, .. } = simulation.sample();
            let (stress, pressure) = (stress.unwrap(), pressure.unwrap());
            let off = trace(stress.total()) / 3.0 - pressure;
            assert!(off.abs() < 1e-13 * pressure, "{off:e} of {pressure}");
            for (a, b) in [(1, 3), (2, 6), (5, 7)] {
                let (a, b) = (stress.total()[a], stress.total()[b]);
                assert!((a - b).abs() < 1e-12 * pressure, "symmetric: {a} and {b}");
            }
        }
    }
}

#[test]
fn an_elastic_gas_in_equilibrium_is_isotropic() {
    let mut system = gas(6, 0.3, 1.0, 8);
    system.measure.stress = true;
    let mut simulation = start(&system);
    simulation.advance(until(1.0), &mut Silent).unwrap();
    simulation.sample();
    let mut rows = Vec::new();
    for k in 0..400 {
        simulation.advance(until(1.0 + 0.2 * f64::from(k + 1)), &mut Silent).unwrap();
        let stress = simulation.sample().stress.unwrap();
        let total = stress.total();
        rows.push([total[1], total[2], total[5], total[0] - total[4], total[4] - total[8]]);
    }
    for component in 0..5 {
        let mean = rows.iter().map(|row| row[component]).sum::<f64>() / rows.len() as f64;
        let variance = rows.iter().map(|row| (row[component] - mean).powi(2)).sum::<f64>() / 399.0;
        let z = mean / (variance / 400.0).sqrt();
        assert!(z.abs() < 4.0, "component {component}: z = {z}");
    }
}

#[test]
fn profiles_sum_to_the_totals_of_the_frames_and_of_the_event_log() {
    let system = measured_gas(0.3, 0.9);
    let mut simulation = start(&system);
    let mut log = Log::default();
    simulation.sample();
    for k in 1..=4 {
        let mut frames = Vec::new();
        for j in 1..=4 {
            simulation.advance(until(0.5 * f64::from(k - 1) + 0.125 * f64::from(j)), &mut log).unwrap();
            frames.push(simulation.frame());
        }
        let stress = simulation.sample().stress.unwrap();
        let rows: Vec<_> = log.1.iter().filter(|row| row.time == 0.5 * f64::from(k)).collect();
        assert_eq!(rows.len(), 3);
        for row in rows {
            let of = &system.measure.profiles[row.profile];
            let volume = system.domain.size.element_product();
            let cell = volume / of.cells() as f64;
            let count = row.density.iter().sum::<f64>() * cell;
            assert!((count - 216.0).abs() < 1e-12 * 216.0, "{count}");
            // An empty cell has no velocity.
            let cells = (0..of.cells()).filter(|&c| row.mass_density[c] > 0.0);
            let momentum: DVec3 = cells.clone().map(|c| row.mass_density[c] * cell * row.velocity[c]).sum();
            let expected = frames.iter().flat_map(|f: &Frame| &f.velocity).sum::<DVec3>() / 4.0;
            assert!((momentum - expected).length() < 1e-11, "{momentum} and {expected}");
            for component in 0..9 {
                let (a, b) = (component / 3, component % 3);
                let flow =
                    cells.clone().map(|c| row.mass_density[c] * row.velocity[c][a] * row.velocity[c][b]);
                let all: f64 = row.pressure.iter().skip(component).step_by(9).sum();
                let found = (all + flow.sum::<f64>()) * cell;
                let states = frames.iter().flat_map(|f| &f.velocity).map(|v| v[a] * v[b]);
                let expected = states.sum::<f64>() / 4.0 + stress.collisional[component] * volume;
                let scale = trace(stress.total()) * volume;
                assert!((found - expected).abs() < 1e-12 * scale, "{component}: {found} and {expected}");
            }
            let thermal: f64 = cells.map(|c| row.temperature[c] * row.density[c] * cell).sum();
            let of_flow: f64 =
                (0..3).map(|a| row.pressure.iter().skip(4 * a).step_by(9).sum::<f64>() * cell).sum::<f64>()
                    - trace(stress.collisional) * volume;
            assert!((3.0 * thermal - of_flow).abs() < 1e-11 * of_flow, "temperature");
        }
    }
}

/// Direct sums over the frames at multiples of the interval.
fn direct(frames: &[Frame], lag: usize, every: usize, term: impl Fn(&Frame, &Frame) -> f64) -> f64 {
    let kept: Vec<&Frame> = frames.iter().step_by(every).collect();
    let terms: Vec<f64> = kept.iter().zip(&kept[lag / every..]).map(|(a, b)| term(a, b)).collect();
    terms.iter().sum::<f64>() / terms.len() as f64
}

#[test]
fn correlations_are_those_of_the_frames() {
    let system = measured_gas(0.1, 1.0);
    let interval = system.measure.correlations.interval;
    let mut simulation = start(&system);
    let mut frames = vec![simulation.frame()];
    let count = system.bodies.len() as f64;
    let mut stresses = Vec::new();
    simulation.sample();
    for k in 1..=200 {
        simulation.advance(until(f64::from(k) * interval), &mut Silent).unwrap();
        frames.push(simulation.frame());
        stresses.push(simulation.sample().stress.unwrap().total());
    }
    let found = simulation.correlations();
    assert_eq!(found.iter().map(|c| c.name).collect::<Vec<_>>(), ["msd", "vacf", "stress", "helfand"]);
    for (k, &lag) in found[0].lag.iter().enumerate() {
        let lag = (lag / interval).round() as usize;
        let every = lag.div_ceil(16).next_power_of_two();
        let unwrapped = |f: &Frame, i: usize| {
            f.position[i] + DVec3::from_array(f.image[i].map(f64::from)) * system.domain.size
        };
        let moved = direct(&frames, lag, every, |a, b| {
            (0..a.position.len()).map(|i| (unwrapped(a, i) - unwrapped(b, i)).length_squared()).sum::<f64>()
                / count
        });
        assert!(
            (found[0].value[k] - moved).abs() < 1e-12 * moved,
            "lag {lag}: {} and {moved}",
            found[0].value[k]
        );
        let product = direct(&frames, lag, every, |a, b| {
            a.velocity.iter().zip(&b.velocity).map(|(a, b)| a.dot(*b)).sum::<f64>() / count
        });
        // The autocorrelations have the lag 0 in addition.
        assert!((found[1].value[k + 1] - product).abs() < 1e-12 * 3.0, "lag {lag}");
    }
    // P_xy and so on.
    let traceless =
        |p: &[f64; 9]| [p[1], p[2], p[5], (p[0] - p[4]) / 2.0, (p[0] + p[4] - 2.0 * p[8]) / 12.0_f64.sqrt()];
    let variance = stresses.iter().flat_map(traceless).map(|p| p * p).sum::<f64>() / 1000.0;
    assert!((found[2].value[0] - variance).abs() < 1e-12 * variance, "{} and {variance}", found[2].value[0]);
    let of_interval = variance * interval * interval;
    assert!((found[3].value[0] - of_interval).abs() < 1e-10 * of_interval);
}

/// Mean force on the floor since the last sample.
fn force_on_floor(simulation: &mut Simulation) -> DVec3 {
    let floor = simulation.system().walls.iter().position(|wall| wall.name == "z-").unwrap();
    simulation.sample().wall_force[floor]
}

/// A grain above a floor with gravity along z.
fn grain_over_a_floor(e: f64, height: f64) -> System {
    let boundary = [Boundary::Periodic, Boundary::Wall, Boundary::Wall];
    let mut system = system(Dimension::Three, DVec3::splat(10.0), boundary);
    system.domain.gravity = DVec3::new(0.0, 0.0, -9.81);
    let grain = class(&mut system, 0.5, 2.0);
    add(&mut system, grain, DVec3::new(5.0, 5.0, 0.5 + height), DVec3::ZERO);
    set_restitution(&mut system, e);
    system.measure.wall_forces = true;
    system
}

#[test]
fn a_floor_carries_the_weight_of_a_grain_that_bounces_and_comes_to_rest() {
    let mut system = grain_over_a_floor(0.5, 0.3);
    // Another grain slides along the floor all the time.
    add(&mut system, 0, DVec3::new(5.0, 8.0, 0.5), DVec3::X);
    let mut simulation = start(&system);
    simulation.sample();
    for k in 1..=20 {
        let before = simulation.frame().velocity[0];
        simulation.advance(until(0.1 * f64::from(k)), &mut Silent).unwrap();
        let after = simulation.frame().velocity[0];
        let expected = 2.0 * (2.0 * system.domain.gravity - (after - before) / 0.1);
        let found = force_on_floor(&mut simulation);
        assert!((found - expected).length() < 1e-9, "{k}: {found} and {expected}");
        if k > 15 {
            assert!((found.z + 4.0 * 9.81).abs() < 1e-12, "{found}");
        }
    }
}

#[test]
fn an_oscillating_floor_carries_the_weight_of_a_grain_on_average() {
    let mut system = grain_over_a_floor(0.5, 0.0);
    let oscillation = Oscillation { waveform: Waveform::Sine, amplitude: 0.02, frequency: 1.0 };
    let floor = system.walls.iter().position(|wall| wall.name == "z-").unwrap();
    system.walls[floor].motion = WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.0 });
    let mut simulation = start(&system);
    simulation.advance(until(30.0), &mut Silent).unwrap();
    simulation.sample();
    simulation.advance(until(30.25), &mut Silent).unwrap();
    // From the middle to the top the wall stops the grain.
    let speed = 0.02 * std::f64::consts::TAU;
    let quarter = force_on_floor(&mut simulation).z;
    assert!((quarter + 2.0 * (9.81 - speed / 0.25)).abs() < 1e-9, "{quarter}");
    simulation.advance(until(40.25), &mut Silent).unwrap();
    let whole = force_on_floor(&mut simulation).z;
    assert!((whole + 2.0 * 9.81).abs() < 1e-10, "{whole}");
}

#[test]
#[ignore = "long: scripts/test all"]
fn a_nearly_collisionless_gas_carries_the_heat_of_theory_from_wall_to_wall() {
    // Free-molecular flow: T = √(T₁T₂), heat flux 2n√(2T₁T₂/(πm)) (√T₁ − √T₂).
    let (hot, cold, edge) = (4.0, 1.0, 10.0);
    let boundary = [Boundary::Wall, Boundary::Periodic, Boundary::Periodic];
    let mut system = system(Dimension::Three, DVec3::splat(edge), boundary);
    let grain = class(&mut system, 1e-6, 1.0);
    let mut random = Random(11);
    for _ in 0..400 {
        let place =
            DVec3::new(random.uniform(0.1, 9.9), random.uniform(0.0, 10.0), random.uniform(0.0, 10.0));
        let spread = f64::sqrt(2.0);
        add(
            &mut system,
            grain,
            place,
            spread * DVec3::new(random.normal(), random.normal(), random.normal()),
        );
    }
    for (law, temperature) in system.contacts.wall.iter_mut().zip([hot, cold]) {
        let restitution = Restitution::Constant(1.0);
        *law = WallLaw::Thermal(ThermalWall { temperature, accommodation: 1.0, restitution });
    }
    system.measure.wall_forces = true;
    let mut simulation = start(&system);
    simulation.advance(until(200.0), &mut Silent).unwrap();
    simulation.sample();
    let mut rows = Vec::new();
    for k in 1..=100 {
        simulation.advance(until(200.0 + 20.0 * f64::from(k)), &mut Silent).unwrap();
        let sample = simulation.sample();
        rows.push((sample.wall_heat_flow[0] - sample.wall_heat_flow[1]) / 2.0);
        let (left, right) = (sample.wall_force[0], sample.wall_force[1]);
        assert!(left.x < 0.0 && right.x > 0.0, "{left} and {right}");
    }
    let mean = rows.iter().sum::<f64>() / 100.0;
    let error = (rows.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 99.0 / 100.0).sqrt();
    let density = 400.0 / edge.powi(3);
    let flux = 2.0 * density * (2.0 * hot * cold / std::f64::consts::PI).sqrt() * (hot.sqrt() - cold.sqrt());
    let z = (mean - flux * edge * edge) / error;
    assert!(z.abs() < 4.0, "{mean} ± {error}, theory {}: z = {z}", flux * edge * edge);
}

#[test]
fn measurements_do_not_change_the_trajectory() {
    for e in [1.0, 0.8] {
        let mut system = measured_gas(0.2, e);
        let mut measured = start(&system);
        system.measure = Measure::default();
        let mut plain = start(&system);
        for simulation in [&mut measured, &mut plain] {
            simulation.advance(until(3.0), &mut Silent).unwrap();
        }
        assert_eq!(measured.state_hash(), plain.state_hash());
        assert_eq!(measured.counters().collisions, plain.counters().collisions);
    }
}

#[test]
fn a_resumed_run_measures_the_same_bits() {
    let system = measured_gas(0.3, 0.9);
    let mut whole = start(&system);
    let mut log = Log::default();
    whole.sample();
    whole.advance(until(1.7), &mut log).unwrap();
    for time in [0.0, 0.31, 0.75, 1.0] {
        let mut simulation = start(&system);
        let mut parts = Log::default();
        simulation.sample();
        simulation.advance(until(time), &mut parts).unwrap();
        let mut simulation =
            Simulation::restore(system.clone(), Options::default(), &simulation.checkpoint()).unwrap();
        simulation.advance(until(1.7), &mut parts).unwrap();
        assert_eq!(parts.1, log.1, "rows of profiles, resumed at {time}");
        assert_eq!(simulation.checkpoint().measured, whole.checkpoint().measured, "resumed at {time}");
    }
}

#[test]
fn a_checkpoint_with_other_measured_data_is_refused() {
    let system = measured_gas(0.3, 0.9);
    let mut simulation = start(&system);
    simulation.advance(until(0.4), &mut Silent).unwrap();
    let good = simulation.checkpoint();
    let mut plain = system.clone();
    plain.measure = Measure::default();
    let refused = |system: &System, measured: Vec<u64>| {
        let checkpoint = haff_engine::Checkpoint { measured, ..good.clone() };
        let restored = Simulation::restore(system.clone(), Options::default(), &checkpoint);
        matches!(restored, Err(EngineError::Checkpoint(text)) if text.starts_with("measured: "))
    };
    assert!(!refused(&system, good.measured.clone()));
    assert!(refused(&plain, good.measured.clone()), "measurements that the scene does not have");
    assert!(refused(&system, Vec::new()), "no measurements");
    assert!(refused(&system, good.measured[..good.measured.len() - 1].to_vec()), "too few");
    assert!(refused(&system, [&good.measured[..], &[0]].concat()), "too many");
    let mut other = good.measured.clone();
    let taken = other.iter().position(|&word| word == 3).expect("three states of profiles until 0.4");
    other[taken] = 300;
    assert!(refused(&system, other), "states that do not fit to the time");
}
