//! Random scenes in containers that shrink with a box that is compressed, or grow with one that expands:
//! every search finds the same, energies are in balance, and nothing leaves the container.

use glam::DVec3;
use haff_engine::{
    Compression, ConstantVelocity, NeighborChoice, Options, Shape, Shrinking, SimdChoice, Simulation, System,
    Wall, WallMotion,
};
use haff_mechanics::{NamedSurface, Surface};
use haff_surfaces::{Revolution, Side, Sphere};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

use super::{
    Recipe, check_each,
    passages::{ENOUGH, MOST, outcome},
    recipe::PLAIN,
};
use crate::common::{Random, features::add_wall};

/// A container in a box of this size, and whether the box can repeat along z.
fn container(flat: bool, size: DVec3, random: &mut Random) -> (Box<dyn Surface>, bool) {
    let center = if flat { (0.5 * size).with_z(0.0) } else { 0.5 * size };
    let round = 0.5 * size.truncate().min_element();
    let (axis, base) = (DVec3::Z, center.with_z(0.0));
    match random.index(4) {
        _ if flat => (Box::new(Sphere { center, radius: round, side: Side::Inside }), false),
        0 => {
            let radius = round.min(0.5 * size.z);
            (Box::new(Sphere { center, radius, side: Side::Inside }), false)
        }
        1 => (Box::new(Revolution::cylinder(base, axis, round, Side::Inside)), true),
        2 => (Box::new(Revolution::finite_cylinder(base, axis, round, size.z, Side::Inside)), false),
        _ => {
            let ends = [0.2 * size.z, size.z];
            (Box::new(Revolution::cone(base, axis, (round / size.z).atan(), ends, Side::Inside)), false)
        }
    }
}

/// The system of a recipe in a container; `None` if no particle is inside.
fn in_container(recipe: &Recipe) -> Option<System> {
    let mut random = Random(recipe.seed ^ 0x636f_6e74);
    let repeats = random.index(2) == 0;
    let plain = Recipe {
        boundary: [1, 1, usize::from(!repeats)],
        gravity: false,
        drag: false,
        ramp: 0,
        wedge: false,
        partition: false,
        corner: false,
        top: false,
        fixed: false,
        rest: false,
        shape: 0,
        shear: 0,
        compression: 0,
        changed: false,
        at_kick: false,
        // The flow along a periodic axis has no work on tangential and thermal impacts: scenes refuse them.
        rough: if repeats { 0 } else { recipe.rough },
        thermal: recipe.thermal && !repeats,
        seed: recipe.seed | 1, // Walls at the faces.
        ..recipe.clone()
    };
    let mut system = plain.build();
    let size = system.domain.size;
    let (surface, can_repeat) = container(recipe.flat, size, &mut random);
    if !recipe.flat && repeats != can_repeat {
        return None;
    }
    let is_inside = |position: DVec3, radius: f64| surface.distance(position) > 1.001 * radius;
    let inside: Vec<bool> = system
        .bodies
        .iter()
        .map(|body| is_inside(body.position, system.classes[body.class as usize].radius))
        .collect();
    let kept = |k: &mut usize| {
        *k += 1;
        inside[*k - 1]
    };
    let (mut k, mut l) = (0, 0);
    system.bodies.retain(|_| kept(&mut k));
    if let Some(spin) = &mut system.spin {
        spin.angular_velocity.retain(|_| kept(&mut l));
    }
    if system.bodies.is_empty() {
        return None;
    }
    let axes = system.dimension.count();
    let volume: f64 = size.to_array()[..axes].iter().product();
    let within = surface.volume(axes, size)? / volume;
    let rate = [0.02, 0.1, -0.05, 1e-5, -2.0][random.index(5)];
    let mut rates = DVec3::ZERO;
    (0..axes).for_each(|axis| rates[axis] = rate);
    system.domain.compression = Some(Compression { rates, inside: within });
    for body in &mut system.bodies {
        body.velocity -= rates * body.position;
    }
    for wall in system.walls.iter_mut().filter(|wall| wall.normal.element_sum() < 0.0) {
        let velocity = wall.normal * (rate * size.dot(wall.normal.abs()));
        wall.motion = WallMotion::Constant(ConstantVelocity { velocity, reference_time: 0.0 });
    }
    let numbers = format!("{surface:?}");
    add_wall(
        &mut system,
        Wall {
            name: "container".into(),
            point: DVec3::ZERO,
            normal: DVec3::ZERO,
            motion: WallMotion::Shrinking(Shrinking { rate, speed: 2.0 * size.length() * rate.abs() }),
            shape: Some(Shape::Named(NamedSurface::of("container", &numbers, surface))),
        },
    );
    Some(system)
}

