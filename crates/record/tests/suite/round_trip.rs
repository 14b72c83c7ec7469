//! All recorded data are read back unchanged.

use std::fs;

use glam::DVec3;
use haff_engine::{CellFields, EventColumn, EventKind, EventRecord, Frame, Term};
use haff_record::{EVENT_CHUNK, Header, RecordError, Recorder, info, last_state};
use hdf5::{File, H5Type, filters::Filter};
use tempfile::TempDir;

use crate::common::{self, checkpoint, correlation, event, events, frame, header, profile_row, sample};

fn directory() -> TempDir {
    tempfile::tempdir().expect("a directory for the test")
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, H5Type)]
#[repr(u8)]
enum Kind {
    #[hdf5(rename = "collision")]
    Collision = 0,
    #[hdf5(rename = "wall")]
    Wall = 1,
    #[hdf5(rename = "rest")]
    Rest = 2,
    #[hdf5(rename = "slack")]
    Slack = 3,
    #[hdf5(rename = "taut")]
    Taut = 4,
    #[hdf5(rename = "release")]
    Release = 5,
    #[hdf5(rename = "stick")]
    Stick = 6,
    #[hdf5(rename = "lift")]
    Lift = 7,
    #[hdf5(rename = "settle")]
    Settle = 8,
    #[hdf5(rename = "change")]
    Change = 9,
    #[hdf5(rename = "slide")]
    Slide = 10,
    #[hdf5(rename = "enter")]
    Enter = 11,
    #[hdf5(rename = "leave")]
    Leave = 12,
}

