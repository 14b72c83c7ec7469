//! The triangles of walls, kept in the file so that a run can go on, and be drawn, where the files that they
//! came from are not.

use std::path::Path;

use glam::DVec3;
use hdf5::Group;

use crate::{
    declared::read_all,
    error::{Context, READ, RecordError},
    file,
};

/// Name of their group in `parameters`.
const GROUP: &str = "meshes";
/// Most triangles of a mesh that is kept; of a larger one the file has the path alone.
const MOST_TRIANGLES: usize = 1_000_000;
/// Triangles in a chunk: 576 KiB.
const CHUNK: usize = 8192;

/// A mesh of triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredMesh {
    /// Hash of the file that it comes from, hexadecimal digits: its name.
    pub hash: String,
    /// Corners of each triangle, in the coordinates of that file.
    pub corners: Vec<[DVec3; 3]>,
}

/// Whether a text is a hash, and not a path in the file.
fn is_hash(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// Writes meshes, each once.
pub(crate) fn write(parameters: &Group, meshes: &[StoredMesh]) -> hdf5::Result<()> {
    let kept = |mesh: &&StoredMesh| is_hash(&mesh.hash) && (1..=MOST_TRIANGLES).contains(&mesh.corners.len());
    let mut kept = meshes.iter().filter(kept).peekable();
    if kept.peek().is_none() {
        return Ok(());
    }
    let group = parameters.create_group(GROUP)?;
    for StoredMesh { hash, corners } in kept {
        if group.link_exists(hash) {
            continue;
        }
        let numbers: Vec<f64> = corners.as_flattened().iter().flat_map(DVec3::to_array).collect();
        let shape = (corners.len(), 3, 3);
        let numbers = ndarray::ArrayView::from_shape(shape, &numbers)
            .map_err(|error| hdf5::Error::from(error.to_string()))?;
        // Always compressed: a damaged byte is then found.
        let dataset = group.new_dataset::<f64>().obj_track_times(false).chunk((CHUNK.min(shape.0), 3, 3));
        dataset.shuffle().deflate(1).shape(shape).create(hash.as_str())?.write(numbers)?;
    }
    Ok(())
}

/// The triangles of the mesh with this hash, if the file has it.
///
/// # Errors
///
/// The file cannot be read, or is damaged.
pub fn mesh(path: impl AsRef<Path>, hash: &str) -> Result<Option<Vec<[DVec3; 3]>>, RecordError> {
    let path = path.as_ref();
    if !is_hash(hash) {
        return Ok(None);
    }
    file::read(path, |file| {
        let read = || -> hdf5::Result<Option<Vec<[DVec3; 3]>>> {
            let parameters = file.group("parameters")?;
            if !parameters.link_exists(GROUP) {
                return Ok(None);
            }
            let group = parameters.group(GROUP)?;
            if !group.link_exists(hash) {
                return Ok(None);
            }
            let dataset = group.dataset(hash)?;
            let shape = dataset.shape();
            if shape.len() != 3 || shape[1..] != [3, 3] || !(1..=MOST_TRIANGLES).contains(&shape[0]) {
                return Err(format!("{} has no triangles", dataset.name()).into());
            }
            let numbers = read_all::<f64>(&dataset)?;
            let corners: Vec<DVec3> = numbers.as_chunks().0.iter().copied().map(DVec3::from_array).collect();
            Ok(Some(corners.as_chunks().0.to_vec()))
        };
        read().doing(path, READ)
    })
}
