//! Opening, beginning and flushing files so that a killed or starved process leaves something readable.

use std::{
    ffi::OsString,
    fs,
    io::{ErrorKind, Read, Seek, SeekFrom, Write},
    mem::ManuallyDrop,
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

use hdf5::file::{FileAccessBuilder, LibraryVersion, MetadataCacheConfig, OpenMode};

use crate::error::{Context, OPEN, RecordError};

/// First bytes of every HDF5 file without a user block.
const SIGNATURE: [u8; 8] = *b"\x89HDF\r\n\x1a\n";
/// Start of a superblock of version 0 with addresses of 8 bytes, as library version bounds `earliest` give it.
const SUPERBLOCK: [u8; 14] = *b"\x89HDF\r\n\x1a\n\0\0\0\0\0\x08";
/// Where such a superblock has the end-of-file address (little-endian).
const END_ADDRESS: u64 = 40;
/// A page of memory [bytes], which the kernel writes whole. An index node has 2 to 3 KiB.
const PAGE: u64 = 4096;
const WRITE: &str = "write";
const CREATE: &str = "create the file";

/// An HDF5 file open for writing.
///
/// It is never closed by dropping: a close writes whatever the library still holds, which after an error (a full
/// disk) would damage what is on disk. [`WritableFile::close`] closes, after a flush.
#[derive(Debug)]
pub(crate) struct WritableFile {
    file: ManuallyDrop<hdf5::File>,
    /// The same file as the system knows it.
    handle: fs::File,
    /// Where it will be when the first flush is done.
    path: PathBuf,
    /// Where it is until then, and whether it may replace a file.
    unpublished: Option<(PathBuf, bool)>,
    /// Bytes of the file for which space is known to be reserved.
    reserved: u64,
}

impl WritableFile {
    /// Begins a file under a name of its own, beside `path`. The first flush moves it to `path`, so that a file
    /// which is to be replaced stays until its successor can be read and resumed.
    pub fn create(path: &Path, overwrite: bool) -> Result<Self, RecordError> {
        // A symbolic link stays a link: what it points to is replaced.
        let path =
            if path.is_symlink() { fs::canonicalize(path).doing(path, CREATE)? } else { path.to_owned() };
        match fs::metadata(&path) {
            Ok(metadata) => {
                if !metadata.is_file() {
                    return Err(RecordError::NotAFile { path });
                }
                if !overwrite {
                    return Err(RecordError::Exists { path });
                }
                if is_being_written(&path) {
                    return Err(RecordError::InUse { path });
                }
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(RecordError::io(&path, CREATE, &error)),
        }
        let mut name = OsString::from(".");
        name.push(path.file_name().ok_or_else(|| RecordError::NotAFile { path: path.clone() })?);
        name.push(format!(".{}.part", std::process::id()));
        let begun = path.with_file_name(name);
        // The system's own error is plainer than HDF5's.
        let handle = fs::File::options().read(true).write(true).create(true).truncate(true).open(&begun);
        let handle = handle.doing(&path, CREATE)?;
        let file = hdf5::File::with_options()
            .set_fapl(&access(Purpose::Write).doing(&path, CREATE)?)
            .and_then(|builder| {
                // An image of a file must not depend on when it was made.
                builder.with_fcpl(|plist| plist.obj_track_times(false)).create(&begun)
            });
        match file {
            Ok(file) => Ok(Self {
                file: ManuallyDrop::new(file),
                handle,
                path,
                unpublished: Some((begun, overwrite)),
                reserved: 0,
            }),
            Err(error) => {
                let _ = fs::remove_file(&begun);
                Err(RecordError::hdf5(&path, CREATE, &error))
            }
        }
    }

    /// Opens a file to go on writing it.
    pub fn append(path: &Path) -> Result<Self, RecordError> {
        check_signature(path)?;
        let handle = fs::File::options().read(true).write(true).open(path).doing(path, OPEN)?;
        let file = access(Purpose::Write)
            .and_then(|plist| hdf5::File::with_options().set_fapl(&plist)?.open_as(path, OpenMode::ReadWrite))
            .doing(path, OPEN)?;
        let reserved = file.size();
        Ok(Self { file: ManuallyDrop::new(file), handle, path: path.to_owned(), unpublished: None, reserved })
    }

    /// The root group.
    pub fn root(&self) -> &hdf5::Group {
        &self.file
    }

    /// The path the file has or will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes all that HDF5 holds in memory.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.reserve()?;
        self.announce_end()?;
        self.file.flush().doing(&self.path, WRITE)?;
        self.reserved = self.file.size();
        // HDF5 may have given back space at the end, and does not know that the file had been extended for it.
        if self.handle.metadata().doing(&self.path, WRITE)?.len() > self.reserved {
            self.handle.set_len(self.reserved).doing(&self.path, WRITE)?;
        }
        self.check_place()
    }

    /// Tells a file that somebody has removed or replaced: the system would go on writing what nobody can open.
    fn check_place(&self) -> Result<(), RecordError> {
        #[cfg(unix)]
        if self.is_published() {
            use std::os::unix::fs::MetadataExt;
            let own = self.handle.metadata().doing(&self.path, WRITE)?;
            let vanished = match fs::metadata(&self.path) {
                Ok(there) => (there.dev(), there.ino()) != (own.dev(), own.ino()),
                Err(error) => error.kind() == ErrorKind::NotFound,
            };
            if vanished {
                return Err(RecordError::Vanished { path: self.path.clone() });
            }
        }
        Ok(())
    }

    /// Makes sure that the disk has room for everything HDF5 has placed in the file, before its bookkeeping on disk
    /// is touched. All chunks are written through, so what is missing is bookkeeping, whose places are fixed.
    fn reserve(&self) -> Result<(), RecordError> {
        let end = self.file.size();
        #[cfg(target_os = "linux")]
        if end > self.reserved {
            use rustix::{
                fs::{FallocateFlags, fallocate},
                io::Errno,
            };
            let flags = FallocateFlags::empty();
            match fallocate(&self.handle, flags, self.reserved, end - self.reserved) {
                // Some file systems cannot, and then a full disk is noticed by the flush itself.
                Ok(()) | Err(Errno::OPNOTSUPP | Errno::NOSYS | Errno::INTR) => {}
                Err(error) => return Err(RecordError::io(&self.path, WRITE, &error.into())),
            }
        }
        #[cfg(not(target_os = "linux"))]
        if end > self.handle.metadata().doing(&self.path, WRITE)?.len() {
            self.handle.set_len(end).doing(&self.path, WRITE)?;
        }
        Ok(())
    }

    /// Writes the end of the file's space into the superblock before anything that lies there is pointed to. HDF5
    /// itself does so at the end of a flush, and until then refuses to read what is beyond the end it knows.
    fn announce_end(&mut self) -> Result<(), RecordError> {
        let end = self.file.size();
        let mut start = [0; SUPERBLOCK.len()];
        self.handle.seek(SeekFrom::Start(0)).doing(&self.path, WRITE)?;
        // A file that has never been flushed has no superblock yet.
        if self.handle.read_exact(&mut start).is_ok() && start == SUPERBLOCK {
            self.handle.seek(SeekFrom::Start(END_ADDRESS)).doing(&self.path, WRITE)?;
            self.handle.write_all(&end.to_le_bytes()).doing(&self.path, WRITE)?;
        }
        Ok(())
    }

    /// Moves a flushed new file to its place.
    pub fn publish(&mut self) -> Result<(), RecordError> {
        let Some((begun, overwrite)) = &self.unpublished else { return Ok(()) };
        if *overwrite {
            fs::rename(begun, &self.path).doing(&self.path, CREATE)?;
        } else {
            // A link, unlike a rename, fails if another file has appeared meanwhile.
            match fs::hard_link(begun, &self.path) {
                Ok(()) => fs::remove_file(begun).doing(&self.path, CREATE)?,
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                    return Err(RecordError::Exists { path: self.path.clone() });
                }
                // File systems without hard links.
                Err(_) if !self.path.exists() => fs::rename(begun, &self.path).doing(&self.path, CREATE)?,
                Err(error) => return Err(RecordError::io(&self.path, CREATE, &error)),
            }
        }
        self.unpublished = None;
        Ok(())
    }

    /// Whether the file is at its place.
    pub fn is_published(&self) -> bool {
        self.unpublished.is_none()
    }

    /// Closes the flushed file. `durable`: only after the disk has it.
    pub fn close(mut self, durable: bool) -> Result<(), RecordError> {
        // SAFETY: `self.file` is not used again: `self` is consumed, and its drop does not touch the field.
        let file = unsafe { ManuallyDrop::take(&mut self.file) };
        file.close().doing(&self.path, WRITE)?;
        if durable { self.handle.sync_all().doing(&self.path, WRITE) } else { Ok(()) }
    }
}

