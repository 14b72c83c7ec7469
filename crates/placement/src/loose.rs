//! Random packings: sequential insertion of the largest first, then growth where insertion fails. Particles
//! that could not be inserted start with overlaps, which is equivalent to a smaller radius, and grow to full
//! size while all are pushed apart. Below random close packing this ends without overlaps.

use std::f64::consts::PI;

use glam::DVec3;
use haff_engine::{Boundary, Instant};
use rayon::prelude::*;

use crate::grid::{Grid, Periods, overlaps};
use crate::random::Stream;
use crate::room::{Obstacles, Room};

/// Insertion attempts for each particle before growth, in dilute and in dense boxes. Insertion saturates at a
/// packing fraction of 0.38 (2D: 0.55), and long before that one push costs less than the attempts that it
/// saves.
const ATTEMPTS: [usize; 2] = [200, 8];

/// Packing fractions above which a box is dense here, by dimension.
const DENSE: [f64; 2] = [0.35, 0.2];

/// Largest number of rounds of pushing, and the window in which the largest overlap must decrease.
const ROUNDS: usize = 20_000;
const WINDOW: usize = 300;

/// Pushed apart to this much more than contact, so that the approach to contact, which is exponential, ends.
const MARGIN: f64 = 1e-4;

/// Random centres for spheres of these radii.
///
/// `stream` gives the random numbers of each particle. The result depends on nothing else, in particular not
/// on the number of threads.
///
/// # Errors
/// The largest remaining overlap [length].
pub fn random(room: &Room, radius: &[f64], stream: &dyn Fn(usize) -> Stream) -> Result<Vec<DVec3>, f64> {
    let n = radius.len();
    let largest = radius.iter().copied().fold(0.0, f64::max);
    let periods = Periods::new(room.domain);
    let obstacles = Obstacles::new(room, largest);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| radius[b].total_cmp(&radius[a]));
    let mut grid = Grid::new(radius, 0.0, periods);
    let mut position = vec![DVec3::ZERO; n];
    let mut complete = true;
    let d = room.dimension.count();
    let volume: f64 =
        radius.iter().map(|&r| if d == 2 { PI * r * r } else { 4.0 / 3.0 * PI * r * r * r }).sum();
    let fraction = volume / (0..d).map(|axis| room.domain.size[axis]).product::<f64>();
    let attempts = ATTEMPTS[usize::from(fraction > DENSE[d - 2])];
    for &i in &order {
        let mut spans = [[0.0; 2]; 3];
        for (axis, span) in spans.iter_mut().enumerate() {
            *span = room.span_of(axis, i, radius[i]).ok_or(2.0 * radius[i])?;
        }
        let mut random = stream(i);
        let mut placed = false;
        for _ in 0..attempts {
            let p = periods.wrap(DVec3::from_array(spans.map(|[low, high]| random.between(low, high))));
            position[i] = p;
            let is_outside = room.region(i).is_some_and(|region| region.distance(p) < radius[i]);
            if is_outside || room.behind_a_plane(p, radius[i]) || obstacles.blocks(p, radius[i]) {
                continue;
            }
            let mut free = true;
            grid.visit(p, radius[i], |j| {
                free = periods.nearest(position[j] - p).length() >= radius[i] + radius[j];
                free
            });
            if free {
                placed = true;
                break;
            }
        }
        complete &= placed;
        grid.insert(i, position[i]);
    }
    if complete { Ok(position) } else { push_apart(room, radius, position) }
}

