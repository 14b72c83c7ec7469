//! Walls of other shapes than planes: the same trajectory by every search, their motions, and what is
//! conserved.

use std::f64::consts::{FRAC_PI_6, TAU};

use glam::DVec3;
use haff_engine::{
    Boundary, Dimension, EventKind, Group, NeighborChoice, Options, Oscillating, Rotation, Shape, Silent,
    Simulation, Spin, System, Term, Until, Wall, WallLaw, WallMotion, allowed_overlap, conserved_momentum,
};
use haff_mechanics::{NamedSurface, Oscillation, Restitution, Roughness, Surface, Waveform};
use haff_surfaces::{Mesh, Rectangle, Revolution, Side, Sphere};
use haff_testing::Random;

use crate::common::{Log, add, check_independence, class, scatter, set_restitution, system};

/// Number of contacts with walls of long tests: `HAFF_BOUNCES`, or a default.
fn contacts(default: u64) -> u64 {
    std::env::var("HAFF_BOUNCES").ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

const CENTER: DVec3 = DVec3::new(6.0, 6.0, 6.0);

/// A wall of this shape.
fn wall<S: Surface + 'static>(name: &str, surface: S) -> Wall {
    let numbers = format!("{surface:?}");
    let shape = Some(Shape::Named(NamedSurface::of(name, &numbers, Box::new(surface))));
    Wall { name: name.into(), point: DVec3::ZERO, normal: DVec3::ZERO, motion: WallMotion::Fixed, shape }
}

/// The triangles of a box.
fn cuboid(low: DVec3, size: DVec3) -> Vec<[DVec3; 3]> {
    let mut triangles = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0.0, 1.0] {
            let corner = |a: f64, b: f64| {
                let mut x = [0.0; 3];
                (x[axis], x[u], x[v]) = (side, a, b);
                low + size * DVec3::from_array(x)
            };
            let square = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            triangles.push([square[0], square[1], square[2]]);
            triangles.push([square[0], square[2], square[3]]);
        }
    }
    triangles
}

/// Grains of two sizes beside walls, in a box with walls around it, or open.
fn grains(dimension: Dimension, walls: Vec<Wall>, count: usize, boundary: Boundary) -> System {
    let mut random = Random(17);
    let mut axes = [boundary; 3];
    if dimension == Dimension::Two {
        axes[2] = Boundary::Periodic;
    }
    let mut scene = system(dimension, DVec3::splat(12.0), axes);
    scene.walls.extend(walls);
    scene.contacts.wall = vec![Restitution::Constant(1.0).into(); scene.walls.len()];
    for (radius, mass) in [(0.3, 1.0), (0.2, 0.3)] {
        let grain = class(&mut scene, radius, mass);
        scatter(&mut scene, grain, count / 2, 1.0, &mut random);
    }
    scene
}

