//! Length of the run, and its output.

use haff_engine::{Body, Boundary, Dimension, EventColumn, System};
use haff_linkage::Joints;
use std::f64::consts::PI;
use std::path::PathBuf;

use super::Assembler;
use super::flow;
use super::values::{SMALLEST, at, positive, storable};
use crate::config::{
    CompressionConfig, EventColumnConfig, EventsConfig, OutputConfig, OutputFileConfig, ScheduleConfig,
    ScheduleTableConfig, WallTimeConfig,
};
use crate::model::scene::{OutputPlan, RunPlan, Schedule, UntilOf};

/// Largest number of records: more are taken for a mistake, since they would fill a disk.
pub(super) const MAX_RECORDS: f64 = 1e8;

/// Largest number of collisions: doubles count them exactly.
const MOST_COLLISIONS: f64 = 9e15;

/// The largest time on the clock [s], about three centuries.
const MAX_WALL_TIME: f64 = 1e10;

impl Assembler<'_> {
    /// Checks the keys of `[run]`, alone and against each other.
    pub(super) fn run_shape(&mut self) {
        let run = self.config.run.clone().unwrap_or_default();
        if let Some(until) = run.until {
            positive(&mut self.document, &at(["run", "until"]), until);
        }
        if let Some(collisions) = run.collisions
            && collisions < 1
        {
            self.document.refuse(&at(["run", "collisions"]), "must be 1 or more");
        }
        let per_particle = at(["run", "collisions_per_particle"]);
        if let Some(count) = run.collisions_per_particle {
            positive(&mut self.document, &per_particle, count);
            if run.collisions.is_some() {
                self.document.report(&per_particle, "contradicts run.collisions: give one of the two");
            }
        }
        let grows_until = self.config.growth.as_ref().is_some_and(|growth| {
            growth.until_packing_fraction.is_some() || growth.until_reduced_pressure.is_some()
        });
        if run.until.is_none()
            && run.collisions.is_none()
            && run.collisions_per_particle.is_none()
            && !grows_until
        {
            let lost = ["until", "collisions", "collisions_per_particle"];
            if !lost.iter().any(|key| self.document.was_reported(&at(["run", key]))) {
                self.document.report_missing(
                    &at(["run"]),
                    "no end: give run.until, run.collisions or run.collisions_per_particle",
                );
            }
        }
        if let Some(wall_time) = &run.wall_time {
            let path = at(["run", "wall_time"]);
            match wall_time {
                WallTimeConfig::Seconds(seconds) => {
                    if !(*seconds > 0.0 && *seconds <= MAX_WALL_TIME) {
                        self.document.refuse(&path, "must be a positive number of seconds, at most 1e10");
                    }
                }
                WallTimeConfig::Text(text) => match humantime::parse_duration(text) {
                    Ok(time) if !time.is_zero() && time.as_secs_f64() <= MAX_WALL_TIME => {}
                    Ok(_) => {
                        self.document.refuse(&path, "must be more than nothing and at most three centuries");
                    }
                    Err(error) => {
                        let text =
                            format!("must be a duration such as \"90s\", \"2h\" or \"1h 30m\": {error}");
                        self.document.refuse(&path, text);
                    }
                },
            }
        }
    }

    /// Checks the keys of `[output]`, alone and against each other.
    pub(super) fn output_shape(&mut self) {
        let output = self.config.output.clone().unwrap_or_default();
        match &output.file {
            Some(OutputFileConfig::Off(_))
                if output.events.as_ref().is_some_and(|events| *events != EventsConfig::All(false)) =>
            {
                self.document.report(&at(["output", "events"]), "contradicts output.file = false");
            }
            Some(OutputFileConfig::Path(path)) if path.trim().is_empty() => {
                self.document.refuse(&at(["output", "file"]), "must be a path or false");
            }
            Some(OutputFileConfig::Path(path)) => storable(&mut self.document, &at(["output", "file"]), path),
            _ => {}
        }
        if let Some(EventsConfig::Some(events)) = &output.events {
            let path = at(["output", "events", "columns"]);
            match events.columns.as_deref() {
                None | Some([]) => self.document.report_missing(
                    &path,
                    "must name columns, as { columns = [\"i\", \"j\"] }; true records all, false none",
                ),
                Some(columns) => {
                    if columns.iter().enumerate().any(|(k, column)| columns[..k].contains(column)) {
                        self.document.refuse(&path, "must name each column once");
                    }
                }
            }
        }
        if let Some(checkpoint) = output.checkpoint {
            positive(&mut self.document, &at(["output", "checkpoint"]), checkpoint);
        }
        for (key, schedule) in [("frames", &output.frames), ("observables", &output.observables)] {
            let path = at(["output", key]);
            match schedule {
                Some(ScheduleConfig::Every(step)) => {
                    positive(&mut self.document, &path, *step);
                }
                Some(ScheduleConfig::Table(table)) => {
                    match table.log.as_deref() {
                        Some([first, factor]) => {
                            positive(&mut self.document, &at(["output", key, "log"]), *first);
                            if !(*factor > 1.0 && factor.is_finite()) {
                                self.document.refuse(&at(["output", key, "log"]), "must have a factor > 1");
                            }
                        }
                        Some(_) => {
                            self.document.refuse(&at(["output", key, "log"]), "must be [first, factor]");
                        }
                        None if table.collisions_per_particle.is_none() => self.document.report_missing(
                            &path,
                            "must have log = [first, factor] or collisions_per_particle = C",
                        ),
                        None => {}
                    }
                    if let Some(count) = table.collisions_per_particle {
                        let path = at(["output", key, "collisions_per_particle"]);
                        positive(&mut self.document, &path, count);
                        if table.log.is_some() {
                            self.document.report(&path, "contradicts log: give one of the two");
                        }
                    }
                }
                Some(ScheduleConfig::Off(_)) | None => {}
            }
        }
    }

    pub(super) fn run_plan(&mut self, system: &System) -> RunPlan {
        let run = self.config.run.clone().unwrap_or_default();
        let n = system.bodies.len();
        let mut collisions = run.collisions.map(|count| count as u64);
        if let Some(count) = run.collisions_per_particle {
            let total = collisions_of(count, n);
            if total > MOST_COLLISIONS {
                self.document
                    .report(&at(["run", "collisions_per_particle"]), "makes more than 9e15 collisions");
            }
            collisions = Some(total as u64);
        }
        if n == 1 && system.flow.is_none() && collisions.is_some() && run.until.is_none() {
            let key = if run.collisions.is_some() { "collisions" } else { "collisions_per_particle" };
            self.document.report(&at(["run", key]), "one particle alone never collides: give run.until");
        }
        let wall_time = run.wall_time.and_then(|time| time.duration());
        RunPlan { until: run.until, until_of: UntilOf::Run, collisions, wall_time, growth: None }
    }

    /// When a key asks for records. Its form has been checked.
    fn schedule(&mut self, key: &str, config: &ScheduleConfig, system: &System) -> Schedule {
        let table = match config {
            ScheduleConfig::Every(step) => return Schedule::Every(*step),
            ScheduleConfig::Off(_) => return Schedule::Off,
            ScheduleConfig::Table(table) => table,
        };
        if let Some(&[first, factor]) = table.log.as_deref() {
            return Schedule::Log { first, factor };
        }
        let n = system.bodies.len();
        let count = collisions_of(table.collisions_per_particle.unwrap_or(1.0), n);
        let path = at(["output", key, "collisions_per_particle"]);
        if count > MOST_COLLISIONS {
            self.document.report(&path, "makes more than 9e15 collisions");
        }
        if n == 1 && system.flow.is_none() {
            self.document.report(&path, "one particle alone never collides: give a time");
        }
        Schedule::Collisions(count.max(1.0) as u64)
    }

    pub(super) fn output_plan(&mut self, system: &System, run: &RunPlan, rate: f64) -> OutputPlan {
        let n = system.bodies.len() as f64;
        let is_rough = system.spin.is_some();
        let steady = system.contacts.are_elastic()
            && !is_rough
            && system.drives.is_empty()
            && system.drag.is_none()
            && system.domain.compression.is_none()
            && rate > 0.0;
        // The run's length in simulated time, where it can be predicted.
        let by_collisions = run.until_of == UntilOf::Box && run.collisions.is_some();
        let length = run.until.filter(|_| !by_collisions).or_else(|| {
            let collisions = run.collisions.filter(|_| steady)?;
            Some(2.0 * collisions as f64 / (n * rate)).filter(|length| (1e-50..=1e50).contains(length))
        });
        let first = 0.1 * time_scale(system, rate);
        let config = self.config.output.get_or_insert_with(OutputConfig::default);
        let completed = |given: &mut Option<ScheduleConfig>, parts: f64, factor: f64| {
            let config = given.get_or_insert_with(|| match length {
                Some(length) => ScheduleConfig::Every((length / parts).max(SMALLEST)),
                None => ScheduleConfig::Table(ScheduleTableConfig {
                    log: Some(vec![first, factor]),
                    collisions_per_particle: None,
                }),
            });
            config.clone()
        };
        let frames = completed(&mut config.frames, 100.0, 1.2);
        let observables = completed(&mut config.observables, 1000.0, 1.02);
        let frames = self.schedule("frames", &frames, system);
        let observables = self.schedule("observables", &observables, system);
        let config = self.config.output.get_or_insert_with(OutputConfig::default);
        let events = event_columns(config.events.get_or_insert(EventsConfig::All(false)), system);
        let compressed =
            *config.compression.get_or_insert(CompressionConfig::Deflate) == CompressionConfig::Deflate;
        if config.checkpoint.is_none() {
            config.checkpoint = length.map(|length| (length / 10.0).max(SMALLEST));
        }
        let checkpoint = config.checkpoint;
        let file = match &config.file {
            Some(OutputFileConfig::Path(path)) => Some(PathBuf::from(path.as_str())),
            // A missing key differs from `false`: the file may be given on the command line.
            Some(OutputFileConfig::Off(_)) | None => None,
        };
        for (key, schedule) in [("frames", frames), ("observables", observables)] {
            if let (Schedule::Collisions(count), Some(collisions)) = (schedule, run.collisions)
                && collisions as f64 / count as f64 > MAX_RECORDS
            {
                let text = format!(
                    "makes a record at each of {count} of {collisions} collisions, at most 1e8 are possible"
                );
                self.document.report(&at(["output", key]), text);
            }
        }
        if let Some(until) = run.until {
            let every = |step: Option<f64>| step.map_or(0.0, |step| until / step);
            let count = |schedule: Schedule| match schedule {
                Schedule::Off | Schedule::Collisions(_) => 0.0,
                Schedule::Every(step) => until / step,
                Schedule::Log { first, factor } => ((until.ln() - first.ln()) / factor.ln()).max(0.0),
            };
            for (key, records) in [
                ("frames", count(frames)),
                ("observables", count(observables)),
                ("checkpoint", every(checkpoint)),
            ] {
                if records > MAX_RECORDS {
                    let text = format!(
                        "makes {records:.1e} records until run.until = {until}, at most 1e8 are possible"
                    );
                    self.document.report(&at(["output", key]), text);
                }
            }
        }
        OutputPlan { file, frames, observables, events, compressed, checkpoint }
    }
}

