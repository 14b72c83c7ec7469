//! Random scenes: their features, how they are drawn, and the systems that follow.

use glam::DVec3;
use haff_engine::{
    Boundary, Compression, Correlations, Dimension, Drag, Drive, DriveKind, Grid, GridAxis, Group, Hole,
    KickTimes, Measure, Oscillating, Partition, Rotation, Shape, Shear, Spin, System, ThermalWall, Wall,
    WallLaw, WallMotion,
};
use haff_mechanics::{NamedSurface, Oscillation, Restitution, Roughness, Scatter, Surface, Waveform};
use haff_surfaces::{Mesh, Rectangle, Revolution, Side, Sphere};
use proptest::prelude::*;

use crate::common::{Random, add, class, scatter_within_room, system};

/// Number of shapes of walls.
const SHAPES: usize = 6;

/// The features of a scene; the rest follows from the seed. Simpler values come first, so that a failure
/// shrinks to few features.
#[expect(clippy::struct_excessive_bools, reason = "each feature is on or off")]
#[derive(Debug, Clone)]
pub struct Recipe {
    pub flat: bool,
    pub boundary: [usize; 3],
    pub particles: usize,
    pub species: usize,
    pub restitution: usize,
    pub gravity: bool,
    pub ramp: usize,
    pub fixed: bool,
    pub tc: bool,
    pub fast: bool,
    /// Speeds over twelve orders of magnitude.
    pub speeds: bool,
    /// Mass ratios up to 10⁹, size ratios up to 30.
    pub ratios: bool,
    /// Grains come to rest on each other.
    pub rest: bool,
    /// The box is a hundred times as large, so that coordinates are large compared with particles.
    pub far: bool,
    /// One light grain in addition.
    pub light: bool,
    /// A second plane, which makes a wedge with the ramp or a wall and sometimes moves into it.
    pub wedge: bool,
    /// Run long enough for a collapse to be reported.
    pub long: bool,
    /// A drive: none, `rescale`, `andersen`, or white noise by Poisson kicks or at intervals.
    pub drive: usize,
    /// Some walls are thermal.
    pub thermal: bool,
    /// Everything that can be measured is measured.
    pub measure: bool,
    /// A partition with a hole divides the box.
    pub partition: bool,
    /// Contacts are rough: not at all, with one law, or with a law for each pair and each wall.
    pub rough: usize,
    /// Simple shear: none, moderate, fast or slow. All axes are then periodic, and no body is fixed.
    pub shear: usize,
    /// Edges along periodic axes change: not at all, moderately, fast or slowly. There is no gravity then.
    pub compression: usize,
    /// One body that is larger than all others, by up to a third of the box.
    pub huge: bool,
    /// A wall of the boundary oscillates along its axis, so that corners move.
    pub corner: bool,
    /// The first grain falls on the top of a fixed body.
    pub top: bool,
    /// The run ends at the time of a kick, when a profile is due, too.
    pub at_kick: bool,
    /// The run is checked once more, with laws, gravity and walls that change on the way.
    pub changed: bool,
    /// A wall of another shape: none, or one of [`SHAPES`]. No axis is periodic then.
    pub shape: usize,
    /// A drag: then there is no gravity, and no wall or body moves by itself.
    pub drag: bool,
    pub seed: u64,
}

/// A scene without any optional feature.
pub const PLAIN: Recipe = Recipe {
    flat: false,
    boundary: [0; 3],
    particles: 2,
    species: 1,
    restitution: 0,
    gravity: false,
    ramp: 0,
    fixed: false,
    tc: false,
    fast: false,
    speeds: false,
    ratios: false,
    rest: false,
    far: false,
    light: false,
    wedge: false,
    long: false,
    drive: 0,
    thermal: false,
    measure: false,
    partition: false,
    rough: 0,
    shear: 0,
    compression: 0,
    huge: false,
    corner: false,
    top: false,
    at_kick: false,
    changed: false,
    shape: 0,
    drag: false,
    seed: 0,
};

