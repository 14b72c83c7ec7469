//! Points in the bins of grids, one grid per range of sizes. Finds the points within a distance of a
//! position.

use crate::{Axis, Geometry, Shift, cells::grid, memory::with_huge_pages};

/// No particle.
const NONE: u32 = u32::MAX;
/// Particles whose radii differ by at most this factor share a grid.
const SIZE_STEP: f64 = 2.0;
/// Largest number of grids.
const MAX_LEVELS: usize = 32;

/// A point: its position, inside the box along periodic axes, and its image in anchor coordinates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Point {
    pub position: [f64; 3],
    pub image: Shift,
    /// The next point of the same bin.
    next: u32,
}

/// One grid, for particles of similar size.
#[derive(Debug, Clone)]
pub(crate) struct Level {
    /// Bins per axis.
    pub n: [i32; 3],
    /// Width of a bin [length].
    pub width: [f64; 3],
    inverse: [f64; 3],
    /// First point of each bin.
    head: Vec<u32>,
    /// Largest radius of its particles [length].
    radius: f64,
}

/**
Points in bins. A bin is a linked list; it takes four bytes, the index of its first point.

Particles of very different sizes are in grids of different widths. With one grid, a single large particle
would require a long range, and the search of a small particle would visit thousands of small ones.
*/
#[derive(Debug, Clone)]
pub(crate) struct Bins {
    axes: [Axis; 3],
    lengths: [f64; 3],
    pub points: Vec<Point>,
    pub levels: Vec<Level>,
    /// Level of each particle; empty if there is only one.
    level: Vec<u8>,
}

impl Bins {
    /// Bins for particles at `positions`. `skin` is the range of a search beyond the radii \[length\].
    pub fn new(geometry: &Geometry, positions: &[glam::DVec3], skin: f64) -> Self {
        let mut bins = Self {
            axes: geometry.axes,
            lengths: geometry.lengths(),
            points: Vec::new(),
            levels: Vec::new(),
            level: Vec::new(),
        };
        let mut radii = vec![(geometry.reach / 2.0, positions.len())];
        if !geometry.radii.is_empty() {
            let least = geometry.radii.iter().copied().fold(f64::INFINITY, f64::min);
            let level = |radius: f64| ((radius / least).log(SIZE_STEP) as usize).min(MAX_LEVELS - 1);
            let mut found = vec![(0.0, 0); MAX_LEVELS];
            for &radius in &geometry.radii {
                let entry: &mut (f64, usize) = &mut found[level(radius)];
                *entry = (entry.0.max(radius), entry.1 + 1);
            }
            let used: Vec<usize> = (0..MAX_LEVELS).filter(|&level| found[level].1 > 0).collect();
            if used.len() > 1 {
                let rank = |radius| used.partition_point(|&other| other < level(radius)) as u8;
                bins.level = geometry.radii.iter().map(|&radius| rank(radius)).collect();
            }
            radii = used.into_iter().map(|level| found[level]).collect();
        }
        for (radius, count) in radii {
            // About one point per bin: wider bins would contain more points out of range.
            let least = 0.25 * (2.0 * radius + skin);
            let (n, width) = grid(&Geometry { reach: least, ..geometry.without_planes() }, count / 2);
            let bins_of_level = n.iter().map(|&n| n as usize).product();
            let inverse = width.map(|width| 1.0 / width);
            bins.levels.push(Level { n, width, inverse, head: vec![NONE; bins_of_level], radius });
        }
        let mut points = with_huge_pages(positions.len());
        points.extend(positions.iter().map(|position| bins.point(*position)));
        bins.points = points;
        for i in 0..positions.len() as u32 {
            bins.insert(i);
        }
        bins
    }

    /// The point for a position in anchor coordinates.
    #[inline]
    pub fn point(&self, position: glam::DVec3) -> Point {
        let mut position = position.to_array();
        let mut image = [0; 3];
        for axis in 0..3 {
            let length = self.lengths[axis];
            if self.axes[axis] == Axis::Periodic && !(0.0..length).contains(&position[axis]) {
                let turns = (position[axis] / length).floor();
                position[axis] = (position[axis] - turns * length).clamp(0.0, length);
                image[axis] = turns as i32;
            }
        }
        Point { position, image, next: NONE }
    }

    #[inline]
    fn level_of(&self, i: u32) -> usize {
        if self.level.is_empty() { 0 } else { usize::from(self.level[i as usize]) }
    }

    /// Bin coordinate along an axis, not folded into the grid.
    #[inline]
    fn coordinate(level: &Level, axis: usize, x: f64) -> i64 {
        floor(x * level.inverse[axis])
    }

    /// Index of the bin of a point.
    #[inline]
    pub fn bin(&self, level: &Level, position: [f64; 3]) -> usize {
        let mut cell = [0; 3];
        for axis in 0..3 {
            let n = i64::from(level.n[axis]);
            let c = Self::coordinate(level, axis, position[axis]);
            cell[axis] = match self.axes[axis] {
                Axis::Flat => 0,
                Axis::Open => c.rem_euclid(n),
                Axis::Periodic | Axis::Bounded => c.clamp(0, n - 1),
            } as usize;
        }
        index(level, cell)
    }

    fn insert(&mut self, i: u32) {
        let level = self.level_of(i);
        let bin = self.bin(&self.levels[level], self.points[i as usize].position);
        let head = &mut self.levels[level].head[bin];
        self.points[i as usize].next = *head;
        *head = i;
    }

