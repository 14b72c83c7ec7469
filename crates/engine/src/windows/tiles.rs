/*!
Tiles of space and time, in which the events of a window can be taken one after the other.

What an event changes travels through space no faster than particles do, and from contact to contact. Along d + s θ, with d
a coordinate, θ the part of the window that has passed and s a skew, whatever goes slower than s never goes back. So with
the box cut into slices of d + s θ along each axis, events may be taken slice by slice, and tile by tile: all that a tile depends on has
been taken before it. What they look at stays in the cache. Nothing ever moves faster than s for certain; who does is found out, and
put right ([`super::history`]).

On periodic axes d is the distance from a fixed plane, so that there is no seam.
*/

use super::axes::Axes;

/// Width of tiles, and skew [cells].
const WIDTH: f32 = 4.0;
const SKEW: f32 = 3.0;
/// Largest number of tiles along an axis: their product fits in 16 bits.
const MOST: u32 = 40;

/// How a window is cut into tiles.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Tiles {
    /// Start of the window [ticks], and windows per tick.
    begin: i64,
    per_tick: f32,
    /// Per axis: d is |c − turn|, with c a place in cells, brought below `edge` if that is periodic, …
    edge: [f32; 3],
    turn: [f32; 3],
    /// … which makes a tile after a factor and a shift by the part of the window.
    factor: [f32; 3],
    skew: [f32; 3],
    /// Number of tiles along each axis.
    n: [u32; 3],
}

impl Tiles {
    /// One tile only.
    pub fn none() -> Self {
        Self { n: [1; 3], ..Self::default() }
    }

    /// Tiles for the window from `begin` to `end` [ticks].
    pub fn new(axes: &Axes, begin: i64, end: i64) -> Self {
        let mut tiles = Self { begin, per_tick: 1.0 / (end - begin) as f32, ..Self::none() };
        for axis in 0..3 {
            let cells = axes.n[axis] as f32;
            if axes.n[axis] == 1 {
                continue;
            }
            let periodic = axes.is_periodic(axis);
            // Rounding, at most, puts somebody beyond a bounded edge: a cell is kept for them.
            tiles.edge[axis] = if periodic { cells } else { 0.0 };
            tiles.turn[axis] = if periodic { 0.5 * cells } else { -1.0 };
            let length = if periodic { 0.5 * cells } else { cells + 1.0 } + SKEW;
            tiles.n[axis] = ((length / WIDTH) as u32).clamp(1, MOST);
            tiles.factor[axis] = tiles.n[axis] as f32 / length;
            tiles.skew[axis] = SKEW;
        }
        tiles
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        self.n.iter().product::<u32>() as usize
    }

    /// The tile of an event at `time` [ticks] on the path that would have started the window at `x` [coordinates] with the displacement `v`
    /// [length].
    #[inline(always)]
    pub fn of(&self, axes: &Axes, x: [i32; 3], v: [f32; 3], time: i64) -> u16 {
        let part = (time - self.begin) as f32 * self.per_tick;
        let places = axes.places(x);
        let mut tile = 0;
        for axis in 0..3 {
            let c = places[axis] + v[axis] * part * axes.cells[axis];
            // Beyond an edge by one box at most. Where d is largest there is the edge, and the other side mirrors this one.
            let edge = self.edge[axis];
            let c = if c < 0.0 { c + edge } else { c };
            let c = if c >= edge { c - edge } else { c };
            let d = (c - self.turn[axis]).abs();
            let along = (d + self.skew[axis] * part) * self.factor[axis];
            tile = tile * self.n[axis] + (along.max(0.0) as u32).min(self.n[axis] - 1);
        }
        tile as u16
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use haff_neighbors::{Axis, Geometry};

    use super::*;
    use crate::windows::random::Random;

    #[test]
    fn nobody_slower_than_the_skew_goes_back() {
        let axes = [Axis::Periodic, Axis::Bounded, Axis::Periodic];
        let size = DVec3::new(60.0, 40.0, 90.0);
        let geometry = Geometry {
            size,
            axes,
            reach: 1.0,
            crowding: 1.0,
            radius: 0.5,
            radii: Vec::new(),
            planes: Vec::new(),
        };
        let axes = Axes::new(&geometry, 1.0, 100_000);
        let (begin, end) = (1 << 40, (1 << 40) + (1 << 50));
        let tiles = Tiles::new(&axes, begin, end);
        let mut random = Random(3);
        let mut seen = std::collections::BTreeSet::new();
        for _ in 0..20_000 {
            let x = [0, 1, 2].map(|axis| axes.coordinate(axis, random.uniform(0.0, size[axis])));
            let mut v = [(); 3].map(|()| random.uniform(-0.99, 0.99) as f32 * SKEW);
            if axes.places(x)[1] + v[1] * axes.cells[1] < 0.0 {
                v[1] = -v[1]; // Walls keep everybody inside.
            }
            let mut before = [0; 3];
            for k in 0..=16 {
                let tile = u32::from(tiles.of(&axes, x, v, begin + (end - begin) / 16 * k));
                let along =
                    [tile / (tiles.n[1] * tiles.n[2]), tile / tiles.n[2] % tiles.n[1], tile % tiles.n[2]];
                assert!((0..3).all(|axis| along[axis] >= before[axis]), "{before:?}, {along:?}");
                before = along;
                seen.insert(tile);
            }
        }
        assert!(seen.len() > 9 * tiles.count() / 10, "{} of {}", seen.len(), tiles.count());
    }
}