pub fn recipe() -> impl Strategy<Value = Recipe> {
    let few_or_many = prop_oneof![1 => 1..4_usize, 6 => 2..16_usize, 3 => 16..60_usize, 1 => 60..=200_usize];
    let shape = (any::<bool>(), [0..3_usize, 0..3, 0..3], few_or_many, 1..=3_usize, 0..6_usize);
    let extras = (any::<bool>(), 0..6_usize, any::<bool>(), any::<bool>(), any::<bool>(), any::<u64>());
    let seldom = || prop::bool::weighted(0.2);
    let ends = (seldom(), seldom(), seldom(), prop::bool::weighted(0.01));
    let drive = prop_oneof![8 => Just(0), 2 => 1..5_usize];
    let rough = prop_oneof![7 => Just(0), 3 => 1..3_usize];
    let last = (drive, prop::bool::weighted(0.1), seldom(), seldom(), rough);
    (shape, extras, (seldom(), seldom(), seldom()), ends, last).prop_map(
        |(
            (flat, boundary, particles, species, restitution),
            (gravity, ramp, fixed, tc, fast, seed),
            (speeds, ratios, rest),
            (far, light, wedge, long),
            (drive, thermal, measure, partition, rough),
        )| {
            // From the seed, so that all other features are drawn as before.
            let shear = [1, 2, 3].get((seed >> 40) as usize % 12).copied().unwrap_or(0);
            let sheared = shear > 0;
            let one_in = |n: u64, bits: u32| (seed >> bits).is_multiple_of(n);
            let chosen = [1, 2, 3].get((seed >> 52) as usize % 24).copied().unwrap_or(0);
            let compression = if sheared { 0 } else { chosen };
            let deforms = sheared || compression > 0;
            let all_periodic = sheared || compression > 0 && rough > 0;
            let shaped = one_in(5, 33) && !deforms;
            let shape = if shaped { 1 + (seed >> 36) as usize % SHAPES } else { 0 };
            // Shapes do not repeat with the box.
            let drawn = one_in(12, 24);
            // What adds energy does not work with rest.
            let drawn_law = if one_in(2, 56) && !rest { 7 } else { 6 };
            let drag = one_in(6, 8) && !deforms && !rest;
            let bounded = boundary.map(|kind| if shaped { kind.max(1) } else { kind });
            Recipe {
                shape,
                flat,
                boundary: if all_periodic { [0; 3] } else { bounded },
                particles,
                species,
                restitution: if drawn { drawn_law } else { restitution },
                drag,
                gravity: gravity && compression == 0 && !drag,
                ramp: if compression > 0 { 0 } else { ramp },
                fixed: fixed && !deforms,
                tc,
                fast,
                speeds,
                ratios,
                rest: rest && !deforms,
                far,
                light,
                wedge: wedge && compression == 0,
                long,
                drive,
                thermal: thermal && compression == 0,
                measure,
                partition: partition && compression == 0,
                rough,
                shear,
                compression,
                huge: one_in(16, 4) && !deforms,
                corner: one_in(8, 12) && !deforms,
                top: one_in(16, 20) && gravity && !deforms && !drag,
                at_kick: one_in(2, 28),
                changed: one_in(4, 44) && compression == 0 && !drag,
                seed,
            }
        },
    )
}

fn law(kind: usize, random: &mut Random) -> Restitution {
    match kind {
        0 => Restitution::Constant(1.0),
        1 => Restitution::Constant(random.uniform(0.5, 1.0)),
        2 => Restitution::Constant(0.0),
        3 => Restitution::Viscoelastic { coefficient: random.uniform(0.01, 0.3) },
        4 => Restitution::Cutoff { restitution: 0.3, speed: 0.2, exponent: 0.75 },
        6 => Restitution::random(match random.index(3) {
            0 => Scatter::Uniform([0.2, random.uniform(0.2, 1.0)]),
            1 => Scatter::Normal([random.uniform(0.5, 1.0), 0.1]),
            _ => Scatter::Values(vec![0.0, 0.7, 1.0]),
        })
        .unwrap(),
        7 => law(random.index(5), random).with_added_speed(10_f64.powf(random.uniform(-4.0, -1.0))),
        // Every pair and every wall gets a law of its own.
        _ => law(random.index(5), random),
    }
}

