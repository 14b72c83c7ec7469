//! Names of species, explicit particles and walls.

use std::collections::BTreeMap;

use super::Assembler;
use super::values::{at, item, storable};
use crate::config::WallConfig;
use crate::config::document::Path;
use crate::source::text::{LONGEST, cut, nearest, some_of};

/// The table of pair rules has the square of this many entries.
pub(super) const MAX_GROUPS: usize = 1000;
/// Name of the group of explicit particles that have none.
const UNNAMED: &str = "particle";

/// Message for an unknown name, with the most similar name and the first of the existing ones.
pub(super) fn among<'n, I: Iterator<Item = &'n str>>(name: &str, known: impl Fn() -> I) -> String {
    let near = nearest(name, known()).map_or_else(String::new, |best| format!("; did you mean \"{best}\"?"));
    format!("\"{}\"{near} (known: {})", cut(name, LONGEST), some_of(known()))
}

/// Names of contact groups: species, then the distinct names of particles.
pub(super) struct Names {
    pub(super) all: Vec<String>,
    pub(super) species: usize,
    /// The first explicit particle of each group beyond the species.
    first: Vec<usize>,
    /// Group of each explicit particle.
    pub(super) of_particle: Vec<u32>,
}

/// Index of the wall of each entry of `[[wall]]` among all walls: those of the boundary, then those with a
/// shape.
pub(super) fn wall_indices(configs: &[WallConfig], walls: &[String]) -> Vec<Option<usize>> {
    let boundary = |config: &WallConfig| walls.iter().position(|name| config.names_boundary(name));
    let shapes = configs.iter().filter(|config| boundary(config).is_none()).count();
    let mut next = walls.len().saturating_sub(shapes);
    let mut index = |config: &WallConfig| {
        let index = boundary(config).or_else(|| {
            next += 1;
            Some(next - 1)
        });
        index.filter(|&index| index < walls.len())
    };
    configs.iter().map(&mut index).collect()
}

impl Assembler<'_> {
    pub(super) fn names(&mut self) -> Names {
        let mut all: Vec<String> = Vec::new();
        for (k, species) in self.config.species.iter().flatten().enumerate() {
            all.push(species.name.clone().unwrap_or_else(|| format!("species.{k}")));
        }
        let species = all.len();
        let mut index: BTreeMap<String, u32> = BTreeMap::new();
        let (mut first, mut of_particle) = (Vec::new(), Vec::new());
        for (k, particle) in self.config.particle.iter_mut().flatten().enumerate() {
            let name = particle.name.get_or_insert_with(|| UNNAMED.to_owned());
            let next = all.len() as u32;
            let group = *index.entry(name.clone()).or_insert(next);
            if group == next {
                all.push(name.clone());
                first.push(k);
            }
            of_particle.push(group);
        }
        Names { all, species, first, of_particle }
    }

    /// Names of species and walls are unique, and no particle has the name of one.
    pub(super) fn check_names(&mut self, names: &Names, walls: &[String]) {
        let mut taken: BTreeMap<String, String> = BTreeMap::new();
        let mut uses: Vec<(String, Path, String)> = Vec::new();
        for (k, species) in self.config.species.iter().flatten().enumerate() {
            match &species.name {
                Some(name) => uses.push((name.clone(), item("species", k, "name"), format!("species.{k}"))),
                None => self
                    .document
                    .report_missing(&item("species", k, "name"), "missing: a species needs a name"),
            }
        }
        for (group, name) in names.all.iter().enumerate().skip(names.species) {
            let first = names.first[group - names.species];
            uses.push((name.clone(), item("particle", first, "name"), format!("particle.{first}")));
        }
        // The entry of each wall that has a shape.
        let configs = self.config.wall.as_deref().unwrap_or_default();
        let mut entry_of = vec![None; walls.len()];
        for (entry, index) in wall_indices(configs, walls).into_iter().enumerate() {
            if let Some(index) = index.filter(|&index| !configs[entry].names_boundary(&walls[index])) {
                entry_of[index] = Some(entry);
            }
        }
        for (name, entry) in walls.iter().zip(entry_of) {
            match entry {
                None => {
                    taken.insert(name.clone(), "a wall of the domain".into());
                }
                Some(own) => uses.push((name.clone(), item("wall", own, "name"), format!("wall.{own}"))),
            }
        }
        for (name, path, label) in uses {
            if name.trim().is_empty() {
                // Walls without a name have been reported.
                if path[0] != "wall" || !self.document.was_reported(&path) {
                    self.document.refuse(&path, "must not be empty");
                }
                continue;
            }
            storable(&mut self.document, &path, &name);
            if let Some(other) = taken.get(&name) {
                let message = format!("the name \"{name}\" is taken by {other}; names must differ");
                self.document.report(&path, message);
            }
            taken.entry(name).or_insert(label);
        }
        if names.all.len() > MAX_GROUPS {
            let list = if names.species > MAX_GROUPS { "species" } else { "particle" };
            let message = format!(
                "{} different names of species and particles, at most {MAX_GROUPS} are possible; particles may share one",
                names.all.len()
            );
            self.document.report(&at([list]), message);
        }
    }
}
