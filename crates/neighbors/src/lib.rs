/*!
The search for partners: the pairs of particles that can collide.

A [`Search`] keeps a coarse *cell* for every particle with one guarantee: two particles whose surfaces can
touch before either of them leaves its cell or collides are [candidates](Search::candidates) of each other.
Leaving a cell is a *crossing*: the search predicts it and carries it out, and never changes the particle's
anchor (position, velocity and time of its last own event). So trajectories are independent of the search.

Coordinates are *anchor coordinates*: those of the anchor's free flight, without wrapping. The periodic image
of a pair is given as an integer shift s per axis: the partner's image is at r_j + s·L.

[`Cells`] is the search for any particles, [`AllPairs`] the plain reference and the search for very few.
[`DeformingCells`] and [`DeformingPairs`] are those for boxes that deform, whose images move.
*/

mod all_pairs;
mod array;
mod cells;
mod deforming;
mod geometry;
mod memory;
mod walls;

pub use all_pairs::AllPairs;
pub use array::Array;
pub use cells::Cells;
pub use deforming::{DeformingCells, DeformingPairs};
pub use geometry::{Axis, Deforming, Geometry, Plane, Sliding};
pub use memory::{Elements, prefetch, prefetch_at, with_huge_pages};
pub use walls::beyond_faces;

use glam::DVec3;

/// Periodic image of a pair: the partner's image is at r_j + shift · L. In a box that deforms L is that of
/// the time; under shear the one along the gradient has a component along the flow, the displacement of the
/// image.
pub type Shift = [i32; 3];

/// Free flight of a particle from its present state, in anchor coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flight {
    /// Present position [length].
    pub position: DVec3,
    /// Present velocity [length/time].
    pub velocity: DVec3,
    /// Acceleration [length/time²].
    pub acceleration: DVec3,
    /// The present [ticks].
    pub now: i64,
}

/// A predicted crossing: a particle leaves its cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Time from now [time], ≥ 0.
    pub delay: f64,
    /// Identifies the crossing, for example by the face that is crossed. Only the search that returned it
    /// uses it.
    pub code: u8,
}

/// The search for partners; see the [crate documentation](self).
pub trait Search: Sync + Send + Sized {
    /// Whether all pairs are searched, which is for very few particles.
    const IS_ALL_PAIRS: bool = false;

    /// Assigns cells to all particles. `positions` are the present ones, in anchor coordinates.
    fn new(geometry: &Geometry, positions: &[DVec3]) -> Self;

    /// Calls `visit(j, shift)` for every candidate j of particle i. `position(k)` is the position of k at
    /// `now`, the present \[ticks\].
    fn candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(&self, i: u32, now: i64, position: P, visit: V);

    /// The same, but only for the candidates that the crossing `code` has added. It must be the last
    /// crossing.
    fn new_candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        code: u8,
        now: i64,
        position: P,
        visit: V,
    );

    /// Indices of the walls that particle i can touch before its next crossing.
    fn walls(&self, i: u32) -> &[u16];

    /// The next crossing of particle i: `None` if there is none, or none `within` this time from now [time].
    fn next_crossing(&self, i: u32, flight: &Flight, within: f64) -> Option<Crossing>;

    /// Carries out the crossing `code`. `flight` is the present one of the particle.
    fn cross(&mut self, i: u32, code: u8, flight: &Flight);

    /// The anchor of particle i has been moved by −wraps · L: its anchor coordinates change, its cell does
    /// not.
    fn rewrap(&mut self, i: u32, wraps: [i32; 3]);
}
