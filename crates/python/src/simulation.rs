//! A simulation that Python advances.

use std::{cell::RefCell, path::PathBuf, sync::Arc};

use glam::DVec3;
use haff_engine::{
    Boundary, Change, Domain, EngineError, EventKind, Grid, NewParticle, Sizes, Stop, Term, Until,
};
use haff_linkage::AnySimulation;
use haff_scene::{Due, OutputPlan, Scene};
use numpy::{PyArray1, PyArray2, PyReadonlyArray2};
use parking_lot::{ArcMutexGuard, Mutex, MutexGuard, RawMutex};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};

use crate::{
    arrays::{column, triples, vector, vectors},
    errors, events,
    keys::{self, Described, Refused},
    measured, observables,
    recording::{self, Recording, Texts},
    scenes::{Files, Source},
    threads::Threads,
};

/// Calendar entries between two checks for Ctrl-C: a few tens of milliseconds.
const SLICE: u64 = 1 << 15;

/// Time, step, positions, velocities, images and, with spin, angular velocities of one instant.
type Frame<'py> = (
    f64,
    u64,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<i32>>,
    Option<Bound<'py, PyArray2<f64>>>,
);

/// A particle to be added: position, velocity, angular velocity, radius, mass, index of the species.
type Added = ([f64; 3], [f64; 3], [f64; 3], f64, f64, u32);

thread_local! {
    /// Locks that [`Simulation::hold`] has taken.
    static HELD: RefCell<Vec<ArcMutexGuard<RawMutex, Moving>>> = const { RefCell::new(Vec::new()) };
}

/// The mutable part.
struct Moving {
    simulation: AnySimulation,
    threads: Threads,
    log: events::Log,
    /// The output file.
    recording: Option<Recording>,
    /// Whether the state has been changed from outside.
    changed: bool,
}

/// A running simulation. Other threads may read while one advances: they get the lock between slices.
#[pyclass(frozen, module = "haff._engine")]
pub struct Simulation {
    moving: Arc<Mutex<Moving>>,
    /// Number of its own threads, unless it shares those of the process.
    own_threads: Option<usize>,
    name: String,
    /// The state that the scene starts from, if it is recorded.
    files: Files,
    dimension: usize,
    sizes: Sizes,
    grids: Vec<Grid>,
    domain: Domain,
    #[pyo3(get)]
    species_names: Vec<String>,
    /// q = I/(m R²) by species, with spin.
    inertia: Option<Vec<f64>>,
    #[pyo3(get)]
    title: String,
    #[pyo3(get)]
    seed: u64,
    #[pyo3(get)]
    packing_fraction: f64,
    #[pyo3(get)]
    until: Option<f64>,
    #[pyo3(get)]
    collisions_asked: Option<u64>,
    /// What changes with keys of the scene; as [`Self::columns`] behind another lock than that of the
    /// simulation, which another thread may hold long.
    described: Mutex<Described>,
    /// Radii, masses and species.
    columns: Mutex<Columns>,
}

/// One value for each particle.
struct Columns {
    radius: Py<PyArray1<f64>>,
    mass: Py<PyArray1<f64>>,
    species: Py<PyArray1<i64>>,
    /// With spin.
    inertia: Option<Py<PyArray1<f64>>>,
}

impl Columns {
    /// Of particles with these radii, masses and species; `inertia` is q by species.
    fn new(py: Python<'_>, properties: &[(f64, f64, u32)], inertia: Option<&[f64]>) -> Self {
        let of_particles = |inertia: &[f64]| {
            let of = |species: u32| inertia.get(species as usize).copied().unwrap_or(f64::NAN);
            column(py, properties.iter().map(|(_, _, species)| of(*species)).collect()).unbind()
        };
        Self {
            inertia: inertia.map(of_particles),
            radius: column(py, properties.iter().map(|(radius, _, _)| *radius).collect()).unbind(),
            mass: column(py, properties.iter().map(|(_, mass, _)| *mass).collect()).unbind(),
            species: column(py, properties.iter().map(|(_, _, species)| i64::from(*species)).collect())
                .unbind(),
        }
    }
}

