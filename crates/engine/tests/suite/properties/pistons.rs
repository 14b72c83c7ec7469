//! Random scenes with pistons: cells find what all pairs find, energies are in balance, and nothing gets
//! through a piston.

use glam::DVec3;
use haff_engine::{
    Boundary, NeighborChoice, Options, Partition, Piston, Shape, SimdChoice, Simulation, System, Wall,
    WallMotion,
};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

use super::{
    Recipe, check_each,
    passages::{ENOUGH, outcome},
    recipe::PLAIN,
};
use crate::common::{Random, features::add_wall};

/// The system of a recipe with one piston or two. `None` if all axes are periodic.
fn with_pistons(recipe: &Recipe) -> Option<System> {
    let plain = Recipe {
        drag: false,
        shear: 0,
        compression: 0,
        changed: false,
        at_kick: false,
        rest: false,
        boundary: recipe
            .boundary
            .map(|kind| if kind == 0 && recipe.seed.is_multiple_of(2) { 1 } else { kind }),
        ..recipe.clone()
    };
    let mut system = plain.build();
    let mut random = Random(recipe.seed ^ 0x7069_7374);
    let axes = 0..system.dimension.count();
    let axis = axes.clone().find(|&axis| system.domain.boundary[axis] != Boundary::Periodic)?;
    let radius = |system: &System, i: usize| system.classes[system.bodies[i].class as usize].radius;
    let count = system.bodies.len();
    let ends = |system: &System, sign: f64| {
        let end = |i: usize| sign * system.bodies[i].position[axis] + radius(system, i);
        sign * (0..count).map(end).fold(f64::NEG_INFINITY, f64::max)
    };
    let (low, high) = (ends(&system, -1.0), ends(&system, 1.0));
    let edge = high - low;
    for k in 0..=random.index(2) {
        let sign = [1.0, -1.0][random.index(2)];
        let normal = DVec3::AXES[axis] * sign;
        // At one end, or two-sided in a gap between the particles that is wide enough.
        let both = k == 0 && random.index(3) == 0;
        let mut at = if sign > 0.0 { low } else { high } - sign * edge * random.uniform(0.01, 0.3);
        if both {
            at = low + edge * random.uniform(0.2, 0.8);
            let near = |i: usize| (system.bodies[i].position[axis] - at).abs() < 1.001 * radius(&system, i);
            if (0..count).any(near) {
                continue;
            }
        }
        let point = DVec3::AXES[axis] * at;
        let largest = system.classes.iter().map(|class| class.mass).filter(|mass| mass.is_finite());
        let mass = largest.fold(1e-3, f64::max) * 10.0_f64.powf(random.uniform(-1.0, 3.0));
        let force = [0.0, mass * random.uniform(-0.1, 2.0)][random.index(2)];
        let speed = [0.0, random.uniform(-0.5, 0.5)][random.index(2)];
        let motion = WallMotion::Piston(Piston::new(mass, force, speed, (normal, system.domain.gravity)));
        let shape = both.then_some(Shape::Partition(Partition { point, normal, hole: None }));
        add_wall(&mut system, Wall { name: format!("piston {k}"), point, normal, motion, shape });
    }
    (system.piston_count() > 0).then_some(system)
}

/// Checks that no particle is in a piston or beyond it.
fn check_sides(system: &System, simulation: &Simulation) -> Result<(), TestCaseError> {
    let frame = simulation.frame();
    for (wall, [position, _]) in system.pistons().map(|(wall, _)| &system.walls[wall]).zip(&frame.pistons) {
        for (i, body) in system.bodies.iter().enumerate() {
            let class = &system.classes[body.class as usize];
            let height = |position: DVec3, point: DVec3| (position - point).dot(wall.normal);
            let start = height(body.position, wall.point);
            let now = height(frame.position[i], *position)
                * if wall.shape.is_some() { start.signum() } else { 1.0 };
            let scale = class.radius + position.abs().max_element() + system.domain.size.max_element();
            prop_assert!(now > class.radius - 1e-9 * scale, "particle {i} at {now} of {}", class.radius);
        }
    }
    Ok(())
}

/// Checks one scene. Returns the number of impacts on walls; `None` without pistons, and if its events have
/// no end.
fn check(recipe: &Recipe) -> Result<Option<u64>, TestCaseError> {
    let Some(system) = with_pistons(recipe) else { return Ok(None) };
    let mut found = Vec::new();
    for (neighbors, simd) in
        [(NeighborChoice::AllPairs, SimdChoice::Portable), (NeighborChoice::Cells, SimdChoice::Auto)]
    {
        let options = Options { neighbors, simd, ..Options::default() };
        let Some((texts, mut simulation)) = outcome(&system, options, ENOUGH) else { return Ok(None) };
        let collapsed = texts.last().is_some_and(|text| text.contains("ollapse") || text.contains("overlap"));
        if !collapsed {
            let ledger = simulation.sample().ledger;
            prop_assert!(ledger.residual.abs() < 1e-9, "ledger {:e}", ledger.residual);
            check_sides(&system, &simulation)?;
        }
        found.push((texts, simulation.counters().wall_collisions));
    }
    prop_assert_eq!(&found[0], &found[1]);
    Ok(Some(found[0].1))
}

#[test]
#[ignore = "long: scripts/test all"]
fn random_pistons_are_in_balance_and_independent_of_search() {
    let counts = std::cell::Cell::new([0, 0]);
    check_each(4, 3, |recipe| {
        let [scenes, impacts] = counts.get();
        if let Some(more) = check(recipe)? {
            counts.set([scenes + 1, impacts + more]);
        }
        Ok(())
    });
    let [scenes, impacts] = counts.get();
    println!("{scenes} scenes with pistons, {impacts} impacts on walls");
    assert!(scenes > 100 && impacts > 20 * scenes, "{scenes} {impacts}");
}

/// A grain that an oscillating wall carries, and a piston that bounces on a fixed body.
#[test]
fn contacts_of_a_carried_grain_follow_the_impacts_on_the_piston() {
    let recipe = Recipe {
        boundary: [1, 2, 2],
        particles: 48,
        species: 2,
        restitution: 2,
        gravity: true,
        ramp: 2,
        fixed: true,
        tc: true,
        corner: true,
        seed: 10_557_759_970_363_737_621,
        ..PLAIN
    };
    assert!(check(&recipe).unwrap().unwrap() > 5000);
}
