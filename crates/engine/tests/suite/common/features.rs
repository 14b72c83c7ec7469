//! A small system for each feature that a search may or may not support.

use glam::DVec3;
use haff_engine::{
    Boundary, Compression, Cuboid, Dimension, Drag, Drive, DriveKind, Flow, Inlet, KickTimes, NeighborChoice,
    Options, Oscillating, Outlet, Partition, Piston, Rotation, Shape, Shear, Spin, Supply, System,
    ThermalWall, Wall, WallLaw, WallMotion, searches,
};
use haff_mechanics::{NamedSurface, Oscillation, Restitution, Roughness, Waveform};
use haff_surfaces::{Revolution, Side, Sphere};

use super::{Random, add, class, scatter, set_restitution, system};

/// A gas of spheres in a closed box.
fn box_of(boundary: [Boundary; 3], radii: &[f64], e: f64) -> System {
    let mut random = Random(3);
    let mut scene = system(Dimension::Three, DVec3::splat(12.0), boundary);
    for &radius in radii {
        let kind = class(&mut scene, radius, (2.0 * radius).powi(3));
        scatter(&mut scene, kind, 120 / radii.len(), 1.0, &mut random);
    }
    set_restitution(&mut scene, e);
    scene
}

/// Adds a thin cylinder in a corner of the box, where there are no particles.
fn pin(scene: &mut System, motion: WallMotion) {
    let surface = Revolution::cylinder(DVec3::splat(0.1), DVec3::Z, 0.06, Side::Outside);
    let numbers = format!("{surface:?}");
    let shape = Some(Shape::Named(NamedSurface::of("pin", &numbers, Box::new(surface))));
    scene.walls.push(Wall { name: "pin".into(), point: DVec3::ZERO, normal: DVec3::ZERO, motion, shape });
    scene.contacts.wall.push(Restitution::Constant(0.9).into());
}

/// Adds a place where particles are taken out; all of the scene are there at the start, if none is said.
pub fn outlet(scene: &mut System, [low, high]: [[f64; 3]; 2]) {
    let present = scene.bodies.len();
    let flow = scene.flow.get_or_insert_with(|| Box::new(Flow { present, ..Flow::default() }));
    let place = Cuboid { low: low.into(), high: high.into() };
    flow.outlets.push(Outlet { place, interval: None });
}

/// Adds a wall with the laws of the particles among each other.
pub fn add_wall(scene: &mut System, wall: Wall) {
    fn added<T: Clone>(laws: &[T], groups: usize, of_group: impl Fn(usize) -> T) -> Vec<T> {
        let walls = laws.len() / groups;
        let row = |group: usize| laws[group * walls..(group + 1) * walls].iter().cloned();
        (0..groups).flat_map(|group| row(group).chain([of_group(group)])).collect()
    }
    let (groups, pair) = (scene.groups.len(), scene.contacts.pair.clone());
    scene.contacts.wall = added(&scene.contacts.wall, groups, |group| pair[group * groups + group].into());
    if let Some(spin) = &mut scene.spin {
        spin.wall = added(&spin.wall, groups, |group| spin.pair[group * groups + group]);
    }
    scene.walls.push(wall);
}

/// Adds a plane of finite mass at a height, with a load; particles are below it, or on both of its sides.
pub fn lid(scene: &mut System, height: f64, [mass, force]: [f64; 2], both: bool) {
    let (point, normal) = (DVec3::Z * height, -DVec3::Z);
    let shape = both.then_some(Shape::Partition(Partition { point, normal, hole: None }));
    let motion = WallMotion::Piston(Piston::new(mass, force, 0.0, (normal, scene.domain.gravity)));
    add_wall(scene, Wall { name: "lid".into(), point, normal, motion, shape });
}

