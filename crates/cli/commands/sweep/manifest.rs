//! `manifest.json` of a sweep's folder: definition of the sweep, and state of each run.
//!
//! The files of the runs are authoritative; the manifest avoids reading all of them. It is replaced
//! atomically, so it can be read at any instant.

use std::{
    collections::HashMap,
    fs,
    io::{self, BufReader, BufWriter, ErrorKind, Write},
    path::{Path, PathBuf},
};

use haff_engine::TRAJECTORY_VERSION;
use serde::{Deserialize, Serialize};
use tempfile::NamedTempFile;

use super::{
    growth,
    plan::{Member, Plan},
    row::Row,
    values::{Axis, same_scene},
};
use crate::{
    arguments::VERSION,
    terminal::{
        failure::{Failure, Status},
        output::{self, shown},
        words::{output_option, say, set},
    },
};

/// Name of the manifest in the sweep's folder.
pub const NAME: &str = "manifest.json";
/// Version of the manifest's layout.
const LAYOUT: u32 = 1;

/// The whole file.
#[derive(Debug, Serialize, Deserialize)]
struct Content {
    manifest: u32,
    version: String,
    trajectory_version: u32,
    scene: PathBuf,
    scene_toml: String,
    set: Vec<String>,
    seeds: Option<u32>,
    runs: Vec<Row>,
}

/// The manifest of a plan in its folder.
#[derive(Debug)]
pub struct Manifest {
    path: PathBuf,
    content: Content,
    grown: bool,
}

impl Manifest {
    /// The manifest in a folder, or a new one for the plan; nothing is written.
    ///
    /// # Errors
    /// If the folder holds another sweep, or a manifest that cannot be read.
    pub fn of_folder(folder: &Path, plan: &Plan) -> Result<Self, Failure> {
        let path = folder.join(NAME);
        let mut content = Content {
            manifest: LAYOUT,
            version: VERSION.to_owned(),
            trajectory_version: TRAJECTORY_VERSION,
            scene: plan.scene.clone(),
            scene_toml: plan.text.clone(),
            set: plan.axes.iter().map(ToString::to_string).collect(),
            seeds: plan.seeds,
            runs: plan.members().map(|member| Row::missing(&member)).collect(),
        };
        let mut grown = false;
        if let Some(known) = read(&path)? {
            let difference = difference(&known, &content);
            grown = has_another_grid(&known, &content);
            match (difference, rows_of(plan, known, grown)) {
                (None, Some(rows)) => content.runs = rows,
                (difference, _) => {
                    let difference = difference.unwrap_or_else(|| "its keys are others".to_owned());
                    return Err(Failure::new(
                        Status::File,
                        format!(
                            "{} belongs to another sweep: {}; take another folder {}",
                            output::path(&path),
                            shown(difference),
                            output_option("output")
                        ),
                    ));
                }
            }
        }
        Ok(Self { path, content, grown })
    }

    /// The member of a number, with its file.
    pub fn member(&self, plan: &Plan, index: usize) -> Member {
        Member { file: self.content.runs[index].file.clone(), ..plan.member(index) }
    }

    /// Whether the folder has a manifest of fewer values or seeds.
    pub fn is_grown(&self) -> bool {
        self.grown
    }

    /// Replaces a manifest of fewer values or seeds, so that the new runs have their files.
    pub fn grow(&self) -> Result<(), Failure> {
        if self.grown { self.write() } else { Ok(()) }
    }

    /// Whether the folder has a manifest.
    pub fn exists(&self) -> bool {
        self.path.exists()
    }

    /// Makes the folder, and the manifest unless it exists.
    pub fn begin(&self) -> Result<(), Failure> {
        let folder = self.folder();
        fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;
        if self.exists() {
            return Ok(());
        }
        // Members of a job array start at the same time; all write the same.
        match self.temporary()?.persist_noclobber(&self.path) {
            Ok(_) => Ok(()),
            Err(error) if error.error.kind() == ErrorKind::AlreadyExists => Ok(()),
            Err(error) => Err(unwritable(&self.path, &error.error)),
        }
    }

    /// Replaces the manifest.
    pub fn write(&self) -> Result<(), Failure> {
        self.temporary()?.persist(&self.path).map(drop).map_err(|error| unwritable(&self.path, &error.error))
    }

    fn temporary(&self) -> Result<NamedTempFile, Failure> {
        let write = || {
            // With the permissions of ordinary files, unlike temporary ones. Created and written by `fs`,
            // whose errors do not contain the temporary name.
            let create = |path: &Path| fs::File::create_new(path);
            let file = tempfile::Builder::new().prefix(".manifest").make_in(self.folder(), create)?;
            let mut out = BufWriter::new(file.as_file());
            serde_json::to_writer_pretty(&mut out, &self.content)?;
            out.write_all(b"\n")?;
            out.flush()?;
            drop(out);
            Ok(file)
        };
        write().map_err(|error: io::Error| unwritable(&self.path, &error))
    }

