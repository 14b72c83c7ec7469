//! Measurements: which ones a scene can have, and their grids.

use std::sync::Arc;

use haff_engine::{
    Boundary, Correlations, Followed, Grid, GridAxis, Measure, NamedProbe, SceneFeatures, System, observables,
};

use super::Assembler;
use super::names::among;
use super::plan::MAX_RECORDS;
use super::values::{at, item, positive};
use crate::config::document::Path;
use crate::config::{
    BinsConfig, FollowedConfig, FollowedSpeciesConfig, InletConfig, MeasureConfig, ProbeConfig,
    ProfileConfig, SpeciesChoice,
};
use crate::model::scene::{OutputPlan, RunPlan, Schedule};
use crate::plugins::{make_probe, probe_names};

/// Largest number of cells of a profile: each takes 400 bytes.
const MAX_CELLS: f64 = 1e7;
/// Number of states in the mean of a row of a profile, unless given.
const SAMPLES: i64 = 10;
/// Most components of a column of a probe: Python has a column for each.
const MOST_COMPONENTS: usize = 16;
/// Largest number of particles that are followed, unless given.
const TRACERS: i64 = 20_000;

/// The path of a key of a profile.
fn profile(index: usize, key: &str) -> Path {
    let mut path = at(["measure"]);
    path.extend(item("profiles", index, key));
    path
}