impl Simulation {
    fn read<R: Send>(&self, py: Python<'_>, f: impl FnOnce(&mut Moving) -> R + Send) -> PyResult<R> {
        // Without the interpreter's lock, which the thread that advances needs to release this one.
        let result = py.detach(|| {
            let mut guard = self.moving.lock();
            let mut threads = std::mem::take(&mut guard.threads);
            let moving: &mut Moving = &mut guard;
            let result = threads.run(|| f(moving));
            guard.threads = threads;
            // A fair unlock: otherwise the next slice would take the lock again before a waiting thread.
            MutexGuard::unlock_fair(guard);
            result
        });
        result.map_err(errors::threads)
    }
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (source, *, threads=None, events=false, file=None, overwrite=false, room=0))]
    // Taken from a dict, by value.
    #[allow(clippy::needless_pass_by_value)]
    fn new(
        py: Python<'_>,
        source: Source,
        threads: Option<usize>,
        events: bool,
        file: Option<PathBuf>,
        overwrite: bool,
        room: u32,
    ) -> PyResult<Self> {
        let own_threads = threads;
        let mut threads = Threads::new(own_threads);
        let files = Files::default();
        let mut scene = source.scene(py, &files)?;
        let texts = Texts::of(&mut scene);
        let Scene { system, joints, title, seed, run, options, resolved, packing_fraction, output, .. } =
            scene;
        let properties = |body: &haff_engine::Body| {
            let class = &system.classes[body.class as usize];
            (class.radius, class.mass, body.species)
        };
        let inertia = system.spin.as_ref().map(|spin| spin.inertia.clone());
        let properties: Vec<_> = system.bodies.iter().map(properties).collect();
        let columns = Mutex::new(Columns::new(py, &properties, inertia.as_deref()));
        let (dimension, domain, species_names) =
            (system.dimension.count(), system.domain, system.species.clone());
        let (sizes, grids) = (Sizes::of(&system), system.measure.profiles.clone());
        let springs = !joints.springs.is_empty();
        let described = Mutex::new(Described::of(&system, resolved, springs));
        let output = OutputPlan { file, ..output };
        let recording = Recording::create(&output, &system, texts, room, overwrite, events)
            .map_err(|error| errors::record(&error))?;
        let start = || AnySimulation::new(system, joints, options);
        let simulation = py
            .detach(|| threads.run(start))
            .map_err(errors::threads)?
            .map_err(|error| errors::simulation(py, &error, source.name()))?;
        let is_logged = events || recording.as_ref().is_some_and(Recording::wants_events);
        let mut moving = Moving {
            simulation,
            threads,
            log: events::Log { enabled: is_logged, ..events::Log::default() },
            recording,
            changed: false,
        };
        if let Some(recording) = &mut moving.recording {
            let first = Due { frame: true, sample: true };
            recording
                .record(&mut moving.simulation, first)
                .map_err(|ended| errors::ended(py, &ended, source.name()))?;
        }
        Ok(Self {
            moving: Arc::new(Mutex::new(moving)),
            own_threads,
            name: source.name().to_owned(),
            files,
            dimension,
            sizes,
            grids,
            domain,
            species_names,
            inertia,
            title,
            seed,
            packing_fraction,
            until: run.until,
            collisions_asked: run.collisions,
            described,
            columns,
        })
    }

    /// Runs events up to a bound; returns which one ended it. `waits`: time passes also where nothing moves.
    fn advance(&self, py: Python<'_>, until: f64, collisions: u64, waits: bool) -> PyResult<&'static str> {
        let bounds = Until { time: until, collisions, entries: SLICE };
        loop {
            let stop = self
                .read(py, |Moving { simulation, log, recording, .. }| {
                    simulation.wait(waits);
                    recording::advance(recording.as_mut(), simulation, bounds, log)
                })?
                .map_err(|ended| errors::ended(py, &ended, &self.name))?;
            match stop {
                Stop::Time => return Ok("until"),
                Stop::Collisions => return Ok("collisions"),
                Stop::Rest => return Ok("rest"),
                Stop::Slice => py.check_signals()?,
            }
        }
    }

    /// Writes the end of the output file, and closes it.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.read(py, |Moving { simulation, log, recording, .. }| match recording.take() {
            Some(recording) => recording.finish(simulation, log),
            None => Ok(()),
        })?
        .map_err(|ended| errors::ended(py, &ended, &self.name))
    }

    /// Leaves the output file to the process that this one is a copy of.
    fn abandon(&self) {
        std::mem::forget(self.moving.lock().recording.take());
    }

    /// Changes the state: arrays `[N][3]` of all positions, velocities or angular velocities, rows of
    /// particles to be removed, and particles to be added as (position, velocity, angular velocity, radius,
    /// mass, index of the species).
    #[pyo3(signature = (
        *, positions=None, velocities=None, angular_velocities=None, remove=Vec::new(), add=Vec::new()
    ))]
    fn change(
        &self,
        py: Python<'_>,
        positions: Option<PyReadonlyArray2<'_, f64>>,
        velocities: Option<PyReadonlyArray2<'_, f64>>,
        angular_velocities: Option<PyReadonlyArray2<'_, f64>>,
        remove: Vec<u32>,
        add: Vec<Added>,
    ) -> PyResult<()> {
        let vectors = |array: Option<PyReadonlyArray2<'_, f64>>| {
            array.map(|array| {
                let rows = array.as_array();
                rows.rows().into_iter().map(|row| DVec3::new(row[0], row[1], row[2])).collect()
            })
        };
        let add = add.into_iter().map(|(position, velocity, spin, radius, mass, species)| NewParticle {
            position: position.into(),
            velocity: velocity.into(),
            angular_velocity: spin.into(),
            radius,
            mass,
            species,
        });
        let change = Change {
            positions: vectors(positions),
            velocities: vectors(velocities),
            angular_velocities: vectors(angular_velocities),
            remove,
            add: add.collect(),
        };
        let properties = self
            .read(py, |Moving { simulation, log, recording, changed, .. }| match simulation {
                AnySimulation::Granular(granular) => {
                    if let Some(recording) = recording {
                        recording.has_room(change.add.len())?;
                    }
                    granular.change(&change, log).map_err(|error: EngineError| error.to_string())?;
                    *changed = true;
                    if let Some(recording) = recording {
                        let kind = |one: &NewParticle| (one.radius, one.mass, one.species);
                        let added: Vec<_> = change.add.iter().map(kind).collect();
                        recording.changed(&change.remove, &added, log).map_err(|error| error.to_string())?;
                    }
                    Ok(Some(granular.properties()))
                }
                AnySimulation::Linkage(_) => Ok(None),
            })?
            .map_err(|error: String| errors::argument(error))?;
        let properties = properties.ok_or_else(|| {
            let why =
                "the state cannot be changed: the scene has pendulums, springs, rods or sticking contacts";
            errors::argument(why.to_owned())
        })?;
        *self.columns.lock() = Columns::new(py, &properties, self.inertia.as_deref());
        Ok(())
    }

    /// Waits until no thread advances the simulation, and lets none do so until [`Self::release`] is called
    /// in the same thread. Between the two the process can be forked: the copy is at the end of a slice.
    fn hold(&self, py: Python<'_>) {
        py.detach(|| {
            let guard = self.moving.lock_arc();
            HELD.with_borrow_mut(|held| held.push(guard));
        });
    }

    /// Ends [`Self::hold`], in the process and in its copy.
    fn release(&self) {
        let own =
            |guard: &ArcMutexGuard<RawMutex, Moving>| Arc::ptr_eq(ArcMutexGuard::mutex(guard), &self.moving);
        HELD.with_borrow_mut(|held| held.retain(|guard| !own(guard)));
    }

    /// Changes keys of the scene from now on; `overrides` are `KEY=VALUE`.
    // Taken from a list, by value.
    #[allow(clippy::needless_pass_by_value)]
    fn set(&self, py: Python<'_>, overrides: Vec<String>) -> PyResult<()> {
        let done = self.read(py, |Moving { simulation, log, recording, changed, .. }| {
            let AnySimulation::Granular(granular) = simulation else {
                let why = "keys cannot change: the scene has pendulums, springs, rods or sticking contacts";
                return Err(Refused::Other(why));
            };
            let mut described = self.described.lock();
            let (next, changes) =
                keys::change(granular, &described, &self.name, &overrides, &self.files, log)?;
            (*described, *changed) = (next, *changed | changes);
            match recording {
                Some(recording) => recording.take_log(log).map_err(Refused::Record),
                None => Ok(()),
            }
        })?;
        done.map_err(|refused| match refused {
            Refused::Scene(errors) => errors::scene(py, &errors, false),
            Refused::Engine(error) => PyValueError::new_err(error.to_string()),
            Refused::Record(error) => errors::record(&error),
            Refused::Other(why) => PyValueError::new_err(why),
        })
    }

    #[getter]
    fn wall_names(&self) -> Vec<String> {
        self.described.lock().wall_names.clone()
    }

    #[getter]
    fn resolved(&self) -> String {
        self.described.lock().resolved.clone()
    }

    #[getter]
    fn radius(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.columns.lock().radius.clone_ref(py)
    }

    #[getter]
    fn mass(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.columns.lock().mass.clone_ref(py)
    }

    #[getter]
    fn species(&self, py: Python<'_>) -> Py<PyArray1<i64>> {
        self.columns.lock().species.clone_ref(py)
    }

    #[getter]
    fn inertia(&self, py: Python<'_>) -> Option<Py<PyArray1<f64>>> {
        self.columns.lock().inertia.as_ref().map(|inertia| inertia.clone_ref(py))
    }

    #[getter]
    fn time(&self, py: Python<'_>) -> PyResult<f64> {
        self.read(py, |moving| moving.simulation.time())
    }

    fn frame<'py>(&self, py: Python<'py>) -> PyResult<Frame<'py>> {
        let frame = self.read(py, |moving| moving.simulation.frame())?;
        Ok((
            frame.time,
            frame.step,
            vectors(py, frame.position)?,
            vectors(py, frame.velocity)?,
            triples(py, frame.image)?,
            if self.inertia.is_some() { Some(vectors(py, frame.angular_velocity)?) } else { None },
        ))
    }

    fn sample<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (sample, changed) = self.read(py, |moving| (moving.simulation.sample(), moving.changed))?;
        let mut present = self.described.lock().present.clone();
        present.terms[Term::Change as usize] = changed;
        observables::sample(py, &sample, &present, self.sizes)
    }

    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counters = self.read(py, |moving| moving.simulation.counters())?;
        observables::counters(py, counters)
    }

    fn take_events<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let rows = self.read(py, |moving| moving.log.take_rows())?;
        events::columns(py, &rows, self.described.lock().extra_columns)
    }

    /// The rows of profiles since the last call, by the letters of the axes.
    fn take_profiles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let rows = self.read(py, |moving| moving.log.take_profiles())?;
        measured::profiles(py, &self.grids, &rows, self.dimension)
    }

    /// The correlations in time so far, by name.
    fn correlations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = self.read(py, |moving| moving.simulation.correlations())?;
        measured::correlations(py, &found)
    }

    /// Warnings for the scene.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.read(py, |moving| moving.simulation.warnings())
    }

    /// A warning, if energies do not balance at present.
    fn residual_warning(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.read(py, |moving| haff_engine::residual_warning(moving.simulation.ledger().residual))
    }

    fn max_overlap(&self, py: Python<'_>) -> PyResult<f64> {
        self.read(py, |moving| {
            // The value is returned even if it exceeds rounding.
            let _ = moving.simulation.measure_overlap();
            moving.simulation.max_overlap()
        })
    }

    #[getter]
    fn state_hash(&self, py: Python<'_>) -> PyResult<String> {
        self.read(py, |moving| moving.simulation.state_hash())
    }

    #[getter]
    fn neighbors(&self, py: Python<'_>) -> PyResult<&'static str> {
        self.read(py, |moving| moving.simulation.search())
    }

    #[getter]
    fn threads(&self) -> usize {
        self.own_threads.unwrap_or_else(rayon::current_num_threads)
    }

    #[getter]
    fn dimension(&self) -> usize {
        self.dimension
    }

    #[getter]
    fn box_size<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, self.domain.size)
    }

    /// Edge vectors at the present of a box that deforms, by row.
    #[getter]
    fn moving_edges(&self, py: Python<'_>) -> PyResult<Option<[[f64; 3]; 3]>> {
        let edges = self.read(py, |moving| moving.simulation.moving_edges())?;
        Ok(edges.map(|edges| edges.map(|edge| edge.to_array())))
    }

    #[getter]
    fn gravity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        vector(py, self.described.lock().gravity)
    }

    #[getter]
    fn boundary(&self) -> Vec<&'static str> {
        let name = |boundary: &Boundary| match boundary {
            Boundary::Periodic => "periodic",
            Boundary::Wall => "wall",
            Boundary::Open => "open",
        };
        self.domain.boundary.iter().map(name).collect()
    }

    #[classattr]
    fn event_kinds() -> [&'static str; EventKind::ALL.len()] {
        EventKind::ALL.map(EventKind::name)
    }
}