fn roughness(random: &mut Random) -> Roughness {
    let tangential_restitution = [-1.0, 1.0, 0.0, random.uniform(-1.0, 1.0)][random.index(4)];
    let friction = [f64::INFINITY, 0.0, random.uniform(0.0, 0.3), 10_f64.powf(random.uniform(-3.0, 1.0))];
    Roughness { tangential_restitution, friction: friction[random.index(4)] }
}

/// Spins of a scene, with one law or with one for each pair and each wall.
fn spins(scene: &System, all_different: bool, random: &mut Random) -> Spin {
    let d = scene.dimension.count();
    let (groups, walls) = (scene.groups.len(), scene.walls.len());
    let one = roughness(random);
    let mut pair = vec![one; groups * groups];
    let mut wall = vec![one; groups * walls];
    if all_different {
        for a in 0..groups {
            for b in 0..=a {
                let law = roughness(random);
                (pair[a * groups + b], pair[b * groups + a]) = (law, law);
            }
        }
        for law in &mut wall {
            *law = roughness(random);
        }
    }
    let component = |axis: usize, random: &mut Random| {
        if d == 3 || axis == 2 { random.uniform(-3.0, 3.0) } else { 0.0 }
    };
    Spin {
        inertia: (0..groups).map(|_| random.uniform(0.05, if d == 2 { 1.0 } else { 2.0 / 3.0 })).collect(),
        angular_velocity: (0..scene.bodies.len())
            .map(|_| DVec3::from_array([0, 1, 2].map(|axis| component(axis, random))))
            .collect(),
        pair,
        wall,
    }
}

/// All measurements that a scene can have.
fn measure_all(scene: &System, random: &mut Random) -> Measure {
    let d = scene.dimension.count();
    let open = |axis: usize| scene.domain.boundary[axis] == Boundary::Open;
    let closed = !(0..d).any(open);
    let axis = |axis: usize, bins: usize| GridAxis { axis, low: 0.0, high: scene.domain.size[axis], bins };
    let profile = |axes: Vec<GridAxis>, interval: f64| {
        let spread = axes.len() == 1;
        let species = if spread { vec![0] } else { Vec::new() };
        Grid { axes, interval, samples: 3, spread, species }
    };
    // Without a volume there is no pressure. Grains that sleep on each other transmit no forces.
    let pressure = closed && scene.contacts.rest_speed == 0.0;
    let profiles =
        vec![profile(vec![axis(0, 7)], 0.3), profile((0..d).map(|k| axis(k, 2 + k)).collect(), 0.7)];
    Measure {
        stress: pressure,
        wall_forces: scene.contacts.rest_speed == 0.0,
        pair_collisions: true,
        profiles: if closed { profiles } else { Vec::new() },
        correlations: Correlations {
            msd: haff_engine::Followed::All,
            vacf: haff_engine::Followed::Species(vec![0]),
            stress: pressure,
            interval: 10_f64.powf(random.uniform(-2.0, 0.0)),
            tracers: 30,
        },
        probes: Vec::new(),
    }
}

