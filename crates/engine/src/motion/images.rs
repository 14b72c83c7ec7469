//! Images of a box that deforms: of position differences of pairs, and of positions at faces.
//!
//! Edges are linear in time, h(t) = (I + A t) h₀, so that images move at constant velocities
//! (`state/deformation.rs`). The flow at a position x is G x; *peculiar* velocities c = v − G x are
//! relative to it; all energies, temperatures and momenta are those of peculiar velocities. An anchor keeps
//! the velocity of the lab in its box; wrapping it by n boxes changes that by −A h₀ n. In its flight a
//! particle keeps its velocity, so that c changes by −G c in a unit of time: this is the work of the flow,
//! −m c·G c. In an impact it is −J·G r, with the vector r between the centers and the impulse J on the
//! second particle. Both together are −V P : G in a unit of time.
//!
//! Simple shear (A. W. Lees, S. F. Edwards, J. Phys. C 5, 1921 (1972)): images across the faces of the
//! gradient axis are displaced along the flow by γ̇ L t, kept as whole edges and a rest from the integer
//! clock, and move with γ̇ L. Compression: images along each axis move with the edge.
//!
//! `DEFORMS` is a feature that engines are compiled for. Cells move with the box
//! (`neighbors::DeformingCells`); under shear they are rows that move with the flow: all particles get new
//! neighbors when rows have moved by one cell. Searches are made again when an edge has changed by a
//! twentieth. Windows use coordinates that deform with the flow and repeat with the box
//! (`search/windows/moving`): filters add the tilt to differences, and cells know paths by their chords.

use glam::DVec3;
use haff_neighbors::{Deforming, Shift, Sliding};

use crate::{
    model::features::Features,
    numerics::clock::LONGEST,
    state::{
        deformation::Deformation,
        periodicity::{Periodicity, nearest_integers},
        sliding_images::{Displacement, SlidingImages},
        world::World,
    },
};

impl World {
    /// Peculiar velocity of particle i at `ticks`, and its position.
    #[inline]
    pub fn peculiar(&self, i: u32, ticks: i64) -> (DVec3, DVec3) {
        let (position, velocity) = self.state(i, ticks);
        (position, velocity - self.flow_velocity(position, ticks))
    }

    /// Velocity of the flow at a position and at `ticks`; zero if the box does not deform.
    #[inline]
    pub fn flow_velocity(&self, position: DVec3, ticks: i64) -> DVec3 {
        let deformation = self.boundary.deformation.as_ref();
        deformation.map_or(DVec3::ZERO, |images| images.velocity(position, self.clock.time(ticks)))
    }

    /// The weight of an impact at `ticks` in means of the pressure; 1 if edges do not change.
    pub fn pressure_weight(&self, ticks: i64) -> f64 {
        let images = self.boundary.deformation.as_ref().filter(|images| images.stretches());
        images.map_or(1.0, |images| images.weight(self.clock.time(ticks)))
    }

    /// The images of a sheared box.
    #[inline]
    pub fn shear(&self) -> Option<&SlidingImages> {
        self.boundary.deformation.as_ref()?.sliding.as_ref()
    }

    /// The displacement of images at `ticks`; zero without shear.
    pub fn displacement(&self, ticks: i64) -> Displacement {
        match self.shear() {
            Some(shear) => shear.at(self.clock.instant(ticks)),
            None => Displacement { turns: 0, offset: 0.0 },
        }
    }

    /// The periodic images at `ticks`, without the displacement of a shear.
    #[inline]
    pub fn periodicity(&self, ticks: i64) -> Periodicity {
        match &self.boundary.deformation {
            Some(images) if images.stretches() => {
                self.boundary.periodicity.with_edges(images.edges(self.clock.time(ticks)))
            }
            _ => self.boundary.periodicity,
        }
    }

    /// Edge vectors of the box at `ticks`.
    pub fn edges(&self, ticks: i64) -> [DVec3; 3] {
        let size = self.periodicity(ticks).size;
        let mut edges = [0, 1, 2].map(|axis| DVec3::AXES[axis] * size[axis]);
        if let Some(shear) = self.shear() {
            edges[shear.gradient][shear.flow] = self.displacement(ticks).offset;
        }
        edges
    }

    /// The images for a search that is built at the present.
    pub fn moving_images(&self) -> Option<Deforming> {
        let images = self.boundary.deformation.as_ref()?;
        let sliding = images.sliding.as_ref().map(|&SlidingImages { flow, gradient, speed, .. }| {
            let Displacement { turns, offset } = self.displacement(self.now);
            Sliding { flow, gradient, speed, offset, turns }
        });
        let horizon = images.horizon(self.clock.time(self.now));
        Some(Deforming { sliding, speeds: images.speeds, start: self.now, tick: self.clock.tick, horizon })
    }

    /// The time after a `delay` \[time\], after the present and within an epoch [ticks].
    pub fn after(&self, delay: f64) -> i64 {
        let end = (self.now as f64 + delay * self.clock.per_time).min(LONGEST);
        (end as i64).max(self.now + 1)
    }

