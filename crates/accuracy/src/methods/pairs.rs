/*!
Pairs of neighbors, for the methods with time steps: a neighbor list with a skin, used until a particle has
moved by half of the skin. In small systems all pairs are tested when it is built, in larger ones a grid of
cells.
*/

use glam::DVec3;

use super::Spheres;

/// Skin of the list [largest radii]: about the best for the gases that are timed, dense and dilute.
const SKIN: f64 = 1.0;
/// Least number of particles in a cell: emptier cells cost more to visit than their particles.
const PER_CELL: f64 = 2.0;
/// Up to this many particles all pairs are tested.
const FEW: usize = 100;

/// A pair in the list, and the shift that makes r_j − r_i − shift the nearest image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Near {
    pub i: u32,
    pub j: u32,
    pub shift: DVec3,
}

/// The list.
pub(super) struct Pairs {
    pub near: Vec<Near>,
    /// Positions when the list was built.
    reference: Vec<DVec3>,
    skin: f64,
}

impl Pairs {
    pub fn new(spheres: &Spheres) -> Self {
        let mut pairs =
            Self { near: Vec::new(), reference: Vec::new(), skin: SKIN * spheres.largest_radius() };
        pairs.build(spheres);
        pairs
    }

    /// Builds the list again if a particle has moved by more than half of the skin.
    pub fn update(&mut self, spheres: &Spheres) {
        let far = 0.25 * self.skin * self.skin;
        if self
            .reference
            .iter()
            .zip(&spheres.position)
            .any(|(reference, now)| now.distance_squared(*reference) > far)
        {
            self.build(spheres);
        }
    }

    fn build(&mut self, spheres: &Spheres) {
        self.near.clear();
        self.reference.clone_from(&spheres.position);
        let reach = 2.0 * spheres.largest_radius() + self.skin;
        let most = (spheres.position.len() as f64 / PER_CELL).cbrt().ceil();
        let cells = (spheres.period / reach).floor().min(DVec3::splat(most));
        // At least three cells along each axis, so that each pair of neighbors occurs in one image.
        if spheres.position.len() <= FEW || cells.min_element() < 3.0 {
            for j in 1..spheres.position.len() {
                for i in 0..j {
                    self.offer(spheres, i, j);
                }
            }
        } else {
            self.build_in_cells(spheres, cells.to_array().map(|count| count as usize));
        }
    }

    fn build_in_cells(&mut self, spheres: &Spheres, cells: [usize; 3]) {
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
        let reach = spheres.radius[i] + spheres.radius[j] + self.skin;
        if (r - shift).length_squared() < reach * reach {
            self.near.push(Near { i: i as u32, j: j as u32, shift });
        }
    }
}
