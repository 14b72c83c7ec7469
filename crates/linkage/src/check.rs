//! Checks of joints against each other and against their system.

use glam::DVec3;
use haff_engine::{Boundary, Instant, System};

use crate::{
    error::LinkageError,
    linear,
    mechanism::{Link, Mechanism},
    model::{Joints, SpringEnd, Tether},
    world::World,
};

/// Tolerance of distances, relative to the length, and of rates, relative to the speeds: numbers in a file
/// are rounded.
const FITS: f64 = 1e-9;

/// Checks joints against their system, as [`crate::Simulation::new`] does.
///
/// # Errors
/// The first error found, with the row of its element.
pub fn check(system: &System, joints: &Joints) -> Result<(), LinkageError> {
    check_elements(system, joints)?;
    with_exact_lengths(system.clone(), joints.clone()).map(|_| ())
}

/// Checks every element separately.
pub(crate) fn check_elements(system: &System, joints: &Joints) -> Result<(), LinkageError> {
    if system.domain.boundary.contains(&Boundary::Periodic) {
        return Err(LinkageError::Unsupported(
            "pendulums, springs, rods and sticking contacts do not work across periodic boundaries; use walls or open axes",
        ));
    }
    if !system.drives.is_empty() || system.drag.is_some() {
        return Err(LinkageError::Unsupported(
            "a drive does not work with pendulums, springs, rods or sticking contacts",
        ));
    }
    if system.contacts.tc > 0.0 {
        return Err(LinkageError::Unsupported(
            "contact.tc does not work with pendulums, springs, rods or sticking contacts: their series of contacts end by themselves",
        ));
    }
    let particles = system.bodies.len();
    let mass = |i: usize| system.classes[system.bodies[i].class as usize].mass;
    let exists = |element, index, particle: usize| {
        if particle < particles {
            Ok(())
        } else {
            Err(LinkageError::NoParticle { element, index, particle, particles })
        }
    };
    let positive = |element, index, key, value: f64| {
        if value > 0.0 && value.is_finite() {
            Ok(())
        } else {
            Err(LinkageError::Parameter {
                element,
                index,
                key,
                value,
                allowed: "must be positive and finite",
            })
        }
    };
    for (index, pendulum) in joints.pendulums.iter().enumerate() {
        positive("pendulum", index, "length", pendulum.length)?;
        exists("pendulum", index, pendulum.bob)?;
        if mass(pendulum.bob) == f64::INFINITY {
            return Err(LinkageError::Ends {
                element: "pendulum",
                index,
                what: "its bob has infinite mass and would not swing",
            });
        }
        if let Some(value) = pendulum.pivot.to_array().into_iter().find(|x| !x.is_finite()) {
            let allowed = "must be finite";
            return Err(LinkageError::Parameter { element: "pendulum", index, key: "pivot", value, allowed });
        }
        let distance = (system.bodies[pendulum.bob].position - pendulum.pivot).length();
        let slack = pendulum.tether == Tether::String && pendulum.slack;
        let fits = (distance - pendulum.length).abs() <= FITS * pendulum.length;
        if !(fits || slack && distance < pendulum.length) {
            return Err(LinkageError::Distance {
                element: "pendulum",
                index,
                distance,
                length: pendulum.length,
                allowed: match (pendulum.tether, slack) {
                    (Tether::Rod, _) => "a rod keeps its bob at its length",
                    (Tether::String, true) => "a string does not stretch",
                    (Tether::String, false) => {
                        "the bob must be at the length of its string, or nearer with slack = true"
                    }
                },
            });
        }
    }
    for (index, spring) in joints.springs.iter().enumerate() {
        positive("spring", index, "stiffness", spring.stiffness)?;
        let value = spring.natural_length;
        if !(value >= 0.0 && value.is_finite()) {
            let allowed = "must be zero or positive, and finite";
            return Err(LinkageError::Parameter { element: "spring", index, key: "length", value, allowed });
        }
        for end in spring.ends {
            match end {
                SpringEnd::Particle(i) => exists("spring", index, i)?,
                SpringEnd::Point(x) => {
                    if let Some(value) = x.to_array().into_iter().find(|x| !x.is_finite()) {
                        let allowed = "must be finite";
                        return Err(LinkageError::Parameter {
                            element: "spring",
                            index,
                            key: "point",
                            value,
                            allowed,
                        });
                    }
                }
            }
        }
        let heavy = |end: SpringEnd| match end {
            SpringEnd::Particle(i) => mass(i) == f64::INFINITY,
            SpringEnd::Point(_) => true,
        };
        if spring.ends[0] == spring.ends[1] {
            return Err(LinkageError::Ends { element: "spring", index, what: "its two ends are the same" });
        }
        if heavy(spring.ends[0]) && heavy(spring.ends[1]) {
            return Err(LinkageError::Ends {
                element: "spring",
                index,
                what: "neither of its ends can move",
            });
        }
    }
    for (index, rod) in joints.rods.iter().enumerate() {
        positive("rod", index, "length", rod.length)?;
        for i in rod.ends {
            exists("rod", index, i)?;
        }
        if rod.ends[0] == rod.ends[1] {
            return Err(LinkageError::Ends { element: "rod", index, what: "its two ends are the same" });
        }
        if mass(rod.ends[0]) == f64::INFINITY && mass(rod.ends[1]) == f64::INFINITY {
            return Err(LinkageError::Ends { element: "rod", index, what: "neither of its ends can move" });
        }
        let distance = (system.bodies[rod.ends[0]].position - system.bodies[rod.ends[1]].position).length();
        if (distance - rod.length).abs() > FITS * rod.length {
            return Err(LinkageError::Distance {
                element: "rod",
                index,
                distance,
                length: rod.length,
                allowed: "the particles must be at its length",
            });
        }
    }
    let groups = system.groups.len();
    for (index, pair) in joints.sticking.iter().enumerate() {
        if let Some(&group) = pair.iter().find(|&&group| group as usize >= groups) {
            return Err(LinkageError::NoParticle {
                element: "sticking",
                index,
                particle: group as usize,
                particles: groups,
            });
        }
        let same = |other: &[u32; 2]| other == pair || (other[1], other[0]) == (pair[0], pair[1]);
        if joints.sticking[..index].iter().any(same) {
            return Err(LinkageError::Twice(pair[0], pair[1]));
        }
    }
    check_carried(system, joints)
}