    /// The sweep's folder.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new("."))
    }

    /// All rows.
    pub fn rows(&self) -> &[Row] {
        &self.content.runs
    }

    /// The row of a member.
    pub fn row_mut(&mut self, index: usize) -> &mut Row {
        &mut self.content.runs[index]
    }
}

/// The rows of the sweep in a folder.
///
/// # Errors
/// If the folder has no manifest, or one that cannot be read.
pub fn rows_in(folder: &Path) -> Result<Vec<Row>, Failure> {
    let missing = || {
        let text = format!("{}: no {NAME}, so it is not the folder of a sweep", output::path(folder));
        Failure::new(Status::File, text)
    };
    read(&folder.join(NAME))?.map(|content| content.runs).ok_or_else(missing)
}

/// Reads a manifest; `None` if it does not exist.
fn read(path: &Path) -> Result<Option<Content>, Failure> {
    let file = match fs::File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) if error.kind() == ErrorKind::NotADirectory => {
            let folder = path.parent().unwrap_or(path);
            return Err(Failure::new(Status::File, format!("{} is not a folder", output::path(folder))));
        }
        Err(error) => return Err(Failure::new(Status::File, format!("{}: {error}", output::path(path)))),
    };
    serde_json::from_reader(BufReader::new(file)).map(Some).map_err(|error| {
        let message = format!("{} is not the manifest of a sweep: {}", output::path(path), shown(error));
        Failure::new(Status::File, message)
    })
}

/// The first difference that makes two manifests those of different sweeps, if any.
fn difference(known: &Content, given: &Content) -> Option<String> {
    if known.manifest != given.manifest {
        return Some(format!("its layout is {}, this version writes {}", known.manifest, given.manifest));
    }
    if known.trajectory_version != given.trajectory_version {
        return Some(format!(
            "it was begun with trajectory version {} (haff {}), this is version {}",
            known.trajectory_version, known.version, given.trajectory_version
        ));
    }
    let text = |seeds: Option<u32>| match seeds {
        Some(n) => format!("{}{n}", say("--seeds ", "seeds=")),
        None => say("no --seeds", "no seeds").to_owned(),
    };
    if known.seeds.is_some() != given.seeds.is_some() || known.seeds > given.seeds {
        return Some(format!("it has {}, not {}", text(known.seeds), text(given.seeds)));
    }
    if !has_values_of(known, given) {
        return Some(format!(
            "it has {}, and may get more values of these keys; not {}",
            all_set(&known.set),
            all_set(&given.set)
        ));
    }
    if !same_scene(&known.scene_toml, &given.scene_toml) {
        return Some(format!("its scene is not that of {}", given.scene.display()));
    }
    None
}

/// Keys with their values.
fn all_set(texts: &[String]) -> String {
    texts.iter().map(set).collect::<Vec<_>>().join(" ")
}

/// Keys and values of `--set`; none if they are invalid.
fn axes(content: &Content) -> Vec<Axis> {
    content.set.iter().filter_map(|text| Axis::parse(text).ok()).collect()
}

/// Whether both have the same keys, and the second all values of the first. Equal values may be written
/// differently: 2, 2.0 or 2e0.
fn has_values_of(known: &Content, given: &Content) -> bool {
    let [known, given] = [axes(known), axes(given)];
    known.len() == given.len()
        && known.iter().all(|axis| given.iter().any(|other| other.key == axis.key && other.has_all_of(axis)))
}

/// Whether the first has fewer values or seeds, or its keys or values in another order.
fn has_another_grid(known: &Content, given: &Content) -> bool {
    let canonical = |content| axes(content).iter().map(Axis::canonical).collect::<Vec<_>>();
    known.seeds != given.seeds || canonical(known) != canonical(given)
}

/// The rows of a plan with those of a manifest. `grown`: the manifest has fewer of them, or another order.
fn rows_of(plan: &Plan, known: Content, grown: bool) -> Option<Vec<Row>> {
    if grown {
        let earlier = plan.with(axes(&known), known.seeds);
        return growth::rows(plan, &earlier, known.runs);
    }
    let mut rows: HashMap<usize, Row> = known.runs.into_iter().map(|row| (row.index, row)).collect();
    let known = |member: Member| {
        let row = rows.remove(&member.index).filter(growth::has_own_file);
        row.unwrap_or_else(|| Row::missing(&member))
    };
    Some(plan.members().map(known).collect())
}

fn unwritable(path: &Path, error: &io::Error) -> Failure {
    Failure::new(Status::File, format!("{}: cannot write: {error}", output::path(path)))
}
