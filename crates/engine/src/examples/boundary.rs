use glam::DVec3;

use crate::state::periodicity::Periodicity;

use super::two_spheres;

/// Images that are displaced along x by `offset` [length] for every box further up in y, as under simple
/// shear.
struct Displaced {
    periodicity: Periodicity,
    offset: f64,
}

impl Displaced {
    /// The nearest image of a difference of positions; y first, because that displaces along x.
    fn nearest(&self, r: DVec3) -> DVec3 {
        let turns = (r.y / self.periodicity.size.y).round_ties_even();
        let r = r - DVec3::new(turns * self.offset, turns * self.periodicity.size.y, 0.0);
        self.periodicity.nearest(r)
    }
}

#[test]
fn the_nearest_displaced_image_is_that_of_a_search_over_all() {
    let simulation = two_spheres();
    let boundary = Displaced { periodicity: simulation.state.world.boundary.periodicity, offset: 3.25 };
    let size = boundary.periodicity.size;
    let mut compared = 0;
    for k in 0..200 {
        let r = DVec3::new(f64::from(k) * 0.37, f64::from(k) * 0.11, 0.0) % size;
        let nearest = boundary.nearest(r);
        // Within a third of the box the choice by axes is the nearest of all.
        if nearest.abs().max_element() > size.x / 3.0 {
            continue;
        }
        compared += 1;
        for (across, up) in (-3..=3).flat_map(|x| (-2..=2).map(move |y| (f64::from(x), f64::from(y)))) {
            let image = r + DVec3::new(across * size.x + up * boundary.offset, up * size.y, 0.0);
            assert!(nearest.length() <= image.length() + 1e-12, "{r}: {nearest}, {image}");
        }
    }
    assert!(compared > 50, "{compared}");
}