/// A scene in which particles are taken out in one part, and come in again in another.
fn circuit(mut scene: System) -> System {
    outlet(&mut scene, [[0.0, 0.0, 0.0], [12.0, 12.0, 1.5]]);
    if let Some(flow) = &mut scene.flow {
        flow.inlets.push(Inlet {
            place: Cuboid { low: DVec3::new(1.0, 1.0, 9.0), high: DVec3::splat(11.0) },
            velocity: DVec3::new(0.0, 0.0, -0.5),
            temperature: 0.5,
            supply: Supply::Refill { species: vec![0], count: u64::MAX },
        });
    }
    scene
}

const PERIODIC: [Boundary; 3] = [Boundary::Periodic; 3];
const WALLS: [Boundary; 3] = [Boundary::Wall; 3];
const FLOOR: [Boundary; 3] = [Boundary::Periodic, Boundary::Periodic, Boundary::Wall];

/// Spheres above a floor, in gravity.
fn falling(radii: &[f64], e: f64) -> System {
    let mut scene = box_of(FLOOR, radii, e);
    scene.domain.gravity = DVec3::new(0.0, 0.0, -0.2);
    scene
}

fn with(mut scene: System, change: impl FnOnce(&mut System)) -> System {
    change(&mut scene);
    scene
}