fn shapes() -> Vec<(&'static str, Vec<Wall>)> {
    let axis = DVec3::new(0.1, 0.2, 1.0);
    let triangles = cuboid(DVec3::splat(1.5), DVec3::new(9.0, 8.0, 9.5));
    let obstacle = cuboid(DVec3::splat(4.5), DVec3::splat(3.0));
    let tilted = DVec3::new(0.0, 0.6, 0.8);
    let along = [DVec3::X, tilted.cross(DVec3::X)];
    vec![
        ("cylinder", vec![wall("cylinder", Revolution::cylinder(CENTER, axis, 5.0, Side::Inside))]),
        (
            "drum",
            vec![wall(
                "drum",
                Revolution::finite_cylinder(CENTER - DVec3::Y * 5.0, DVec3::Y, 5.0, 10.0, Side::Inside),
            )],
        ),
        ("sphere", vec![wall("sphere", Sphere { center: CENTER, radius: 5.5, side: Side::Inside })]),
        (
            "cone",
            vec![wall(
                "cone",
                Revolution::cone(
                    DVec3::new(6.0, 6.0, 0.0),
                    DVec3::Z,
                    0.5,
                    [0.0, f64::INFINITY],
                    Side::Inside,
                ),
            )],
        ),
        (
            "obstacles",
            vec![
                wall("ball", Sphere { center: CENTER, radius: 1.5, side: Side::Outside }),
                wall(
                    "pin",
                    Revolution::finite_cylinder(DVec3::new(2.0, 9.0, 3.0), axis, 0.3, 4.0, Side::Outside),
                ),
                wall(
                    "spike",
                    Revolution::cone(DVec3::new(9.0, 3.0, 8.0), -DVec3::Z, 0.4, [0.0, 5.0], Side::Outside),
                ),
            ],
        ),
        (
            "tube and funnel",
            vec![
                wall(
                    "tube",
                    Revolution::finite_cylinder(DVec3::new(6.0, 6.0, 1.5), DVec3::Z, 1.5, 3.0, Side::Both),
                ),
                wall(
                    "funnel",
                    Revolution::cone(DVec3::new(6.0, 6.0, 3.0), DVec3::Z, FRAC_PI_6, [2.6, 7.0], Side::Both),
                ),
            ],
        ),
        (
            "rectangle",
            vec![wall("plate", Rectangle { center: CENTER, normal: tilted, along, half: [2.0, 3.0] })],
        ),
        ("box of triangles", vec![wall("mesh", Mesh::new(&triangles, Side::Inside).unwrap())]),
        ("block of triangles", vec![wall("block", Mesh::new(&obstacle, Side::Outside).unwrap())]),
    ]
}

#[test]
#[ignore = "long: scripts/test all"]
fn a_gas_beside_shapes_is_independent_of_search_threads_slices_and_resumption() {
    for (name, walls) in shapes() {
        for (e, gravity) in [(1.0, DVec3::ZERO), (0.9, DVec3::ZERO), (0.95, DVec3::new(0.1, -0.2, -0.5))] {
            let mut scene = grains(Dimension::Three, walls.clone(), 120, Boundary::Wall);
            set_restitution(&mut scene, e);
            scene.domain.gravity = gravity;
            let mut reference = check_independence(&scene, &[0.1, 1.0, 1.3, 2.0]);
            assert!(reference.counters().wall_collisions > 20, "{name}: {:?}", reference.counters());
            reference.measure_overlap().unwrap();
        }
    }
}

#[test]
fn containers_in_open_space_keep_all_grains() {
    for (name, walls) in
        shapes().into_iter().filter(|(name, _)| !name.contains("obstacle") && *name != "cone")
    {
        if ["tube and funnel", "rectangle", "block of triangles", "cylinder"].contains(&name) {
            continue;
        }
        let scene = grains(Dimension::Three, walls.clone(), 60, Boundary::Open);
        let reference = check_independence(&scene, &[1.0, 8.0]);
        assert!(reference.counters().wall_collisions > 20, "{name}: {:?}", reference.counters());
        let frame = reference.frame();
        for (i, position) in frame.position.iter().enumerate() {
            let radius = if i < 30 { 0.3 } else { 0.2 };
            let distance = walls[0].distance(*position, haff_engine::Instant::ZERO);
            assert!(distance > radius * (1.0 - 1e-12), "{name}: particle {i} is {distance} from the wall");
        }
    }
}

