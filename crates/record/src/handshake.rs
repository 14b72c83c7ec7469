//! The handshake between the process that writes a file and those that read it.
//!
//! A flush rewrites metadata in place, so a process that reads meanwhile finds parts of two states. Two means
//! prevent this, and the first alone makes what is read right:
//!
//! - *A counter in the file*, odd while the file is being changed. A reader compares it before and after: if
//!   it is not the same even number, what was read is discarded and read again. It stands at a fixed address,
//!   since it is needed before HDF5 opens the file, and HDF5 does not write it after the file was created.
//! - *A lock* on one byte far behind the end, shared for readers and exclusive for flushes (on Linux; it has
//!   nothing to do with HDF5's lock on the whole file, which is of another kind). It lets readers
//!   finish: a flush is put off while there are some, and if that has lasted long, it says beside the counter
//!   that it waits, so that no other begins. Both sides wait for a limited time: a flush goes on beside a
//!   reader that is stopped, which then finds the counter changed. The locks of a process end with it.
//!
//! `python/haff/files/handshake.py` is the reader's part in Python.

use std::{
    fs, io,
    path::Path,
    thread,
    time::{Duration, Instant},
};

use hdf5::Group;

use crate::error::{Context, OPEN, RecordError};

/// Group and name of the dataset: two words that mark the place, then those of [`Count`].
pub(crate) const GROUP: &str = "checkpoint";
const NAME: &str = "flushes";
/// The two words, as bytes.
const MARK: [u8; 16] = *b"haff flush count";
/// Address of the dataset, which is the first raw data of a file.
pub(crate) const ADDRESS: u64 = 4096;
/// Size of the dataset [bytes].
pub(crate) const SIZE: usize = 40;
/// Longest time for which a flush waits for readers. Data are queued meanwhile, and the run goes on.
const FLUSH_WAITS: Duration = Duration::from_secs(1);
/// Longest time for which a reader waits and tries again.
const READER_WAITS: Duration = Duration::from_secs(10);
/// Longest time between two attempts.
const PAUSE: Duration = Duration::from_millis(1);

/// Creates the counter of a new, empty file.
pub(crate) fn create(root: &Group) -> hdf5::Result<()> {
    let group = root.create_group(GROUP)?;
    let dataset = group
        .new_dataset::<u64>()
        .layout(hdf5::dataset::Layout::Contiguous)
        .alloc_time(Some(hdf5::dataset::AllocTime::Early))
        .obj_track_times(false)
        .shape(SIZE / 8)
        .create(NAME)?;
    dataset.write(&words(&bytes(Count::default())))?;
    match dataset.offset() {
        Some(ADDRESS) => Ok(()),
        found => Err(format!("{} is at {found:?} instead of {ADDRESS}", dataset.name()).into()),
    }
}

/// The counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Count {
    /// Beginnings and ends of changes; 0 in a file that was closed.
    flushes: u64,
    /// Number of resumptions. Each may drop rows and use their space again.
    resumptions: u64,
    /// 1 while a change waits for readers.
    waiting: u64,
}

impl Count {
    /// The counter in a file; `None` in files of versions without one.
    fn read(file: &fs::File) -> io::Result<Option<Self>> {
        let mut found = [0; SIZE];
        match read_at(file, &mut found) {
            Ok(()) => {}
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
            Err(error) => return Err(error),
        }
        let [_, _, flushes, resumptions, waiting] = words(&found);
        Ok(found.starts_with(&MARK).then_some(Self { flushes, resumptions, waiting }))
    }

    /// Whether the file is being changed, or about to be.
    fn is_changing(self) -> bool {
        self.flushes % 2 == 1 || self.waiting > 0
    }
}

fn words(bytes: &[u8; SIZE]) -> [u64; SIZE / 8] {
    let (words, _) = bytes.as_chunks();
    std::array::from_fn(|k| u64::from_le_bytes(words[k]))
}

fn bytes(count: Count) -> [u8; SIZE] {
    let mut bytes = [0; SIZE];
    bytes[..16].copy_from_slice(&MARK);
    bytes[16..24].copy_from_slice(&count.flushes.to_le_bytes());
    bytes[24..32].copy_from_slice(&count.resumptions.to_le_bytes());
    bytes[32..].copy_from_slice(&count.waiting.to_le_bytes());
    bytes
}