    /// Prepares for searches that are made at the present. Returns until when they may be used \[ticks\];
    /// under shear this holds for lists.
    pub fn begin_horizon(&mut self) -> i64 {
        let Some(images) = self.boundary.deformation else { return i64::MAX };
        let time = self.clock.time(self.now);
        let horizon = images.horizon(time);
        let end = self.after(horizon);
        if !images.stretches() {
            return end;
        }
        // Beyond the horizon by more than events are rounded.
        let later = time + 1.01 * horizon;
        let certain = images.edges(time).min(images.edges(later)) * (1.0 - 1e-9);
        let periodicity = &mut self.boundary.periodicity;
        for axis in (0..3).filter(|&axis| periodicity.is_periodic[axis]) {
            periodicity.certain[axis] = certain[axis];
        }
        end
    }

    /// The difference of positions and velocities of a pair at `ticks`, for the image that a search has
    /// found.
    #[inline(always)]
    pub fn image<F: Features>(&self, r: DVec3, v: DVec3, shift: Shift, ticks: i64) -> (DVec3, DVec3) {
        if shift == [0; 3] {
            return (r, v);
        }
        if F::DEFORMS
            && let Some(images) = &self.boundary.deformation
            && images.sliding.is_none_or(|shear| shift[shear.gradient] != 0)
        {
            return self.image_at(images, r, v, shift, ticks);
        }
        (self.boundary.periodicity.image(r, shift), v)
    }

    #[inline(never)]
    fn image_at(
        &self,
        images: &Deformation,
        r: DVec3,
        mut v: DVec3,
        shift: Shift,
        ticks: i64,
    ) -> (DVec3, DVec3) {
        let mut lengths = shift.map(f64::from);
        let Some(shear) = &images.sliding else {
            let edges = self.periodicity(ticks).size;
            let shift = DVec3::from_array(lengths);
            return (r + shift * edges, v + shift * images.speeds);
        };
        let Displacement { turns, offset } = self.displacement(ticks);
        let up = f64::from(shift[shear.gradient]);
        let along = i64::from(shift[shear.flow]) + i64::from(shift[shear.gradient]) * turns;
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
        if let Some(images) = &self.boundary.deformation {
            match &images.sliding {
                Some(shear) if 2.0 * present[shear.gradient].abs() > shear.height => {
                    return self.sliding_image_of_present(images, shear, r, v, present, ticks);
                }
                None => {
                    if (2.0 * present.abs()).cmple(self.boundary.periodicity.certain).all() {
                        return (r, v);
                    }
                    return self.stretched_image_of_present(images, r, v, present, ticks);
                }
                _ => {}
            }
        }
        (r + self.boundary.periodicity.offset(present), v)
    }

    #[inline(never)]
    fn sliding_image_of_present(
        &self,
        images: &Deformation,
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
        self.image_at(images, r, v, shift, ticks)
    }

    #[inline(never)]
    fn stretched_image_of_present(
        &self,
        images: &Deformation,
        r: DVec3,
        v: DVec3,
        present: DVec3,
        ticks: i64,
    ) -> (DVec3, DVec3) {
        let [now, then] = [self.now, ticks].map(|ticks| images.edges(self.clock.time(ticks)));
        let shift = -nearest_integers(present / now);
        // Edges of axes that are not periodic are infinite.
        let edges = DVec3::select(shift.cmpeq(DVec3::ZERO), DVec3::ZERO, then);
        (r + shift * edges, v + shift * images.speeds)
    }

    /// The nearest image of a difference of positions at `ticks`, and its velocity. Along the gradient the
    /// image must be nearer than half of the box.
    #[inline(always)]
    pub fn nearest_image(&self, r: DVec3, ticks: i64) -> (DVec3, DVec3) {
        match &self.boundary.deformation {
            None => (self.boundary.periodicity.nearest(r), DVec3::ZERO),
            Some(images) => self.nearest_moving_image(images, r, ticks),
        }
    }

    #[inline(never)]
    fn nearest_moving_image(&self, images: &Deformation, mut r: DVec3, ticks: i64) -> (DVec3, DVec3) {
        let mut velocity = DVec3::ZERO;
        let Some(shear) = &images.sliding else {
            if (2.0 * r.abs()).cmple(self.boundary.periodicity.certain).all() {
                return (r, velocity);
            }
            let periodicity = self.periodicity(ticks);
            let shift = DVec3::from_array(periodicity.nearest_shift(r).map(f64::from));
            return (r + shift * periodicity.size, shift * images.speeds);
        };
        let up = -(r[shear.gradient] / shear.height).round_ties_even();
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
        let Some(images) = &self.boundary.deformation else {
            let (position, wraps) = self.boundary.periodicity.wrap(position);
            return (position, wraps, DVec3::ZERO);
        };
        let Some(shear) = &images.sliding else {
            let (position, wraps) = self.periodicity(ticks).wrap(position);
            return (
                position,
                wraps,
                images.speeds * DVec3::from_array(wraps.map(|turns| -f64::from(turns))),
            );
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
        if let Some(shear) = self.shear() {
            let turns = self.displacement(ticks).turns;
            image[shear.flow] += (i64::from(image[shear.gradient]) * turns) as i32;
        }
        image
    }

    /// The opposite of [`Self::image_in_box`].
    pub fn image_from_box(&self, mut image: [i32; 3], ticks: i64) -> [i32; 3] {
        if let Some(shear) = self.shear() {
            let turns = self.displacement(ticks).turns;
            image[shear.flow] -= (i64::from(image[shear.gradient]) * turns) as i32;
        }
        image
    }
}
