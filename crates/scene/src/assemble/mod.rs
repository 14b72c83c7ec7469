/*!
Assembles a [`Scene`] from a checked [`SceneConfig`]: all checks, all defaults.

Checks are made in rounds, and a round starts only if the previous one found no error: syntax and types;
values one by one and against each other; geometry; placement. Within a round all errors are found.

*What is here.* A file for each section of a scene ([`domain`], [`particles`], [`contact`], [`drive`],
[`measure`], [`plan`], …), with its checks and the texts of its errors; [`going_on`] for walls that go on
from where they are.

*What to change here.* The check of a new key, in the file of its section.

*May import* all rooms below: `source`, `plugins`, `config`, `model` and `placement`.

*Begin with* [`domain`].
*/

mod compression;
mod contact;
mod container;
mod domain;
mod drag;
mod drive;
mod flow;
mod going_on;
mod growth;
mod joints;
mod measure;
mod mesh;
mod motion;
mod names;
mod particles;
mod partition;
mod passage;
mod piston;
mod placement;
mod plan;
mod region;
mod restitution;
mod scaling;
mod shape;
mod shear;
mod sizes;
mod spin;
mod surface;
mod values;

use glam::DVec3;
use haff_engine::{Compression, Dimension, NeighborChoice, Options, SimdChoice, System, bounds};

use crate::config::document::Document;
use crate::config::{EngineConfig, NeighborsConfig, SceneConfig, SimdConfig, templates::template};
use crate::model::present::Present;
use crate::model::scene::Scene;
use crate::model::state::StateSource;
use crate::source::error::{Code, ErrorKind, SceneError, SceneErrors};
use crate::source::mesh::MeshFile;
use values::{at, storable};

/// Bytes per particle that a run needs, to refuse systems that do not fit: the largest value measured, in a
/// dense random packing; the run itself takes about 250.
const BYTES_PER_PARTICLE: f64 = 420.0;

/// Reading a text may always take this much [bytes], even if the system reports less free memory.
const LEAST_MEMORY: u64 = 256 << 20;

/// Rows are 32-bit numbers in the engine and in files.
const MAX_PARTICLES: u64 = 1 << 31;

/// Limits of a scene on this machine.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    pub(crate) particles: u64,
    /// For reading the text [bytes].
    pub(crate) memory: u64,
}

impl Limits {
    /// As many particles as fit into the free memory, if the system reports it.
    pub(crate) fn of_this_machine() -> Self {
        let free = available_memory();
        let fits = free.map_or(u64::MAX, |bytes| (bytes / BYTES_PER_PARTICLE) as u64);
        let memory = free.map_or(u64::MAX, |bytes| bytes as u64).max(LEAST_MEMORY);
        Self { particles: fits.clamp(10_000, MAX_PARTICLES), memory }
    }
}

/// Free memory [bytes], from `/proc`.
fn available_memory() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().trim_end_matches("kB").trim().parse::<f64>().ok().map(|kilobytes| 1024.0 * kilobytes)
}

/// Keys that may change in a run that goes on, with those below them.
pub const CHANGEABLE: [&str; 7] = ["contact", "domain.gravity", "engine", "output", "run", "title", "wall"];

/// Where the particles are, and with them the time of checks that depend on time.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Start<'a> {
    /// Where the scene puts them, at time 0.
    Scene,
    /// In the checkpoint of the file that has recorded the scene.
    Recorded,
    /// In a simulation that goes on with changed keys.
    Present(&'a Present),
}

/// A scene under construction.
struct Assembler<'a> {
    document: Document,
    /// As written, with overrides; the checks add the defaults, which makes the resolved scene.
    config: SceneConfig,
    states: &'a dyn StateSource,
    start: Start<'a>,
    limits: Limits,
    dimension: Dimension,
    seed: u64,
    /// Pairs of groups that stick.
    sticking: Vec<[u32; 2]>,
    sticking_to_walls: Vec<[u32; 2]>,
    unreadable: bool,
    /// The meshes of walls, each once.
    meshes: Vec<MeshFile>,
}

/// An error has been recorded in the document.
struct Refused;