impl Drop for WritableFile {
    fn drop(&mut self) {
        // Nobody will miss a file that never came to its place.
        if let Some((begun, _)) = &self.unpublished {
            let _ = fs::remove_file(begun);
        }
    }
}

/// What a file is opened for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    Write,
    /// A run in progress may be looked at.
    Read,
    /// The same within the process that writes it, where HDF5 wants equal locking.
    ReadOwn,
}

fn access(purpose: Purpose) -> hdf5::Result<hdf5::plist::FileAccess> {
    let mut builder = FileAccessBuilder::new();
    builder.file_locking(purpose != Purpose::Read);
    if purpose == Purpose::Write {
        builder
            .libver_bounds(LibraryVersion::Earliest, LibraryVersion::latest())
            // Bookkeeping in pages of the system: a process can be killed within a write, but not within a page.
            .alignment(PAGE / 2, PAGE)
            .meta_block_size(PAGE)
            // No chunk cache: each write is a whole chunk, or goes in place into an uncompressed one, and nothing
            // but bookkeeping is left to a flush.
            .chunk_cache(1, 0, 1.0)
            .mdc_config(&MetadataCacheConfig {
                evictions_enabled: false,
                // The library asks for these when evictions are off.
                incr_mode: hdf5::file::CacheIncreaseMode::Off,
                flash_incr_mode: hdf5::file::FlashIncreaseMode::Off,
                decr_mode: hdf5::file::CacheDecreaseMode::Off,
                ..MetadataCacheConfig::default()
            });
    }
    builder.finish()
}

