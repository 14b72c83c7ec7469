//! Random mixtures of two sizes, for the choice of a search.

use glam::DVec3;
use haff_engine::{Boundary, Dimension, System};

use super::{Random, class, scatter_within_room, set_restitution, system};

/// A mixture of two sizes, whose ratio is between 1 and 100, in two or three dimensions. The least packing
/// fraction is 0.01; the largest is one at which particles still find room at random positions.
pub fn mixture(seed: u64) -> System {
    let mut random = Random(7919 * seed + 15);
    let flat = random.index(2) == 0;
    let (dimension, d) = if flat { (Dimension::Two, 2) } else { (Dimension::Three, 3) };
    let ratio = 10_f64.powf(random.uniform(0.0, 2.0));
    let large = [1, 1, 2, 5, 20, 100][random.index(6)];
    let small = 10_f64.powf(random.uniform(2.0, 3.6)) as usize;
    let phi = 10_f64.powf(random.uniform(-2.0, if flat { -0.4 } else { -0.6 }));
    let volume = |radius: f64| {
        if flat {
            std::f64::consts::PI * radius.powi(2)
        } else {
            std::f64::consts::PI * 4.0 / 3.0 * radius.powi(3)
        }
    };
    let occupied = volume(0.5) * small as f64 + volume(0.5 * ratio) * f64::from(large);
    let edge = (occupied / phi).powf(1.0 / f64::from(d)).max(1.05 * ratio);
    let boundary = [Boundary::Periodic, Boundary::Wall][random.index(2)];
    let mut scene = system(dimension, DVec3::splat(edge), [boundary; 3]);
    // Masses in the ratio of volumes, or equal ones.
    let mass = if random.index(2) == 0 { ratio.powi(d) } else { 1.0 };
    let kinds = [class(&mut scene, 0.5 * ratio, mass), class(&mut scene, 0.5, 1.0)];
    scatter_within_room(&mut scene, kinds[0], large as usize, mass.powf(-0.5), &mut random);
    scatter_within_room(&mut scene, kinds[1], small, 1.0, &mut random);
    set_restitution(&mut scene, [1.0, 0.9][random.index(2)]);
    scene
}
