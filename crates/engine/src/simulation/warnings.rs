//! What a user should know of a scene before it runs.

use crate::{
    model::System,
    simulation::{
        bouncing::endless_bounces_warning, clustering::clustering_warning, pressing::pressing_piston_warning,
    },
};

/// All warnings for a scene, as texts without a final point. `haff check`, runs, sweeps and Python show the
/// same ones.
pub fn warnings(system: &System) -> Vec<String> {
    let found =
        [clustering_warning(system), endless_bounces_warning(system), pressing_piston_warning(system)];
    found.into_iter().flatten().collect()
}
