/*!
Pairs that are near each other, for the methods that step in time: a neighbor list with a shell, kept until somebody
has moved by half of the shell. Small systems test all pairs when it is made, larger ones a grid of cells.
*/

use glam::DVec3;

use super::Spheres;

/// Shell of the list [largest radii]: about the best for the gases that are timed, dense and dilute.
const SHELL: f64 = 1.0;
/// Particles in a cell, at least: emptier cells cost more to visit than their particles.
const PER_CELL: f64 = 2.0;
/// Up to this many particles all pairs are tested.
const FEW: usize = 100;

/// A pair within reach of each other, and the shift that makes r_j − r_i − shift the nearest image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near {
    pub i: u32,
    pub j: u32,
    pub shift: DVec3,
}

/// The list.
pub(super) struct Pairs {
    pub near: Vec<Near>,
    /// Where everybody was when it was made.
    then: Vec<DVec3>,
    shell: f64,
}

impl Pairs {
    pub fn new(spheres: &Spheres) -> Self {
        let mut pairs = Self { near: Vec::new(), then: Vec::new(), shell: SHELL * spheres.largest_radius() };
        pairs.make(spheres);
        pairs
    }

    /// Makes the list anew if somebody has left half of the shell.
    pub fn keep(&mut self, spheres: &Spheres) {
        let far = 0.25 * self.shell * self.shell;
        if self.then.iter().zip(&spheres.position).any(|(then, now)| now.distance_squared(*then) > far) {
            self.make(spheres);
        }
    }

    fn make(&mut self, spheres: &Spheres) {
        self.near.clear();
        self.then.clone_from(&spheres.position);
        let reach = 2.0 * spheres.largest_radius() + self.shell;
        let most = (spheres.position.len() as f64 / PER_CELL).cbrt().ceil();
        let cells = (spheres.period / reach).floor().min(DVec3::splat(most));
        // Three cells along each axis, so that each pair of neighbors meets in one image.
        if spheres.position.len() <= FEW || cells.min_element() < 3.0 {
            for j in 1..spheres.position.len() {
                for i in 0..j {
                    self.offer(spheres, i, j);
                }
            }
        } else {
            self.make_in_cells(spheres, cells.to_array().map(|count| count as usize));
        }
    }

    fn make_in_cells(&mut self, spheres: &Spheres, cells: [usize; 3]) {
        let index = |[x, y, z]: [usize; 3]| (z * cells[1] + y) * cells[0] + x;
        let mut members = vec![Vec::new(); cells.iter().product()];
        for (i, position) in spheres.position.iter().enumerate() {
            let part = position / spheres.period;
            let part = part - part.floor();
            let cell =
                [0, 1, 2].map(|axis| ((part[axis] * cells[axis] as f64) as usize).min(cells[axis] - 1));
            members[index(cell)].push(i);
        }
        for z in 0..cells[2] {
            for y in 0..cells[1] {
                for x in 0..cells[0] {
                    let own = &members[index([x, y, z])];
                    for neighbor in 0..27 {
                        let step = [neighbor % 3, neighbor / 3 % 3, neighbor / 9];
                        let other = [0, 1, 2]
                            .map(|axis| ([x, y, z][axis] + step[axis] + cells[axis] - 1) % cells[axis]);
                        for &i in own {
                            for &j in &members[index(other)] {
                                if i < j {
                                    self.offer(spheres, i, j);
                                }
                            }
                        }
                    }
                }
            }
        }
    }

    fn offer(&mut self, spheres: &Spheres, i: usize, j: usize) {
        let r = spheres.position[j] - spheres.position[i];
        let image = |axis: usize| {
            let period = spheres.period[axis];
            if period > 0.0 { (r[axis] / period).round_ties_even() * period } else { 0.0 }
        };
        let shift = DVec3::new(image(0), image(1), image(2));
        let reach = spheres.radius[i] + spheres.radius[j] + self.shell;
        if (r - shift).length_squared() < reach * reach {
            self.near.push(Near { i: i as u32, j: j as u32, shift });
        }
    }
}
