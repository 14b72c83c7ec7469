//! The description of a run, written to a file before it starts.

use glam::DVec3;
use haff_engine::{Body, Boundary, Class, EventColumn, Measure, SceneFeatures, Sizes, System};

use crate::meshes::StoredMesh;

/// Version of the scene schema and of the file layout that this crate writes and reads.
pub const SCHEMA: i64 = 1;

/// Name of the dataset with the walls that are pistons.
pub(crate) const PISTONS: &str = "pistons";

/// Names of the dataset with the summary of a run, and of that with its summary before it was resumed. They
/// are equally long, so that one can replace the other in a group when the disk is full.
pub(crate) const SUMMARY: &str = "summary";
pub(crate) const EARLIER: &str = "earlier";

/// Everything that is known about a run before it starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// Title of the scene.
    pub title: String,
    /// The resolved scene as TOML text, sufficient to build the same system again.
    pub scene_toml: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Version of haff.
    pub version: String,
    /// Git revision haff was built from; empty if unknown.
    pub git_revision: String,
    /// Version of the scene schema.
    pub schema: i64,
    /// Version of the trajectory: equal versions give equal bits.
    pub trajectory_version: u32,
    /// 2 or 3.
    pub dimension: usize,
    /// Edge lengths of the box [length].
    pub box_size: DVec3,
    /// Corner of the box [length].
    pub box_origin: DVec3,
    /// Boundaries per axis.
    pub boundary: [Boundary; 3],
    /// Axes along which temperatures and pressures are relative to the velocity of the center of mass.
    pub conserved_momentum: [bool; 3],
    /// [N] species index per particle.
    pub species: Vec<u32>,
    /// Names by species index.
    pub species_names: Vec<String>,
    /// [N] masses; infinite for fixed and driven bodies.
    pub mass: Vec<f64>,
    /// [N] radii [length].
    pub radius: Vec<f64>,
    /// [N] numbers q = I/(m R²) of moments of inertia; empty without spin.
    pub inertia: Vec<f64>,
    /// The summary of the run before this file was made (JSON text); empty if there is none.
    pub earlier: String,
    /// Names of the walls; event rows refer to walls by their index here.
    pub wall_names: Vec<String>,
    /// The walls that are pistons, by their indices.
    pub pistons: Vec<u32>,
    /// Whether frames are recorded.
    pub frames: bool,
    /// Whether observables are recorded.
    pub observables: bool,
    /// Columns of the event log, always including the time; empty: events are not recorded.
    pub events: Vec<EventColumn>,
    /// Whether frames and the event log are compressed (shuffle and deflate).
    pub compressed: bool,
    /// The parts of the scene that its observables depend on.
    pub present: SceneFeatures,
    /// Profiles and correlations.
    pub measure: Measure,
    /// How many rows have a particle from the start on; the others are kept for those that are added later.
    pub used: usize,
    /// Triangles of walls, each mesh once.
    pub meshes: Vec<StoredMesh>,
}

impl Header {
    /// The numbers on which the shapes of observables depend.
    pub(crate) fn sizes(&self) -> Sizes {
        Sizes {
            species: self.species_names.len(),
            walls: self.wall_names.len(),
            pistons: self.pistons.len(),
            dimension: self.dimension,
        }
    }

    /// The part of the header that follows from the system: everything except the texts, the seed, the
    /// versions and the meshes, which are empty or zero, with frames, observables and compression on and
    /// events off.
    ///
    /// ```
    /// # use haff_engine::*;
    /// # fn example(system: &System) -> haff_record::Header {
    /// haff_record::Header {
    ///     title: "gas".into(),
    ///     seed: 7,
    ///     events: EventColumn::ALL.to_vec(),
    ///     ..haff_record::Header::from_system(system)
    /// }
    /// # }
    /// ```
    pub fn from_system(system: &System) -> Self {
        let axes = system.dimension.count();
        let boundary = system.domain.boundary;
        let class = |class: u32| system.classes.get(class as usize);
        Self {
            title: String::new(),
            scene_toml: String::new(),
            seed: 0,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            git_revision: String::new(),
            schema: SCHEMA,
            trajectory_version: haff_engine::TRAJECTORY_VERSION,
            dimension: axes,
            box_size: system.domain.size,
            box_origin: DVec3::ZERO,
            boundary,
            conserved_momentum: haff_engine::conserved_momentum(system),
            species: system.bodies.iter().map(|body| body.species).collect(),
            species_names: system.species.clone(),
            mass: system.bodies.iter().map(|body| class(body.class).map_or(f64::NAN, |c| c.mass)).collect(),
            radius: system
                .bodies
                .iter()
                .map(|body| class(body.class).map_or(f64::NAN, |c| c.radius))
                .collect(),
            inertia: system.spin.as_ref().map_or(Vec::new(), |spin| {
                let inertia = |class: &Class| spin.inertia.get(class.group as usize).copied();
                let of = |body: &Body| class(body.class).and_then(inertia).unwrap_or(f64::NAN);
                system.bodies.iter().map(of).collect()
            }),
            earlier: String::new(),
            wall_names: system.walls.iter().map(|wall| wall.name.clone()).collect(),
            pistons: system.pistons().map(|(wall, _)| wall as u32).collect(),
            frames: true,
            observables: true,
            events: Vec::new(),
            compressed: true,
            present: SceneFeatures::of(system),
            measure: system.measure.clone(),
            used: system.bodies.len(),
            meshes: Vec::new(),
        }
    }
}