/// Particles that stick to a moving wall or a moving body of infinite mass move with it permanently; their
/// joints must not be fixed to anything else.
fn check_carried(system: &System, joints: &Joints) -> Result<(), LinkageError> {
    let class = |i: usize| system.classes[system.bodies[i].class as usize];
    let moves = |i: usize| class(i).mass == f64::INFINITY && system.bodies[i].velocity != DVec3::ZERO;
    let mut carried = vec![false; system.groups.len()];
    let mut spread: Vec<u32> =
        (0..system.bodies.len()).filter(|&i| moves(i)).map(|i| class(i).group).collect();
    let walls =
        joints.sticking_to_walls.iter().filter(|[_, wall]| system.walls[*wall as usize].motion.is_moving());
    for &[group, _] in walls {
        carried[group as usize] = true;
        spread.push(group);
    }
    while let Some(from) = spread.pop() {
        for pair in joints.sticking.iter().filter(|pair| pair.contains(&from)) {
            let to = if pair[0] == from { pair[1] } else { pair[0] };
            if !std::mem::replace(&mut carried[to as usize], true) {
                spread.push(to);
            }
        }
    }
    let is_carried = |i: usize| class(i).mass.is_finite() && carried[class(i).group as usize];
    let is_fixed_or_carried = |end: SpringEnd| match end {
        SpringEnd::Particle(i) => class(i).mass == f64::INFINITY || is_carried(i),
        SpringEnd::Point(_) => true,
    };
    let what = "it holds a particle that may stick to a wall or body in motion, which would carry it off; that one must rest";
    let error = |element, index| Err(LinkageError::Ends { element, index, what });
    if let Some(index) = joints.pendulums.iter().position(|pendulum| is_carried(pendulum.bob)) {
        return error("pendulum", index);
    }
    let pulls = |[a, b]: [SpringEnd; 2]| {
        let is_carried = |end| matches!(end, SpringEnd::Particle(i) if is_carried(i));
        (is_carried(a) && is_fixed_or_carried(b)) || (is_carried(b) && is_fixed_or_carried(a))
    };
    if let Some(index) = joints.springs.iter().position(|spring| pulls(spring.ends)) {
        return error("spring", index);
    }
    match joints.rods.iter().position(|rod| pulls(rod.ends.map(SpringEnd::Particle))) {
        Some(index) => error("rod", index),
        None => Ok(()),
    }
}