fn column<T: H5Type>(file: &File, path: &str) -> Vec<T> {
    file.dataset(path)
        .and_then(|dataset| dataset.read_raw())
        .unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn shape(file: &File, path: &str) -> Vec<usize> {
    file.dataset(path).unwrap_or_else(|error| panic!("{path}: {error}")).shape()
}

/// Checks the profiles and the correlation of a synthetic run with this many rows.
fn check_measured(file: &File, rows: u64) {
    let d = column::<u32>(file, "parameters/dimension")[0] as usize;
    for (profile, name, bins) in [(0, "z", vec![5]), (1, "xy", vec![3, 2])] {
        let expected: Vec<_> = (0..rows).map(|k| profile_row(profile, k, d as u64)).collect();
        let value = |field: &str| format!("profiles/{name}/{field}/value");
        let with = |more: &[usize]| [&[rows as usize][..], &bins, more].concat();
        assert_eq!(shape(file, &value("density")), with(&[]));
        assert_eq!(shape(file, &value("velocity")), with(&[3]));
        assert_eq!(shape(file, &value("pressure")), with(&[d, d]));
        let pressures: Vec<f64> = expected.iter().flat_map(|row| row.pressure.clone()).collect();
        assert!(column::<f64>(file, &value("pressure")) == pressures, "{name}: pressures differ");
        let temperatures: Vec<f64> = expected.iter().flat_map(|row| row.temperature.clone()).collect();
        assert!(column::<f64>(file, &value("temperature")) == temperatures, "{name}: temperatures differ");
        if profile == 1 {
            assert_eq!(
                shape(file, &value("species_pressure")),
                [&[rows as usize, 2][..], &bins, &[d, d]].concat()
            );
            assert_eq!(shape(file, &value("species_density")), [&[rows as usize, 2][..], &bins].concat());
            let of_species = |field: fn(&CellFields) -> &Vec<f64>| -> Vec<f64> {
                expected.iter().flat_map(|row| row.species.iter().flat_map(field)).copied().collect()
            };
            assert!(column::<f64>(file, &value("species_pressure")) == of_species(|fields| &fields.pressure));
            assert!(column::<f64>(file, &value("species_density")) == of_species(|fields| &fields.density));
            let species =
                file.group("profiles/xy").unwrap().attr("species").unwrap().read_raw::<u32>().unwrap();
            assert_eq!(species, [0, 1]);
        }
        let times: Vec<f64> = expected.iter().map(|row| row.time).collect();
        for element in ["density", "pressure", "position"] {
            assert_eq!(column::<f64>(file, &format!("profiles/{name}/{element}/time")), times);
        }
    }
    assert_eq!(column::<f64>(file, "profiles/z/position/value"), [0.5, 1.5, 2.5, 3.5, 4.5]);
    let centers = column::<f64>(file, "profiles/xy/position/value");
    assert_eq!(shape(file, "profiles/xy/position/value"), [3, 2, 2]);
    assert_eq!(centers[..6], [0.5, 0.5, 0.5, 1.5, 1.5, 0.5]);
    let expected = correlation((rows - 1) % 30);
    assert_eq!(column::<f64>(file, "correlations/msd/value"), expected.value);
    assert_eq!(shape(file, "correlations/msd/error"), [expected.lag.len(), 2]);
    assert_eq!(column::<i64>(file, "correlations/msd/count").len(), expected.count.len());
}

/// Checks frames, samples and events of a synthetic run against their rows.
fn check(path: &std::path::Path, particles: usize, frames: u64, samples: u64, events: u64) {
    let file = File::open(path).expect("the file opens");
    let expected: Vec<_> = (0..frames).map(|k| frame(k, particles)).collect();
    assert_eq!(shape(&file, "particles/all/position/value"), [frames as usize, particles, 3]);
    let flat = |vectors: fn(&haff_engine::Frame) -> &Vec<glam::DVec3>| -> Vec<f64> {
        expected.iter().flat_map(vectors).flat_map(glam::DVec3::to_array).collect()
    };
    assert!(
        column::<f64>(&file, "particles/all/position/value") == flat(|f| &f.position),
        "positions differ"
    );
    assert!(
        column::<f64>(&file, "particles/all/velocity/value") == flat(|f| &f.velocity),
        "velocities differ"
    );
    assert!(
        column::<f64>(&file, "particles/all/angular_velocity/value") == flat(|f| &f.angular_velocity),
        "angular velocities differ"
    );
    let images: Vec<i32> = expected.iter().flat_map(|f| &f.image).flatten().copied().collect();
    assert!(column::<i32>(&file, "particles/all/image/value") == images, "images differ");
    let present: Vec<u8> = expected.iter().flat_map(|f| &f.present).map(|&there| u8::from(there)).collect();
    assert!(column::<u8>(&file, "particles/all/present/value") == present, "those that are there differ");
    let states = |at: usize| {
        expected.iter().flat_map(|f| &f.pistons).flat_map(|s| s[at].to_array()).collect::<Vec<_>>()
    };
    for (name, at) in [("position", 0), ("velocity", 1)] {
        let found = column::<f64>(&file, &format!("particles/all/pistons/{name}/value"));
        assert!(found == states(at), "pistons: {name} differs");
    }
    let of_pistons = ["pistons/position", "pistons/velocity"];
    for element in ["position", "velocity", "image", "present", "box/edges"].into_iter().chain(of_pistons) {
        let steps = column::<i64>(&file, &format!("particles/all/{element}/step"));
        assert_eq!(steps, (0..frames as i64).map(|k| 10 * k).collect::<Vec<_>>(), "{element}");
        let times = column::<f64>(&file, &format!("particles/all/{element}/time"));
        assert_eq!(times, (0..frames).map(|k| k as f64 * 0.25).collect::<Vec<_>>(), "{element}");
    }
    let edges = [1.0, 2.0, 3.0].repeat(frames as usize);
    assert_eq!(column::<f64>(&file, "particles/all/box/edges/value"), edges);

    let expected: Vec<_> = (0..samples).map(sample).collect();
    let reals = |value: fn(&haff_engine::Sample) -> f64| expected.iter().map(value).collect::<Vec<_>>();
    for (name, values) in [
        ("kinetic_energy", reals(|s| s.ledger.kinetic)),
        ("potential_energy", reals(|s| s.ledger.potential)),
        ("dissipated_energy", reals(|s| s.ledger.dissipated)),
        ("carnot_energy", reals(|s| s.ledger.carnot)),
        ("wall_work", reals(|s| s.ledger.term(Term::WallWork))),
        ("rest_energy", reals(|s| s.ledger.term(Term::Rest))),
        ("ledger_residual", reals(|s| s.ledger.residual)),
        ("temperature", reals(|s| s.temperature)),
        ("sonine_a2", reals(|s| s.sonine_a2)),
        ("discharge_rate", reals(|s| s.discharge_rate)),
        ("collision_rate", reals(|s| s.collision_rate)),
        ("mean_free_time", reals(|s| s.mean_free_time)),
    ] {
        assert!(column::<f64>(&file, &format!("observables/{name}/value")) == values, "{name} differs");
        assert_eq!(
            column::<f64>(&file, &format!("observables/{name}/time")).len(),
            samples as usize,
            "{name}"
        );
        assert_eq!(
            column::<i64>(&file, &format!("observables/{name}/step")).len(),
            samples as usize,
            "{name}"
        );
    }
    let momenta: Vec<f64> = expected.iter().flat_map(|s| s.momentum.to_array()).collect();
    assert!(column::<f64>(&file, "observables/momentum/value") == momenta, "momenta differ");
    let species: Vec<f64> = expected.iter().flat_map(|s| s.species_temperature.clone()).collect();
    assert!(column::<f64>(&file, "observables/species_temperature/value") == species, "temperatures differ");
    let collisions: Vec<i64> = (0..samples as i64).map(|k| 4 * k).collect();
    assert_eq!(column::<i64>(&file, "observables/collisions/value"), collisions);
    let forces: Vec<f64> =
        expected.iter().flat_map(|s| &s.wall_force).flat_map(glam::DVec3::to_array).collect();
    assert_eq!(shape(&file, "observables/wall_force/value"), [samples as usize, 2, 3]);
    assert!(column::<f64>(&file, "observables/wall_force/value") == forces, "forces on walls differ");
    let probes = |range: std::ops::Range<usize>| -> Vec<f64> {
        expected.iter().flat_map(|s| s.probes[range.clone()].to_vec()).collect()
    };
    assert_eq!(shape(&file, "observables/swirl/value"), [samples as usize, 2]);
    assert_eq!(shape(&file, "observables/flux/value"), [samples as usize]);
    assert_eq!(column::<f64>(&file, "observables/swirl/value"), probes(0..2));
    assert_eq!(column::<f64>(&file, "observables/flux/value"), probes(2..3));
    let d = column::<u32>(&file, "parameters/dimension")[0] as usize;
    assert_eq!(shape(&file, "observables/pressure_tensor/value"), [samples as usize, d, d]);
    check_measured(&file, samples);

    let expected: Vec<_> = (0..events).map(event).collect();
    let kinds = expected.iter().map(|e| match e.kind {
        EventKind::Collision => Kind::Collision,
        EventKind::Wall => Kind::Wall,
        EventKind::Rest => Kind::Rest,
        EventKind::Slack => Kind::Slack,
        EventKind::Taut => Kind::Taut,
        EventKind::Release => Kind::Release,
        EventKind::Stick => Kind::Stick,
        EventKind::Lift => Kind::Lift,
        EventKind::Settle => Kind::Settle,
        EventKind::Change => Kind::Change,
        EventKind::Slide => Kind::Slide,
        EventKind::Enter => Kind::Enter,
        EventKind::Leave => Kind::Leave,
    });
    assert!(column::<Kind>(&file, "events/kind") == kinds.collect::<Vec<_>>(), "kinds differ");
    let ids: Vec<u32> = expected.iter().map(|e| e.j).collect();
    assert!(column::<u32>(&file, "events/j") == ids, "partners differ");
    for (name, value) in [
        ("time", (|e| e.time) as fn(&haff_engine::EventRecord) -> f64),
        ("approach_speed", |e| e.approach_speed),
        ("impulse", |e| e.impulse),
        ("energy_loss", |e| e.energy_loss),
        ("carnot_energy", |e| e.carnot_energy),
        ("tangential_loss", |e| e.tangential_loss),
    ] {
        let values: Vec<f64> = expected.iter().map(value).collect();
        assert!(column::<f64>(&file, &format!("events/{name}")) == values, "{name} differs");
    }
    let impulses: Vec<f64> = expected.iter().flat_map(|e| e.impulse_vector.to_array()).collect();
    assert!(column::<f64>(&file, "events/impulse_vector") == impulses, "impulse vectors differ");
    let points: Vec<f64> = expected.iter().flat_map(|e| e.position.to_array()).collect();
    assert_eq!(shape(&file, "events/position"), [events as usize, 3]);
    assert!(column::<f64>(&file, "events/position") == points, "contact points differ");
}

fn record(recorder: &Recorder, particles: usize, rows: std::ops::Range<u64>, events_per_row: u64) {
    record_in(3, recorder, particles, rows, events_per_row);
}

/// Records rows in this dimension.
fn record_in(
    dimension: u64,
    recorder: &Recorder,
    particles: usize,
    rows: std::ops::Range<u64>,
    events_per_row: u64,
) {
    for k in rows {
        recorder.frame(frame(k, particles)).expect("a frame");
        recorder.sample(sample(k)).expect("a sample");
        for profile in [0, 1] {
            recorder.profile(profile_row(profile, k, dimension)).expect("a row of a profile");
        }
        recorder.correlations(vec![correlation(k % 30)]).expect("correlations");
        recorder.events(events(k * events_per_row, (k + 1) * events_per_row)).expect("events");
    }
}

#[test]
fn recorded_data_are_read_back_bit_by_bit() {
    let directory = directory();
    // Small frames share chunks; larger ones have their own; the largest are divided into blocks.
    for (particles, frames, per_frame) in [(1, 3000, 7), (700, 40, 1000), (1400, 9, 1), (70_000, 3, 20_000)] {
        let path = directory.path().join(format!("{particles}.h5"));
        let recorder = Recorder::create(&path, header(particles), false).expect("a new file");
        record(&recorder, particles, 0..frames, per_frame);
        recorder.finish("{}", true).expect("a finished file");
        check(&path, particles, frames, frames, frames * per_frame);

        let state = last_state(&path).expect("a last state");
        let mut last = frame(frames - 1, particles);
        let (mut radius, mut mass) = (header(particles).radius, header(particles).mass);
        // Those that are not there are left out.
        let present = std::mem::take(&mut last.present);
        keep(&mut last.position, &present);
        keep(&mut last.velocity, &present);
        keep(&mut last.image, &present);
        keep(&mut radius, &present);
        keep(&mut mass, &present);
        assert_eq!((state.time, state.step), (last.time, last.step));
        assert!(
            state.position == last.position && state.velocity == last.velocity && state.image == last.image
        );
        assert_eq!(state.box_size, header(particles).box_size);
        assert!(state.radius == radius && state.mass == mass);
    }
}

/// Removes the values of particles that are not there.
fn keep<T>(values: &mut Vec<T>, present: &[bool]) {
    let mut present = present.iter();
    values.retain(|_| *present.next().expect("one for each"));
}

#[test]
fn files_of_sheared_boxes_have_the_edge_vectors_of_each_frame() {
    let directory = directory();
    let path = directory.path().join("sheared.h5");
    let mut wanted = header(3);
    wanted.present.shear = true;
    let edges = |k: u64| {
        let mut edges = frame(k, 3).edges;
        edges[1].x = 0.125 * k as f64 - 0.5;
        edges
    };
    let recorder = Recorder::create(&path, wanted, false).expect("a new file");
    for k in 0..5 {
        recorder.frame(Frame { edges: edges(k), ..frame(k, 3) }).expect("a frame");
    }
    recorder.finish("{}", true).expect("a finished file");
    let file = File::open(&path).expect("the file opens");
    let place = "particles/all/box/edges/value";
    assert_eq!(shape(&file, place), [5, 3, 3]);
    let expected: Vec<f64> = (0..5).flat_map(edges).flat_map(|edge| edge.to_array()).collect();
    assert_eq!(column::<f64>(&file, place), expected);
    drop(file);
    let state = last_state(&path).expect("a last state");
    assert_eq!((state.box_size, state.sheared_edges), (DVec3::new(1.0, 2.0, 3.0), Some(edges(4))));
}

#[test]
fn uncompressed_files_contain_the_same_numbers() {
    let directory = directory();
    let path = |name: &str| directory.path().join(name);
    for (name, compressed) in [("packed.h5", true), ("plain.h5", false)] {
        let wanted = Header { compressed, ..header(1400) };
        let recorder = Recorder::create(path(name), wanted, false).expect("a new file");
        record(&recorder, 1400, 0..6, 30_000);
        recorder.finish("{}", true).expect("a finished file");
        check(&path(name), 1400, 6, 6, 180_000);
        let file = File::open(path(name)).expect("the file opens");
        for dataset in ["particles/all/velocity/value", "events/i", "events/normal"] {
            let filters = file.dataset(dataset).expect(dataset).filters();
            let expected = if compressed { vec![Filter::Shuffle, Filter::Deflate(1)] } else { Vec::new() };
            assert_eq!(filters, expected, "{dataset} of {name}");
        }
    }
    let size = |name| fs::metadata(path(name)).expect("the file is there").len();
    assert!(size("packed.h5") < size("plain.h5") * 9 / 10);
}

#[test]
fn a_log_of_selected_columns_contains_these_and_the_time_and_is_continued() {
    use EventColumn::{EnergyLoss, I, Position};
    let directory = directory();
    for (name, compressed) in [("packed.h5", true), ("plain.h5", false)] {
        let path = directory.path().join(name);
        // The time is always included.
        let wanted = Header { events: vec![Position, EnergyLoss, I], compressed, ..header(20) };
        let recorder = Recorder::create(&path, wanted, false).expect("a new file");
        // Two and a half chunks, and rows after the checkpoint, which are dropped.
        let kept = 5 * EVENT_CHUNK as u64 / 2;
        recorder.events(events(0, kept)).expect("events");
        recorder.checkpoint(checkpoint(1, 20)).expect("a checkpoint");
        recorder.events(events(kept, 2 * kept)).expect("events");
        drop(recorder);
        let (recorder, resumed) = Recorder::append(&path).expect("the file is resumed");
        assert_eq!(resumed.event_rows, kept);
        // Buffers are reused by the writer.
        for k in 0..40 {
            let mut rows = recorder.event_buffer();
            assert!(rows.is_empty());
            rows.extend(events(kept + 1000 * k, kept + 1000 * (k + 1)));
            recorder.events(rows).expect("events");
        }
        recorder.finish("{}", true).expect("a finished file");

        let found = info(&path).expect("the file is read");
        assert_eq!(found.event_columns, ["time", "i", "energy_loss", "position"]);
        assert_eq!(found.event_rows, Some(kept + 40_000));
        let file = File::open(&path).expect("the file opens");
        let mut names = file.group("events").and_then(|group| group.member_names()).expect("columns");
        names.sort();
        assert_eq!(names, ["energy_loss", "i", "position", "time"]);
        let expected: Vec<_> = (0..kept + 40_000).map(event).collect();
        assert!(column::<f64>(&file, "events/time") == expected.iter().map(|e| e.time).collect::<Vec<_>>());
        assert!(column::<u32>(&file, "events/i") == expected.iter().map(|e| e.i).collect::<Vec<_>>());
        let losses: Vec<f64> = expected.iter().map(|e| e.energy_loss).collect();
        assert!(column::<f64>(&file, "events/energy_loss") == losses);
        let points: Vec<f64> = expected.iter().flat_map(|e| e.position.to_array()).collect();
        assert!(column::<f64>(&file, "events/position") == points);
    }
}

#[test]
fn disks_and_files_with_few_datasets_are_read_back() {
    let directory = directory();
    let path = directory.path().join("disks.h5");
    let particles = 2000;
    let wanted = Header { dimension: 2, ..header(particles) };
    let recorder = Recorder::create(&path, wanted, false).expect("a new file");
    record_in(2, &recorder, particles, 0..4, 30_000);
    recorder.finish("{}", true).expect("a finished file");
    check(&path, particles, 4, 4, 120_000);
    let file = File::open(&path).expect("the file opens");
    let attribute = file.group("particles/all/box").and_then(|group| group.attr("dimension"));
    assert_eq!(attribute.and_then(|a| a.read_scalar::<i32>()).expect("the box has a dimension"), 3);
    drop(file);
    assert_eq!(info(&path).expect("the file is read").dimension, 2);

    // Only data included in the header are stored; the rest is dropped.
    let path = directory.path().join("bare.h5");
    let bare = Header { frames: false, observables: false, events: Vec::new(), ..header(5) };
    let recorder = Recorder::create(&path, bare, false).expect("a new file");
    record(&recorder, 5, 0..4, 10);
    recorder.checkpoint(checkpoint(1, 5)).expect("a checkpoint");
    drop(recorder);
    let found = info(&path).expect("the file is read");
    assert_eq!((found.frames, found.samples, found.event_rows), (None, None, None));
    assert!(found.resumable);
    assert!(matches!(last_state(&path), Err(RecordError::Missing { what: "frames", .. })));
    let file = File::open(&path).expect("the file opens");
    assert_eq!(file.group("particles/all").and_then(|g| g.member_names()).expect("a group").len(), 6);
}

#[test]
fn info_agrees_with_the_header_and_the_last_rows() {
    let directory = directory();
    let path = directory.path().join("run.h5");
    let recorder = Recorder::create(&path, header(10), false).expect("a new file");
    record(&recorder, 10, 0..3, 100);
    recorder.checkpoint(checkpoint(5, 10)).expect("a checkpoint");
    recorder.flush().expect("a flush");

    // While it is being written.
    let running = info(&path).expect("a running file is read");
    assert_eq!((running.frames, running.samples, running.event_rows), (Some(3), Some(3), Some(300)));
    assert!(running.resumable && !running.finished && running.summary.is_none());

    recorder.finish(r#"{"stopped":"until"}"#, true).expect("a finished file");
    let found = info(&path).expect("the file is read");
    let wanted = header(10);
    assert_eq!((found.title, found.scene_toml, found.seed), (wanted.title, wanted.scene_toml, wanted.seed));
    assert_eq!((found.version, found.git_revision), (wanted.version, wanted.git_revision));
    assert_eq!((found.schema, found.trajectory_version, found.dimension), (1, 3, 3));
    assert_eq!(found.species, [("grain".to_owned(), 5), ("Kügelchen".to_owned(), 5)]);
    assert_eq!(found.walls, ["y-", "y+"]);
    assert_eq!((found.box_size, found.periodic), (wanted.box_size, [true, false, false]));
    assert_eq!(
        (found.particles, found.frames, found.samples, found.event_rows),
        (10, Some(3), Some(3), Some(300))
    );
    assert_eq!(found.time_range, Some((0.0, 0.5)));
    // There are no springs, so their energy is NaN, which equals nothing.
    assert_eq!(format!("{:?}", found.last_sample), format!("{:?}", Some(sample(2))));
    assert_eq!(found.checkpoint_time, Some(5.0));
    assert_eq!(found.counters.map(|counters| counters.collisions), Some(20));
    assert_eq!((found.finished, found.resumable), (true, false));
    assert_eq!(found.summary.as_deref(), Some(r#"{"stopped":"until"}"#));
    assert_eq!(found.file_size, fs::metadata(&path).expect("the file is there").len());
}

#[test]
fn a_resumed_file_continues_from_its_newest_checkpoint() {
    let directory = directory();
    let path = directory.path().join("run.h5");
    let particles = 900;
    let per_row = EVENT_CHUNK as u64 / 3 + 1;
    let recorder = Recorder::create(&path, header(particles), false).expect("a new file");
    recorder.checkpoint(checkpoint(0, particles)).expect("a checkpoint");
    record(&recorder, particles, 0..5, per_row);
    recorder.checkpoint(checkpoint(1, particles)).expect("a checkpoint");
    // These must be dropped: they come after the checkpoint.
    record(&recorder, particles, 7..12, per_row);
    recorder.finish("{\"stopped\":\"signal\"}", false).expect("a stopped file");
    assert_eq!(info(&path).expect("the file is read").frames, Some(10));

    for round in 1..4_u64 {
        let (recorder, resumed) = Recorder::append(&path).expect("the file is resumed");
        let rows = 5 * round;
        assert_eq!(resumed.checkpoint, checkpoint(round, particles), "round {round}");
        assert_eq!((resumed.frames, resumed.samples, resumed.event_rows), (rows, rows, rows * per_row));
        assert_eq!(resumed.last_frame, Some((rows - 1) as f64 * 0.25));
        assert_eq!(resumed.last_sample, Some((rows - 1) as f64 * 0.125));
        assert!(!resumed.finished);
        // The summary of the previous part is available only until new rows are recorded.
        assert_eq!(resumed.summary.is_some(), round == 1);
        record(&recorder, particles, rows..rows + 5, per_row);
        recorder.checkpoint(checkpoint(round + 1, particles)).expect("a checkpoint");
        record(&recorder, particles, 100..102, per_row);
        // Dropped, not finished: as after a failure.
    }
    let (recorder, _) = Recorder::append(&path).expect("the file is resumed");
    record(&recorder, particles, 20..23, per_row);
    recorder.finish("{}", true).expect("a finished file");
    check(&path, particles, 23, 23, 23 * per_row);
}

#[test]
fn a_complete_run_is_reported_and_not_changed() {
    let directory = directory();
    let path = directory.path().join("run.h5");
    let recorder = Recorder::create(&path, header(4), false).expect("a new file");
    record(&recorder, 4, 0..4, 10);
    recorder.checkpoint(checkpoint(3, 4)).expect("a checkpoint");
    record(&recorder, 4, 4..5, 10);
    recorder.finish("{\"stopped\":\"until\"}", true).expect("a finished file");
    let before = fs::read(&path).expect("the file is there");

    let (recorder, resumed) = Recorder::append(&path).expect("the file is read");
    assert!(resumed.finished);
    assert_eq!(resumed.summary.as_deref(), Some("{\"stopped\":\"until\"}"));
    assert_eq!(resumed.checkpoint, checkpoint(3, 4));
    assert!(matches!(recorder.frame(frame(5, 4)), Err(RecordError::Complete { .. })));
    assert!(matches!(recorder.flush(), Err(RecordError::Complete { .. })));
    drop(recorder);
    assert!(fs::read(&path).expect("the file is there") == before, "a complete file was changed");
}

#[test]
fn after_damage_the_previous_checkpoint_is_used() {
    let directory = directory();
    let path = directory.path().join("run.h5");
    let recorder = Recorder::create(&path, header(50), false).expect("a new file");
    for k in 0..3 {
        record(&recorder, 50, k..k + 1, 10);
        recorder.checkpoint(checkpoint(k, 50)).expect("a checkpoint");
    }
    drop(recorder);
    // The third checkpoint is in slot 0.
    {
        let file = File::open_rw(&path).expect("the file opens");
        let velocity = file.dataset("checkpoint/0/velocity").expect("the slot");
        let mut values: Vec<f64> = velocity.read_raw().expect("velocities");
        values[77] += 1e-9;
        let view = hdf5_view(&values);
        velocity.write(view).expect("velocities are written");
    }
    let (recorder, resumed) = Recorder::append(&path).expect("the file is resumed");
    assert_eq!(resumed.checkpoint, checkpoint(1, 50));
    assert_eq!((resumed.frames, resumed.event_rows), (2, 20));
    // The next one must replace the damaged one, not the one that was used.
    record(&recorder, 50, 2..3, 10);
    recorder.checkpoint(checkpoint(9, 50)).expect("a checkpoint");
    drop(recorder);
    let file = File::open(&path).expect("the file opens");
    let sequences = ["0", "1"].map(|slot| column::<u64>(&file, &format!("checkpoint/{slot}/header"))[0]);
    assert_eq!(sequences, [4, 2]);
    drop(file);
    let (_, resumed) = Recorder::append(&path).expect("the file is resumed");
    assert_eq!(resumed.checkpoint, checkpoint(9, 50));
}

fn hdf5_view(values: &[f64]) -> ndarray::ArrayView2<'_, f64> {
    ndarray::ArrayView2::from_shape((values.len() / 3, 3), values).expect("whole rows")
}

#[test]
fn the_estimated_file_size_is_accurate_to_15_percent() {
    use EventColumn::{I, J, Time};
    let directory = directory();
    let all = &EventColumn::ALL[..];
    for (particles, frames, samples, events, columns, compressed) in [
        (5000, 20, 500, 100_000, all, true),
        (5000, 20, 500, 100_000, all, false),
        (1000, 0, 2, 400_000, &[Time, I, J], true),
        (2, 10, 20_000, 0, &[], true),
        (30_000, 4, 4, 0, &[], true),
        (30_000, 4, 4, 0, &[], false),
    ] {
        let path = directory.path().join(format!("{particles}-{}-{compressed}.h5", columns.len()));
        let wanted = Header { events: columns.to_vec(), compressed, ..header(particles) };
        let recorder = Recorder::create(&path, wanted, false).expect("a new file");
        (0..frames).for_each(|k| recorder.frame(frame(k, particles)).expect("a frame"));
        (0..samples).for_each(|k| recorder.sample(sample(k)).expect("a sample"));
        // Ids and times as irregular as those of a gas.
        let irregular = |row: EventRecord| EventRecord {
            time: row.time + 1e-3 * row.impulse,
            i: (row.normal.x * particles as f64) as u32,
            j: (row.normal.y * particles as f64) as u32,
            ..row
        };
        recorder.events(common::events(0, events).into_iter().map(irregular).collect()).expect("events");
        recorder.finish("{}", true).expect("a finished file");
        let size = fs::metadata(&path).expect("the file is there").len();
        let estimate = haff_record::estimate_file_size(&haff_record::FileSize {
            particles: particles as u64,
            dimension: 3,
            spin: true,
            pistons: 1,
            frames,
            samples,
            events,
            columns,
            compressed,
            // The pressure tensor with its parts, force and heat of two walls, rates and mean free times of
            // two species.
            measured: samples * (27 + 8 + 6),
            kept: 0,
            profiles: &[],
        });
        let ratio = estimate as f64 / size as f64;
        assert!((0.85..1.15).contains(&ratio), "N = {particles}: {estimate} bytes expected, {size} found");
    }
}
