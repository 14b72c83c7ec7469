//! Every particle is a candidate of every other.

use glam::DVec3;

use crate::{Axis, Crossing, Flight, Geometry, Search, Shift};

/**
All pairs: O(N) candidates, for very few particles and as the reference for every other search.

Along a periodic axis each pair is given with its two nearest images, at distances d and L − d. A third could
touch only after the two have moved by L − reach relative to each other. So the candidates of a particle are
searched again (its *crossing*) when it has moved by a third of this distance since its last search. Of two
particles, the one whose candidates were searched last has moved by at most one third since then, and the
other by at most two thirds.
*/
#[derive(Debug, Clone)]
pub struct AllPairs {
    lengths: [f64; 3],
    periodic: [bool; 3],
    /// Distance along a periodic axis after which the candidates are searched again [length].
    stride: [f64; 3],
    count: u32,
    walls: Vec<u16>,
}

impl AllPairs {
    /// The two nearest images along each periodic axis.
    fn images(&self, from: DVec3, to: DVec3, mut visit: impl FnMut(Shift)) {
        let d = (to - from).to_array();
        let range = |axis: usize| {
            if !self.periodic[axis] {
                return 0..=0;
            }
            // −d/L is between the shifts of the two nearest images, one on each side.
            let low = (-d[axis] / self.lengths[axis]).floor() as i32;
            low..=low + 1
        };
        for x in range(0) {
            for y in range(1) {
                for z in range(2) {
                    visit([x, y, z]);
                }
            }
        }
    }
}

impl Search for AllPairs {
    const IS_ALL_PAIRS: bool = true;

    fn new(geometry: &Geometry, positions: &[DVec3]) -> Self {
        let lengths = geometry.lengths();
        let periodic = geometry.axes.map(|axis| axis == Axis::Periodic);
        Self {
            lengths,
            periodic,
            stride: lengths.map(|length| (length - geometry.reach).max(length * 1e-3) / 3.0),
            count: positions.len() as u32,
            walls: (0..geometry.planes.len() as u16).collect(),
        }
    }

    fn candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        _now: i64,
        position: P,
        mut visit: V,
    ) {
        let from = if self.periodic.contains(&true) { Some(position(i)) } else { None };
        for j in (0..self.count).filter(|&j| j != i) {
            match from {
                Some(from) => self.images(from, position(j), |shift| visit(j, shift)),
                None => visit(j, [0; 3]),
            }
        }
    }

    fn new_candidates<P: Fn(u32) -> DVec3, V: FnMut(u32, Shift)>(
        &self,
        i: u32,
        _code: u8,
        now: i64,
        position: P,
        visit: V,
    ) {
        self.candidates(i, now, position, visit);
    }

    fn walls(&self, _i: u32) -> &[u16] {
        &self.walls
    }

    fn next_crossing(&self, _i: u32, flight: &Flight, _within: f64) -> Option<Crossing> {
        // There is no acceleration along a periodic axis.
        let speed = flight.velocity.to_array();
        let delay = (0..3)
            .filter(|&axis| self.periodic[axis] && speed[axis] != 0.0)
            .map(|axis| self.stride[axis] / speed[axis].abs())
            .reduce(f64::min)?;
        Some(Crossing { delay, code: 0 })
    }

    fn cross(&mut self, _i: u32, _code: u8, _flight: &Flight) {}

    fn rewrap(&mut self, _i: u32, _wraps: [i32; 3]) {}
}
