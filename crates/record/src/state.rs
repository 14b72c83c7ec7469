//! One frame of a file, as the start of another run.

use std::path::Path;

use glam::DVec3;

use crate::{
    datasets::Datasets,
    declared::read_all,
    error::{Context, READ, RecordError},
    file,
    info::{Parameters, vectors},
};

/// All particles at the last frame of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Simulated time [time].
    pub time: f64,
    /// Collisions + wall collisions so far.
    pub step: u64,
    /// 2 or 3.
    pub dimension: usize,
    /// Edge lengths of the box [length].
    pub box_size: DVec3,
    /// Edge vectors of a sheared box \[length\].
    pub sheared_edges: Option<[DVec3; 3]>,
    /// [N] centres [length], wrapped into the box along periodic axes.
    pub position: Vec<DVec3>,
    /// [N] velocities [length/time].
    pub velocity: Vec<DVec3>,
    /// [N] angular velocities [1/time]; empty without spin.
    pub angular_velocity: Vec<DVec3>,
    /// [N] box images.
    pub image: Vec<[i32; 3]>,
    /// [N] radii [length].
    pub radius: Vec<f64>,
    /// [N] masses.
    pub mass: Vec<f64>,
    /// [N] species indices.
    pub species: Vec<u32>,
    /// Names by species index.
    pub species_names: Vec<String>,
}

impl State {
    /// Leaves out the particles that are not there.
    fn keep(&mut self, present: &[u8]) {
        fn those<T: Copy>(values: &mut Vec<T>, present: &[u8]) {
            let kept = values.iter().zip(present).filter(|(_, present)| **present != 0);
            *values = kept.map(|(&value, _)| value).collect();
        }
        those(&mut self.position, present);
        those(&mut self.velocity, present);
        those(&mut self.angular_velocity, present);
        those(&mut self.image, present);
        those(&mut self.radius, present);
        those(&mut self.mass, present);
        those(&mut self.species, present);
    }
}

/// Reads the last frame of a file; see [`state`].
pub fn last_state(path: impl AsRef<Path>) -> Result<State, RecordError> {
    state(path, -1)
}

/// Reads a frame of a file, from the end if `index` is negative.
///
/// # Errors
///
/// Those of [`info`], and [`RecordError::Missing`] if there is no such frame.
pub fn state(path: impl AsRef<Path>, index: i64) -> Result<State, RecordError> {
    let path = path.as_ref();
    file::read(path, |file| {
        let parameters = Parameters::read(file, path)?;
        let datasets = Datasets::open(file, parameters.particles, parameters.sizes()).doing(path, READ)?;
        let missing = || RecordError::Missing { path: path.to_owned(), what: "frames" };
        let trajectory = datasets.trajectory.ok_or_else(missing)?;
        let rows = trajectory.rows().doing(path, READ)?;
        if rows == 0 {
            return Err(missing());
        }
        let from_end = if index < 0 { index.saturating_add(rows as i64) } else { index };
        let row = usize::try_from(from_end)
            .ok()
            .filter(|&row| row < rows)
            .ok_or_else(|| RecordError::Missing { path: path.to_owned(), what: "frame of this index" })?;
        let read = || -> hdf5::Result<State> {
            let all = file.group("particles/all")?;
            let edges = vectors(&trajectory.edges.read::<f64>(row, row + 1)?);
            let present = match &trajectory.present {
                Some(series) => Some(series.read::<u8>(row, row + 1)?),
                None => None,
            };
            let mut state = State {
                time: trajectory.clock.time.read::<f64>(row, row + 1)?[0],
                step: trajectory.clock.step.read::<i64>(row, row + 1)?[0] as u64,
                dimension: parameters.dimension,
                box_size: match edges[..] {
                    [lengths] => lengths,
                    [x, y, z] => DVec3::new(x.x, y.y, z.z),
                    _ => DVec3::NAN,
                },
                sheared_edges: edges.try_into().ok(),
                position: vectors(&trajectory.position.read(row, row + 1)?),
                velocity: vectors(&trajectory.velocity.read(row, row + 1)?),
                angular_velocity: match &trajectory.angular_velocity {
                    Some(series) => vectors(&series.read(row, row + 1)?),
                    None => Vec::new(),
                },
                image: trajectory.image.read::<i32>(row, row + 1)?.as_chunks().0.to_vec(),
                radius: read_all(&all.dataset("radius")?)?,
                mass: read_all(&all.dataset("mass")?)?,
                species: read_all(&all.dataset("species")?)?,
                species_names: parameters.species_names.clone(),
            };
            if let Some(present) = present {
                state.keep(&present);
            }
            Ok(state)
        };
        read().doing(path, READ)
    })
}