/// The writer's part.
#[derive(Debug)]
pub(crate) struct Flushes {
    /// `None` in files of versions without a counter.
    count: Option<Count>,
    /// Whether the file is being changed.
    changing: bool,
    /// Longest time for which a change waits for readers.
    waits: Duration,
    /// Whether changes wait for readers: not after one has waited for a reader that did not go on.
    patient: bool,
}

impl Flushes {
    /// For a new file.
    pub fn new() -> Self {
        Self { count: Some(Count::default()), changing: false, waits: FLUSH_WAITS, patient: true }
    }

    /// For a file that is continued.
    pub fn of(file: &fs::File) -> io::Result<Self> {
        let count = Count::read(file)?.map(|found| Count {
            // Odd after a kill. A damaged file may have any number.
            flushes: (found.flushes & (u64::MAX >> 1)).next_multiple_of(2),
            resumptions: found.resumptions.wrapping_add(1),
            waiting: 0,
        });
        Ok(Self { count, changing: false, waits: FLUSH_WAITS, patient: true })
    }

    /// Whether no process reads the file. A change that is put off while this is false leaves time to readers
    /// also where one of them does not go on.
    pub fn is_free(&mut self, file: &fs::File) -> bool {
        if self.changing {
            return true;
        }
        let free = lock(file, Lock::Exclusive);
        lock(file, Lock::None);
        free
    }

    /// Keeps readers away until [`Flushes::end`].
    pub fn begin(&mut self, file: &fs::File) -> io::Result<()> {
        if self.changing {
            return Ok(());
        }
        if lock(file, Lock::Exclusive) {
            self.patient = true;
        } else {
            self.wait(file)?;
        }
        self.changing = true;
        self.write(file, |count| (count.flushes, count.waiting) = (count.flushes + 1, 0))
    }

    /// Waits for readers, for a limited time.
    fn wait(&mut self, file: &fs::File) -> io::Result<()> {
        self.write(file, |count| count.waiting = 1)?;
        let began = Instant::now();
        let until = began + if self.patient { self.waits } else { Duration::ZERO };
        let mut pause = PAUSE / 64;
        self.patient = loop {
            if lock(file, Lock::Exclusive) {
                break true;
            }
            if Instant::now() >= until {
                break false;
            }
            thread::sleep(pause);
            pause = (2 * pause).min(PAUSE);
        };
        tracing::debug!(seconds = began.elapsed().as_secs_f64(), "waited for readers");
        Ok(())
    }

    /// Lets readers begin.
    pub fn end(&mut self, file: &fs::File) -> io::Result<()> {
        if !self.changing {
            return Ok(());
        }
        self.write(file, |count| count.flushes += 1)?;
        self.changing = false;
        lock(file, Lock::None);
        Ok(())
    }

    /// Marks a closed file: its bytes do not depend on the number of flushes, which depends on the clock.
    pub fn close(&mut self, file: &fs::File) -> io::Result<()> {
        // HDF5 has given up its lock, so another process may continue the file already; it then has the
        // counter. It cannot begin as long as this lock is held.
        let taken = matches!(file.try_lock_shared(), Err(fs::TryLockError::WouldBlock));
        if !taken {
            self.write(file, |count| count.flushes = 0)?;
        }
        // The file is closed after this; both locks end with it.
        Ok(())
    }

    fn write(&mut self, file: &fs::File, change: impl FnOnce(&mut Count)) -> io::Result<()> {
        let Some(count) = &mut self.count else { return Ok(()) };
        change(count);
        write_at(file, &bytes(*count))
    }
}

/// A reader's part.
#[derive(Debug)]
struct Reading {
    /// Holds the lock.
    file: fs::File,
    count: Option<Count>,
}

impl Reading {
    /// Waits until the file is not being changed; `None` if that takes too long.
    fn begin(path: &Path, until: Instant) -> io::Result<Option<Self>> {
        loop {
            let file = fs::File::open(path)?;
            lock(&file, Lock::Shared);
            let count = Count::read(&file)?;
            // A run that was killed during a change has left these numbers.
            if !count.is_some_and(Count::is_changing) || !is_being_written(path) {
                return Ok(Some(Self { file, count }));
            }
            drop(file);
            if Instant::now() >= until {
                return Ok(None);
            }
            thread::sleep(PAUSE);
        }
    }

