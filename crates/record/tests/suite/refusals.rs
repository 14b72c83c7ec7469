//! Invalid writes and reads are refused with an error that names the reason, and no data are lost.

use std::{
    fs,
    path::{Path, PathBuf},
};

use haff_engine::Frame;
use haff_record::{Header, RecordError, Recorder, info, last_state};
use tempfile::TempDir;

use crate::common::{self, checkpoint, frame, header, sample};

fn directory() -> TempDir {
    tempfile::tempdir().expect("a directory for the test")
}

fn names(directory: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(directory).expect("the directory is there");
    let mut names: Vec<_> = entries.map(|entry| entry.expect("an entry").file_name().into()).collect();
    names.sort();
    names
}

/// A small complete file.
fn write(path: &Path, overwrite: bool) -> Result<(), RecordError> {
    let recorder = Recorder::create(path, header(3), overwrite)?;
    recorder.frame(frame(0, 3))?;
    recorder.sample(sample(0))?;
    recorder.checkpoint(checkpoint(0, 3))?;
    recorder.finish("{}", true)
}

#[test]
fn an_existing_file_is_replaced_only_with_overwrite() {
    let directory = directory();
    let path = directory.path().join("run.h5");
    fs::write(&path, "precious").expect("a file");
    let error = write(&path, false).expect_err("the file is there");
    assert_eq!(error, RecordError::Exists { path: path.clone() });
    assert!(error.to_string().ends_with("run.h5 exists"), "{error}");
    assert_eq!(fs::read_to_string(&path).expect("the file is there"), "precious");

    write(&path, true).expect("it may be replaced");
    assert_eq!(info(&path).expect("the new file is read").frames, Some(1));
    assert_eq!(names(directory.path()), [PathBuf::from("run.h5")]);
}

#[test]
fn the_old_file_stays_until_the_new_one_can_be_resumed() {
    let directory = directory();
    let path = directory.path().join("run.h5");
    fs::write(&path, "precious").expect("a file");
    let recorder = Recorder::create(&path, header(3), true).expect("it may be replaced");
    assert_eq!(fs::read_to_string(&path).expect("the file is there"), "precious");
    // A run that fails before it has recorded anything leaves no file.
    drop(recorder);
    assert_eq!(fs::read_to_string(&path).expect("the file is there"), "precious");
    assert_eq!(names(directory.path()), [PathBuf::from("run.h5")]);

    let recorder = Recorder::create(&path, header(3), true).expect("it may be replaced");
    recorder.checkpoint(checkpoint(0, 3)).expect("a checkpoint");
    recorder.flush().expect("a flush");
    assert!(info(&path).expect("the new file is read").resumable);
}

#[test]
fn a_file_created_by_another_process_is_not_replaced() {
    let directory = directory();
    let path = directory.path().join("run.h5");
    let recorder = Recorder::create(&path, header(3), false).expect("nothing is there");
    fs::write(&path, "precious").expect("a file");
    recorder.checkpoint(checkpoint(0, 3)).expect("the queue takes it");
    let error = recorder.finish("{}", true).expect_err("the file is there");
    assert_eq!(error, RecordError::Exists { path: path.clone() });
    assert_eq!(fs::read_to_string(&path).expect("the file is there"), "precious");
    assert_eq!(names(directory.path()), [PathBuf::from("run.h5")]);
}

#[test]
#[cfg(unix)]
fn links_are_kept_and_devices_and_directories_refused() {
    let directory = directory();
    let (target, link) = (directory.path().join("target.h5"), directory.path().join("link.h5"));
    write(&target, false).expect("a file");
    std::os::unix::fs::symlink(&target, &link).expect("a link");
    assert!(matches!(write(&link, false), Err(RecordError::Exists { .. })));
    write(&link, true).expect("it may be replaced");
    assert!(link.is_symlink());

    let refused = write(Path::new("/dev/null"), true);
    assert!(matches!(refused, Err(RecordError::NotAFile { .. })), "{refused:?}");
    let refused = write(directory.path(), true);
    assert!(matches!(refused, Err(RecordError::NotAFile { .. })), "{refused:?}");
    let refused = write(&directory.path().join("no/such/place.h5"), false);
    assert!(
        matches!(&refused, Err(RecordError::Io { reason, .. }) if reason.contains("No such file")),
        "{refused:?}"
    );
}

#[test]
fn a_file_being_written_is_neither_replaced_nor_resumed() {
    let directory = directory();
    let path = directory.path().join("run.h5");
    let recorder = Recorder::create(&path, header(3), false).expect("a new file");
    recorder.checkpoint(checkpoint(0, 3)).expect("a checkpoint");
    recorder.flush().expect("a flush");
    let refused = Recorder::create(&path, header(3), true).map(|_| ());
    assert_eq!(refused, Err(RecordError::InUse { path: path.clone() }));
    drop(recorder);
    Recorder::append(&path).expect("now it may");
}

