//! Pistons: walls of finite mass, whose flights change at impacts.

use glam::DVec3;

use crate::{
    model::{Piston, Wall, WallMotion},
    numerics::{
        instant::Instant,
        scalars::{ScalarReader, ScalarWriter},
    },
    state::world::World,
};

impl World {
    /// Whether a wall is a piston.
    #[inline]
    pub fn is_piston(&self, wall: u32) -> bool {
        self.piston(wall).is_some()
    }

    /// The flight of a wall that is a piston.
    #[inline]
    pub fn piston(&self, wall: u32) -> Option<&Piston> {
        self.boundary.walls[wall as usize].piston()
    }

    /// 1/M of a wall [1/mass]: 0 unless it is a piston.
    #[inline]
    pub fn inverse_wall_mass(&self, wall: u32) -> f64 {
        self.piston(wall).map_or(0.0, |piston| 1.0 / piston.mass)
    }

    /// The walls that are pistons.
    pub fn pistons(&self) -> impl Iterator<Item = (u32, &Piston)> {
        self.boundary.pistons.iter().filter_map(|&wall| Some((wall, self.piston(wall)?)))
    }

    /// Starts another flight of a piston at `ticks`, after an impulse on it [mass·length/time].
    pub fn push_piston(&mut self, wall: u32, impulse: DVec3, ticks: i64) {
        let at = self.clock.instant(ticks);
        let wall = &mut self.boundary.walls[wall as usize];
        let normal = wall.normal;
        if let WallMotion::Piston(piston) = &mut wall.motion {
            *piston = piston.restarted(at);
            piston.speed += impulse.dot(normal) / piston.mass;
        }
    }

    /// Reverses the velocities of all pistons now.
    pub fn reverse_pistons(&mut self) {
        for wall in self.boundary.pistons.clone() {
            let now = self.now;
            self.push_piston(wall, DVec3::ZERO, now);
            if let WallMotion::Piston(piston) = &mut self.boundary.walls[wall as usize].motion {
                piston.speed = -piston.speed;
            }
        }
    }

    /// Kinetic energy of all pistons now, and the work of their loads and weights from their given positions
    /// on \[energy\].
    pub fn energies_of_pistons(&self) -> (f64, f64) {
        let now = self.clock.instant(self.now);
        self.pistons().fold((0.0, 0.0), |(kinetic, work), (_, piston)| {
            (kinetic + piston.kinetic(now), work + piston.work(now))
        })
    }

    /// Position of a point of each piston, and its velocity, now.
    pub fn states_of_pistons(&self) -> Vec<[DVec3; 2]> {
        let now = self.clock.instant(self.now);
        let of = |(wall, piston): (u32, &Piston)| {
            let wall = &self.boundary.walls[wall as usize];
            let (displacement, speed) = piston.at(now);
            [wall.point + wall.normal * displacement, wall.normal * speed]
        };
        self.pistons().map(of).collect()
    }

    /// Pistons go on as those of a world that this one replaces: from where they are and as fast as they are
    /// now, unless the change has set another position or another velocity, or the piston is said to begin
    /// now. `walls` are those at the start of the system before the change.
    pub fn pistons_go_on(&mut self, before: &Self, walls: &[Wall]) {
        let now = before.clock.instant(before.now);
        for wall in self.boundary.pistons.clone() {
            let Some(old) = walls.get(wall as usize) else { continue };
            let Wall { point, normal, motion, .. } = &mut self.boundary.walls[wall as usize];
            let WallMotion::Piston(piston) = motion else { continue };
            let begins = std::mem::replace(&mut piston.since, now) == now;
            if begins {
                continue;
            }
            let (Some(start), Some(flight)) = (old.piston(), before.piston(wall)) else { continue };
            let present = flight.restarted(now);
            if (*point, *normal) == (old.point, old.normal) {
                piston.displacement = present.displacement;
                piston.displacement_low = present.displacement_low;
            }
            if piston.speed == start.speed {
                piston.speed = present.speed;
            }
        }
    }

    /// Saves the flights of pistons.
    pub fn save_pistons(&self, scalars: &mut ScalarWriter) {
        for (wall, piston) in self.pistons() {
            for (name, value) in piston.flight() {
                scalars.real(&format!("piston.{wall}.{name}"), value);
            }
        }
    }

    /// Loads the flights of pistons.
    pub fn load_pistons(&mut self, scalars: &mut ScalarReader) {
        for wall in self.boundary.pistons.clone() {
            if let WallMotion::Piston(piston) = &mut self.boundary.walls[wall as usize].motion {
                let values = piston.flight().map(|(name, _)| scalars.real(&format!("piston.{wall}.{name}")));
                let [displacement, displacement_low, speed, high, low] = values;
                let since = Instant { high, low };
                *piston = Piston { displacement, displacement_low, speed, since, ..*piston };
            }
        }
    }
}