    /// Whether what has been read since is one state of the file that is at the path.
    fn is_consistent(&self, path: &Path) -> io::Result<bool> {
        let flushes = |count: Option<Count>| count.map(|count| (count.flushes, count.resumptions));
        Ok(is_at(&self.file, path)? && flushes(Count::read(&self.file)?) == flushes(self.count))
    }
}

/// Reads a file by `read` while no other process changes it.
pub(crate) fn read_one_state<T>(
    path: &Path,
    read: impl Fn() -> Result<T, RecordError>,
) -> Result<T, RecordError> {
    let until = Instant::now() + READER_WAITS;
    loop {
        let Some(reading) = Reading::begin(path, until).doing(path, OPEN)? else { break };
        let result = read();
        let patient = Instant::now() < until;
        if reading.is_consistent(path).doing(path, OPEN)? {
            match result {
                // Nothing says that a version without a counter is flushing.
                Err(RecordError::Io { .. } | RecordError::Truncated { .. })
                    if reading.count.is_none() && patient && is_being_written(path) => {}
                result => return result,
            }
        } else if !patient {
            break;
        }
        drop(reading);
        thread::sleep(PAUSE);
    }
    Err(RecordError::Changing { path: path.to_owned() })
}

/// Whether a path leads to an open file.
pub(crate) fn is_at(file: &fs::File, path: &Path) -> io::Result<bool> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let own = file.metadata()?;
        match fs::metadata(path) {
            Ok(there) => Ok((there.dev(), there.ino()) == (own.dev(), own.ino())),
            // Other errors do not say that the file has gone.
            Err(error) => Ok(error.kind() != io::ErrorKind::NotFound),
        }
    }
    #[cfg(not(unix))]
    {
        let _ = (file, path);
        Ok(true)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lock {
    None,
    Shared,
    Exclusive,
}

/// Sets the lock on the byte, which belongs to `file` and ends with it; returns whether there is one now.
#[cfg(target_os = "linux")]
fn lock(file: &fs::File, kind: Lock) -> bool {
    use nix::{
        fcntl::{FcntlArg, fcntl},
        libc,
    };
    let kind = match kind {
        Lock::None => libc::F_UNLCK,
        Lock::Shared => libc::F_RDLCK,
        Lock::Exclusive => libc::F_WRLCK,
    };
    let range = libc::flock {
        l_type: kind as libc::c_short,
        l_whence: libc::SEEK_SET as libc::c_short,
        l_start: LOCKED,
        l_len: 1,
        l_pid: 0,
    };
    fcntl(file, FcntlArg::F_OFD_SETLK(&range)).is_ok()
}

/// The byte that is locked: behind the end of every file.
#[cfg(target_os = "linux")]
const LOCKED: i64 = 1 << 62;

/// Other systems have no such locks: the counter is enough.
#[cfg(not(target_os = "linux"))]
fn lock(_: &fs::File, kind: Lock) -> bool {
    kind != Lock::Shared
}

#[cfg(unix)]
fn read_at(file: &fs::File, bytes: &mut [u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, ADDRESS)
}

#[cfg(unix)]
fn write_at(file: &fs::File, bytes: &[u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, ADDRESS)
}

#[cfg(not(unix))]
fn read_at(mut file: &fs::File, bytes: &mut [u8]) -> io::Result<()> {
    use std::io::{Read, Seek, SeekFrom};
    file.seek(SeekFrom::Start(ADDRESS)).and_then(|_| file.read_exact(bytes))
}

#[cfg(not(unix))]
fn write_at(mut file: &fs::File, bytes: &[u8]) -> io::Result<()> {
    use std::io::{Seek, SeekFrom, Write};
    file.seek(SeekFrom::Start(ADDRESS)).and_then(|_| file.write_all(bytes))
}

/// Whether a process has the file open for writing; `false` if there is no such file.
pub fn is_being_written(path: &Path) -> bool {
    // HDF5 holds a lock on files that it writes, until its process ends.
    fs::File::open(path).is_ok_and(|file| matches!(file.try_lock_shared(), Err(fs::TryLockError::WouldBlock)))
}

#[cfg(test)]
mod tests {
    use std::{
        cell::Cell,
        sync::{Arc, Barrier},
    };

    use super::*;

    const LONG: Duration = Duration::from_secs(600);

    /// A file with a counter, and the writer's part of the handshake.
    fn file() -> (tempfile::TempDir, std::path::PathBuf, fs::File, Flushes) {
        let directory = tempfile::tempdir().expect("a directory for the test");
        let path = directory.path().join("run.h5");
        let file = fs::File::options().read(true).write(true).create_new(true).open(&path).expect("a file");
        file.set_len(2 * ADDRESS).expect("space");
        write_at(&file, &bytes(Count::default())).expect("a counter");
        (directory, path, file, Flushes { waits: LONG, ..Flushes::new() })
    }

    fn count(file: &fs::File) -> Count {
        Count::read(file).expect("the file is read").expect("a counter")
    }

    #[test]
    fn the_counter_is_odd_during_a_change_and_zero_after_the_end() {
        let (_directory, _, file, mut flushes) = file();
        for expected in [1, 3] {
            flushes.begin(&file).expect("a change");
            flushes.begin(&file).expect("the same change");
            assert_eq!(count(&file), Count { flushes: expected, ..Count::default() });
            flushes.end(&file).expect("its end");
            assert_eq!(count(&file), Count { flushes: expected + 1, ..Count::default() });
        }
        // Killed during a change, and resumed.
        flushes.begin(&file).expect("a change");
        let mut resumed = Flushes::of(&file).expect("the file is read");
        resumed.begin(&file).expect("a change");
        assert_eq!(count(&file), Count { flushes: 7, resumptions: 1, waiting: 0 });
        resumed.close(&file).expect("the end");
        assert_eq!(count(&file), Count { flushes: 0, resumptions: 1, waiting: 0 });
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_change_waits_for_a_reader_and_no_other_begins() {
        let (_directory, path, file, mut flushes) = file();
        let reader = fs::File::open(&path).expect("the file opens");
        assert!(lock(&reader, Lock::Shared));
        let begun = Arc::new(Barrier::new(2));
        let writer = thread::spawn({
            let (begun, file) = (Arc::clone(&begun), file.try_clone().expect("a handle"));
            move || {
                flushes.begin(&file).expect("a change");
                begun.wait();
                flushes.patient
            }
        });
        while count(&file).waiting == 0 {
            thread::yield_now();
        }
        assert!(count(&file).is_changing() && count(&file).flushes == 0, "nothing has been changed");
        drop(reader);
        begun.wait();
        assert_eq!(count(&file), Count { flushes: 1, ..Count::default() });
        assert!(!lock(&fs::File::open(&path).expect("the file opens"), Lock::Shared));
        assert!(writer.join().expect("the writer ends"));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn changes_do_not_wait_again_for_a_reader_that_does_not_go_on() {
        let (_directory, path, file, mut flushes) = file();
        let reader = fs::File::open(&path).expect("the file opens");
        assert!(lock(&reader, Lock::Shared));
        flushes.waits = Duration::ZERO;
        assert!(!flushes.is_free(&file));
        flushes.begin(&file).expect("a change");
        flushes.end(&file).expect("its end");
        // Other readers are given time between changes all the same.
        assert!(!flushes.is_free(&file));
        // It would be a test of ten minutes.
        flushes.waits = LONG;
        flushes.begin(&file).expect("a change");
        flushes.end(&file).expect("its end");
        assert_eq!((count(&file).flushes, flushes.patient), (4, false));
        drop(reader);
        flushes.begin(&file).expect("a change");
        assert!(flushes.patient, "the reader has gone");
    }

    #[test]
    fn what_is_read_during_a_change_is_read_again() {
        let (_directory, path, file, mut flushes) = file();
        flushes.waits = Duration::ZERO;
        let (flushes, attempts) = (Cell::new(Some(flushes)), Cell::new(0));
        let found = read_one_state(&path, || {
            attempts.set(attempts.get() + 1);
            if let Some(mut flushes) = flushes.take() {
                flushes.begin(&file).expect("a change");
                flushes.end(&file).expect("its end");
                return Err(RecordError::NotHdf5 { path: path.clone() });
            }
            Ok(attempts.get())
        });
        assert_eq!(found, Ok(2));
        // A counter that a kill has left odd delays nothing, since no process has HDF5's lock.
        write_at(&file, &bytes(Count { flushes: 5, resumptions: 0, waiting: 1 })).expect("a counter");
        assert_eq!(read_one_state(&path, || Ok(1)), Ok(1));
    }
}
