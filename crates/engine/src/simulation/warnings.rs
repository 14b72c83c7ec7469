//! What a user should know of a scene before it runs.

use crate::{
    model::System,
    simulation::{bouncing::endless_bounces_warning, clustering::clustering_warning},
};

/// All warnings for a scene, as texts without a final point. `haff check`, runs, sweeps and Python show the
/// same ones.
pub fn warnings(system: &System) -> Vec<String> {
    [clustering_warning(system), endless_bounces_warning(system)].into_iter().flatten().collect()
}
