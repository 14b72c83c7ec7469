//! Simple shear of a periodic box (A. W. Lees, S. F. Edwards, J. Phys. C 5, 1921 (1972)).
//!
//! The image of the box across the upper face of the gradient axis is displaced along the flow by γ̇ L t and
//! moves with γ̇ L, for the edge length L of the gradient axis. The mean velocity at the coordinate y along
//! the gradient is then γ̇ y. *Peculiar* velocities c are relative to it; all energies, temperatures and
//! momenta are those of peculiar velocities. In its flight a particle keeps its velocity, so that c changes
//! along the flow by −γ̇ c_y in a unit of time: this is the work of the shear, −γ̇ m c_x c_y. In an impact it
//! is −γ̇ y₁₂ J_x, with the vector r₁₂ of the centers and the impulse J on the second particle. Both together
//! are −γ̇ V P_yx in a unit of time.
//!
//! Images across the faces of the gradient axis are displaced by γ̇ L t, kept as whole edges and a rest from
//! the integer clock, and move with γ̇ L. An anchor keeps the velocity of the lab in its box; wrapping it
//! changes that by γ̇ L. `World::peculiar` has velocities relative to the flow, which all energies are made
//! of. `SHEAR` is a feature that engines are compiled for. Cells are rows that move with the flow
//! (`neighbors::ShearedCells`): all particles get new neighbors when rows have moved by one cell. Windows
//! use coordinates that deform with the flow and repeat with the box (`search/windows/shear`): filters add
//! the tilt to differences, and cells know paths by their chords.

use glam::DVec3;
use haff_neighbors::{Shift, Sliding};

use crate::{
    model::features::Features,
    state::{
        sliding_images::{Displacement, SlidingImages},
        world::World,
    },
};

impl World {
    /// Peculiar velocity of particle i at `ticks`, and its position.
    #[inline]
    pub fn peculiar(&self, i: u32, ticks: i64) -> (DVec3, DVec3) {
        let (position, velocity) = self.state(i, ticks);
        (position, velocity - self.flow_velocity(position))
    }

    /// Velocity of the flow at a position; zero without shear.
    #[inline]
    pub fn flow_velocity(&self, position: DVec3) -> DVec3 {
        self.boundary.shear.as_ref().map_or(DVec3::ZERO, |shear| shear.velocity(position))
    }

    /// The displacement of images at `ticks`; zero without shear.
    pub fn displacement(&self, ticks: i64) -> Displacement {
        match &self.boundary.shear {
            Some(shear) => shear.at(self.clock.instant(ticks)),
            None => Displacement { turns: 0, offset: 0.0 },
        }
    }

    /// Edge vectors of the box at `ticks`.
    pub fn edges(&self, ticks: i64) -> [DVec3; 3] {
        let size = self.boundary.periodicity.size;
        let mut edges = [0, 1, 2].map(|axis| DVec3::AXES[axis] * size[axis]);
        if let Some(shear) = &self.boundary.shear {
            edges[shear.gradient][shear.flow] = self.displacement(ticks).offset;
        }
        edges
    }

    /// The images for a search that is built at the present.
    pub fn sliding_images(&self) -> Option<Sliding> {
        let shear = self.boundary.shear.as_ref()?;
        let Displacement { turns, offset } = self.displacement(self.now);
        let SlidingImages { flow, gradient, speed, .. } = *shear;
        Some(Sliding { flow, gradient, speed, offset, turns, start: self.now, tick: self.clock.tick })
    }

    /// The difference of positions and velocities of a pair at `ticks`, for the image that a search has
    /// found.
    #[inline(always)]
    pub fn image<F: Features>(&self, r: DVec3, v: DVec3, shift: Shift, ticks: i64) -> (DVec3, DVec3) {
        if shift == [0; 3] {
            return (r, v);
        }
        if F::SHEAR
            && let Some(shear) = &self.boundary.shear
            && shift[shear.gradient] != 0
        {
            return self.image_at(shear, r, v, shift, ticks);
        }
        (self.boundary.periodicity.image(r, shift), v)
    }

    #[inline(never)]
    fn image_at(
        &self,
        shear: &SlidingImages,
        r: DVec3,
        mut v: DVec3,
        shift: Shift,
        ticks: i64,
    ) -> (DVec3, DVec3) {
        let Displacement { turns, offset } = self.displacement(ticks);
        let up = f64::from(shift[shear.gradient]);
        let along = i64::from(shift[shear.flow]) + i64::from(shift[shear.gradient]) * turns;
        let mut lengths = shift.map(f64::from);
        lengths[shear.flow] = along as f64;
        let mut moved = DVec3::from_array(lengths) * self.boundary.periodicity.size;
        moved[shear.flow] += up * offset;
        v[shear.flow] += up * shear.speed;
        (r + moved, v)
    }