/// Name of the feature, and a system that has it.
pub fn features() -> Vec<(&'static str, System)> {
    let plain = || box_of(PERIODIC, &[0.5], 0.9);
    let rough = Roughness { tangential_restitution: 0.5, friction: 0.3 };
    let floor_motion = WallMotion::Oscillating(Oscillating {
        oscillation: Oscillation { waveform: Waveform::Sine, amplitude: 0.1, frequency: 0.7 },
        cycles: 0.0,
    });
    let vibrated = |e: f64| {
        with(box_of(FLOOR, &[0.5], e), |scene| {
            scene.walls[0].motion = floor_motion;
        })
    };
    let disks = {
        let mut scene = system(Dimension::Two, DVec3::splat(16.0), PERIODIC);
        let kind = class(&mut scene, 0.5, 1.0);
        scatter(&mut scene, kind, 80, 1.0, &mut Random(5));
        scene
    };
    let many_walls = with(box_of(WALLS, &[0.5], 0.9), |scene| {
        for k in 0..14 {
            // Planes that cut off corners.
            let normal = DVec3::new(1.0, 0.02 * f64::from(k), 0.3).normalize();
            scene.walls.push(Wall {
                name: format!("oblique {k}"),
                point: normal * 1e-3,
                normal,
                motion: WallMotion::Fixed,
                shape: None,
            });
            scene.contacts.wall.push(Restitution::Constant(0.9).into());
        }
    });
    let fixed = |scene: System| {
        with(scene, |scene| {
            let kind = class(scene, 0.7, f64::INFINITY);
            scatter(scene, kind, 3, 0.0, &mut Random(8));
        })
    };
    let lone = |edge: f64| {
        with(system(Dimension::Three, DVec3::new(edge, 12.0, 12.0), PERIODIC), |scene| {
            let kind = class(scene, 0.5, 1.0);
            scatter(scene, kind, 40, 1.0, &mut Random(4));
        })
    };
    let drive = |kind: DriveKind| {
        with(plain(), |scene| scene.drives = vec![Drive { kind, species: vec![0], rotational: false }])
    };
    vec![
        ("spheres of one size", box_of(PERIODIC, &[0.5], 1.0)),
        ("restitution below 1", plain()),
        ("disks", disks),
        ("radii that differ by up to 2 times", box_of(PERIODIC, &[0.35, 0.6], 0.9)),
        ("radii that differ by more", box_of(PERIODIC, &[0.25, 1.0], 0.9)),
        (
            "one particle larger than all others, walls",
            with(box_of(WALLS, &[0.5], 1.0), |scene| {
                let kind = class(scene, 0.95, 6.0);
                scatter(scene, kind, 1, 30.0, &mut Random(8));
            }),
        ),
        ("walls", box_of(WALLS, &[0.5], 0.9)),
        ("more than 16 walls", many_walls),
        ("walls of other shapes", with(box_of(WALLS, &[0.5], 0.9), |scene| pin(scene, WallMotion::Fixed))),
        (
            "walls of other shapes that turn, rough contacts",
            with(box_of(WALLS, &[0.5], 0.9), |scene| {
                let angular_velocity = DVec3::Z * 2.0;
                pin(scene, WallMotion::Rotating(Rotation { point: DVec3::splat(0.1), angular_velocity }));
                let law = Roughness { tangential_restitution: 0.5, friction: 0.5 };
                scene.spin = Some(Spin {
                    inertia: vec![0.4],
                    angular_velocity: vec![DVec3::ZERO; scene.bodies.len()],
                    pair: vec![law],
                    wall: vec![law; scene.walls.len()],
                });
            }),
        ),
        (
            "particles that pass through a wall",
            with(box_of(WALLS, &[0.5], 0.9), |scene| {
                pin(scene, WallMotion::Fixed);
                if let Some(law) = scene.contacts.wall.last_mut() {
                    *law = WallLaw::Passes;
                }
            }),
        ),
        (
            "thermal wall",
            with(box_of(WALLS, &[0.5], 0.9), |scene| {
                let thermal = ThermalWall {
                    temperature: 1.0,
                    accommodation: 0.7,
                    restitution: Restitution::Constant(0.9),
                };
                scene.contacts.wall[0] = WallLaw::Thermal(thermal);
            }),
        ),
        ("bodies of infinite mass", fixed(plain())),
        ("gravity, elastic", falling(&[0.5], 1.0)),
        ("gravity, radii that differ by more than 2 times", falling(&[0.25, 1.0], 1.0)),
        (
            "gravity, grains that come to rest on walls",
            with(falling(&[0.5], 0.3), |scene| {
                scene.domain.gravity.z = -5.0;
                // So few that none piles up on others.
                scene.bodies.truncate(12);
            }),
        ),
        ("gravity and bodies of infinite mass", fixed(falling(&[0.5], 1.0))),
        ("wall that oscillates, elastic", vibrated(1.0)),
        ("wall that oscillates, restitution below 1", vibrated(0.8)),
        (
            "contact.rest_speed",
            with(falling(&[0.5], 0.5), |scene| {
                scene.contacts.rest_speed = 0.05;
            }),
        ),
        ("piston", with(box_of(FLOOR, &[0.5], 0.9), |scene| lid(scene, 12.0, [30.0, 5.0], false))),
        ("inlets and outlets", circuit(box_of(FLOOR, &[0.5], 0.9))),
        (
            "inlets and outlets, contact.rest_speed",
            circuit(with(falling(&[0.5, 0.3], 0.5), |scene| scene.contacts.rest_speed = 0.05)),
        ),
        (
            "container with open axes",
            with(system(Dimension::Three, DVec3::splat(13.0), [Boundary::Open; 3]), |scene| {
                let surface = Sphere { center: DVec3::splat(6.5), radius: 6.5, side: Side::Inside };
                let numbers = format!("{surface:?}");
                let shape = Some(Shape::Named(NamedSurface::of("flask", &numbers, Box::new(surface))));
                let (point, normal, motion) = (DVec3::ZERO, DVec3::ZERO, WallMotion::Fixed);
                add_wall(scene, Wall { name: "flask".into(), point, normal, motion, shape });
                let kind = class(scene, 0.5, 1.0);
                scatter(scene, kind, 100, 1.0, &mut Random(6));
                set_restitution(scene, 0.9);
            }),
        ),
        ("open axis", box_of([Boundary::Open, Boundary::Periodic, Boundary::Wall], &[0.5], 0.9)),
        ("edge of two diameters", lone(2.0)),
        ("edge of 10⁹ diameters", with(lone(12.0), |scene| scene.domain.size.x = 1e9)),
        (
            "shear",
            with(plain(), |scene| {
                scene.domain.shear = Some(Shear { flow: 0, gradient: 1, rate: 0.1, offset: 0.0 });
            }),
        ),
        (
            "compression",
            with(plain(), |scene| {
                scene.domain.compression = Some(Compression { rates: DVec3::splat(0.01), inside: 1.0 });
            }),
        ),
        (
            "elongation",
            with(plain(), |scene| {
                scene.domain.compression =
                    Some(Compression { rates: DVec3::new(-0.02, 0.01, 0.01), inside: 1.0 });
            }),
        ),
        (
            "rough contacts",
            with(plain(), |scene| {
                scene.spin = Some(Spin {
                    inertia: vec![0.4],
                    angular_velocity: vec![DVec3::Z; scene.bodies.len()],
                    pair: vec![rough],
                    wall: Vec::new(),
                });
            }),
        ),
        ("contact.tc", with(plain(), |scene| scene.contacts.tc = 0.01)),
        ("drive at regular times", drive(DriveKind::Rescale { temperature: 1.0, interval: 0.3 })),
        (
            "drive at random times",
            drive(DriveKind::WhiteNoise { strength: 0.1, kicks: KickTimes::Poisson { rate: 1.0 } }),
        ),
        ("drag", with(plain(), |scene| scene.drag = Some(Drag { time: 5.0, rotational: false }))),
        ("measure.stress", with(plain(), |scene| scene.measure.stress = true)),
        ("measure.wall_forces", with(box_of(WALLS, &[0.5], 0.9), |scene| scene.measure.wall_forces = true)),
        (
            "one particle",
            with(system(Dimension::Three, DVec3::splat(9.0), WALLS), |scene| {
                let kind = class(scene, 0.5, 1.0);
                add(scene, kind, DVec3::splat(3.0), DVec3::new(1.0, 0.3, 0.2));
            }),
        ),
        (
            "walls of the box far beyond its faces",
            with(box_of(WALLS, &[0.5], 0.9), |scene| {
                scene.walls[0].point.x = -9.0;
            }),
        ),
    ]
}

