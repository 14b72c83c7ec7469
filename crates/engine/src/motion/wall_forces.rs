//! The force on each wall and the heat that it gives, as means over the time between samples.

use glam::DVec3;

use crate::{
    numerics::total::total,
    report::sample::Sample,
    state::{particle::Support, wall_sums::WallSum, world::World},
};

impl World {
    /// Adds an impulse on a particle by a wall, and an energy given to it in the frame of the wall, to the
    /// sums of the wall, if these are measured.
    #[inline]
    pub fn add_from_wall(&mut self, wall: u32, impulse: DVec3, energy: f64) {
        if let Some(sums) = &mut self.boundary.wall_sums {
            sums.add(wall, impulse, energy);
        }
    }

    /// [`Self::add_from_wall`] for an impulse alone.
    #[inline]
    pub fn add_wall_impulse(&mut self, wall: u32, impulse: DVec3) {
        self.add_from_wall(wall, impulse, 0.0);
    }

    /// [`Self::add_from_wall`] for an energy alone.
    #[inline]
    pub fn add_wall_heat(&mut self, wall: u32, energy: f64) {
        self.add_from_wall(wall, DVec3::ZERO, energy);
    }

    /// Adds the force by which walls support particle i from `ticks` on to the sums of the walls, or takes it
    /// off (`sign` −1), if these are measured.
    pub fn change_support_of_walls(&mut self, i: u32, sign: f64, ticks: i64) {
        let class = *self.class(i);
        if self.boundary.wall_sums.is_none() || class.inverse_mass == 0.0 {
            return;
        }
        let force = class.mass * (self.acceleration(i) - self.gravity);
        let shares = self.shares(self.support(i), force);
        let time = self.clock.shown(ticks);
        if let Some(sums) = &mut self.boundary.wall_sums {
            sums.change_support(shares.into_iter(), sign, time);
        }
    }

    /// Adds an impulse on a particle by the walls that support it to the sums of these walls, if these are
    /// measured.
    pub fn add_support_impulse(&mut self, support: Support, impulse: DVec3) {
        if self.boundary.wall_sums.is_some() {
            for (wall, share) in self.shares(support, impulse) {
                self.add_wall_impulse(u32::from(wall), share);
            }
        }
    }

    /// The shares of the walls of `support` in a vector along their normals.
    fn shares(&self, support: Support, vector: DVec3) -> Vec<(u16, DVec3)> {
        let walls: Vec<u16> = support.into_iter().flatten().collect();
        let normals: Vec<DVec3> =
            walls.iter().map(|&wall| self.boundary.walls[usize::from(wall)].normal).collect();
        shares(&normals, vector).into_iter().map(|(k, share)| (walls[k], share)).collect()
    }

    /// Adds to a sample the force on each wall and the heat that it gives, as means since the previous
    /// sample.
    pub fn complete_walls(&mut self, time: f64, sample: &mut Sample) {
        let Some(mut sums) = self.boundary.wall_sums.take() else { return };
        let carried = self.carried_by_wall();
        let span = sums.sampled_at.map_or(0.0, |at| time - at);
        let mean = |value: f64| if span > 0.0 { value / span } else { f64::NAN };
        sample.wall_force.clear();
        sample.wall_heat_flow.clear();
        for (wall, carried) in sums.walls.iter_mut().zip(carried) {
            let by_impacts = DVec3::from_array([0, 1, 2].map(|axis| wall.given.value(axis)));
            let impulse = by_impacts + wall.support.impulse_until(time) + (carried - wall.carried);
            sample.wall_force.push(DVec3::from_array((-impulse).to_array().map(mean)));
            sample.wall_heat_flow.push(mean(wall.given.value(3)));
            let total = wall.support.total;
            *wall = WallSum { carried, ..WallSum::default() };
            (wall.support.total, wall.support.until) = (total, time);
        }
        sums.sampled_at = Some(time);
        self.boundary.wall_sums = Some(sums);
    }

    /// Momentum along its normal that each wall has given to the grains that it carries.
    pub fn carried_by_wall(&self) -> Vec<DVec3> {
        let carries =
            |wall: u32| self.boundary.carries && self.boundary.walls[wall as usize].motion.carries();
        (0..self.boundary.walls.len() as u32)
            .map(|wall| {
                if !carries(wall) {
                    return DVec3::ZERO;
                }
                let plane = &self.boundary.walls[wall as usize];
                let [mass] = total(self.particles.len(), |i| {
                    [if self.carrier(i) == Some(wall) { self.class(i).mass } else { 0.0 }]
                });
                mass * plane.motion.velocity(plane.normal, (&self.clock, self.now))
            })
            .collect()
    }
}

/// The components of a vector along at most three normals that span it: (index of the normal, component). Of
/// several possible ones the first, with as few normals as possible, whose components point along the
/// normals.
fn shares(normals: &[DVec3], vector: DVec3) -> Vec<(usize, DVec3)> {
    let noise = 1e-12 * vector.length();
    if vector == DVec3::ZERO {
        return Vec::new();
    }
    for (k, &n) in normals.iter().enumerate() {
        let along = n * n.dot(vector);
        if (vector - along).length() <= noise {
            return vec![(k, along)];
        }
    }
    for (k, &n) in normals.iter().enumerate() {
        for (l, &m) in normals.iter().enumerate().skip(k + 1) {
            let (cosine, a, b) = (n.dot(m), n.dot(vector), m.dot(vector));
            let determinant = 1.0 - cosine * cosine;
            if determinant > 0.0 {
                let (a, b) = ((a - cosine * b) / determinant, (b - cosine * a) / determinant);
                if (vector - a * n - b * m).length() <= noise {
                    return vec![(k, a * n), (l, b * m)];
                }
            }
        }
    }
    if let &[n, m, l] = normals {
        let volume = n.dot(m.cross(l));
        if volume != 0.0 {
            let parts = [m.cross(l), l.cross(n), n.cross(m)].map(|area| area.dot(vector) / volume);
            return vec![(0, parts[0] * n), (1, parts[1] * m), (2, parts[2] * l)];
        }
    }
    // Walls that do not span it: the rounding errors of parallel walls.
    normals.first().map(|_| (0, vector)).into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_weight_is_shared_by_the_walls_that_support_it() {
        let up = DVec3::new(0.0, 0.0, 2.0);
        assert_eq!(shares(&[DVec3::X, DVec3::Z], up), [(1, up)]);
        let valley = [DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.6, 0.0, 0.8)];
        let found = shares(&valley, up);
        assert_eq!(found.iter().map(|(k, _)| *k).collect::<Vec<_>>(), [0, 1]);
        for (k, share) in &found {
            assert!((*share - 1.25 * valley[*k]).length() < 1e-15, "{share}");
        }
        let corner = [DVec3::X, DVec3::new(0.0, 0.6, 0.8), DVec3::new(0.0, -0.6, 0.8)];
        let vector = DVec3::new(1.0, 0.0, 2.0);
        let sum: DVec3 = shares(&corner, vector).into_iter().map(|(_, share)| share).sum();
        assert!((sum - vector).length() < 1e-15);
    }
}
