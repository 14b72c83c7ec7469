/*!
Who may meet whom next: the search for partners.

A [`Search`] keeps, for every particle, a coarse *place* that is exact about what it promises: two particles whose
surfaces could touch before either of them changes its place or collides are [candidates](Search::candidates) of
each other. A change of place is a *transfer*: it is predicted and carried out by the search, and never touches
the particle's anchor (position, velocity and time of its last own event). So the kind of search cannot change
a trajectory.

Coordinates are *anchor coordinates*: where the anchor's free flight leads without wrapping. The periodic image of a
pair is given as an integer shift s per axis: the partner's image meant is at r_j + s·L.

[`Cells`] is the search where particles are far apart, [`Lists`] where they are close, [`AllPairs`] the plain twin of
both and the choice for a handful of particles.
*/

mod all_pairs;
mod bins;
mod cells;
mod geometry;
mod lists;
mod memory;
mod packed;
mod shell;
mod walls;

pub use all_pairs::AllPairs;
pub use cells::Cells;
pub use geometry::{Axis, Geometry, Plane};
pub use lists::Lists;
pub use memory::{prefetch, prefetch_at, roomy};
pub use packed::{Offsets, Packed};

use glam::DVec3;

/// Periodic image of a pair: the partner's image stands at r_j + shift · L.
pub type Shift = [i32; 3];

/// Free flight of a particle from where it is now, in anchor coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flight {
    /// Where it is now [length].
    pub position: DVec3,
    /// Its velocity now [length/time].
    pub velocity: DVec3,
    /// Its acceleration [length/time²].
    pub acceleration: DVec3,
}

/// A predicted change of place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transfer {
    /// Time from now [time], ≥ 0.
    pub delay: f64,
    /// What changes; meaningful to the search that made it.
    pub code: u8,
}

/// The search for partners; see the [module's page](self).
pub trait Search: Sync + Send + Sized {
    /// Places all particles. `positions` are in anchor coordinates, now.
    fn new(geometry: &Geometry, positions: &[DVec3]) -> Self;

    /// Calls `visit(j, shift)` for every candidate j of particle i. `position(k)` tells where k is now.
    fn candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(&self, i: u32, position: P, visit: V);

    /// The same for those alone that the transfer `code`, just carried out, has brought near.
    fn new_candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        code: u8,
        position: P,
        visit: V,
    );

    /// All candidates of particle i as one slice, if this search keeps them so, and those of i are.
    #[inline(always)]
    fn packed(&self, i: u32) -> Option<&[Packed]> {
        let _ = i;
        None
    }

    /// Asks for what [`Self::packed`] of particle i will read.
    #[inline(always)]
    fn prefetch(&self, i: u32) {
        let _ = i;
    }

    /// What the images in [`Self::packed`] mean.
    fn offsets(&self) -> Option<&Offsets> {
        None
    }

    /// Indices of the walls that particle i may touch before its next transfer.
    fn walls(&self, i: u32) -> &[u16];

    /// The next transfer of particle i, `None` if it will never need one, or none `within` this time from now [time].
    fn next_transfer(&self, i: u32, flight: &Flight, within: f64) -> Option<Transfer>;

    /// Carries out the transfer. `flight` is that of the particle, now.
    fn transfer(&mut self, i: u32, code: u8, flight: &Flight);

    /// The anchor of particle i has been moved by −wraps · L: its anchor coordinates change, its place does not.
    fn rewrap(&mut self, i: u32, wraps: [i32; 3]);
}