/// A pipe without end repeats with the box along its axis, and smooth contacts keep the momentum along it.
#[test]
fn a_pipe_along_a_periodic_axis_keeps_the_momentum_along_it() {
    let pipe = wall("pipe", Revolution::cylinder(CENTER, DVec3::Z, 5.0, Side::Inside));
    let mut scene = grains(Dimension::Three, vec![pipe], 120, Boundary::Wall);
    scene.domain.boundary[2] = Boundary::Periodic;
    // Without the walls across the axis of the pipe.
    scene.walls.drain(4..6);
    scene.contacts.wall.truncate(scene.walls.len());
    set_restitution(&mut scene, 0.9);
    assert_eq!(conserved_momentum(&scene), [false, false, true]);
    let momentum = |frame: &haff_engine::Frame| -> f64 {
        let classes = scene.bodies.iter().map(|body| scene.classes[body.class as usize].mass);
        classes.zip(&frame.velocity).map(|(mass, velocity)| mass * velocity.z).sum()
    };
    let start = momentum(&Simulation::new(scene.clone(), Options::default()).unwrap().frame());
    let mut end = check_independence(&scene, &[0.5, 12.0]);
    let collisions = end.counters().collisions;
    assert!(collisions > 100 && end.counters().wall_collisions > 100, "{:?}", end.counters());
    let off = (momentum(&end.frame()) - start).abs();
    assert!(off < 4.0 * (collisions as f64).sqrt() * f64::EPSILON * 4.0, "{off:e}");
    assert!(end.frame().image.iter().any(|image| image[2] != 0), "none has left the box along the pipe");
    end.measure_overlap().unwrap();
}

#[test]
fn circles_and_lines_in_two_dimensions() {
    let center = DVec3::new(6.0, 6.0, 0.0);
    let tilted = DVec3::new(0.6, 0.8, 0.0);
    let line = |center: DVec3| Rectangle {
        center,
        normal: tilted,
        along: [DVec3::new(-0.8, 0.6, 0.0), DVec3::Z],
        half: [1.5, f64::INFINITY],
    };
    let scenes = [
        vec![wall("circle", Revolution::cylinder(center, DVec3::Z, 5.5, Side::Inside))],
        vec![wall("circle", Sphere { center, radius: 5.5, side: Side::Inside })],
        vec![
            wall("line", line(center)),
            wall(
                "wedge",
                Revolution::cone(DVec3::new(2.0, 2.0, 0.0), DVec3::X, 0.4, [0.0, 3.0], Side::Outside),
            ),
        ],
    ];
    for (k, walls) in scenes.into_iter().enumerate() {
        for gravity in [DVec3::ZERO, DVec3::NEG_Y] {
            let mut scene = grains(Dimension::Two, walls.clone(), 60, Boundary::Wall);
            scene.domain.gravity = gravity;
            let mut reference = check_independence(&scene, &[0.5, 3.0]);
            assert!(reference.counters().wall_collisions > 20, "{k}: {:?}", reference.counters());
            assert!(reference.frame().position.iter().all(|x| x.z == 0.0), "{k}");
            reference.measure_overlap().unwrap();
        }
    }
}

/// A shape that moves with the grains inside is the same scene as one at rest, seen from a moving frame.
#[test]
fn a_box_with_a_constant_velocity_is_at_rest_in_its_own_frame() {
    let drift = DVec3::new(0.25, -0.125, 0.5);
    let drum = Revolution::finite_cylinder(CENTER - DVec3::Y * 5.0, DVec3::Y, 5.0, 10.0, Side::Inside);
    let mut scene = grains(Dimension::Three, vec![wall("drum", drum)], 40, Boundary::Open);
    let at_rest = check_independence(&scene, &[4.0]).frame();
    scene.walls[0].motion = drift.into();
    scene.bodies.iter_mut().for_each(|body| body.velocity += drift);
    let moving = check_independence(&scene, &[4.0]);
    let frame = moving.frame();
    for (a, b) in at_rest.position.iter().zip(&frame.position) {
        assert!((*a + drift * 4.0 - *b).length() < 1e-9, "{a} {b}");
    }
    assert!(moving.ledger().term(Term::WallWork).abs() > 1e-3);
}

#[test]
fn shapes_that_oscillate_do_work_and_leave_no_overlap() {
    for waveform in [Waveform::Sine, Waveform::Triangle] {
        let oscillation = Oscillation { waveform, amplitude: 0.3, frequency: 0.7 };
        let motion = WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.2 });
        for (name, mut walls) in shapes().into_iter().filter(|(name, _)| *name != "obstacles") {
            walls.truncate(1);
            walls[0].normal = DVec3::new(0.6, 0.0, 0.8);
            walls[0].motion = motion;
            let mut scene = grains(Dimension::Three, walls, 50, Boundary::Wall);
            set_restitution(&mut scene, 0.9);
            scene.domain.gravity = DVec3::new(0.0, 0.0, -0.3);
            let mut reference = check_independence(&scene, &[0.4, 3.0]);
            reference.measure_overlap().unwrap();
            let work = reference.ledger().term(Term::WallWork);
            assert!(work.abs() > 1e-3, "{name}: {work}");
        }
    }
}

