//! A synthetic run whose numbers are functions of their rows, so that all data read back can be checked.
#![allow(dead_code, missing_docs, reason = "each test file uses a part of it")]

use glam::DVec3;
use haff_engine::{
    Boundary, CellFields, Checkpoint, Column, Correlation, Correlations, EventColumn, EventKind, EventRecord,
    Followed, Frame, Grid, GridAxis, Ledger, Measure, ProfileRow, Sample, SceneFeatures, StressTensor, Term,
};
use haff_record::Header;

/// A number in [0, 1) with a full mantissa.
pub fn number(a: u64, b: u64) -> f64 {
    // SplitMix64.
    let mut z = (a << 32 ^ b).wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

pub fn vector(a: u64, b: u64) -> DVec3 {
    DVec3::new(number(a, 3 * b), number(a, 3 * b + 1), number(a, 3 * b + 2))
}

fn axis(axis: usize, bins: usize) -> GridAxis {
    GridAxis { axis, low: 0.0, high: bins as f64, bins }
}

/// A row of profile 0 with 5 cells, or of profile 1 with 6 and fields of two species, in d dimensions.
pub fn profile_row(profile: usize, k: u64, d: u64) -> ProfileRow {
    let cells = 5 + profile as u64;
    let fields = |salt: u64| {
        let all = |more: u64| (0..cells).map(|cell| number(k * 8 + salt + more, cell)).collect::<Vec<_>>();
        CellFields {
            density: all(1),
            mass_density: all(2),
            velocity: (0..cells).map(|cell| vector(k * 8 + salt + 3, cell)).collect(),
            temperature: all(4),
            pressure: (0..d * d * cells).map(|value| number(k * 8 + salt + 5, value)).collect(),
        }
    };
    let species = if profile == 0 { Vec::new() } else { vec![fields(1000), fields(2000)] };
    ProfileRow { profile, time: (k + 1) as f64 / 5.0, step: k * 10, all: fields(0), species }
}

/// A correlation with one more lag for each `k`.
pub fn correlation(k: u64) -> Correlation {
    let all = |salt: u64| (0..k).map(|lag| number(salt, lag)).collect::<Vec<_>>();
    let of_curves = |salt: u64| (0..2 * k).map(|value| number(salt, value)).collect::<Vec<_>>();
    Correlation {
        name: "msd",
        species: vec![0, 1],
        lag: all(1),
        value: of_curves(2),
        error: of_curves(3),
        count: (0..k).collect(),
    }
}

pub fn header(particles: usize) -> Header {
    Header {
        earlier: String::new(),
        title: "made up".to_owned(),
        scene_toml: "schema = 1\n# ζ\n".to_owned(),
        seed: u64::MAX - 6,
        version: "0.1.0".to_owned(),
        git_revision: "abc".to_owned(),
        schema: haff_record::SCHEMA,
        trajectory_version: 3,
        dimension: 3,
        box_size: DVec3::new(1.0, 2.0, 3.0),
        box_origin: DVec3::ZERO,
        boundary: [Boundary::Periodic, Boundary::Wall, Boundary::Open],
        conserved_momentum: [false; 3],
        species: (0..particles as u32).map(|i| i % 2).collect(),
        species_names: vec!["grain".to_owned(), "Kügelchen".to_owned()],
        mass: (0..particles).map(|i| if i == 0 { f64::INFINITY } else { i as f64 }).collect(),
        radius: (0..particles).map(|i| 0.5 + i as f64).collect(),
        inertia: vec![0.4; particles],
        wall_names: vec!["y-".to_owned(), "y+".to_owned()],
        pistons: vec![1],
        frames: true,
        observables: true,
        events: EventColumn::ALL.to_vec(),
        compressed: true,
        used: particles,
        meshes: vec![haff_record::StoredMesh {
            hash: "0123456789abcdef".to_owned(),
            corners: vec![[DVec3::ZERO, DVec3::X, DVec3::Y], [DVec3::X, DVec3::Z, DVec3::splat(0.1)]],
        }],
        present: SceneFeatures {
            springs: false,
            volume: false,
            angular_momentum: false,
            shear: false,
            // The names in the order of the alphabet are in another one.
            columns: vec![Column::vector("swirl", "1/time", 2), Column::number("flux", "1")],
            ..SceneFeatures::all()
        },
        measure: Measure {
            profiles: vec![
                Grid {
                    axes: vec![axis(2, 5)],
                    interval: 1.0,
                    samples: 1,
                    spread: false,
                    species: Vec::new(),
                },
                Grid {
                    axes: vec![axis(0, 3), axis(1, 2)],
                    interval: 1.0,
                    samples: 1,
                    spread: false,
                    species: vec![0, 1],
                },
            ],
            correlations: Correlations { msd: Followed::Species(vec![0, 1]), ..Correlations::default() },
            ..Measure::default()
        },
    }
}

pub fn frame(k: u64, particles: usize) -> Frame {
    let all = |salt: u64| (0..particles as u64).map(|i| vector(k * 8 + salt, i)).collect::<Vec<_>>();
    Frame {
        time: k as f64 * 0.25,
        step: k * 10,
        position: all(1),
        velocity: all(2),
        image: (0..particles as i32).map(|i| [i % 3 - 1, k as i32, -i]).collect(),
        angular_velocity: all(5),
        edges: [DVec3::X, DVec3::Y * 2.0, DVec3::Z * 3.0],
        present: (0..particles as u64).map(|i| (i + k) % 5 != 4).collect(),
        pistons: vec![[vector(k, 33), vector(k, 34)]],
    }
}

pub fn sample(k: u64) -> Sample {
    let x = |salt| number(k * 32 + salt, 7);
    Sample {
        time: k as f64 * 0.125,
        step: k * 5,
        ledger: Ledger {
            kinetic: x(1),
            rotational: x(25),
            pistons: x(33),
            potential: x(2),
            spring: f64::NAN,
            dissipated: x(3),
            carnot: x(4),
            terms: Term::ALL.map(|term| x(if term == Term::WallWork { 5 } else { 21 })),
            residual: x(6),
        },
        temperature: x(7),
        species_temperature: vec![x(8), x(9)],
        rotational_temperature: x(26),
        species_rotational_temperature: vec![x(27), x(28)],
        sonine_a2: x(10),
        pressure: None,
        box_volume: x(19),
        packing_fraction: x(20),
        stress: Some(StressTensor { kinetic: [x(15); 9], collisional: [x(16); 9] }),
        pair_collision_rate: vec![x(37), x(38), x(38), x(39)],
        species_mean_free_time: vec![x(40), x(41)],
        wall_force: vec![vector(k, 23), vector(k, 24)],
        wall_heat_flow: vec![x(17), x(18)],
        piston_position: vec![vector(k, 35)],
        piston_velocity: vec![vector(k, 36)],
        probes: vec![x(29), x(30), x(31)],
        momentum: vector(k, 11),
        external_impulse: vector(k, 12),
        angular_momentum: None,
        collisions: k * 4,
        wall_collisions: k,
        collision_rate: x(13),
        mean_free_time: x(14),
        particles: k + 2,
        particles_in: k + 3,
        particles_out: k + 5,
        discharge_rate: x(32),
    }
}

pub fn event(k: u64) -> EventRecord {
    let x = |salt| number(k * 32 + salt, 9);
    EventRecord {
        time: k as f64 * 1e-3,
        kind: EventKind::ALL[(k % EventKind::ALL.len() as u64) as usize],
        i: (k % 1000) as u32,
        j: (k % 1000 + 1) as u32,
        approach_speed: x(1),
        impulse: x(2),
        energy_loss: x(3),
        carnot_energy: x(4),
        normal: vector(k, 21),
        position: vector(k, 22),
        impulse_vector: vector(k, 29),
        tangential_loss: x(30),
    }
}

pub fn events(from: u64, to: u64) -> Vec<EventRecord> {
    (from..to).map(event).collect()
}

pub fn checkpoint(k: u64, particles: usize) -> Checkpoint {
    let all = |salt: u64| (0..particles as u64).map(|i| vector(k * 8 + salt, i)).collect::<Vec<_>>();
    Checkpoint {
        position: all(3),
        velocity: all(4),
        angular_velocity: all(6),
        anchor: (0..particles as i64).map(|i| i - k as i64).collect(),
        image: (0..particles as i32).map(|i| [i, -1, k as i32]).collect(),
        count: (0..particles as u32).map(|i| i + k as u32).collect(),
        // Lengths that vary from one checkpoint to the next.
        resting: if k.is_multiple_of(2) { Vec::new() } else { (0..particles as u32).collect() },
        scalars: (0..5 + (k * 7) % 40)
            .map(|s| (format!("scalar.{s}"), s ^ k))
            .chain([("clock.time".to_owned(), (k as f64).to_bits()), ("collisions".to_owned(), 4 * k)])
            .collect(),
        measured: (0..(k * 5) % 17).collect(),
    }
}