    /// The difference of positions and velocities of a pair at `ticks`, for the image that is the nearest at
    /// present, when the difference of positions is `present`.
    #[inline(always)]
    pub fn image_of_present(&self, r: DVec3, v: DVec3, present: DVec3, ticks: i64) -> (DVec3, DVec3) {
        if let Some(shear) = &self.boundary.shear
            && 2.0 * present[shear.gradient].abs() > shear.height
        {
            return self.sliding_image_of_present(shear, r, v, present, ticks);
        }
        (r + self.boundary.periodicity.offset(present), v)
    }

    #[inline(never)]
    fn sliding_image_of_present(
        &self,
        shear: &SlidingImages,
        r: DVec3,
        v: DVec3,
        mut present: DVec3,
        ticks: i64,
    ) -> (DVec3, DVec3) {
        let Displacement { turns, offset } = self.displacement(self.now);
        let up = -(present[shear.gradient] / shear.height).round_ties_even();
        present[shear.flow] += up * offset;
        let mut shift = [0, 1, 2].map(|axis| -self.boundary.periodicity.turns(present[axis], axis) as i32);
        shift[shear.gradient] = up as i32;
        shift[shear.flow] -= (up as i64 * turns) as i32;
        self.image_at(shear, r, v, shift, ticks)
    }

    /// The nearest image of a difference of positions at `ticks`, and its velocity. Along the gradient the
    /// image must be nearer than half of the box.
    #[inline(always)]
    pub fn nearest_image(&self, r: DVec3, ticks: i64) -> (DVec3, DVec3) {
        match &self.boundary.shear {
            None => (self.boundary.periodicity.nearest(r), DVec3::ZERO),
            Some(shear) => self.nearest_sliding_image(shear, r, ticks),
        }
    }

    #[inline(never)]
    fn nearest_sliding_image(&self, shear: &SlidingImages, mut r: DVec3, ticks: i64) -> (DVec3, DVec3) {
        let up = -(r[shear.gradient] / shear.height).round_ties_even();
        let mut velocity = DVec3::ZERO;
        if up != 0.0 {
            r[shear.gradient] += up * shear.height;
            r[shear.flow] += up * self.displacement(ticks).offset;
            velocity[shear.flow] = up * shear.speed;
        }
        (self.boundary.periodicity.nearest(r), velocity)
    }

    /// Wraps a position at `ticks` into the box: the position, the number of box lengths, which along the
    /// flow count from the start of the run, and the velocity that has to be added.
    pub fn wrap(&self, mut position: DVec3, ticks: i64) -> (DVec3, [i32; 3], DVec3) {
        let Some(shear) = &self.boundary.shear else {
            let (position, wraps) = self.boundary.periodicity.wrap(position);
            return (position, wraps, DVec3::ZERO);
        };
        let up = self.boundary.periodicity.wrap(position).1[shear.gradient];
        let mut velocity = DVec3::ZERO;
        let mut turned = 0;
        if up != 0 {
            let Displacement { turns, offset } = self.displacement(ticks);
            position[shear.flow] -= f64::from(up) * offset;
            velocity[shear.flow] = -f64::from(up) * shear.speed;
            turned = (i64::from(up) * turns) as i32;
        }
        let (position, mut wraps) = self.boundary.periodicity.wrap(position);
        wraps[shear.flow] -= turned;
        (position, wraps, velocity)
    }

    /// The image numbers of a particle at `ticks` in the box whose edge along the gradient is displaced by at
    /// most half an edge: unwrapped position = position + Σ image · edge.
    pub fn image_in_box(&self, mut image: [i32; 3], ticks: i64) -> [i32; 3] {
        if let Some(shear) = &self.boundary.shear {
            let turns = self.displacement(ticks).turns;
            image[shear.flow] += (i64::from(image[shear.gradient]) * turns) as i32;
        }
        image
    }

    /// The opposite of [`Self::image_in_box`].
    pub fn image_from_box(&self, mut image: [i32; 3], ticks: i64) -> [i32; 3] {
        if let Some(shear) = &self.boundary.shear {
            let turns = self.displacement(ticks).turns;
            image[shear.flow] -= (i64::from(image[shear.gradient]) * turns) as i32;
        }
        image
    }
}