/// A rough grain in a drum that turns: the work of the wall is the torque on it times its rate, and the
/// torque changes the angular momentum of the grain.
#[test]
fn the_work_of_a_drum_is_its_torque_times_its_rate() {
    let rate = 0.8;
    let point = DVec3::new(6.0, 6.0, 0.0);
    let mut drum = wall("drum", Revolution::cylinder(point, DVec3::Z, 5.0, Side::Inside));
    drum.motion = WallMotion::Rotating(Rotation { point, angular_velocity: DVec3::Z * rate });
    let mut scene = grains(Dimension::Three, vec![drum], 60, Boundary::Wall);
    set_restitution(&mut scene, 0.9);
    let count = scene.bodies.len();
    let law = Roughness { tangential_restitution: 0.5, friction: 0.6 };
    scene.spin = Some(Spin {
        inertia: vec![0.4],
        angular_velocity: vec![DVec3::ZERO; count],
        pair: vec![law],
        wall: vec![Roughness { tangential_restitution: -1.0, friction: f64::INFINITY }; 6]
            .into_iter()
            .chain([law])
            .collect(),
    });
    let mut simulation = check_independence(&scene, &[0.5, 4.0]);
    let mut log = Log::default();
    let before = simulation.ledger().term(Term::WallWork);
    simulation.advance(Until { time: 12.0, ..Until::default() }, &mut log).unwrap();
    let wall_of_drum = 6;
    let mut torque = 0.0;
    let mut hits = 0;
    for row in log.0.iter().filter(|row| row.kind == EventKind::Wall && row.j == wall_of_drum) {
        // The impulse of the particle on the wall, at the point of contact.
        let at = row.position - point;
        torque += at.cross(row.impulse_vector).z;
        hits += 1;
    }
    let work = simulation.ledger().term(Term::WallWork) - before;
    assert!(hits > 50 && work.abs() > 0.1, "{hits} {work}");
    assert!((work + torque * rate).abs() < 1e-12 * f64::from(hits), "{work} {}", -torque * rate);
    // The grains turn with the drum in the end.
    let frame = simulation.frame();
    let turned: f64 = frame.position.iter().zip(&frame.velocity).map(|(x, v)| (*x - point).cross(*v).z).sum();
    assert!(turned > 0.0, "{turned}");
}

#[test]
fn species_that_pass_through_a_wall_are_never_stopped_by_it() {
    let membrane = wall(
        "membrane",
        Rectangle { center: CENTER, normal: DVec3::X, along: [DVec3::Y, DVec3::Z], half: [20.0, 20.0] },
    );
    let mut scene = grains(Dimension::Three, vec![membrane], 0, Boundary::Wall);
    scene.groups = ["coarse", "fine"].map(|name| Group { name: name.into() }).to_vec();
    scene.species = vec!["coarse".into(), "fine".into()];
    scene.classes.clear();
    let (coarse, fine) = (class(&mut scene, 0.4, 1.0), class(&mut scene, 0.15, 0.2));
    scene.classes[fine as usize].group = 1;
    let mut random = Random(3);
    scatter(&mut scene, coarse, 30, 1.0, &mut random);
    scatter(&mut scene, fine, 60, 1.0, &mut random);
    let walls = scene.walls.len();
    scene.contacts.pair = vec![Restitution::Constant(1.0); 4];
    scene.contacts.wall = vec![Restitution::Constant(1.0).into(); 2 * walls];
    scene.contacts.wall[2 * walls - 1] = WallLaw::Passes;
    let side = |simulation: &Simulation, first: usize, last: usize| -> Vec<bool> {
        simulation.frame().position[first..last].iter().map(|x| x.x > 6.0).collect()
    };
    let start = Simulation::new(scene.clone(), Options::default()).unwrap();
    let mut end = check_independence(&scene, &[0.5, 6.0]);
    assert_eq!(side(&start, 0, 30), side(&end, 0, 30), "a coarse grain has passed");
    let changed = side(&start, 30, 90).iter().zip(side(&end, 30, 90)).filter(|(a, b)| **a != *b).count();
    assert!(changed > 10, "{changed} fine grains have passed");
    end.measure_overlap().unwrap();
}