/// Moves overlapping spheres apart until none overlap.
fn push_apart(room: &Room, radius: &[f64], mut position: Vec<DVec3>) -> Result<Vec<DVec3>, f64> {
    let movable = position.len();
    let periods = Periods::new(room.domain);
    let all_radii: Vec<f64> = radius.iter().copied().chain(room.obstacles.iter().map(|o| o.1)).collect();
    position.extend(room.obstacles.iter().map(|o| o.0));
    let mean = radius.iter().sum::<f64>() / movable as f64;
    let skin = 0.6 * mean;
    let largest = all_radii.iter().copied().fold(0.0, f64::max);
    // From here on particles are sorted by position, so that neighbors are close in memory: for 10⁶ particles
    // in random order a round takes several times as long. Sums are still formed in the order of the rows.
    let order = by_place(&position, 2.0 * largest);
    let sorted_index = inverse(&order);
    let mut bodies: Vec<Body> = order
        .iter()
        .map(|&row| Body { row, position: position[row as usize], radius: all_radii[row as usize] })
        .collect();
    let radii: Vec<f64> = bodies.iter().map(|body| body.radius).collect();
    let mut grid = Grid::new(&radii, skin + 2.0 * MARGIN * largest, periods);
    let mut list = Neighbors::default();
    let mut drift = f64::INFINITY;
    let mut velocity = vec![DVec3::ZERO; bodies.len()];
    let mut pushes: Vec<(DVec3, f64)> = Vec::new();
    // Displacement up to which a particle that was clear of all others at its last check cannot touch one.
    let mut clear_until = vec![0.0; bodies.len()];
    let (mut worst_of_window, mut worst_before) = (f64::INFINITY, f64::INFINITY);
    for round in 0..ROUNDS {
        if drift > 0.5 * skin {
            list.build(&mut grid, &bodies, &sorted_index, skin, movable, periods);
            drift = 0.0;
            clear_until.fill(0.0);
        }
        // Jacobi steps: every particle reads the old positions only, so the order of work does not matter.
        bodies
            .par_iter()
            .zip(clear_until.par_iter_mut())
            .enumerate()
            .map(|(k, (body, clear_until))| {
                if body.row as usize >= movable || drift < *clear_until {
                    return (DVec3::ZERO, 0.0);
                }
                let (step, worst, clear) = push(room, &bodies, list.of(k), body, movable, periods);
                // Both may have moved towards each other; with a margin for rounding.
                *clear_until = drift + 0.499 * clear - 1e-9 * body.radius;
                (step, worst)
            })
            .collect_into_vec(&mut pushes);
        let worst = pushes.iter().map(|push| push.1).fold(0.0, f64::max);
        if worst <= 0.0 {
            for body in &bodies {
                position[body.row as usize] = body.position;
            }
            position.truncate(movable);
            let strict = overlaps(&position, radius, periods, 0.0, &|_, _| false);
            debug_assert!(strict.is_empty(), "{strict:?}");
            return if strict.is_empty() { Ok(position) } else { Err(strict[0].depth) };
        }
        worst_of_window = worst_of_window.min(worst);
        if round % WINDOW == WINDOW - 1 {
            if worst_of_window > 0.8 * worst_before {
                return Err(worst_of_window);
            }
            worst_before = worst_of_window;
            worst_of_window = f64::INFINITY;
        }
        let step = velocity
            .par_iter_mut()
            .zip(bodies.par_iter_mut())
            .zip(pushes.par_iter())
            .map(|((v, body), (push, _))| {
                if body.row as usize >= movable {
                    return 0.0;
                }
                // Momentum from the last step: displacements propagate faster along chains of contacts.
                *v = (0.5 * *v + *push).clamp_length_max(0.3 * body.radius);
                body.position = periods.wrap(body.position + *v);
                v.length()
            })
            .reduce(|| 0.0, f64::max);
        drift += step;
    }
    Err(worst_of_window.min(worst_before))
}

/// A sphere that is pushed, or an obstacle.
struct Body {
    position: DVec3,
    radius: f64,
    row: u32,
}

/// Rows in the order of cubes of some width, the cubes along a Z-order curve.
fn by_place(position: &[DVec3], width: f64) -> Vec<u32> {
    // Every third bit. For cubes far apart the bits may overlap, which only costs locality.
    let spread = |x: f64| {
        let mut x = (x / width).floor() as i64 as u64 & 0x1F_FFFF;
        for (shift, mask) in [
            (32, 0x001F_0000_0000_FFFF),
            (16, 0x001F_0000_FF00_00FF),
            (8, 0x100F_00F0_0F00_F00F),
            (4, 0x10C3_0C30_C30C_30C3),
            (2, 0x1249_2492_4924_9249_u64),
        ] {
            x = (x | (x << shift)) & mask;
        }
        x
    };
    let mut keys: Vec<(u64, u32)> = position
        .par_iter()
        .enumerate()
        .map(|(row, p)| (spread(p.x) << 2 | spread(p.y) << 1 | spread(p.z), row as u32))
        .collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|(_, row)| row).collect()
}

/// The inverse of a permutation.
fn inverse(order: &[u32]) -> Vec<u32> {
    let mut inverse = vec![0; order.len()];
    for (k, &row) in order.iter().enumerate() {
        inverse[row as usize] = k as u32;
    }
    inverse
}

