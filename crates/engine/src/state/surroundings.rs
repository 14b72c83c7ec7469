//! What is around the particles: the box with its images, and walls.

use glam::DVec3;

use crate::{
    model::{System, Wall, WallLaw},
    state::{deformation::Deformation, periodicity::Periodicity, wall_sums::WallSums},
};

/// The box and the walls.
#[derive(Debug, Clone)]
pub(crate) struct Surroundings {
    /// Edge lengths of the box, and its periodic images.
    pub periodicity: Periodicity,
    /// How the box deforms.
    pub deformation: Option<Deformation>,
    pub walls: Vec<Wall>,
    /// For each wall, whether it is at rest, under gravity, and perpendicular to an axis, see
    /// `World::is_level`.
    pub level: Vec<bool>,
    /// The walls that are pistons, by their indices.
    pub pistons: Vec<u32>,
    /// Whether a wall can carry grains: it oscillates, and does not reflect all of them elastically or
    /// thermally.
    pub carries: bool,
    /// Forces on walls, if they are measured.
    pub wall_sums: Option<Box<WallSums>>,
}

impl Surroundings {
    pub fn of(system: &System) -> Self {
        let deformation = Deformation::of(system);
        let mut periodicity = Periodicity::of(&system.domain);
        if deformation.is_some_and(|images| images.stretches()) {
            // Nothing is certain before the first search is made.
            periodicity.certain = DVec3::ZERO;
        }
        Self {
            periodicity,
            deformation,
            walls: system.walls.clone(),
            level: system.walls.iter().map(|wall| is_level(wall, system.domain.gravity)).collect(),
            pistons: system.pistons().map(|(wall, _)| wall as u32).collect(),
            carries: can_carry(system),
            wall_sums: system.measure.wall_forces.then(|| Box::new(WallSums::new(system.walls.len()))),
        }
    }
}

impl Surroundings {
    /// The same for a block, which keeps what walls give in its step.
    pub fn of_block(&self) -> Self {
        let wall_sums = self.wall_sums.as_ref().map(|_| Box::new(WallSums::of_block()));
        let (walls, level, pistons) = (self.walls.clone(), self.level.clone(), self.pistons.clone());
        Self { walls, level, pistons, wall_sums, ..*self }
    }
}

fn is_level(wall: &Wall, gravity: DVec3) -> bool {
    gravity != DVec3::ZERO
        && !wall.motion.is_moving()
        && wall.shape.is_none()
        && wall.normal.abs().max_element() == 1.0
}

/// Whether a wall can carry grains: it oscillates, and grains bounce on it with losses.
pub(crate) fn can_carry(system: &System) -> bool {
    let walls = system.walls.len();
    (0..walls)
        .filter(|&wall| system.walls[wall].motion.carries())
        .any(|wall| system.contacts.wall.iter().skip(wall).step_by(walls).any(WallLaw::has_series))
}
