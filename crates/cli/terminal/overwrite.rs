//! Files that no run replaces: its own input, and files that are not HDF5.

use std::{
    fs::{self, File},
    io::{ErrorKind, Read},
    os::unix::fs::MetadataExt,
    path::Path,
};

use haff_record::RecordError;

use crate::terminal::{
    failure::{Failure, Status, file_failure},
    output,
    words::{output_option, say},
};

/// First bytes of an HDF5 file.
const SIGNATURE: [u8; 8] = *b"\x89HDF\r\n\x1a\n";

/// Refuses an output that is the scene file or the state file itself, by any name or link; and, if an
/// existing file may be overwritten, a file that is not HDF5.
pub fn check(file: &Path, inputs: &[(&str, Option<&Path>)], overwrite: bool) -> Result<(), Failure> {
    for (what, input) in inputs {
        if input.is_some_and(|input| is_same(file, input)) {
            let message = format!(
                "output {}: is {what}; name another file {}",
                output::path(file),
                output_option("file")
            );
            return Err(Failure::new(Status::Invalid, message));
        }
    }
    if overwrite { check_kind(file) } else { Ok(()) }
}

/// Refuses a file that exists already, as the run itself does later.
pub fn check_free(file: &Path, overwrite: bool) -> Result<(), Failure> {
    if overwrite || !fs::symlink_metadata(file).is_ok_and(|metadata| metadata.is_file()) {
        return Ok(());
    }
    Err(file_failure(&RecordError::Exists { path: file.to_owned() }))
}

/// Whether two paths lead to one file, also by links.
fn is_same(one: &Path, other: &Path) -> bool {
    let identity = |path| fs::metadata(path).map(|metadata| (metadata.dev(), metadata.ino()));
    matches!((identity(one), identity(other)), (Ok(one), Ok(other)) if one == other)
}

/// Refuses an existing file that is not HDF5, unless it is empty. Folders and devices are refused when the
/// file is created.
fn check_kind(path: &Path) -> Result<(), Failure> {
    if !fs::metadata(path).is_ok_and(|metadata| metadata.is_file() && metadata.len() > 0) {
        return Ok(());
    }
    let mut start = [0; SIGNATURE.len()];
    let why = match File::open(path).and_then(|mut file| file.read_exact(&mut start)) {
        Ok(()) if start == SIGNATURE => return Ok(()),
        Ok(()) => "it is not an HDF5 file".to_owned(),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => "it is not an HDF5 file".to_owned(),
        Err(error) => error.to_string(),
    };
    let path = output::path(path);
    let message = format!(
        "{path}: {} replaces outputs of runs only: {why}; remove it, or name another file {}",
        say("--overwrite", "overwrite=True"),
        output_option("file")
    );
    Err(Failure::new(Status::File, message))
}