pub(crate) fn assemble(
    name: &str,
    text: &str,
    overrides: &[String],
    states: &dyn StateSource,
    start: Start<'_>,
    limits: Limits,
) -> Result<Scene, SceneErrors> {
    scene_of(name, Document::new(name, text, overrides, limits.memory), states, start, limits)
}

/// [`assemble`] with overrides of the keys in `changeable` only.
pub(crate) fn assemble_changed(
    name: &str,
    text: &str,
    overrides: &[String],
    changeable: &[&str],
    states: &dyn StateSource,
    start: Start<'_>,
    limits: Limits,
) -> Result<Scene, SceneErrors> {
    let mut document = Document::new(name, text, overrides, limits.memory);
    document.allow_overrides(changeable);
    scene_of(name, document, states, start, limits)
}

fn scene_of(
    name: &str,
    mut document: Document,
    states: &dyn StateSource,
    start: Start<'_>,
    limits: Limits,
) -> Result<Scene, SceneErrors> {
    let garbled = document.is_garbled();
    let config = if garbled { SceneConfig::default() } else { document.config() };
    let mut assembler = Assembler {
        document,
        config,
        states,
        start,
        limits,
        dimension: Dimension::Three,
        seed: 0,
        sticking: Vec::new(),
        sticking_to_walls: Vec::new(),
        unreadable: false,
        meshes: Vec::new(),
    };
    let result = if garbled { Err(Refused) } else { assembler.scene(name) };
    if let (Ok(scene), true) = (result, assembler.document.is_sound()) {
        return Ok(scene);
    }
    let kind = if assembler.unreadable { ErrorKind::Unreadable } else { ErrorKind::Invalid };
    let (errors, more, source) = assembler.document.into_errors();
    Err(SceneErrors { errors, more, source, kind })
}

/// The error of a scene file that is too long.
pub(crate) fn too_long(name: &str) -> SceneErrors {
    invalid(name, crate::source::weight::too_long())
}

/// The error of a scene file that cannot be read.
pub(crate) fn unreadable(name: &str, why: &std::io::Error) -> SceneErrors {
    let (code, why) = match why.kind() {
        std::io::ErrorKind::InvalidData => (Code::NotText, "it is not text".to_owned()),
        std::io::ErrorKind::NotFound if template(name).is_some() => {
            let hint = format!("a template is called so: haff init {name} > {name}.toml writes its scene");
            (Code::Unreadable, format!("{why}; {hint}"))
        }
        _ => (Code::Unreadable, why.to_string()),
    };
    whole(SceneError::of_file(name, code, format!("cannot read the scene: {why}")), ErrorKind::Unreadable)
}

/// The error of a text that no scene can have.
pub(crate) fn invalid(name: &str, message: String) -> SceneErrors {
    whole(SceneError::of_file(name, Code::Syntax, message), ErrorKind::Invalid)
}

/// An error of a scene file as a whole.
fn whole(error: SceneError, kind: ErrorKind) -> SceneErrors {
    SceneErrors { errors: vec![error], more: 0, source: String::new(), kind }
}

