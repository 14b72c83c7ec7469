//! Files with meshes of triangles: STL, binary and text, and OBJ.

use std::{
    borrow::Cow,
    collections::HashMap,
    fs::File,
    io::{Cursor, Read},
    path::Path,
};

use glam::DVec3;
use xxhash_rust::xxh3::xxh3_128;

/// Most triangles of a mesh: it and its tree take some 250 bytes for each.
const MOST_FACES: usize = 4_000_000;
/// Most bytes of a file: a triangle of a text takes about that many.
const LONGEST: u64 = 300 * MOST_FACES as u64;
/// Bytes of a binary STL file before its facets, and of a facet.
const HEADER: usize = 84;
/// See [`HEADER`].
const FACET: usize = 50;

/// The triangles of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// Corners of each triangle, in the coordinates of the file.
    pub corners: Vec<[DVec3; 3]>,
    /// XXH3 of the file, 128 bits, as 32 hexadecimal digits.
    pub hash: String,
}

/// Why a file has no triangles; the end of a sentence that begins with its name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MeshFileError {
    /// It cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// It is no such file, or too large.
    #[error("{0}")]
    Invalid(String),
}

impl MeshFile {
    /// Reads a file; its ending, `.stl` or `.obj`, is its format.
    ///
    /// # Errors
    /// The file cannot be read, is of another format or damaged, or has too many triangles.
    pub fn read(path: &Path) -> Result<Self, MeshFileError> {
        let bytes = bytes(path).map_err(MeshFileError::Unreadable)?;
        let suffix = path.extension().map(|suffix| suffix.to_string_lossy().to_lowercase());
        let corners = match suffix.unwrap_or_default().as_str() {
            "stl" => stl(&bytes),
            "obj" => obj(&bytes),
            other => Err(format!("must end in .stl or .obj: meshes of \".{other}\" are not read")),
        };
        let corners = corners.map_err(MeshFileError::Invalid)?;
        if corners.len() > MOST_FACES {
            let why = format!("has {} triangles, at most {MOST_FACES} are possible", corners.len());
            return Err(MeshFileError::Invalid(why));
        }
        Ok(Self { corners, hash: format!("{:032x}", xxh3_128(&bytes)) })
    }
}

/// All bytes of a file, if it is not too long.
fn bytes(path: &Path) -> Result<Vec<u8>, String> {
    let mut file = File::open(path).map_err(|error| error.to_string())?;
    let metadata = file.metadata().map_err(|error| error.to_string())?;
    if !metadata.is_file() {
        return Err("it is not a file".into());
    }
    if metadata.len() > LONGEST {
        let most = LONGEST >> 20;
        return Err(format!("it has {} MiB, at most {most} MiB are read", metadata.len() >> 20));
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// Those of an STL file, whose coordinates are single-precision numbers.
fn stl(bytes: &[u8]) -> Result<Vec<[DVec3; 3]>, String> {
    const TEXT: &[u8] = b"solid";
    let facets = bytes.get(HEADER - 4..HEADER).and_then(|count| count.try_into().ok());
    let length = facets.map(|count| HEADER + FACET * u32::from_le_bytes(count) as usize);
    let mut bytes = Cow::Borrowed(bytes);
    if length == Some(bytes.len()) {
        // Some binary files begin with the word of texts: the length decides.
        bytes.to_mut()[..TEXT.len()].fill(0);
    } else if !bytes.starts_with(TEXT) {
        // Before memory is allocated for the number of facets in its header.
        return Err("is not an STL file: it is neither a text nor as long as its header says".into());
    }
    let mesh =
        stl_io::read_stl(&mut Cursor::new(&bytes)).map_err(|error| format!("is not an STL file: {error}"))?;
    let corner = |index: usize| mesh.vertices.get(index).map(|v| DVec3::from_array(v.0.map(f64::from)));
    let triangle = |face: &stl_io::IndexedTriangle| {
        let [a, b, c] = face.vertices.map(corner);
        Some([a?, b?, c?])
    };
    mesh.faces.iter().map(triangle).collect::<Option<_>>().ok_or_else(|| "is not an STL file".into())
}

/// Those of an OBJ file; faces of more corners are divided.
fn obj(bytes: &[u8]) -> Result<Vec<[DVec3; 3]>, String> {
    let options = tobj::LoadOptions { triangulate: true, ..tobj::LoadOptions::default() };
    // Materials do not matter.
    let materials = |_: &Path| Ok((Vec::new(), HashMap::default()));
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, materials)
        .map_err(|error| format!("is not an OBJ file: {error}"))?;
    let mut triangles = Vec::new();
    for model in &models {
        let mesh = &model.mesh;
        let corner = |index: &u32| {
            let first = 3 * *index as usize;
            mesh.positions.get(first..first + 3).map(|x| DVec3::new(x[0], x[1], x[2]))
        };
        for face in mesh.indices.chunks_exact(3) {
            let corners = [corner(&face[0]), corner(&face[1]), corner(&face[2])];
            let [Some(a), Some(b), Some(c)] = corners else { return Err("is not an OBJ file".into()) };
            triangles.push([a, b, c]);
        }
    }
    Ok(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &[u8] = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    const SQUARE: &[u8] = b"# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1/1 2 3 -1\n";

    /// A binary file with one facet and this header.
    fn binary(header: &[u8]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(HEADER - 4, b' ');
        bytes.extend(1_u32.to_le_bytes());
        let numbers = [0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0, 0]);
        bytes
    }

    #[test]
    fn all_forms_of_a_triangle_are_read() {
        let expected = vec![[DVec3::ZERO, DVec3::X, DVec3::Y]];
        assert_eq!(stl(TEXT), Ok(expected.clone()));
        assert_eq!(stl(&binary(b"made by hand")), Ok(expected.clone()));
        // As some programs write it.
        assert_eq!(stl(&binary(b"solid made by hand")), Ok(expected));
        let halves = [
            [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0)],
            [DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::Y],
        ];
        assert_eq!(obj(SQUARE).unwrap(), halves);
    }

    #[test]
    fn damaged_files_are_refused_and_take_no_memory() {
        let mut long = binary(b"");
        long[HEADER - 4..HEADER].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(stl(&long).unwrap_err().contains("as long as its header says"));
        for text in ["solid\nfacet\nvertex 1 2\n", "", "vertex 1 2 3\n"] {
            assert!(stl(text.as_bytes()).is_err(), "{text}");
        }
        for text in ["v 0 0 0\nf 1 2 3\n", "v 0 0 0\nf x\n", "v 0 0\nf 1 1 1\n"] {
            assert!(obj(text.as_bytes()).is_err(), "{text}");
        }
        // Changed bytes give triangles or an error.
        let mut random = 1_u64;
        let mut next = |below: usize| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 33) as usize % below
        };
        for _ in 0..3_000 {
            for (whole, read) in [(TEXT, stl as fn(&[u8]) -> _), (&binary(b"a")[..], stl), (SQUARE, obj)] {
                let mut bytes = whole.to_vec();
                for _ in 0..=next(3) {
                    let at = next(bytes.len());
                    bytes[at] = next(256) as u8;
                }
                bytes.truncate(bytes.len() - next(bytes.len()) * next(2));
                let _ = read(&bytes);
            }
        }
    }
}