/// Collisions in which N particles have `count` each on average: each collision has two partners.
fn collisions_of(count: f64, particles: usize) -> f64 {
    (0.5 * count * particles as f64).ceil()
}

/// The requested columns in the order of files, always with the time.
fn event_columns(config: &EventsConfig, system: &System) -> Vec<EventColumn> {
    match config {
        EventsConfig::All(false) => Vec::new(),
        EventsConfig::All(true) => {
            EventColumn::ALL.into_iter().filter(|column| column.exists(system)).collect()
        }
        EventsConfig::Some(events) => {
            let columns = events.columns.as_deref().unwrap_or_default();
            let mut requested: Vec<EventColumn> = columns.iter().map(|&column| column.into()).collect();
            requested.push(EventColumn::Time);
            EventColumn::ALL.into_iter().filter(|column| requested.contains(column)).collect()
        }
    }
}

impl From<EventColumnConfig> for EventColumn {
    fn from(column: EventColumnConfig) -> Self {
        match column {
            EventColumnConfig::Time => Self::Time,
            EventColumnConfig::Kind => Self::Kind,
            EventColumnConfig::I => Self::I,
            EventColumnConfig::J => Self::J,
            EventColumnConfig::ApproachSpeed => Self::ApproachSpeed,
            EventColumnConfig::Impulse => Self::Impulse,
            EventColumnConfig::EnergyLoss => Self::EnergyLoss,
            EventColumnConfig::CarnotEnergy => Self::CarnotEnergy,
            EventColumnConfig::Normal => Self::Normal,
            EventColumnConfig::Position => Self::Position,
            EventColumnConfig::ImpulseVector => Self::ImpulseVector,
            EventColumnConfig::TangentialLoss => Self::TangentialLoss,
        }
    }
}