impl Recipe {
    pub fn build(&self) -> System {
        let mut random = Random(self.seed);
        let dimension = if self.flat { Dimension::Two } else { Dimension::Three };
        let d = dimension.count();
        let boundary = self.boundary.map(|k| [Boundary::Periodic, Boundary::Wall, Boundary::Open][k]);
        // The packing fraction is at most about 0.2, so that random placement succeeds.
        let edge = (self.particles as f64 * if self.flat { 6.0 } else { 5.0 }).powf(1.0 / d as f64).max(4.0);
        let edge = if self.far { 100.0 * edge } else { edge };
        let size = DVec3::from_array([0; 3].map(|_| edge * random.uniform(1.0, 1.6)));
        let mut scene = system(dimension, size, boundary);
        let free = |axis: usize| axis < d && boundary[axis] != Boundary::Periodic;
        if self.gravity {
            for axis in (0..d).filter(|&axis| free(axis)) {
                scene.domain.gravity[axis] = random.uniform(-1.0, 1.0);
            }
        }
        if self.ramp > 1
            && let Some(axis) = (0..d).find(|&axis| free(axis))
        {
            let mut normal = DVec3::AXES[axis];
            for other in (0..d).filter(|&other| other != axis && free(other)) {
                normal[other] = random.uniform(-0.5, 0.5);
            }
            let normal = normal.normalize();
            let motion = match self.ramp {
                3 => (normal * 0.1).into(),
                4 | 5 => {
                    let waveform = if self.ramp == 4 { Waveform::Sine } else { Waveform::Triangle };
                    let frequency = 10_f64.powf(random.uniform(-1.0, 0.5));
                    let oscillation = Oscillation { waveform, amplitude: 0.1, frequency };
                    WallMotion::Oscillating(Oscillating { oscillation, cycles: random.uniform(0.0, 1.0) })
                }
                _ => WallMotion::Fixed,
            };
            scene.walls.push(Wall { name: "ramp".into(), point: size * 0.15, normal, motion, shape: None });
        }
        if self.wedge
            && let Some(axis) = (0..d).rev().find(|&axis| free(axis))
        {
            let mut normal = -DVec3::AXES[axis];
            for other in (0..d).filter(|&other| other != axis && free(other)) {
                normal[other] = random.uniform(-0.9, 0.9);
            }
            let normal = normal.normalize();
            let velocity = normal * [0.0, 0.05, 0.3][random.index(3)];
            scene.walls.push(Wall {
                name: "wedge".into(),
                point: size * 0.9,
                normal,
                motion: velocity.into(),
                shape: None,
            });
        }
        if self.partition && (0..d).all(free) {
            let point = size * random.uniform(0.4, 0.6);
            let hole = Some(Hole { center: point, radius: random.uniform(0.7, 1.5) });
            let shape = Some(Shape::Partition(Partition { point, normal: DVec3::X, hole }));
            let (name, normal, motion) = ("partition".into(), DVec3::X, WallMotion::Fixed);
            scene.walls.push(Wall { name, point, normal, motion, shape });
        }
        if self.shape > 0 {
            scene.walls.push(self.shaped_wall(size, &mut random));
        }
        let (groups, walls) = (self.species + usize::from(self.fixed), scene.walls.len());
        scene.groups = (0..groups).map(|k| Group { name: format!("group {k}") }).collect();
        let mut pair = vec![Restitution::Constant(1.0); groups * groups];
        for a in 0..groups {
            for b in 0..=a {
                let rule = law(self.restitution, &mut random);
                (pair[a * groups + b], pair[b * groups + a]) = (rule, rule);
            }
        }
        scene.contacts.pair = pair;
        scene.contacts.wall =
            (0..groups * walls).map(|_| law(self.restitution, &mut random).into()).collect();
        if self.thermal {
            for law in scene.contacts.wall.iter_mut().step_by(2) {
                if let WallLaw::Restitution(restitution) = *law {
                    let (temperature, accommodation) = (random.uniform(0.0, 3.0), random.uniform(0.0, 1.0));
                    *law = WallLaw::Thermal(ThermalWall { temperature, accommodation, restitution });
                }
            }
        }
        if self.shape > 0 && groups > 1 && random.index(3) == 0 {
            // One species passes through the shape.
            scene.contacts.wall[walls - 1] = WallLaw::Passes;
        }
        if self.tc {
            scene.contacts.tc = 10_f64.powf(random.uniform(-6.0, -1.0));
        }
        if self.corner
            && let Some(wall) = scene.walls.iter_mut().find(|wall| wall.motion == WallMotion::Fixed)
        {
            let oscillation = Oscillation { waveform: Waveform::Sine, amplitude: 0.1, frequency: 0.1 };
            wall.motion = WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.0 });
        }
        if self.drag {
            // Before particles are placed beside them.
            let moves = |wall: &&mut Wall| !matches!(wall.motion, WallMotion::Rotating(_));
            scene.walls.iter_mut().filter(moves).for_each(|wall| wall.motion = WallMotion::Fixed);
        }
        if self.huge {
            let kind = class(&mut scene, edge * random.uniform(0.1, 0.3), 1e3);
            scatter_within_room(&mut scene, kind, 1, 0.1, &mut random);
        }
        for k in 0..self.species {
            let alone = self.species == 1;
            let (least, orders) = if self.ratios { (0.02, 4.5) } else { (0.1, 3.0) };
            let radius = if alone { 0.5 } else { random.uniform(least, 0.6) };
            let mass = if alone { 1.0 } else { 10_f64.powf(random.uniform(-orders, orders)) };
            let kind = class(&mut scene, radius, mass);
            scene.classes[kind as usize].group = k as u32;
            let count = (self.particles / self.species).max(1);
            // A wedge can leave too little room for all.
            scatter_within_room(&mut scene, kind, count, 1.0, &mut random);
        }
        // A hole is larger than every particle.
        let largest = scene.classes.iter().map(|class| class.radius).fold(0.0, f64::max);
        let holes = scene.walls.iter_mut().filter_map(|wall| match &mut wall.shape {
            Some(Shape::Partition(partition)) => partition.hole.as_mut(),
            _ => None,
        });
        holes.for_each(|hole| hole.radius = hole.radius.max(1.1 * largest));
        if self.light {
            let [radius, mass] = [random.uniform(0.1, 0.5), 10_f64.powf(random.uniform(-6.0, -1.0))];
            let kind = class(&mut scene, radius, mass);
            scatter_within_room(&mut scene, kind, 1, 1.0, &mut random);
        }
        if self.fast {
            scene.bodies[0].velocity *= 10_f64.powf(random.uniform(0.0, 4.0));
        }
        if self.speeds {
            for body in &mut scene.bodies {
                body.velocity *= 10_f64.powf(random.uniform(-8.0, 4.0));
            }
        }
        if self.rest {
            scene.contacts.rest_speed = 10_f64.powf(random.uniform(-3.0, -1.0));
        }
        let (temperature, rate, interval) = (1.5, random.uniform(0.1, 10.0), random.uniform(0.01, 0.5));
        let noise = |kicks: KickTimes| DriveKind::WhiteNoise { strength: 0.3, kicks };
        let kind = match self.drive {
            // Scenes refuse drives of grains that are put to rest.
            _ if self.rest => None,
            1 => Some(DriveKind::Rescale { temperature, interval }),
            2 => Some(DriveKind::Andersen { temperature, rate }),
            3 => Some(noise(KickTimes::Poisson { rate })),
            4 => Some(noise(KickTimes::Regular { interval })),
            _ => None,
        };
        // Only where there are spins.
        let rotational = (self.seed >> 16).is_multiple_of(2);
        scene.drives = kind.map(|kind| Drive { kind, species: vec![0], rotational }).into_iter().collect();
        if self.fixed {
            let kind = class(&mut scene, 0.5, f64::INFINITY);
            scene.classes[kind as usize].group = self.species as u32;
            let speed = if random.index(2) == 0 { 0.0 } else { 0.2 };
            scatter_within_room(&mut scene, kind, 1, speed, &mut random);
        }
        if self.top {
            Self::put_on_top(&mut scene);
        }
        if self.rough > 0 {
            scene.spin = Some(spins(&scene, self.rough == 2, &mut random));
        }
        if self.shear > 0 {
            let flow = random.index(d);
            let gradient = (flow + 1 + random.index(d - 1)) % d;
            let size =
                [random.uniform(0.1, 2.0), 10_f64.powf(random.uniform(0.5, 2.5)), 1e-3][self.shear - 1];
            let rate = if random.index(2) == 0 { size } else { -size };
            // Whole edges: the particles have been placed for images without displacement.
            let offset = (random.index(5) as f64 - 2.0) * scene.domain.size[flow];
            scene.domain.shear = Some(Shear { flow, gradient, rate, offset });
            for body in &mut scene.bodies {
                body.velocity[flow] += rate * body.position[gradient];
            }
        }
        if self.compression > 0 {
            self.compress(&mut scene, &mut random);
        }
        if self.measure {
            scene.measure = measure_all(&scene, &mut random);
            if self.at_kick
                && let (Some(interval), Some(profile)) =
                    (kick_interval(&scene), scene.measure.profiles.first_mut())
            {
                (profile.interval, profile.samples, profile.spread) = (interval, 1, false);
            }
        }
        if self.seed.is_multiple_of(4) {
            // Walls of the box outside of its faces, by more than a radius.
            let of_box = 2 * scene.domain.boundary.iter().filter(|&&kind| kind == Boundary::Wall).count();
            for wall in &mut scene.walls[..of_box] {
                wall.point -= wall.normal * random.uniform(0.0, 1.5);
            }
        }
        if self.drag {
            self.damp(&mut scene, &mut random);
        }
        scene
    }

    /// A wall of another shape in a box of this size.
    fn shaped_wall(&self, size: DVec3, random: &mut Random) -> Wall {
        let flat = self.flat;
        let size = if flat { size.with_z(0.0) } else { size };
        let center = size * 0.5 + if flat { DVec3::ZERO } else { DVec3::Z * 0.01 * size.z };
        let least = if flat { size.truncate().min_element() } else { size.min_element() };
        let mut direction = || {
            let z = if flat { 0.0 } else { random.normal() };
            DVec3::new(random.normal(), random.normal(), z).normalize()
        };
        let [axis, shift] = [direction(), direction()];
        let axis = if flat && self.shape != 4 { DVec3::Z } else { axis };
        let half = least * random.uniform(0.1, 0.25);
        let (surface, point): (Box<dyn Surface>, Option<DVec3>) = match self.shape {
            1 => (Box::new(Sphere { center, radius: half, side: Side::Outside }), Some(center)),
            2 => {
                let radius = least * random.uniform(0.45, 0.7);
                (Box::new(Sphere { center, radius, side: Side::Inside }), Some(center))
            }
            3 if flat => {
                (Box::new(Revolution::cylinder(center, axis, 2.0 * half, Side::Inside)), Some(center))
            }
            3 => {
                let length = least * random.uniform(0.6, 1.0);
                let (point, radius) = (center - axis * (0.5 * length), least * random.uniform(0.35, 0.6));
                let side = [Side::Inside, Side::Outside, Side::Both][random.index(3)];
                let radius = if side == Side::Inside { radius } else { 0.5 * radius };
                (Box::new(Revolution::finite_cylinder(point, axis, radius, length, side)), Some(point))
            }
            4 => {
                let apex = center - axis * (0.45 * least);
                let side = [Side::Inside, Side::Outside, Side::Both][random.index(3)];
                let angle = if side == Side::Outside { 0.2 } else { random.uniform(0.4, 1.2) };
                let start = if side == Side::Both { 0.2 * least } else { 0.0 };
                let end = if side == Side::Inside { f64::INFINITY } else { 0.6 * least };
                (Box::new(Revolution::cone(apex, axis, angle, [start, end], side)), Some(apex))
            }
            5 => {
                let normal = shift;
                let (along, half) = if flat {
                    ([DVec3::new(-normal.y, normal.x, 0.0), DVec3::Z], [half, f64::INFINITY])
                } else {
                    let (u, v) = normal.any_orthonormal_pair();
                    ([u, v], [half, 1.5 * half])
                };
                (Box::new(Rectangle { center, normal, along, half }), None)
            }
            _ if flat => (Box::new(Sphere { center, radius: half, side: Side::Both }), Some(center)),
            _ => {
                let tip = |axis: usize, sign: f64| center + DVec3::AXES[axis] * (sign * half);
                let faces = (0..8).map(|k| {
                    let sign = |bit: u32| if k >> bit & 1 == 0 { 1.0 } else { -1.0 };
                    [tip(0, sign(0)), tip(1, sign(1)), tip(2, sign(2))]
                });
                let faces: Vec<[DVec3; 3]> = faces.collect();
                let side = [Side::Outside, Side::Both][random.index(2)];
                (Box::new(Mesh::new(&faces, side).unwrap()), None)
            }
        };
        let motion = match (random.index(4), point) {
            // About an axis in the plane a wall would leave it; scenes refuse that.
            (2, Some(point)) if !flat || axis == DVec3::Z => {
                let angular_velocity = axis * random.uniform(-2.0, 2.0);
                WallMotion::Rotating(Rotation { point, angular_velocity })
            }
            (3, _) => {
                let waveform = [Waveform::Sine, Waveform::Triangle][random.index(2)];
                let frequency = 10_f64.powf(random.uniform(-1.0, 0.5));
                let oscillation = Oscillation { waveform, amplitude: 0.1, frequency };
                WallMotion::Oscillating(Oscillating { oscillation, cycles: random.uniform(0.0, 1.0) })
            }
            _ => WallMotion::Fixed,
        };
        let numbers = format!("{surface:?}");
        let shape = Some(Shape::Named(NamedSurface::of("shape", &numbers, surface)));
        Wall { name: "shape".into(), point: DVec3::ZERO, normal: shift, motion, shape }
    }

    /// Adds a drag, and stops bodies of infinite mass.
    fn damp(&self, scene: &mut System, random: &mut Random) {
        for body in &mut scene.bodies {
            if scene.classes[body.class as usize].mass.is_infinite() {
                body.velocity = DVec3::ZERO;
            }
        }
        let (time, rotational) = (10_f64.powf(random.uniform(-1.5, 2.0)), self.seed.is_multiple_of(3));
        scene.drag = Some(Drag { time, rotational });
    }

    /// Changes edges along periodic axes: all alike, or each by its own rate.
    fn compress(&self, scene: &mut System, random: &mut Random) {
        let size = [random.uniform(0.01, 0.2), 10_f64.powf(random.uniform(0.0, 2.0)), 1e-4];
        let size = size[self.compression - 1];
        let alike = random.index(2) == 0;
        let mut rates = DVec3::ZERO;
        for axis in 0..scene.dimension.count() {
            let rate = if alike { size } else { size * random.uniform(-1.0, 1.0) };
            if scene.domain.boundary[axis] == Boundary::Periodic {
                rates[axis] = rate;
            }
        }
        if rates == DVec3::ZERO {
            return;
        }
        scene.domain.compression = Some(Compression { rates, inside: 1.0 });
        for body in &mut scene.bodies {
            body.velocity -= rates * body.position;
        }
    }

    /// Adds a fixed body below the first grain, which starts at rest: without other grains it falls on the
    /// top.
    fn put_on_top(scene: &mut System) {
        let first = scene.bodies[0];
        let gravity = scene.domain.gravity;
        let reach = scene.classes[first.class as usize].radius + 0.3;
        let position = first.position + gravity.normalize_or(-DVec3::Y) * (reach + 0.2);
        let is_clear = scene.bodies[1..].iter().all(|body| {
            (body.position - position).length() > 0.3 + scene.classes[body.class as usize].radius
        });
        let is_inside = (0..scene.dimension.count()).all(|axis| {
            (0.3..scene.domain.size[axis] - 0.3).contains(&position[axis])
                || scene.domain.boundary[axis] == Boundary::Open
        });
        let is_before_walls = scene.walls.iter().all(|wall| {
            wall.shape.is_none() && (position - wall.point).dot(wall.normal) > 0.3 + wall.motion.max_speed()
        });
        if is_clear && is_inside && is_before_walls {
            let kind = class(scene, 0.3, f64::INFINITY);
            scene.bodies[0].velocity = DVec3::ZERO;
            add(scene, kind, position, DVec3::ZERO);
        }
    }
}

/// The interval of regular kicks of a system \[time\], if it has any.
pub fn kick_interval(system: &System) -> Option<f64> {
    system.drives.iter().find_map(|drive| match drive.kind {
        DriveKind::Rescale { interval, .. }
        | DriveKind::WhiteNoise { kicks: KickTimes::Regular { interval }, .. } => Some(interval),
        _ => None,
    })
}