/// The table of docs/searches.md.
pub fn table() -> String {
    let mut notes: Vec<String> = Vec::new();
    let mut note = |why: String| {
        let at = notes.iter().position(|other| *other == why).unwrap_or_else(|| {
            notes.push(why);
            notes.len() - 1
        });
        at + 1
    };
    let mut rows = Vec::new();
    for (feature, system) in features() {
        let cells = searches(&system, Options::default()).unwrap().into_iter().map(|search| {
            match (search.refuses, search.serial) {
                (Some(why), _) => format!("no <sup>{}</sup>", note(without_numbers(&why))),
                (None, Some(why)) => format!("one thread <sup>{}</sup>", note(why)),
                (None, None) => "threads".to_owned(),
            }
        });
        rows.push(format!("| {feature} | {} |", cells.collect::<Vec<_>>().join(" | ")));
    }
    let names = searches(&features()[0].1, Options::default()).unwrap();
    let names: Vec<&str> = names.iter().map(|search| search.name).collect();
    let head = format!("| feature | {} |\n|---|{}", names.join(" | "), "---|".repeat(names.len()));
    let notes: Vec<String> = notes.iter().enumerate().map(|(k, why)| format!("{}. {why}", k + 1)).collect();
    format!("{head}\n{}\n\n{}\n", rows.join("\n"), notes.join("\n"))
}

/// A reason for any system: numbers of this one are left out.
fn without_numbers(why: &str) -> String {
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    let words = why.split(' ').zip(why.split(' ').skip(1).chain([""])).map(|(word, next)| {
        let bare = word.trim_end_matches(',');
        let is_limit = ["times", "walls", "bits", "of"].contains(&next);
        if is_number(bare) && !is_limit { word.replacen(bare, "…", 1) } else { word.to_owned() }
    });
    words.collect::<Vec<_>>().join(" ")
}

/// What `engine.neighbors` can ask for.
pub const SEARCHES: [NeighborChoice; 4] =
    [NeighborChoice::AllPairs, NeighborChoice::Cells, NeighborChoice::Lists, NeighborChoice::Windows];