/// Mean free time, or else the time in which a body at the root of the mean square speed crosses the system.
fn time_scale(system: &System, rate: f64) -> f64 {
    if rate > 0.0 && rate.is_finite() {
        return (1.0 / rate).clamp(1e-40, 1e40);
    }
    let d = system.dimension.count();
    let length = (0..d).map(|axis| system.domain.size[axis]).fold(0.0, f64::max);
    let mean_square = system.bodies.iter().map(|body| body.velocity.length_squared()).sum::<f64>()
        / system.bodies.len() as f64;
    let gravity = system.domain.gravity.length();
    // A body that starts at rest falls.
    let speed = mean_square.max(gravity * length).sqrt();
    let time = length / speed;
    if (1e-40..=1e40).contains(&time) { time } else { 1.0 }
}

/// Volume of all particles over that of the box at the start; NaN with open axes.
pub(super) fn packing_fraction(system: &System) -> f64 {
    packing_fraction_at(system, 0.0)
}

/// [`packing_fraction`] at a time.
pub(super) fn packing_fraction_at(system: &System, time: f64) -> f64 {
    let d = system.dimension.count();
    if system.domain.boundary[..d].contains(&Boundary::Open) {
        return f64::NAN;
    }
    let radius = |class: u32| system.classes[class as usize].radius;
    let filled: f64 = system.bodies.iter().map(|body| system.dimension.volume(radius(body.class))).sum();
    // The sum of nothing is −0.
    (0.0 + filled) / system.domain.volume(system.dimension, time)
}