/// Moves bobs and ends of rods exactly to their lengths, and projects their velocities accordingly.
pub(crate) fn with_exact_lengths(
    mut system: System,
    joints: Joints,
) -> Result<(System, Joints), LinkageError> {
    let mut world = World::new(system.clone(), joints);
    let element = |link: Link| match link {
        Link::Tether(p) => ("pendulum", p),
        Link::Rod(r) => ("rod", r),
        Link::Pair(..) | Link::Wall(..) | Link::Impact => ("contact", 0),
    };
    for p in 0..world.taut.len() {
        world.taut[p] = !world.joints.pendulums[p].slack;
    }
    let bodies: Vec<usize> = (0..world.count()).filter(|&i| !world.immovable(i)).collect();
    let links = world.rigid_links(&bodies);
    let mut mechanism = world.mechanism(&bodies, &links, Instant::ZERO);
    let mut states = world.anchors(&bodies);
    let rows = mechanism.row_states(0.0, &states);
    let mut keep = vec![true; rows.len()];
    for ((row, state), keep) in mechanism.rows.iter().zip(&rows).zip(&mut keep) {
        let (v, w) = (row.a.state(0.0, &states).1, row.b.state(0.0, &states).1);
        let rate = row.sign * state.rate;
        if rate.abs() > FITS * (v.length() + w.length()) {
            // A string may be shortened, but not stretched.
            if row.unilateral && state.rate > 0.0 {
                *keep = false;
            } else {
                let (element, index) = element(row.link);
                return Err(LinkageError::Stretching { element, index, rate });
            }
        }
    }
    let mut kept = keep.iter();
    mechanism.rows.retain(|_| kept.next() == Some(&true));
    check_independence(&mechanism, &states, element)?;
    // States that are exact to the last bit are not changed: the order of contacts may depend on it.
    let exact = mechanism.rows.iter().zip(mechanism.row_states(0.0, &states)).all(|(row, state)| {
        let (r, v) = (row.b.state(0.0, &states), row.a.state(0.0, &states));
        state.gap.abs() <= 4.0 * f64::EPSILON * (r.0 - v.0).length()
            && state.rate.abs() <= 4.0 * f64::EPSILON * (r.1.length() + v.1.length())
    });
    if !exact {
        mechanism.project(0.0, &mut states);
    }
    for (&body, state) in bodies.iter().zip(&states) {
        system.bodies[body].position = state.0;
        system.bodies[body].velocity = state.1;
        if system.dimension == haff_engine::Dimension::Two {
            system.bodies[body].position.z = 0.0;
            system.bodies[body].velocity.z = 0.0;
        }
    }
    Ok((system, world.joints))
}

/// Two-sided constraints must be independent.
fn check_independence(
    mechanism: &Mechanism,
    states: &[(DVec3, DVec3)],
    element: impl Fn(Link) -> (&'static str, usize),
) -> Result<(), LinkageError> {
    let matrix = mechanism.compliance(&mechanism.row_states(0.0, states));
    let n = mechanism.rows.len();
    let mut active = vec![false; n];
    for k in 0..n {
        if mechanism.rows[k].unilateral {
            continue;
        }
        active[k] = true;
        if !linear::solve(&matrix, &vec![0.0; n], &active).1 {
            let (element, index) = element(mechanism.rows[k].link);
            return Err(LinkageError::OverConstrained { element, index });
        }
    }
    Ok(())
}
