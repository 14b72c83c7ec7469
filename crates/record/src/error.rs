//! Errors of output files.

use std::{
    io,
    path::{Path, PathBuf},
};

/// Error of writing or reading a file. Every variant names the file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The output file exists and may not be replaced.
    #[error("{path} exists")]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The output path is a directory, a device, ….
    #[error("{path} is not a regular file")]
    NotAFile {
        /// The path.
        path: PathBuf,
    },
    /// Another process is writing the file.
    #[error("{path} is being written by another process")]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// No such file.
    #[error("{path}: no such file")]
    NotFound {
        /// The file.
        path: PathBuf,
    },
    /// A file, but not HDF5.
    #[error("{path} is not an HDF5 file")]
    NotHdf5 {
        /// The file.
        path: PathBuf,
    },
    /// HDF5, but not written by haff.
    #[error("{path} is an HDF5 file, but not one written by haff: {missing} is missing")]
    NotHaff {
        /// The file.
        path: PathBuf,
        /// A part that every file of haff has and this one lacks.
        missing: String,
    },
    /// The file ends before the end that it declares.
    #[error("{path} is truncated: {reason}")]
    Truncated {
        /// The file.
        path: PathBuf,
        /// The message of HDF5.
        reason: String,
    },
    /// Written with another version of the file layout or scene schema.
    #[error("{path} has schema {found}; this version of haff reads schema {expected}")]
    Schema {
        /// The file.
        path: PathBuf,
        /// Version in the file.
        found: i64,
        /// Version of this program.
        expected: i64,
    },
    /// The file does not contain the requested data.
    #[error("{path} holds no {what}")]
    Missing {
        /// The file.
        path: PathBuf,
        /// The requested data.
        what: &'static str,
    },
    /// The run in the file is complete; nothing can be added.
    #[error("{path} holds a complete run: nothing can be added")]
    Complete {
        /// The file.
        path: PathBuf,
    },
    /// The given data do not fit the file.
    #[error("{path}: cannot record {reason}")]
    Unfit {
        /// The file.
        path: PathBuf,
        /// The mismatch: expected and found counts.
        reason: String,
    },
    /// The disk is full, or a quota or size limit is reached.
    #[error(
        "{path}: cannot write: {reason}; {}",
        if *exists { "everything up to the last flush is readable" } else { "no file has been made, nothing is saved" }
    )]
    Full {
        /// The file.
        path: PathBuf,
        /// The system's message.
        reason: String,
        /// Whether the file has been made before, with a first checkpoint.
        exists: bool,
    },
    /// Another process has changed the file during every attempt to read it.
    #[error("{path}: the run that is writing it has changed it whenever it was read; try again")]
    Changing {
        /// The file.
        path: PathBuf,
    },
    /// The file is no longer at its path.
    #[error("{path} was removed or replaced while it was being written")]
    Vanished {
        /// The file.
        path: PathBuf,
    },
    /// Any other failure of reading or writing.
    #[error("{path}: cannot {action}: {reason}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The failed action.
        action: &'static str,
        /// The message of the system or of HDF5.
        reason: String,
    },
}

impl RecordError {
    /// An error of the system during `action`.
    pub(crate) fn io(path: &Path, action: &'static str, error: &io::Error) -> Self {
        let path = path.to_owned();
        match error.kind() {
            io::ErrorKind::NotFound if action == OPEN => Self::NotFound { path },
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                Self::Full { path, reason: plain(&error.to_string()), exists: true }
            }
            io::ErrorKind::FileTooLarge => {
                let reason = "the limit on the size of files is reached (ulimit -f, or the file system's)";
                Self::Full { path, reason: reason.to_owned(), exists: true }
            }
            _ => Self::Io { path, action, reason: plain(&error.to_string()) },
        }
    }

    /// The same error of a file that is not yet at its path.
    pub(crate) fn unpublished(self) -> Self {
        match self {
            Self::Full { path, reason, .. } => Self::Full { path, reason, exists: false },
            other => other,
        }
    }

    /// An error of HDF5 during `action`.
    pub(crate) fn hdf5(path: &Path, action: &'static str, error: &hdf5::Error) -> Self {
        let path = path.to_owned();
        let text = error.to_string();
        // HDF5 reports failed system calls as `… errno = 28, error message = 'No space left on device', …`.
        let system = text.split_once("errno = ").and_then(|(_, rest)| {
            let code: i32 = rest.split(',').next()?.trim().parse().ok()?;
            Some(io::Error::from_raw_os_error(code))
        });
        if let Some(error) = system {
            return match error.kind() {
                io::ErrorKind::WouldBlock => Self::InUse { path },
                _ => Self::io(&path, action, &error),
            };
        }
        // It reports a file that ends too early as `truncated file: eof = 9, sblock->base_addr = 0,
        // stored_eof = 99`.
        if let Some((_, rest)) = text.rsplit_once("truncated file: ") {
            let number = |key| rest.split_once(key)?.1.split(',').next()?.trim().parse::<u64>().ok();
            let reason = match (number("eof = "), number("stored_eof = ")) {
                (Some(found), Some(written)) => format!("{found} of its {written} bytes are there"),
                _ => rest.to_owned(),
            };
            return Self::Truncated { path, reason };
        }
        Self::Io { path, action, reason: text }
    }
}

/// The action of opening a file to read it: a missing file then has its own error.
pub(crate) const OPEN: &str = "open the file";
/// The action of reading it.
pub(crate) const READ: &str = "read";

/// The system's message without `(os error 28)`.
fn plain(message: &str) -> String {
    message.split(" (os error").next().unwrap_or(message).to_owned()
}

/// Adds the path and the action to errors of HDF5.
pub(crate) trait Context<T> {
    /// The error with its context.
    fn doing(self, path: &Path, action: &'static str) -> Result<T, RecordError>;
}

impl<T> Context<T> for hdf5::Result<T> {
    fn doing(self, path: &Path, action: &'static str) -> Result<T, RecordError> {
        self.map_err(|error| RecordError::hdf5(path, action, &error))
    }
}

impl<T> Context<T> for io::Result<T> {
    fn doing(self, path: &Path, action: &'static str) -> Result<T, RecordError> {
        self.map_err(|error| RecordError::io(path, action, &error))
    }
}