/// Checks that all particles are in the container.
fn check_inside(system: &System, simulation: &Simulation) -> Result<(), TestCaseError> {
    let frame = simulation.frame();
    let Some(Shape::Named(named)) = system.walls.last().and_then(|wall| wall.shape) else {
        panic!("the last wall is the container")
    };
    let scale = system.domain.edges(frame.time).x / system.domain.size.x;
    for (i, body) in system.bodies.iter().enumerate() {
        let distance = scale * named.get().distance(frame.position[i] / scale);
        let radius = system.classes[body.class as usize].radius;
        prop_assert!(distance > radius - 1e-9 * system.domain.size.length(), "particle {i} at {distance}");
    }
    Ok(())
}

/// Searches beside all pairs.
const SEARCHES: [NeighborChoice; 3] = [NeighborChoice::Cells, NeighborChoice::Windows, NeighborChoice::Lists];

/// Checks one scene. Returns the number of impacts on walls, and which searches have run it; `None` without a
/// container, and if its events have no end.
fn check(recipe: &Recipe) -> Result<Option<(u64, [bool; 3])>, TestCaseError> {
    let Some(system) = in_container(recipe) else { return Ok(None) };
    let plain =
        Options { neighbors: NeighborChoice::AllPairs, simd: SimdChoice::Portable, ..Options::default() };
    let Some((texts, mut simulation)) = outcome(&system, plain, ENOUGH) else { return Ok(None) };
    let collapsed = texts.last().is_some_and(|text| text.contains("ollapse") || text.contains("overlap"));
    if !collapsed {
        let ledger = simulation.sample().ledger;
        prop_assert!(ledger.residual.abs() < 1e-9, "ledger {:e}", ledger.residual);
        check_inside(&system, &simulation)?;
    }
    let mut has_run = [false; 3];
    for (neighbors, has_run) in SEARCHES.into_iter().zip(&mut has_run) {
        let options = Options { neighbors, ..plain };
        if Simulation::new(system.clone(), options).is_err() {
            continue; // This search cannot run it.
        }
        let found = outcome(&system, options, MOST).map(|(texts, _)| texts);
        prop_assert_eq!(Some(&texts), found.as_ref(), "{:?}", neighbors);
        *has_run = true;
    }
    Ok(Some((simulation.counters().wall_collisions, has_run)))
}

#[test]
#[ignore = "long: scripts/test all"]
fn random_containers_that_shrink_are_in_balance_and_independent_of_search() {
    let counts = std::cell::Cell::new((0, 0, [0; 3]));
    check_each(4, 5, |recipe| {
        let (scenes, impacts, mut runs) = counts.get();
        if let Some((more, has_run)) = check(recipe)? {
            runs.iter_mut().zip(has_run).for_each(|(runs, run)| *runs += u64::from(run));
            counts.set((scenes + 1, impacts + more, runs));
        }
        Ok(())
    });
    let (scenes, impacts, runs) = counts.get();
    println!("{scenes} scenes in containers, {impacts} impacts on walls, {runs:?} runs of {SEARCHES:?}");
    assert!(scenes > 100 && impacts > 20 * scenes, "{scenes} {impacts}");
    assert!(runs.iter().all(|&runs| runs > 10), "{runs:?} runs of {SEARCHES:?}");
}

/// Walls that move with the box to 11 times its edge: windows are made anew before a coordinate is out of
/// range.
#[test]
fn windows_follow_walls_that_move_far() {
    let recipe = Recipe {
        flat: true,
        particles: 21,
        species: 1,
        restitution: 0,
        drive: 2,
        seed: 12_179_184_945_208_638_111,
        ..PLAIN
    };
    let (_, has_run) = check(&recipe).unwrap().unwrap();
    assert!(has_run[1]);
}