/// Closed billiards: a grain keeps its energy, and in a circle and a sphere its angular momentum, to
/// rounding; with the velocity reversed it retraces its path.
#[test]
#[ignore = "long: scripts/test all"]
fn billiards_keep_energy_and_angular_momentum() {
    /// A stadium: all points at a distance from a line of finite length.
    #[derive(Debug)]
    struct Stadium;
    impl Stadium {
        fn from_middle(position: DVec3) -> DVec3 {
            position - DVec3::new(position.x.clamp(4.0, 8.0), 6.0, position.z)
        }
    }
    impl Surface for Stadium {
        fn distance(&self, position: DVec3) -> f64 {
            3.0 - Self::from_middle(position).length()
        }
        fn normal(&self, position: DVec3) -> DVec3 {
            -Self::from_middle(position).normalize_or(DVec3::Y)
        }
        fn curvature(&self, _low: f64, high: f64) -> f64 {
            if high < 3.0 { 1.0 / (3.0 - high) } else { f64::INFINITY }
        }
    }
    let flat = DVec3::new(6.0, 6.0, 0.0);
    let bounces = contacts(100_000);
    let cases: [(&str, Dimension, Wall, bool); 4] = [
        (
            "circle",
            Dimension::Two,
            wall("circle", Revolution::cylinder(flat, DVec3::Z, 5.0, Side::Inside)),
            true,
        ),
        (
            "sphere",
            Dimension::Three,
            wall("sphere", Sphere { center: CENTER, radius: 5.0, side: Side::Inside }),
            true,
        ),
        ("stadium", Dimension::Two, wall("stadium", Stadium), false),
        (
            "can",
            Dimension::Three,
            wall(
                "can",
                Revolution::finite_cylinder(CENTER - DVec3::Z * 3.0, DVec3::Z, 5.0, 6.0, Side::Inside),
            ),
            false,
        ),
    ];
    for (name, dimension, wall, is_round) in cases {
        let center = if dimension == Dimension::Two { flat } else { CENTER };
        let mut scene = system(dimension, DVec3::splat(12.0), [Boundary::Open; 3]);
        scene.walls.push(wall);
        scene.contacts.wall = vec![Restitution::Constant(1.0).into()];
        let grain = class(&mut scene, 0.25, 1.0);
        let z = if dimension == Dimension::Two { 0.0 } else { 0.3 };
        add(&mut scene, grain, center + DVec3::new(0.7, 0.4, z), DVec3::new(1.0, 0.35, z));
        let mut simulation = Simulation::new(scene.clone(), Options::default()).unwrap();
        let momentum = |simulation: &Simulation| {
            let frame = simulation.frame();
            (frame.position[0] - center).cross(frame.velocity[0])
        };
        let (start, energy) = (momentum(&simulation), scene.bodies[0].velocity.length_squared());
        while simulation.counters().wall_collisions < bounces {
            let until = Until { time: f64::INFINITY, entries: 1_000_000, ..Until::default() };
            simulation.advance(until, &mut Silent).unwrap();
        }
        // Every bounce rounds position, normal and velocity: a walk at random.
        let bound = 16.0 * (bounces as f64).sqrt() * f64::EPSILON;
        let speed = simulation.frame().velocity[0].length_squared();
        assert!((speed / energy - 1.0).abs() < bound, "{name}: {}", speed / energy - 1.0);
        if is_round {
            // Relative to the largest that the grain could have.
            let off = (momentum(&simulation) - start).length() / (5.0 * energy.sqrt());
            assert!(off < bound, "{name}: {off:e}");
        }
        simulation.measure_overlap().unwrap();

        // Few bounces there and back: chaotic billiards double the error with each.
        let mut there = Simulation::new(scene.clone(), Options::default()).unwrap();
        let time = 60.0;
        there.advance(Until { time, ..Until::default() }, &mut Silent).unwrap();
        let frame = there.frame();
        scene.bodies[0].position = frame.position[0];
        scene.bodies[0].velocity = -frame.velocity[0];
        let mut back = Simulation::new(scene.clone(), Options::default()).unwrap();
        back.advance(Until { time, ..Until::default() }, &mut Silent).unwrap();
        let off = (back.frame().position[0] - (center + DVec3::new(0.7, 0.4, z))).length();
        let tolerance = if is_round { 1e-12 } else { 1e-7 };
        assert!(off < tolerance, "{name}: {off:e}");
    }
}

