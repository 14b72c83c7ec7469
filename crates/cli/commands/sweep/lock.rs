//! File locks of the operating system: one sweep per folder, one process per member. A lock ends with its
//! process, also when the process is killed.

use std::{
    fs::{self, File, TryLockError},
    io::{self, ErrorKind, Read, Write},
    path::{Path, PathBuf},
};

/// A lock, held until dropped. Its file holds the process id and is removed with the lock.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    /// `None` if the file system does not support locks.
    file: Option<File>,
}

/// Why a lock was not taken.
#[derive(Debug)]
pub enum Refused {
    /// Another process holds it: a text with its id, if known.
    Held(String),
    /// The lock file cannot be created or locked.
    Failed(io::Error),
}

impl From<io::Error> for Refused {
    fn from(error: io::Error) -> Self {
        Self::Failed(error)
    }
}

impl Lock {
    /// The lock of a whole sweep in a folder.
    pub fn of_sweep(folder: &Path) -> Result<Self, Refused> {
        Self::take(folder.join(".sweep.lock"))
    }

    /// The lock of a member, by the name of its file.
    pub fn of_member(folder: &Path, name: &str) -> Result<Self, Refused> {
        Self::take(Self::path_of_member(folder, name))
    }

    /// Removes the lock file of a member whose process was killed. A lock that is held stays.
    pub fn remove_left(folder: &Path, name: &str) {
        let path = Self::path_of_member(folder, name);
        if path.exists() {
            drop(Self::take(path));
        }
    }

    fn path_of_member(folder: &Path, name: &str) -> PathBuf {
        folder.join(format!(".{name}.lock"))
    }

    fn take(path: PathBuf) -> Result<Self, Refused> {
        loop {
            let mut file = File::options().read(true).write(true).create(true).truncate(false).open(&path)?;
            match file.try_lock() {
                Ok(()) if !is_at(&file, &path)? => {}
                Ok(()) => {
                    // The id is only for messages: a failure does not matter.
                    let _ = file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id()));
                    return Ok(Self { path, file: Some(file) });
                }
                Err(TryLockError::WouldBlock) => return Err(Refused::Held(holder(&file))),
                Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Unsupported => {
                    tracing::warn!("{}: the file system does not support locks", path.display());
                    return Ok(Self { path, file: None });
                }
                Err(TryLockError::Error(error)) => return Err(Refused::Failed(error)),
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Removed while the lock is held. A process that has opened it in the meantime detects that it is
        // gone, and retries.
        if self.file.is_some() {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Whether an open file is still the one at `path`: the previous holder may have removed it after it was
/// opened.
fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let own = file.metadata()?;
        match fs::metadata(path) {
            Ok(there) => Ok((there.dev(), there.ino()) == (own.dev(), own.ino())),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
            Err(error) => Err(error),
        }
    }
    #[cfg(not(unix))]
    Ok(path.exists() && file.metadata().is_ok())
}

/// A text for the process that holds a lock.
fn holder(mut file: &File) -> String {
    let mut text = String::new();
    let read = file.read_to_string(&mut text);
    match text.trim().parse::<u32>() {
        Ok(process) if read.is_ok() => format!("another process ({process})"),
        _ => "another process".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_is_exclusive_and_its_file_is_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = Lock::of_sweep(folder.path()).expect("the lock is free");
        let Err(Refused::Held(holder)) = Lock::of_sweep(folder.path()) else { panic!("it is held") };
        assert_eq!(holder, format!("another process ({})", std::process::id()));
        let member = Lock::of_member(folder.path(), "run-0000.h5").expect("a lock of its own");
        drop(Lock::of_member(folder.path(), "run-0001.h5").expect("another one"));
        drop((first, member));
        assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 0);
        // A killed process leaves its file, but no lock.
        fs::write(folder.path().join(".sweep.lock"), "1234567890").expect("a file");
        drop(Lock::of_sweep(folder.path()).expect("the lock is free"));
        fs::write(folder.path().join(".run-0001.h5.lock"), "1234567890").expect("a file");
        let lock = Lock::of_member(folder.path(), "run-0000.h5").expect("the lock is free");
        for name in ["run-0000.h5", "run-0001.h5", "run-0002.h5"] {
            Lock::remove_left(folder.path(), name);
        }
        assert!(matches!(Lock::of_member(folder.path(), "run-0000.h5"), Err(Refused::Held(_))));
        drop(lock);
        assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 0);
        assert!(matches!(Lock::of_sweep(&folder.path().join("none")), Err(Refused::Failed(_))));
    }
}