impl Assembler<'_> {
    /// Checks the keys of `[measure]`, alone and against each other.
    pub(super) fn measure_shape(&mut self) {
        let Some(measure) = self.config.measure.clone() else { return };
        let on = |flag: Option<bool>| flag == Some(true);
        let [msd, vacf] =
            [&measure.msd, &measure.vacf].map(|key| key.as_ref().is_some_and(FollowedConfig::any));
        let flags = [
            ("stress", on(measure.stress)),
            ("wall_forces", on(measure.wall_forces)),
            ("pair_collisions", on(measure.pair_collisions)),
            ("msd", msd),
            ("vacf", vacf),
            ("stress_correlation", on(measure.stress_correlation)),
            ("profiles", measure.profiles.as_ref().is_some_and(|profiles| !profiles.is_empty())),
            ("probes", measure.probes.as_ref().is_some_and(|probes| !probes.is_empty())),
        ];
        let rests =
            self.config.contact.as_ref().and_then(|contact| contact.rest_speed).is_some_and(|v| v > 0.0);
        for (key, _) in flags.iter().filter(|(_, on)| *on) {
            if self.has_joints() {
                let why = "does not work with pendulums, springs, rods or sticking contacts";
                self.document.report(&at(["measure", key]), why);
            } else if rests && matches!(*key, "stress" | "wall_forces" | "stress_correlation") {
                let why = "does not work with contact.rest_speed: grains at rest on each other transmit forces \
                           that are not computed";
                self.document.report(&at(["measure", key]), why);
            }
        }
        if let Some(interval) = measure.interval {
            positive(&mut self.document, &at(["measure", "interval"]), interval);
            if !(msd || vacf || on(measure.stress_correlation)) {
                let why = "is the shortest lag of correlations: turn on msd, vacf or stress_correlation";
                self.document.report(&at(["measure", "interval"]), why);
            }
        }
        if measure.tracers.is_some_and(|count| count < 1) {
            self.document.refuse(&at(["measure", "tracers"]), "must be 1 or more");
        }
        let profiles = measure.profiles.unwrap_or_default();
        for (index, config) in profiles.iter().enumerate() {
            self.profile_shape(index, config);
            let same = |other: &ProfileConfig| other.axis.is_some() && other.axis == config.axis;
            if profiles[..index].iter().any(same) {
                let why = "there is a profile along it already: files name profiles by their axes";
                self.document.report(&profile(index, "axis"), why);
            }
        }
    }

    /// Checks the keys of one profile.
    fn profile_shape(&mut self, index: usize, config: &ProfileConfig) {
        let axes = self.profile_axes(index, config);
        match &config.bins {
            None => {
                let why = "missing: the number of cells along the axis";
                self.document.report_missing(&profile(index, "bins"), why);
            }
            Some(bins) => {
                let bins = bin_counts(bins, axes.len());
                if bins.len() != axes.len() && !axes.is_empty() {
                    let why = format!("must be one number, or {}, one for each axis", axes.len());
                    self.document.refuse(&profile(index, "bins"), why);
                } else if !bins.iter().all(|&count| count >= 1.0 && count == count.trunc()) {
                    self.document.refuse(&profile(index, "bins"), "must be whole numbers, 1 or more");
                } else if bins.iter().product::<f64>() > MAX_CELLS {
                    self.document.report(&profile(index, "bins"), "makes more than 1e7 cells");
                }
            }
        }
        match config.interval {
            None => {
                self.document.report_missing(&profile(index, "interval"), "missing: the time between rows");
            }
            Some(interval) => {
                positive(&mut self.document, &profile(index, "interval"), interval);
            }
        }
        if config.samples.is_some_and(|samples| !(1..=1_000_000).contains(&samples)) {
            self.document.refuse(&profile(index, "samples"), "must be between 1 and 1e6");
        }
        if let Some(range) = &config.range {
            let path = profile(index, "range");
            if range.len() != 2 * axes.len() && !axes.is_empty() {
                let why = "must have two numbers for each axis: [low, high], or [low, high, low, high]";
                self.document.refuse(&path, why);
            } else if !range.chunks_exact(2).all(|ends| {
                ends.iter().all(|end| end.is_finite() && end.abs() <= super::values::LARGEST)
                    && ends[0] < ends[1]
            }) {
                self.document.refuse(&path, "must be finite, with low < high");
            }
        }
    }

    /// The axes of a profile; empty if an error has been reported.
    fn profile_axes(&mut self, index: usize, config: &ProfileConfig) -> Vec<usize> {
        let letters = &["x", "y", "z"][..self.dimension.count()];
        let path = profile(index, "axis");
        let Some(text) = &config.axis else {
            self.document
                .report_missing(&path, "missing: the axis, such as \"z\", or several, such as \"xz\"");
            return Vec::new();
        };
        let known = |letter: char| letters.iter().position(|known| known.starts_with(letter));
        let axes: Option<Vec<usize>> = text.chars().map(known).collect();
        match axes {
            Some(axes) if !axes.is_empty() && axes.windows(2).all(|pair| pair[0] < pair[1]) => axes,
            _ => {
                let why =
                    format!("must be one or several of {}, each once and in this order", letters.join(", "));
                self.document.refuse(&path, why);
                Vec::new()
            }
        }
    }

    /// The measurements of a system, and the defaults in the resolved scene.
    pub(super) fn measure(&mut self, system: &System, run: &RunPlan, output: &OutputPlan) -> Measure {
        let Some(mut config) = self.config.measure.clone() else { return Measure::default() };
        let on = |flag: &mut Option<bool>| *flag.get_or_insert(false);
        let MeasureConfig { stress, wall_forces, pair_collisions, stress_correlation, .. } = &mut config;
        let pair_collisions = on(pair_collisions);
        let (stress, wall_forces, stress_correlation) = (on(stress), on(wall_forces), on(stress_correlation));
        let msd = self.followed("msd", config.msd.get_or_insert(FollowedConfig::All(false)), system);
        let vacf = self.followed("vacf", config.vacf.get_or_insert(FollowedConfig::All(false)), system);
        let open = (0..system.dimension.count()).any(|axis| system.domain.boundary[axis] == Boundary::Open);
        for (key, _) in
            [("stress", stress), ("stress_correlation", stress_correlation)].iter().filter(|(_, on)| *on)
        {
            if open {
                let why = "needs a volume: an axis of the domain is open";
                self.document.report(&at(["measure", key]), why);
            }
        }
        if wall_forces && system.walls.is_empty() {
            self.document.report(&at(["measure", "wall_forces"]), "there are no walls");
        }
        let mut correlations =
            Correlations { msd, vacf, stress: stress_correlation, interval: 0.0, tracers: 0 };
        if correlations.any() {
            correlations.interval = self.correlation_interval(&mut config, run, output);
            correlations.tracers = *config.tracers.get_or_insert(TRACERS) as usize;
        }
        let mut profiles = config.profiles.take().unwrap_or_default();
        let grids = profiles
            .iter_mut()
            .enumerate()
            .filter_map(|(index, profile)| self.grid(system, run, index, profile))
            .collect();
        config.profiles = Some(profiles);
        let config_probes = config.probes.clone().unwrap_or_default();
        self.config.measure = Some(config);
        let probes = self.probes(config_probes);
        Measure { stress, wall_forces, pair_collisions, profiles: grids, correlations, probes }
    }

    /// Whose displacements or velocities are followed.
    fn followed(&mut self, key: &str, config: &FollowedConfig, system: &System) -> Followed {
        let given = match config {
            FollowedConfig::All(false) => return Followed::Nothing,
            FollowedConfig::All(true) => return Followed::All,
            FollowedConfig::Species(FollowedSpeciesConfig { species }) => species,
        };
        let path = at(["measure", key, "species"]);
        if let Some(given) = given {
            return Followed::Species(self.measured_species(&path, given, system));
        }
        self.document.report_missing(&path, "missing: \"each\", or names of species");
        Followed::Nothing
    }

    /// The species of a choice, as indices. They must have particles that move.
    fn measured_species(&mut self, path: &[String], given: &SpeciesChoice, system: &System) -> Vec<u32> {
        let inlets = self.config.inlet.clone().unwrap_or_default();
        let moves = |species: usize| {
            let is_let_in = |inlet: &InletConfig| inlet.species.as_ref() == Some(&system.species[species]);
            inlets.iter().any(is_let_in)
                || system.bodies.iter().any(|body| {
                    body.species as usize == species && system.classes[body.class as usize].mass.is_finite()
                })
        };
        let names: Vec<&str> = system.species.iter().map(String::as_str).collect();
        let names = match given {
            SpeciesChoice::Each(word) if word == "each" => {
                let found: Vec<u32> = (0..names.len()).filter(|&k| moves(k)).map(|k| k as u32).collect();
                if found.is_empty() {
                    self.document.report(path, "no species has particles that move");
                }
                return found;
            }
            SpeciesChoice::Each(_) => {
                self.document.refuse(path, "must be \"each\", or a list with names of species");
                return Vec::new();
            }
            SpeciesChoice::Names(given) if given.is_empty() => {
                self.document.refuse(path, "must name at least one species");
                return Vec::new();
            }
            SpeciesChoice::Names(given) => {
                given.iter().map(|name| (name, names.iter().position(|known| known == name)))
            }
        };
        let mut found = Vec::new();
        for (name, index) in names {
            match index {
                None => {
                    let known = || system.species.iter().map(String::as_str);
                    self.document.report(path, format!("no species is named {}", among(name, known)));
                }
                Some(index) if !moves(index) => {
                    self.document.report(path, format!("\"{name}\" has no particles that move"));
                }
                Some(index) if found.contains(&(index as u32)) => {
                    self.document.report(path, format!("\"{name}\" is there twice"));
                }
                Some(index) => found.push(index as u32),
            }
        }
        found
    }

    /// The probes of plug-ins.
    fn probes(&mut self, configs: Vec<ProbeConfig>) -> Vec<Arc<NamedProbe>> {
        let mut columns: Vec<String> = ["step", "time"].map(str::to_owned).into();
        columns.extend(
            observables(&SceneFeatures::all()).into_iter().map(|observable| observable.name.into_owned()),
        );
        let mut probes = Vec::with_capacity(configs.len());
        for (k, config) in configs.into_iter().enumerate() {
            let path = |key: &str| {
                let mut path = at(["measure"]);
                path.extend(item("probes", k, key));
                path
            };
            let known = || {
                let names: Vec<String> = probe_names().iter().map(|name| format!("\"{name}\"")).collect();
                if names.is_empty() { "this program has none".to_owned() } else { names.join(", ") }
            };
            let Some(name) = config.kind else {
                self.document
                    .report_missing(&path("kind"), format!("missing: a probe needs a kind: {}", known()));
                continue;
            };
            match make_probe(&name, &config.parameters.unwrap_or_default()) {
                None => {
                    let why = format!("must be one of these probes: {}", known());
                    self.document.refuse(&path("kind"), why);
                }
                Some(Err(faults)) => self.report_faults(&path("parameters"), faults),
                Some(Ok(probe)) => {
                    for column in probe.columns() {
                        let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '_';
                        let name = &column.name;
                        let why = if name.is_empty() || !name.chars().all(is_allowed) {
                            "must have a name of letters, digits and _ only"
                        } else if columns.contains(name) {
                            "has the name of another column of the observables"
                        } else if !(1..=MOST_COMPONENTS).contains(&column.components) {
                            "must have 1 to 16 components"
                        } else {
                            columns.push(name.clone());
                            continue;
                        };
                        self.document.report(&path("kind"), format!("its column \"{name}\" {why}"));
                    }
                    probes.push(probe);
                }
            }
        }
        probes
    }

    /// The time between states of correlations.
    fn correlation_interval(
        &mut self,
        config: &mut MeasureConfig,
        run: &RunPlan,
        output: &OutputPlan,
    ) -> f64 {
        let path = at(["measure", "interval"]);
        let of_samples =
            if let Schedule::Every(interval) = output.observables { Some(interval) } else { None };
        let Some(interval) = config.interval.or(of_samples) else {
            let why =
                "missing: the shortest lag of correlations, since output.observables is not an interval";
            self.document.report_missing(&path, why);
            return 1.0;
        };
        if run.until.is_some_and(|until| until / interval > MAX_RECORDS) {
            self.document.report(&path, "makes more than 1e8 states until run.until");
        }
        config.interval = Some(interval);
        interval
    }

    /// The grid of a profile. Its keys have been checked alone.
    fn grid(
        &mut self,
        system: &System,
        run: &RunPlan,
        index: usize,
        config: &mut ProfileConfig,
    ) -> Option<Grid> {
        let axes = self.profile_axes(index, config);
        let bins = bin_counts(config.bins.as_ref()?, axes.len());
        let samples = *config.samples.get_or_insert(SAMPLES) as u64;
        let spread = *config.spread.get_or_insert(true);
        let interval = config.interval?;
        let species = config
            .species
            .clone()
            .map_or(Vec::new(), |given| self.measured_species(&profile(index, "species"), &given, system));
        let is_open = |axis: usize| system.domain.boundary[axis] == Boundary::Open;
        if let Some(other) = (0..system.dimension.count()).find(|axis| is_open(*axis) && !axes.contains(axis))
        {
            let why = format!("needs a volume: the domain is open along {}", ["x", "y", "z"][other]);
            self.document.report(&profile(index, "axis"), why);
        }
        if let Some(&axis) = axes.iter().find(|axis| is_open(**axis))
            && config.range.is_none()
        {
            let why = format!("missing: the domain is open along {}", ["x", "y", "z"][axis]);
            self.document.report_missing(&profile(index, "range"), why);
            return None;
        }
        let range = config
            .range
            .get_or_insert_with(|| axes.iter().flat_map(|&axis| [0.0, system.domain.size[axis]]).collect());
        let mut grid = Vec::with_capacity(axes.len());
        for ((&axis, &bins), ends) in axes.iter().zip(&bins).zip(range.chunks_exact(2)) {
            let (low, high) = (ends[0], ends[1]);
            let edge = system.domain.size[axis];
            if !is_open(axis) && (low < 0.0 || high > edge) {
                let why = format!("must be within the box, 0 to {edge} along {}", ["x", "y", "z"][axis]);
                self.document.refuse(&profile(index, "range"), why);
            }
            grid.push(GridAxis { axis, low, high, bins: bins as usize });
        }
        if run.until.is_some_and(|until| until / interval * samples as f64 > MAX_RECORDS) {
            self.document.report(&profile(index, "interval"), "makes more than 1e8 states until run.until");
        }
        Some(Grid { axes: grid, interval, samples, spread, species })
    }
}

/// Numbers of cells along `axes` axes.
fn bin_counts(bins: &BinsConfig, axes: usize) -> Vec<f64> {
    match bins {
        BinsConfig::Each(count) => vec![*count; axes.max(1)],
        BinsConfig::PerAxis(counts) => counts.clone(),
    }
}