    fn remove(&mut self, i: u32) {
        let level = self.level_of(i);
        let bin = self.bin(&self.levels[level], self.points[i as usize].position);
        let next = self.points[i as usize].next;
        let mut at = self.levels[level].head[bin];
        if at == i {
            self.levels[level].head[bin] = next;
            return;
        }
        while at != NONE {
            let point = &mut self.points[at as usize];
            if point.next == i {
                point.next = next;
                return;
            }
            at = point.next;
        }
    }

    /// Moves point i to a position in anchor coordinates.
    pub fn set(&mut self, i: u32, position: glam::DVec3) {
        self.remove(i);
        self.points[i as usize] = self.point(position);
        self.insert(i);
    }

    /// Calls `visit(j, point, d, d·L)` for every image d of every point that can be within `range(radius)` of
    /// the position `from`, where `radius` is the largest radius of a grid. The image is at the position of
    /// the point plus d·L.
    #[inline]
    pub fn near(
        &self,
        from: [f64; 3],
        range: impl Fn(f64) -> f64,
        mut visit: impl FnMut(u32, &Point, Shift, [f64; 3]),
    ) {
        for level in &self.levels {
            let range = range(level.radius);
            let mut low = [0; 3];
            let mut high = [0; 3];
            for axis in 0..3 {
                let n = i64::from(level.n[axis]);
                match self.axes[axis] {
                    Axis::Flat => {}
                    Axis::Bounded => {
                        low[axis] = Self::coordinate(level, axis, from[axis] - range).clamp(0, n - 1);
                        high[axis] = Self::coordinate(level, axis, from[axis] + range).clamp(0, n - 1);
                    }
                    Axis::Periodic => {
                        low[axis] = Self::coordinate(level, axis, from[axis] - range);
                        high[axis] = Self::coordinate(level, axis, from[axis] + range);
                    }
                    Axis::Open => {
                        low[axis] = Self::coordinate(level, axis, from[axis] - range);
                        // The grid is folded onto itself, and no bin must be visited twice.
                        high[axis] = Self::coordinate(level, axis, from[axis] + range).min(low[axis] + n - 1);
                    }
                }
            }
            let reach2 = range * range;
            let fold = |axis: usize, c: i64| -> Bin {
                let (width, position) = (level.width[axis], from[axis]);
                // The gap is unknown along an open axis, where a bin represents its folded images too, and
                // for the outermost bins along a bounded axis, which contain the points outside the box.
                let exact = match self.axes[axis] {
                    Axis::Periodic => true,
                    Axis::Bounded => c > 0 && c < i64::from(level.n[axis]) - 1,
                    Axis::Open | Axis::Flat => false,
                };
                let gap = if exact {
                    (c as f64 * width - position).max(position - (c + 1) as f64 * width).max(0.0)
                } else {
                    0.0
                };
                let n = i64::from(level.n[axis]);
                let (cell, image) = if (0..n).contains(&c) {
                    (c, 0)
                } else {
                    let image = if self.axes[axis] == Axis::Periodic { c.div_euclid(n) as i32 } else { 0 };
                    (c.rem_euclid(n), image)
                };
                Bin {
                    cell: cell as usize,
                    image,
                    offset: f64::from(image) * self.lengths[axis],
                    gap2: gap * gap,
                }
            };
            // The first bins along x and y are folded in advance, because the loops below visit them
            // repeatedly.
            let mut folded = [[Bin::default(); FOLDED]; 2];
            for axis in 0..2 {
                for (bin, c) in folded[axis].iter_mut().zip(low[axis]..=high[axis]) {
                    *bin = fold(axis, c);
                }
            }
            let bin = |axis: usize, c: i64| {
                let slot = (c - low[axis]) as usize;
                if slot < FOLDED { folded[axis][slot] } else { fold(axis, c) }
            };
            for z in low[2]..=high[2] {
                let z = fold(2, z);
                for y in low[1]..=high[1] {
                    let y = bin(1, y);
                    let row = index(level, [0, y.cell, z.cell]);
                    let left2 = reach2 - y.gap2 - z.gap2;
                    for x in low[0]..=high[0] {
                        let x = bin(0, x);
                        if x.gap2 > left2 {
                            continue;
                        }
                        let mut j = level.head[row + x.cell];
                        while j != NONE {
                            let point = &self.points[j as usize];
                            visit(j, point, [x.image, y.image, z.image], [x.offset, y.offset, z.offset]);
                            j = point.next;
                        }
                    }
                }
            }
        }
    }
}

/// Number of bins along an axis that are folded in advance, enough for most searches.
const FOLDED: usize = 8;

/// A bin along one axis: its coordinate in the grid, its image d, and d·L [length].
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    cell: usize,
    image: i32,
    offset: f64,
    /// Square of its distance from the center of the search [length²]; 0 if unknown.
    gap2: f64,
}

/// ⌊x⌋. The baseline of x86-64 has no instruction for it, and `f64::floor` would call a library function.
#[inline]
fn floor(x: f64) -> i64 {
    let whole = x as i64;
    whole - i64::from((whole as f64) > x)
}

/// Index of a bin from its coordinates in the grid.
#[inline]
fn index(level: &Level, cell: [usize; 3]) -> usize {
    (cell[2] * level.n[1] as usize + cell[1]) * level.n[0] as usize + cell[0]
}