/// The step that moves a particle out of its overlaps, its largest overlap, and its distance from the nearest
/// sphere or wall that would push it [length].
fn push(
    room: &Room,
    bodies: &[Body],
    neighbors: &[u32],
    own: &Body,
    movable: usize,
    periods: Periods,
) -> (DVec3, f64, f64) {
    let (p, r) = (own.position, own.radius);
    let mut step = DVec3::ZERO;
    let mut worst = 0.0_f64;
    let mut clear = f64::INFINITY;
    for &j in neighbors {
        let other = &bodies[j as usize];
        let contact = r + other.radius;
        let d = periods.nearest(p - other.position);
        let distance = d.length();
        worst = worst.max(contact - distance);
        let gap = contact * (1.0 + MARGIN) - distance;
        clear = clear.min(-gap);
        if gap > 0.0 {
            // Two centres at one point have no direction: x is used, with opposite signs for the two.
            let n = if distance > 0.0 {
                d / distance
            } else {
                DVec3::X * if own.row < other.row { 1.0 } else { -1.0 }
            };
            step += n * gap * if (other.row as usize) < movable { 0.4 } else { 0.8 };
        }
    }
    let mut wall = |distance: f64, normal: DVec3| {
        worst = worst.max(r - distance);
        let gap = r * (1.0 + MARGIN) - distance;
        clear = clear.min(-gap);
        if gap > 0.0 {
            step += normal * gap * 0.8;
        }
    };
    let region = room.region(own.row as usize);
    if let Some(region) = region {
        wall(region.distance(p), region.normal(p));
    }
    for axis in 0..room.dimension.count() {
        let boundary = room.domain.boundary[axis];
        // The placeholder faces of open axes do not count in a region.
        let is_free = boundary == Boundary::Open && region.is_some();
        if boundary != Boundary::Periodic && !is_free {
            wall(p[axis], DVec3::AXES[axis]);
            wall(room.domain.size[axis] - p[axis], -DVec3::AXES[axis]);
        }
    }
    for plane in room.planes {
        wall(plane.distance(p, Instant::ZERO), plane.normal_at(p, Instant::ZERO));
    }
    (step, worst, clear)
}

/// Neighbors of every particle, in one array; both indices in sorted order.
#[derive(Default)]
struct Neighbors {
    start: Vec<usize>,
    partner: Vec<u32>,
}

impl Neighbors {
    fn of(&self, i: usize) -> &[u32] {
        &self.partner[self.start[i]..self.start[i + 1]]
    }

    /// `sorted_index`: sorted index of each row's body.
    fn build(
        &mut self,
        grid: &mut Grid,
        bodies: &[Body],
        sorted_index: &[u32],
        skin: f64,
        movable: usize,
        periods: Periods,
    ) {
        grid.clear();
        for &k in sorted_index {
            grid.insert(k as usize, bodies[k as usize].position);
        }
        // Each pair once, from its smaller particle: `visit` covers its level and those above.
        let halves: Vec<Vec<u32>> = bodies
            .par_iter()
            .map(|own| {
                let mut mine = Vec::new();
                let octave = |radius: f64| radius.to_bits() >> 52;
                grid.visit(own.position, own.radius, |j| {
                    let other = &bodies[j];
                    let twice = octave(other.radius) == octave(own.radius) && other.row <= own.row;
                    let reach = (own.radius + other.radius) * (1.0 + MARGIN) + skin;
                    if !twice
                        && ((own.row as usize) < movable || (other.row as usize) < movable)
                        && periods.nearest(other.position - own.position).length_squared() < reach * reach
                    {
                        mine.push(j as u32);
                    }
                    true
                });
                mine
            })
            .collect();
        self.start = vec![0; bodies.len() + 1];
        for (k, half) in halves.iter().enumerate() {
            self.start[k + 1] += half.len();
            for &j in half {
                self.start[j as usize + 1] += 1;
            }
        }
        for k in 0..bodies.len() {
            self.start[k + 1] += self.start[k];
        }
        let mut fill = self.start.clone();
        self.partner = vec![0; self.start[bodies.len()]];
        for &k in sorted_index {
            for &j in &halves[k as usize] {
                self.partner[fill[k as usize]] = j;
                self.partner[fill[j as usize]] = k;
                fill[k as usize] += 1;
                fill[j as usize] += 1;
            }
        }
    }
}