impl Assembler<'_> {
    fn scene(&mut self, name: &str) -> Result<Scene, Refused> {
        self.header(name);
        let options = self.options();
        let species = self.species_plans();
        self.place_by_angles();
        let explicit = self.particle_plans();
        let names = self.names();
        let mut domain = self.domain_plan(!species.is_empty(), !explicit.is_empty());
        self.walls_go_on(&domain.wall_names());
        let extra_walls = self.extra_walls(&domain);
        let wall_names: Vec<String> =
            domain.wall_names().into_iter().chain(extra_walls.iter().map(|wall| wall.name.clone())).collect();
        self.check_names(&names, &wall_names);
        let shear = self.shear_plan(&domain, self.config.wall.as_ref().map_or(0, Vec::len));
        self.check_sheared_masses(shear.as_ref(), &species, &explicit);
        let contacts = self.contacts(&names, &wall_names);
        let rates = self.compression_plan(&domain, &extra_walls, &species, &explicit);
        let growth = self.growth_plan(&domain, &extra_walls, &species, &explicit);
        let spin = self.spin_plan(&names, &wall_names);
        let motions = self.wall_motions();
        let (mut drives, drag) = self.drives(&names);
        let initial = self.initial(species.len());
        self.run_shape();
        self.output_shape();
        self.measure_shape();
        let passages = self.passages(&species, &names);
        let to_come = if let Some(passages) = &passages { passages.count() } else { 0 };
        self.count_particles(&species, explicit.len(), to_come);
        self.gate()?;

        // All single values are valid here. Sizes and masses, then the box, then positions.
        let mut rows = self.draw_rows(&species, &explicit, &names);
        self.gate()?;
        let state = self.read_state(&initial, &species, &mut rows)?;
        self.fix_size(&mut domain, &species, &rows, state.as_ref());
        self.gate()?;
        if let Some(growth) = &growth {
            self.check_growth(growth, &rows);
        }
        let rates = growth.as_ref().map_or(rates, |growth| Some(growth.rates(self.dimension, &rows)));
        drives.extend(growth.as_ref().and_then(|growth| growth.rescaling(names.all.len(), &rows)));
        let compression = rates.map(|rates| Compression { rates, inside: 1.0 });
        let mut system_domain = domain.finish(self.dimension, &rows, shear, compression);
        self.fix_shear(&mut system_domain, &rows, &initial, state.as_ref());
        let mut walls = domain.walls(&system_domain, extra_walls);
        self.shrink_container(&mut walls, domain.wall_names().len(), &mut system_domain);
        self.displace(&mut walls, &wall_names, &system_domain, &rows);
        self.set_motions(&mut walls, &wall_names, &motions, &rows);
        self.check_partitions(&walls, &system_domain, &rows);
        if let Some(passages) = &passages {
            self.check_passages(passages, &system_domain, &walls, &species);
        }
        self.check_box(&system_domain, &rows, initial.positions.as_ref());
        self.check_compressed_edges(&system_domain, &rows);
        self.check_resolution(&system_domain, &species, &rows, initial.positions.as_ref());
        self.gate()?;
        // Scenes with joints have few bodies, and their joints are checked at the start.
        let at_start = matches!(self.start, Start::Scene) || self.has_joints();
        if at_start {
            self.check_places(&system_domain, &walls, &mut rows, state.as_ref(), &contacts);
            self.gate()?;
            self.place_species(&system_domain, &walls, &species, &mut rows, &initial);
            self.gate()?;
        }
        self.draw_velocities(&species, &mut rows, &initial, state.as_ref());
        flow::add(&system_domain, &species, &mut rows, &initial, state.as_ref());

        let spin = spin.map(|plan| self.spin(plan, &species, &rows, state.as_ref()));
        let present = rows.bodies.len();
        let first = rows.species;
        let mut system = System {
            dimension: self.dimension,
            domain: system_domain,
            bodies: std::mem::take(&mut rows.bodies),
            classes: std::mem::take(&mut rows.classes),
            groups: names.all.iter().map(|name| haff_engine::Group { name: name.clone() }).collect(),
            species: names.all.clone(),
            walls,
            contacts,
            spin,
            drag: drag.map(|(_, drag)| drag),
            drives,
            seed: self.seed,
            measure: haff_engine::Measure::default(),
            flow: passages.as_ref().map(|passages| Box::new(passages.of_start(present))),
        };
        let joints = self.joints(first, &|row| system.bodies[row].position);
        self.gate()?;
        self.check_joints(&system, &joints);
        self.check_drag(drag.as_ref(), &system);
        if at_start {
            self.check_displaced_images(&system, state.is_some());
        }
        self.gate()?;
        let rate = plan::collision_rate(&system);
        let rate_unknown = plan::rate_unknown(&system, rate, system.bodies.len() - first, &joints);
        let box_limit = compression::box_limit(&system, first);
        let mut run = self.run_plan(&system);
        if let Some(growth) = &growth {
            self.end_growth(growth, &system, box_limit.as_ref(), &mut run);
        }
        self.check_compression(&system, box_limit.as_ref(), rate, &mut run);
        self.gate()?;
        let output = self.output_plan(&system, &run, rate);
        self.gate()?;
        system.measure = self.measure(&system, &run, &output);
        self.check_compressed(&system);
        self.gate()?;
        let packing_fraction = plan::packing_fraction(&system);
        if let Some(passages) = &passages {
            passages.add_waiting((self.seed, self.dimension), &mut system, &species, rows);
        }
        Ok(Scene {
            title: self.config.title.clone().unwrap_or_default(),
            seed: self.seed,
            state_file: initial.state_file(),
            packing_fraction,
            collision_rate: rate,
            rate_unknown,
            system,
            joints,
            options,
            run,
            box_limit,
            output,
            resolved: self.resolved()?,
            meshes: std::mem::take(&mut self.meshes),
        })
    }

    /// Returns if an error has been found.
    fn gate(&self) -> Result<(), Refused> {
        if self.document.is_sound() { Ok(()) } else { Err(Refused) }
    }

    fn header(&mut self, name: &str) {
        if let Some(schema) = self.config.schema
            && schema != 1
        {
            self.document.refuse(&at(["schema"]), "must be 1, the only version of the format so far");
        }
        self.config.schema = Some(1);
        match self.config.dimension.unwrap_or(3) {
            2 => self.dimension = Dimension::Two,
            3 => {}
            _ => self.document.refuse(&at(["dimension"]), "must be 2 or 3"),
        }
        self.config.dimension = Some(self.dimension.count() as i64);
        match u64::try_from(self.config.seed.unwrap_or(0)) {
            Ok(seed) => self.seed = seed,
            Err(_) => self.document.refuse(&at(["seed"]), "must be in 0..=9223372036854775807"),
        }
        self.config.seed = Some(self.seed as i64);
        if let Some(title) = &self.config.title {
            storable(&mut self.document, &at(["title"]), title);
        }
        self.config.title.get_or_insert_with(|| {
            std::path::Path::new(name)
                .file_stem()
                .map_or_else(String::new, |stem| stem.to_string_lossy().into())
        });
    }

    fn options(&mut self) -> Options {
        let engine = self.config.engine.get_or_insert_with(EngineConfig::default);
        let neighbors = *engine.neighbors.get_or_insert(NeighborsConfig::Auto);
        let simd = *engine.simd.get_or_insert(SimdConfig::Auto);
        let neighbors = match neighbors {
            NeighborsConfig::Auto => NeighborChoice::Auto,
            NeighborsConfig::Cells => NeighborChoice::Cells,
            NeighborsConfig::AllPairs => NeighborChoice::AllPairs,
            NeighborsConfig::Lists => NeighborChoice::Lists,
            NeighborsConfig::Windows => NeighborChoice::Windows,
        };
        let simd = match simd {
            SimdConfig::Auto => SimdChoice::Auto,
            SimdConfig::Avx2 => SimdChoice::Avx2,
            SimdConfig::Portable => SimdChoice::Portable,
        };
        let blocks = engine.blocks.map(|blocks| u16::try_from(blocks).unwrap_or(0));
        if blocks.is_some_and(|blocks| !(1..=1024).contains(&blocks)) {
            self.document.refuse(&at(["engine", "blocks"]), "must be in 1..=1024");
        }
        Options { neighbors, simd, blocks }
    }

    fn resolved(&mut self) -> Result<String, Refused> {
        toml::to_string(&self.config).map_err(|error| {
            self.document.report(&[], format!("cannot be written out again: {error}"));
            Refused
        })
    }

    /// The components of a vector of the scene: one per dimension, or three with z = 0.
    fn vector(&mut self, path: &[String], values: &[f64]) -> DVec3 {
        let d = self.dimension.count();
        if values.len() != d && values.len() != 3 {
            let form = if d == 2 { "two numbers (or three, the last one 0)" } else { "three numbers" };
            self.document.refuse(path, format!("must have {form}"));
            return DVec3::ZERO;
        }
        if let Some(k) = values.iter().position(|&x| bounds::component(x).is_err()) {
            let mut element = path.to_vec();
            element.push(k.to_string());
            self.document.refuse(&element, bounds::FINITE);
            return DVec3::ZERO;
        }
        if d == 2 && values.len() == 3 && values[2] != 0.0 {
            self.document.refuse(path, "must have z = 0 in two dimensions");
            return DVec3::ZERO;
        }
        DVec3::new(values[0], values[1], if d == 3 { values[2] } else { 0.0 })
    }

    /// The components in use in this dimension.
    fn components(&self, v: DVec3) -> Vec<f64> {
        v.to_array()[..self.dimension.count()].to_vec()
    }
}