/// Share of the particles that a scene may place one by one in a homogeneous gas.
const PLACED: f64 = 0.1;
/// Packing fractions above which equal disks and spheres begin to freeze.
const FREEZING: [f64; 2] = [0.70, 0.49];

/// Why [`collision_rate`] is not that of the system, of which `placed` particles were placed one by one.
pub(super) fn rate_unknown(
    system: &System,
    rate: f64,
    placed: usize,
    joints: &Joints,
) -> Option<&'static str> {
    let d = system.dimension.count();
    let is_fixed = |body: &Body| system.classes[body.class as usize].mass.is_infinite();
    let reasons = [
        (system.domain.boundary[..d].contains(&Boundary::Open), "an axis is open"),
        (system.flow.is_some(), "particles come and go"),
        (system.bodies.len() < 2, "a single particle"),
        (system.bodies.iter().any(is_fixed), "the arrangement of bodies of infinite mass decides it"),
        (!joints.is_empty(), "bodies are joined"),
        (
            placed as f64 > PLACED * system.bodies.len() as f64,
            "particles placed one by one are no homogeneous gas",
        ),
        (packing_fraction(system) >= FREEZING[d - 2], "the packing fraction is above that of freezing"),
        (rate.is_nan(), "nothing moves at the start"),
    ];
    reasons.into_iter().find_map(|(applies, reason)| applies.then_some(reason))
}

/// Collisions per particle and time of a homogeneous elastic mixture, each group with its mean radius and its
/// own temperature, by Enskog's theory. In three dimensions the rate of one particle of group i with those of
/// group j is
///
/// ```text
/// ω_ij = 2 n_j σ_ij² g_ij √(2π(T_i/m_i + T_j/m_j))
/// ```
///
/// and in two dimensions half of it, with `σ_ij` for `σ_ij²`. For one species this is 4 n σ² g₀ √(πT/m), or 2
/// n σ g₀ √(πT/m). The contact value is that of Boublík and of Mansoori et al., in two dimensions of Jenkins
/// and Mancini; for equal spheres these are Carnahan–Starling's and Henderson's.
pub(super) fn collision_rate(system: &System) -> f64 {
    let d = system.dimension.count();
    let eta = packing_fraction(system);
    // Above this the formulae are beyond the fluid branch.
    if system.bodies.len() < 2 || !(eta > 0.0 && eta < 0.8) {
        return f64::NAN;
    }
    let area = system.domain.volume(system.dimension, 0.0);
    let groups = system.groups.len();
    // Per group: particles, Σ R, Σ |v|².
    let mut sums = vec![[0.0_f64; 3]; groups];
    let mut moments = [0.0_f64; 2];
    for (body, velocity) in system.bodies.iter().zip(flow::thermal(system)) {
        let class = &system.classes[body.class as usize];
        let sigma = 2.0 * class.radius;
        let sum = &mut sums[class.group as usize];
        sum[0] += 1.0;
        sum[1] += class.radius;
        sum[2] += velocity.length_squared();
        moments[0] += sigma;
        moments[1] += sigma * sigma;
    }
    let present: Vec<usize> = (0..groups).filter(|&g| sums[g][0] > 0.0).collect();
    if present.len() > 100 {
        // Many named bodies do not form a gas.
        return f64::NAN;
    }
    let free = 1.0 - eta;
    let mut total = 0.0;
    for &i in &present {
        for &j in &present {
            let sigma = |g: usize| 2.0 * sums[g][1] / sums[g][0];
            let variance = |g: usize| sums[g][2] / (sums[g][0] * d as f64);
            let contact = 0.5 * (sigma(i) + sigma(j));
            // σ_i σ_j / (σ_i + σ_j)
            let reduced = 0.5 * sigma(i) * sigma(j) / contact;
            let others = if i == j { sums[j][0] - 1.0 } else { sums[j][0] };
            let speed = (2.0 * PI * (variance(i) + variance(j))).sqrt();
            total += sums[i][0] * others / area
                * speed
                * match system.dimension {
                    Dimension::Three => {
                        let x = PI / 6.0 * moments[1] / area * reduced / free;
                        2.0 * contact * contact * (1.0 + 3.0 * x + 2.0 * x * x) / free
                    }
                    Dimension::Two => {
                        let x = PI / 4.0 * moments[0] / area * reduced / free;
                        contact * (1.0 + 9.0 / 8.0 * x) / free
                    }
                };
        }
    }
    let rate = total / system.bodies.len() as f64;
    if rate > 0.0 && rate.is_finite() { rate } else { f64::NAN }
}