/// Tells files that are missing, unreadable or something else than HDF5.
fn check_signature(path: &Path) -> Result<(), RecordError> {
    let mut file = fs::File::open(path).doing(path, OPEN)?;
    if !file.metadata().doing(path, OPEN)?.is_file() {
        return Err(RecordError::NotAFile { path: path.to_owned() });
    }
    let mut start = [0; SIGNATURE.len()];
    match file.read_exact(&mut start) {
        Ok(()) if start == SIGNATURE => Ok(()),
        Ok(()) => Err(RecordError::NotHdf5 { path: path.to_owned() }),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
            Err(RecordError::NotHdf5 { path: path.to_owned() })
        }
        Err(error) => Err(RecordError::io(path, OPEN, &error)),
    }
}

/// Whether a process has the file open for writing; `false` if there is no such file.
pub fn is_being_written(path: &Path) -> bool {
    // HDF5 holds a lock on files it writes; it ends with its process.
    fs::File::open(path).is_ok_and(|file| matches!(file.try_lock_shared(), Err(fs::TryLockError::WouldBlock)))
}

/// Opens a file and reads it by `read`. A file in the middle of being flushed by a running simulation can fail to be
/// read; it is tried again a few times.
pub(crate) fn read<T>(
    path: &Path,
    read: impl Fn(&hdf5::File) -> Result<T, RecordError>,
) -> Result<T, RecordError> {
    check_signature(path)?;
    let mut tries = 0;
    let mut purpose = Purpose::Read;
    loop {
        let result = access(purpose)
            .and_then(|plist| hdf5::File::with_options().set_fapl(&plist)?.open_as(path, OpenMode::Read))
            .doing(path, OPEN)
            .and_then(|file| read(&file));
        tries += 1;
        match result {
            Err(RecordError::Io { reason, .. })
                if purpose == Purpose::Read && reason.contains("file locking flag") =>
            {
                purpose = Purpose::ReadOwn;
            }
            Err(RecordError::Io { .. } | RecordError::Truncated { .. })
                if tries < 5 && is_being_written(path) =>
            {
                thread::sleep(Duration::from_millis(20));
            }
            result => return result,
        }
    }
}
