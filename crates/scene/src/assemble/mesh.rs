//! Walls that are meshes of triangles, from STL and OBJ files.

use std::{
    collections::HashMap,
    fs::File,
    io::{Cursor, Read},
    path::{Path, PathBuf},
};

use glam::{DMat3, DVec3};
use haff_engine::Dimension;
use haff_mechanics::NamedSurface;
use haff_surfaces::{Mesh, Side};
use xxhash_rust::xxh3::xxh3_128;

use super::Assembler;
use super::values::{item, positive};
use crate::config::{MeshConfig, SideConfig};
use crate::source::error::Why;

/// Most triangles of a mesh: it and its tree take some 250 bytes for each.
const MOST_FACES: usize = 4_000_000;
/// Most bytes of a file: a triangle of a text takes about that many.
const LONGEST: u64 = 300 * MOST_FACES as u64;

impl Assembler<'_> {
    /// The mesh of wall `k`.
    pub(super) fn mesh(&mut self, k: usize, config: &MeshConfig) -> Option<&'static NamedSurface> {
        let errors = self.document.count();
        if self.dimension == Dimension::Two {
            self.document.report(&item("wall", k, "mesh"), "needs three dimensions");
        }
        let path = item("wall", k, "mesh.file");
        let Some(file) = &config.file else {
            self.document.report_missing(&path, "missing: a mesh needs an STL or OBJ file");
            return None;
        };
        let scale = config.scale.unwrap_or(1.0);
        positive(&mut self.document, &item("wall", k, "mesh.scale"), scale);
        let point = config.point.as_ref();
        let point = point.map_or(DVec3::ZERO, |point| self.vector(&item("wall", k, "mesh.point"), point));
        let mut turn = DMat3::IDENTITY;
        if let Some((axis, angle)) = &config.rotation {
            let path = item("wall", k, "mesh.rotation");
            let axis = self.vector(&path, axis).normalize();
            if axis.is_finite() && angle.is_finite() {
                turn = DMat3::from_axis_angle(axis, *angle);
            } else {
                let why = "must have an axis other than zero, and an angle [radians]: [[0, 0, 1], 1.5708]";
                self.document.refuse(&path, why);
            }
        }
        if self.document.count() != errors {
            return None;
        }
        let place = self.place_of(Path::new(file));
        let bytes = match read(&place) {
            Ok(bytes) => bytes,
            Err(why) => {
                self.document.report(&path, format!("cannot be read: {why}"));
                self.unreadable = true;
                return None;
            }
        };
        let hash = format!("{:032x}", xxh3_128(&bytes));
        if config.hash.as_ref().is_some_and(|known| *known != hash) {
            let why = "has changed since the run began: it goes on only with the same mesh";
            self.document.report(&path, why);
            return None;
        }
        let side = match config.side {
            None | Some(SideConfig::Both) => Side::Both,
            Some(SideConfig::Inside) => Side::Inside,
            Some(SideConfig::Outside) => Side::Outside,
        };
        let made = triangles(Path::new(file), &bytes).and_then(|mut triangles| {
            for corner in triangles.iter_mut().flatten() {
                *corner = turn * (*corner * scale) + point;
            }
            Mesh::new(&triangles, side).map_err(|error| error.to_string())
        });
        match made {
            Ok(mesh) => {
                if let Some(walls) = &mut self.config.wall
                    && let Some(mesh) = walls.get_mut(k).and_then(|wall| wall.mesh.as_mut())
                {
                    mesh.hash = Some(hash.clone());
                    // A run goes on from any directory.
                    let whole = std::fs::canonicalize(&place).unwrap_or(place);
                    mesh.file = Some(whole.to_string_lossy().into_owned());
                }
                let numbers = format!("{hash} {scale:?} {point:?} {:?} {side:?}", config.rotation);
                Some(NamedSurface::of("mesh", &numbers, Box::new(mesh)))
            }
            Err(why) => {
                self.document.report_why(&path, Why::stated(why));
                None
            }
        }
    }
}

impl Assembler<'_> {
    /// Where a file is: as it is named, or beside the scene file.
    fn place_of(&self, file: &Path) -> PathBuf {
        let beside = Path::new(self.document.name()).parent().map(|folder| folder.join(file));
        match beside {
            Some(beside) if !file.exists() && beside.exists() => beside,
            _ => file.to_owned(),
        }
    }
}

/// All bytes of a file, if it is not too long.
fn read(path: &Path) -> Result<Vec<u8>, String> {
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

/// The corners of the triangles of a file, by its suffix.
fn triangles(path: &Path, bytes: &[u8]) -> Result<Vec<[DVec3; 3]>, String> {
    let suffix = path.extension().map(|suffix| suffix.to_string_lossy().to_lowercase()).unwrap_or_default();
    let triangles = match suffix.as_str() {
        "stl" => stl(bytes)?,
        "obj" => obj(bytes)?,
        _ => return Err(format!("must end in .stl or .obj: meshes of \".{suffix}\" are not read")),
    };
    if triangles.len() > MOST_FACES {
        return Err(format!("has {} triangles, at most {MOST_FACES} are possible", triangles.len()));
    }
    Ok(triangles)
}

/// Those of an STL file, binary or text, whose coordinates are single-precision numbers.
fn stl(bytes: &[u8]) -> Result<Vec<[DVec3; 3]>, String> {
    let mesh =
        stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|error| format!("is not an STL file: {error}"))?;
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