/// A mesh of a cube has the contacts of six planes, until chaos makes rounding visible.
#[test]
fn a_mesh_of_a_cube_is_six_walls() {
    let mut planes = system(Dimension::Three, DVec3::splat(8.0), [Boundary::Wall; 3]);
    let grain = class(&mut planes, 0.4, 1.0);
    set_restitution(&mut planes, 0.9);
    scatter(&mut planes, grain, 20, 1.0, &mut Random(2));
    let mut mesh = planes.clone();
    mesh.domain.boundary = [Boundary::Open; 3];
    let triangles = cuboid(DVec3::ZERO, DVec3::splat(8.0));
    mesh.walls = vec![wall("mesh", Mesh::new(&triangles, Side::Inside).unwrap())];
    mesh.contacts.wall = vec![Restitution::Constant(0.9).into()];
    for gravity in [DVec3::ZERO, DVec3::new(0.0, 0.0, -0.2)] {
        let ends = [&planes, &mesh].map(|scene| {
            let mut scene = scene.clone();
            scene.domain.gravity = gravity;
            let mut simulation = Simulation::new(scene, Options::default()).unwrap();
            simulation.advance(Until { time: 10.0, ..Until::default() }, &mut Silent).unwrap();
            (simulation.counters(), simulation.frame())
        });
        assert_eq!(ends[0].0.wall_collisions, ends[1].0.wall_collisions);
        assert!(ends[0].0.wall_collisions > 30, "{:?}", ends[0].0);
        for (a, b) in ends[0].1.position.iter().zip(&ends[1].1.position) {
            assert!((*a - *b).length() < 1e-7, "{a} {b}");
        }
    }
}

