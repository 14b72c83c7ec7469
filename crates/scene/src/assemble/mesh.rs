//! Walls that are meshes of triangles, from STL and OBJ files.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use haff_engine::Dimension;
use haff_mechanics::NamedSurface;
use haff_surfaces::Mesh;

use super::Assembler;
use super::shape::side;
use super::values::{item, positive};
use crate::config::{MeshConfig, SideConfig};
use crate::source::{
    error::Why,
    mesh::{MeshFile, MeshFileError},
};

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
        // Another file that a change names must be there, and be the same.
        let is_set = self.document.is_overridden(&path);
        let known = config.hash.as_ref();
        let kept = || {
            let hash = known.filter(|_| !is_set)?;
            Some(MeshFile { corners: self.states.mesh(hash)?, hash: hash.clone() })
        };
        let file = match MeshFile::read(&place) {
            Ok(file) if known.is_none_or(|known| *known == file.hash) => file,
            read => match (kept(), read) {
                (Some(file), _) => file,
                (None, Ok(_)) => {
                    let why = "has changed since the run began: it goes on only with the same mesh";
                    self.document.report(&path, why);
                    return None;
                }
                (None, Err(error)) => {
                    self.unreadable |= matches!(error, MeshFileError::Unreadable(_));
                    self.document.report_why(&path, Why::stated(error.to_string()));
                    return None;
                }
            },
        };
        let hash = file.hash.clone();
        let side = side(Some(config.side.unwrap_or(SideConfig::Both)));
        let placed: Vec<_> =
            file.corners.iter().map(|corners| corners.map(|x| turn * (x * scale) + point)).collect();
        match Mesh::new(&placed, side) {
            Ok(mesh) => {
                if self.meshes.iter().all(|known| known.hash != hash) {
                    self.meshes.push(file);
                }
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
            Err(error) => {
                self.document.report(&path, error.to_string());
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