#[test]
fn unreadable_files_have_distinct_errors() {
    let directory = directory();
    let at = |name: &str| directory.path().join(name);
    assert_eq!(info(at("none.h5")), Err(RecordError::NotFound { path: at("none.h5") }));
    assert_eq!(info(directory.path()), Err(RecordError::NotAFile { path: directory.path().to_owned() }));

    for content in ["", "short", "schema = 1 # a scene, not an output file"] {
        fs::write(at("text.h5"), content).expect("a file");
        assert_eq!(info(at("text.h5")), Err(RecordError::NotHdf5 { path: at("text.h5") }), "{content:?}");
    }

    hdf5::File::create(at("foreign.h5")).and_then(|file| file.create_group("h5md")).expect("a foreign file");
    let refused = info(at("foreign.h5"));
    assert!(
        matches!(&refused, Err(RecordError::NotHaff { missing, .. }) if missing == "parameters"),
        "{refused:?}"
    );

    write(&at("old.h5"), false).expect("a file");
    let file = hdf5::File::open_rw(at("old.h5")).expect("the file opens");
    file.dataset("parameters/schema").and_then(|dataset| dataset.write_scalar(&2_i64)).expect("a schema");
    drop(file);
    let refused = Err(RecordError::Schema { path: at("old.h5"), found: 2, expected: 1 });
    assert_eq!(info(at("old.h5")), refused);

    write(&at("cut.h5"), false).expect("a file");
    let whole = fs::read(at("cut.h5")).expect("the file is there");
    for length in [whole.len() - 1, whole.len() / 2, 4096, 100, 9] {
        fs::write(at("cut.h5"), &whole[..length]).expect("a shorter file");
        for refused in [
            info(at("cut.h5")).map(|_| ()),
            last_state(at("cut.h5")).map(|_| ()),
            Recorder::append(at("cut.h5")).map(|_| ()),
        ] {
            let error = refused.expect_err("the file is cut");
            let truncated = matches!(error, RecordError::Truncated { .. });
            // With less than its superblock, HDF5 cannot determine what is missing.
            assert!(truncated || length <= 100, "{length} of {} bytes: {error:?}", whole.len());
            assert!(error.to_string().contains("cut.h5"), "{error}");
        }
    }
}

#[test]
fn corrupted_files_give_errors_not_panics() {
    let directory = directory();
    let path = directory.path().join("whole.h5");
    write(&path, false).expect("a file");
    let whole = fs::read(&path).expect("the file is there");
    let mut refused = 0;
    for seed in 0..70 {
        let path = directory.path().join(format!("{seed}.h5"));
        let mut bytes = whole.clone();
        // The start contains the metadata; later there are more data, where damage has less effect.
        for k in 0..20 {
            let offset = (common::number(seed, k) * 12_000.0) as usize;
            bytes[offset % whole.len()] = (common::number(seed, k + 100) * 256.0) as u8;
        }
        fs::write(&path, &bytes).expect("a corrupted file");
        refused += u32::from(info(&path).is_err());
        let _ = last_state(&path);
        let _ = Recorder::append(&path);
    }
    assert!(refused > 20, "{refused} of 70 were refused: too little damage, the test is inconclusive");
}

#[test]
fn data_that_do_not_fit_are_refused_and_recording_continues() {
    let directory = directory();
    let path = directory.path().join("run.h5");
    for (wrong, word) in [
        (
            Header { species: Vec::new(), mass: Vec::new(), radius: Vec::new(), ..header(3) },
            "without particles",
        ),
        (Header { mass: vec![1.0], ..header(3) }, "1 masses"),
        (Header { title: "a\0b".to_owned(), ..header(3) }, "NUL"),
    ] {
        let refused = Recorder::create(&path, wrong, false).map(|_| ()).expect_err("the header is wrong");
        assert!(
            matches!(refused, RecordError::Unfit { .. }) && refused.to_string().contains(word),
            "{refused}"
        );
    }
    assert!(names(directory.path()).is_empty());

    let recorder = Recorder::create(&path, header(3), false).expect("a new file");
    let short = Frame { image: vec![[0; 3]; 2], ..frame(0, 3) };
    for refused in [recorder.frame(frame(0, 4)), recorder.frame(short)] {
        assert!(matches!(refused, Err(RecordError::Unfit { .. })), "{refused:?}");
    }
    let mut one = sample(0);
    one.species_temperature.pop();
    assert!(matches!(recorder.sample(one), Err(RecordError::Unfit { .. })));
    let mut odd = checkpoint(1, 3);
    odd.scalars.push(("ζ".repeat(40), 0));
    for refused in [recorder.checkpoint(checkpoint(0, 2)), recorder.checkpoint(odd)] {
        assert!(matches!(refused, Err(RecordError::Unfit { .. })), "{refused:?}");
    }
    recorder.frame(frame(0, 3)).expect("a frame");
    recorder.checkpoint(checkpoint(0, 3)).expect("a checkpoint");
    recorder.finish("{}", true).expect("a finished file");
    assert_eq!(info(&path).expect("the file is read").frames, Some(1));
}