/// Fast grains in containers whose walls meet in edges: none is outside after many contacts.
#[test]
#[ignore = "long: scripts/test all"]
fn nothing_leaks_through_edges() {
    let contacts = contacts(40_000);
    let wedge = Revolution::cone(DVec3::new(6.0, 6.0, 1.0), DVec3::Z, 0.3, [0.0, 9.0], Side::Inside);
    let triangles: Vec<[DVec3; 3]> = (0..12)
        .flat_map(|k| {
            let corner = |k: u32| {
                let (sin, cos) = (TAU * f64::from(k % 12) / 12.0).sin_cos();
                CENTER + DVec3::new(4.0 * cos, 4.0 * sin, 0.0)
            };
            [5.0, -5.0].map(|z| [corner(k), corner(k + 1), CENTER + DVec3::Z * z])
        })
        .collect();
    let can = Revolution::finite_cylinder(
        CENTER - DVec3::Z * 4.0,
        DVec3::new(0.1, 0.0, 1.0),
        4.0,
        8.0,
        Side::Inside,
    );
    let shapes = [
        ("cone", wall("cone", wedge)),
        ("double pyramid", wall("mesh", Mesh::new(&triangles, Side::Inside).unwrap())),
        ("can", wall("can", can)),
    ];
    for (name, shape) in shapes {
        for gravity in [DVec3::ZERO, DVec3::new(0.0, 0.3, -1.0)] {
            let mut scene = system(Dimension::Three, DVec3::splat(12.0), [Boundary::Open; 3]);
            scene.walls.push(shape.clone());
            scene.contacts.wall = vec![Restitution::Constant(1.0).into()];
            scene.domain.gravity = gravity;
            let grain = class(&mut scene, 0.1, 1.0);
            scatter(&mut scene, grain, 20, 10.0, &mut Random(5));
            let options = Options { neighbors: NeighborChoice::AllPairs, ..Options::default() };
            let mut simulation = Simulation::new(scene.clone(), options).unwrap();
            while simulation.counters().wall_collisions < contacts / 6 {
                let until = Until { time: f64::INFINITY, entries: 100_000, ..Until::default() };
                simulation.advance(until, &mut Silent).unwrap();
            }
            for (i, position) in simulation.frame().position.iter().enumerate() {
                let distance = scene.walls[0].distance(*position, haff_engine::Instant::ZERO);
                assert!(
                    distance > 0.1 - allowed_overlap(0.1, 24.0),
                    "{name}, {gravity}: particle {i} at {position}: {distance}"
                );
            }
            simulation.measure_overlap().unwrap();
            // Of very many contacts, half an ulp of the energy for each.
            let tolerance = f64::max(1e-12, contacts as f64 / 6.0 * (0.5 * f64::EPSILON));
            assert!(simulation.ledger().residual.abs() < tolerance);
        }
    }
}

#[test]
fn containers_bound_open_axes_for_searches() {
    let chosen = |walls: Vec<Wall>, motion: Option<WallMotion>| {
        let mut scene = grains(Dimension::Three, walls, 200, Boundary::Open);
        if let Some(motion) = motion {
            scene.walls[0].motion = motion;
        }
        Simulation::new(scene, Options::default()).unwrap().neighbors()
    };
    let flask = |center: DVec3, side: Side| vec![wall("flask", Sphere { center, radius: 6.0, side })];
    assert_eq!(chosen(flask(CENTER, Side::Inside), None), NeighborChoice::Windows);
    let mesh = Mesh::new(&cuboid(DVec3::splat(0.5), DVec3::splat(11.0)), Side::Inside).unwrap();
    assert_eq!(mesh.enclosure(), Some([DVec3::splat(0.5), DVec3::splat(11.5)]));
    assert_eq!(chosen(vec![wall("box", mesh)], None), NeighborChoice::Windows);
    let drum = Revolution::finite_cylinder(DVec3::new(6.0, 6.0, 0.5), DVec3::Z, 5.5, 11.0, Side::Inside);
    assert_eq!(chosen(vec![wall("drum", drum)], None), NeighborChoice::Windows);
    // A fixed body is outside.
    let mut scene = grains(Dimension::Three, flask(CENTER, Side::Inside), 200, Boundary::Open);
    let fixed = class(&mut scene, 0.5, f64::INFINITY);
    add(&mut scene, fixed, DVec3::splat(40.0), DVec3::ZERO);
    let outside = Simulation::new(scene, Options::default()).unwrap();
    assert_eq!(outside.neighbors(), NeighborChoice::Cells);
    // Nothing holds the grains, or not all of them, or the container moves on.
    assert_eq!(chosen(flask(DVec3::splat(-9.0), Side::Outside), None), NeighborChoice::Cells);
    assert_eq!(chosen(flask(CENTER, Side::Both), None), NeighborChoice::Cells);
    let tube = Revolution::cylinder(CENTER, DVec3::Z, 5.5, Side::Inside);
    assert_eq!(chosen(vec![wall("tube", tube)], None), NeighborChoice::Cells);
    assert_eq!(chosen(flask(CENTER, Side::Inside), Some(DVec3::X.into())), NeighborChoice::Cells);
}
