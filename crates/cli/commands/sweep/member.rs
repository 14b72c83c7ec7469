//! One run of a sweep: started, resumed, or found complete.

use std::{collections::BTreeMap, fs, path::Path};

use haff_record::RecordError;
use serde_json::Value;

use super::{
    lock::{Lock, Refused},
    plan::{Member, Plan},
    row::{Row, State},
    values::same_scene,
};
use crate::{
    running::{
        controls::Controls,
        single::{self, Finished},
        states::States,
    },
    terminal::{
        failure::{Failure, Status, file_failure, scene_failure},
        output,
        progress::Progress,
        signals::Signals,
        words::output_option,
    },
};

/// Runs or resumes a member to its end; returns its row, and the whole report if it ran.
pub fn run(
    folder: &Path,
    plan: &Plan,
    member: &Member,
    signals: &Signals,
    progress: Progress,
) -> (Row, Option<Value>) {
    let mut row = Row::missing(member);
    let path = folder.join(&member.file);
    // A new file is moved to its path with its first flush. Before that, only this lock shows a second
    // process.
    let _lock = match Lock::of_member(folder, &member.file) {
        Ok(lock) => lock,
        Err(Refused::Held(holder)) => {
            let text = format!("{}: {holder} is at work on this run", path.display());
            fail(&mut row, &Failure::new(Status::File, text));
            row.status = State::Running;
            return (row, None);
        }
        Err(Refused::Failed(error)) => {
            fail(&mut row, &Failure::new(Status::File, format!("{}: cannot write: {error}", path.display())));
            return (row, None);
        }
    };
    let finished = match go(&path, plan, member, Controls { signals, progress, watch: false }) {
        Ok(finished) => finished,
        Err(failure) => {
            fail(&mut row, &failure);
            if is_being_written(&path) {
                row.status = State::Running;
            }
            return (row, None);
        }
    };
    row.take(&finished.report);
    row.status = if finished.is_complete() { State::Complete } else { State::Unfinished };
    match finished.status() {
        Ok(exit) => row.exit = Some(exit),
        Err(failure) => fail(&mut row, &failure),
    }
    note_results(&mut row, folder);
    (row, Some(finished.report))
}

fn go(path: &Path, plan: &Plan, member: &Member, controls: Controls) -> Result<Finished, Failure> {
    let name = plan.scene.display().to_string();
    let mut scene = haff_scene::parse(&name, &plan.text, &member.overrides(), &States)
        .map_err(|errors| scene_failure(&errors))?;
    if !path.exists() {
        scene.output.file = Some(path.to_owned());
        return single::start(scene, false, controls);
    }
    let info = haff_record::info(path).map_err(|error| file_failure(&error))?;
    if !same_scene(&info.scene_toml, &scene.resolved) {
        let message = format!(
            "{} holds another run, or one of another version of haff: remove it, or take another folder {}",
            output::path(path),
            output_option("output")
        );
        return Err(Failure::new(Status::File, message));
    }
    drop(scene);
    single::resume(path.to_owned(), controls)
}

/// Updates a row of the manifest from the file of its member.
pub fn update_from_file(folder: &Path, row: &mut Row) {
    let path = folder.join(&row.file);
    match haff_record::info(&path) {
        Ok(info) => {
            let report: Value =
                info.summary.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default();
            row.take(&report);
            if let Some(error) = report["error"].as_str() {
                fail(row, &Failure::new(Status::Stopped, error));
                return;
            }
            row.error = None;
            row.exit = None;
            row.status = match (info.finished, is_being_written(&path)) {
                (true, _) => State::Complete,
                (false, true) => State::Running,
                (false, false) => State::Unfinished,
            };
            note_results(row, folder);
        }
        Err(RecordError::NotFound { .. }) => {
            // A run that failed before it had a file stays failed.
            if row.status != State::Failed {
                row.status = State::Missing;
            }
        }
        // A file that is being flushed cannot always be read.
        Err(_) if is_being_written(&path) => row.status = State::Running,
        Err(error) => fail(row, &file_failure(&error)),
    }
}

/// Whether a complete run's file still agrees with the manifest.
pub fn is_settled(folder: &Path, row: &Row) -> bool {
    row.status == State::Complete && row.file_bytes.is_some() && size(folder, row) == row.file_bytes
}

fn is_being_written(path: &Path) -> bool {
    haff_record::is_being_written(path)
}

fn fail(row: &mut Row, failure: &Failure) {
    row.status = State::Failed;
    row.exit = Some(failure.status as u8);
    row.error = Some(failure.message.clone());
}

/// Notes the size of the file of a complete run, and the means of its observables.
fn note_results(row: &mut Row, folder: &Path) {
    if row.status != State::Complete {
        (row.file_bytes, row.means) = (None, BTreeMap::new());
        return;
    }
    row.file_bytes = size(folder, row);
    // A file that cannot be read is found by what reads it next.
    let means = haff_record::means(folder.join(&row.file)).unwrap_or_default();
    row.means = means.iter().map(|found| (found.name.clone(), found.into())).collect();
}

fn size(folder: &Path, row: &Row) -> Option<u64> {
    fs::metadata(folder.join(&row.file)).ok().map(|metadata| metadata.len())
}
