//! Opening, creating and flushing files so that they stay readable if the process is killed or the disk is
//! full.

use std::{
    ffi::OsString,
    fs,
    io::{self, ErrorKind, Read, Seek, SeekFrom, Write},
    mem::ManuallyDrop,
    path::{Path, PathBuf},
    thread,
    time::Duration,
};

use hdf5::file::{FileAccessBuilder, LibraryVersion, MetadataCacheConfig, OpenMode};

use crate::{
    error::{Context, OPEN, RecordError},
    handshake::{self, Flushes, is_at, is_being_written},
};

/// First bytes of every HDF5 file without a user block.
const SIGNATURE: [u8; 8] = *b"\x89HDF\r\n\x1a\n";
/// Start of a superblock of version 0 with addresses of 8 bytes, as written with library version bounds
/// `earliest`.
const SUPERBLOCK: [u8; 14] = *b"\x89HDF\r\n\x1a\n\0\0\0\0\0\x08";
/// Its size with the entry of the root group [bytes].
const SUPERBLOCK_SIZE: usize = 96;
/// Position of the end-of-file address (little-endian) in such a superblock.
const END_ADDRESS: u64 = 40;
/// A page of memory [bytes], which the kernel writes as a whole. An index node has 2 to 3 KiB.
const PAGE: u64 = 4096;
const WRITE: &str = "write";
const CREATE: &str = "create the file";

/// An HDF5 file open for writing.
///
/// It is never closed by dropping: a close writes all data that the library still holds, which after an error
/// (a full disk) would damage the file on disk. [`WritableFile::close`] closes, after a flush.
#[derive(Debug)]
pub(crate) struct WritableFile {
    file: ManuallyDrop<hdf5::File>,
    /// The same file as opened by the system.
    handle: fs::File,
    /// Path of the file after the first flush.
    path: PathBuf,
    /// Path of the file until then, and whether it may replace a file.
    unpublished: Option<(PathBuf, bool)>,
    /// Bytes of the file for which disk space is reserved.
    reserved: u64,
    flushes: Flushes,
    /// Parts of the file as they were before it was opened for writing: places and bytes.
    undo: Vec<(u64, Vec<u8>)>,
}

impl WritableFile {
    /// Creates a file under a temporary name, beside `path`. The first flush moves it to `path`, so that a
    /// file to be replaced stays until the new one can be read and resumed.
    pub fn create(path: &Path, overwrite: bool) -> Result<Self, RecordError> {
        // A symbolic link stays a link: its target is replaced.
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
        let part = path.with_file_name(name);
        // The system's own error is clearer than HDF5's.
        let handle = fs::File::options().read(true).write(true).create(true).truncate(true).open(&part);
        let handle = handle.doing(&path, CREATE)?;
        let file = hdf5::File::with_options()
            .set_fapl(&access(Purpose::Write).doing(&path, CREATE)?)
            .and_then(|builder| {
                // The bytes of a file must not depend on the time of its creation.
                builder.with_fcpl(|plist| plist.obj_track_times(false)).create(&part)
            })
            .and_then(|file| handshake::create(&file).map(|()| file));
        match file {
            Ok(file) => Ok(Self {
                file: ManuallyDrop::new(file),
                handle,
                path,
                unpublished: Some((part, overwrite)),
                reserved: 0,
                flushes: Flushes::new(),
                undo: Vec::new(),
            }),
            Err(error) => {
                let _ = fs::remove_file(&part);
                Err(RecordError::hdf5(&path, CREATE, &error))
            }
        }
    }

    /// Opens a file to continue it.
    pub fn append(path: &Path) -> Result<Self, RecordError> {
        check_signature(path)?;
        let handle = fs::File::options().read(true).write(true).open(path).doing(path, OPEN)?;
        // HDF5 marks the file as open for writing.
        let undo = [(0, SUPERBLOCK_SIZE), (handshake::ADDRESS, handshake::SIZE)];
        let undo = parts(&handle, &undo).doing(path, OPEN)?;
        let file = open_to_write(path)?;
        let flushes = Flushes::of(&handle).doing(path, OPEN)?;
        let (reserved, path) = (file.size(), path.to_owned());
        Ok(Self { file: ManuallyDrop::new(file), handle, path, unpublished: None, reserved, flushes, undo })
    }

    /// The root group.
    pub fn root(&self) -> &hdf5::Group {
        &self.file
    }

    /// The path that the file has or will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes all data that HDF5 holds in memory, while no process reads the file.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.begin_change()?;
        self.write_out()?;
        self.end_change()
    }

    /// Whether a change need not wait for readers.
    pub fn is_free(&mut self) -> bool {
        self.flushes.is_free(&self.handle)
    }

    /// Keeps readers away until [`WritableFile::end_change`]: they find all of a change, or nothing.
    pub fn begin_change(&mut self) -> Result<(), RecordError> {
        self.flushes.begin(&self.handle).doing(&self.path, WRITE)
    }

    /// Lets readers begin.
    pub fn end_change(&mut self) -> Result<(), RecordError> {
        self.flushes.end(&self.handle).doing(&self.path, WRITE)?;
        self.check_path()
    }

    /// The part of a flush during a change.
    pub fn write_out(&mut self) -> Result<(), RecordError> {
        if let Err(error) = self.reserve() {
            // The metadata on disk are as they were.
            self.end_change()?;
            return Err(error);
        }
        self.write_end_address()?;
        self.file.flush().doing(&self.path, WRITE)?;
        self.reserved = self.file.size();
        // HDF5 may have freed space at the end, without shortening the file, which had been extended for it.
        if self.handle.metadata().doing(&self.path, WRITE)?.len() > self.reserved {
            self.handle.set_len(self.reserved).doing(&self.path, WRITE)?;
        }
        Ok(())
    }

    /// Fails if the file has been removed or replaced by another process: the system would continue to write
    /// a file that cannot be opened.
    fn check_path(&self) -> Result<(), RecordError> {
        if self.is_published() && !is_at(&self.handle, &self.path).doing(&self.path, WRITE)? {
            return Err(RecordError::Vanished { path: self.path.clone() });
        }
        Ok(())
    }

    /// Reserves disk space for everything that HDF5 has allocated in the file, before its metadata on disk
    /// are changed. All chunks are written through, so only metadata are missing, whose addresses are fixed.
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
                // Some file systems do not support this; a full disk is then detected by the flush itself.
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

    /// Writes the end of the file's space into the superblock before any pointer to data there is written.
    /// HDF5 itself does so at the end of a flush, and until then refuses to read beyond the end in the
    /// superblock.
    fn write_end_address(&mut self) -> Result<(), RecordError> {
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

    /// Moves a flushed new file to its path.
    pub fn publish(&mut self) -> Result<(), RecordError> {
        let Some((part, overwrite)) = &self.unpublished else { return Ok(()) };
        if *overwrite {
            fs::rename(part, &self.path).doing(&self.path, CREATE)?;
        } else {
            // A link, unlike a rename, fails if another file has been created in the meantime.
            match fs::hard_link(part, &self.path) {
                Ok(()) => fs::remove_file(part).doing(&self.path, CREATE)?,
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                    return Err(RecordError::Exists { path: self.path.clone() });
                }
                // File systems without hard links.
                Err(_) if !self.path.exists() => fs::rename(part, &self.path).doing(&self.path, CREATE)?,
                Err(error) => return Err(RecordError::io(&self.path, CREATE, &error)),
            }
        }
        self.unpublished = None;
        Ok(())
    }

    /// Whether the file is at its path.
    pub fn is_published(&self) -> bool {
        self.unpublished.is_none()
    }

    /// Keeps parts of the file, as places and sizes, for [`WritableFile::abandon`].
    pub fn remember(&mut self, places: &[(u64, usize)]) -> Result<(), RecordError> {
        self.undo.extend(parts(&self.handle, places).doing(&self.path, WRITE)?);
        Ok(())
    }

    /// Gives up a file that was opened to continue it, and of which nothing has been flushed.
    pub fn abandon(self) -> Result<(), RecordError> {
        // It is not closed, which would write what HDF5 has changed in memory.
        self.undo.iter().try_for_each(|(start, bytes)| {
            let mut handle = &self.handle;
            handle
                .seek(SeekFrom::Start(*start))
                .and_then(|_| handle.write_all(bytes))
                .doing(&self.path, WRITE)
        })
    }

    /// Closes the flushed file. `durable`: only after it is stored on the disk.
    pub fn close(mut self, durable: bool) -> Result<(), RecordError> {
        // HDF5 gives unused space at the end back.
        self.begin_change()?;
        // SAFETY: `self.file` is not used again: `self` is consumed, and its drop does not touch the field.
        let file = unsafe { ManuallyDrop::take(&mut self.file) };
        file.close().doing(&self.path, WRITE)?;
        self.flushes.close(&self.handle).doing(&self.path, WRITE)?;
        if durable { self.handle.sync_all().doing(&self.path, WRITE) } else { Ok(()) }
    }
}

impl Drop for WritableFile {
    fn drop(&mut self) {
        // A file that was never published is removed.
        if let Some((part, _)) = &self.unpublished {
            let _ = fs::remove_file(part);
        }
    }
}

/// Purpose of opening a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    Write,
    /// A run in progress may be read.
    Read,
    /// The same within the process that writes it, where HDF5 requires equal locking.
    ReadOwn,
}

fn access(purpose: Purpose) -> hdf5::Result<hdf5::plist::FileAccess> {
    let mut builder = FileAccessBuilder::new();
    builder.file_locking(purpose != Purpose::Read);
    if purpose == Purpose::Write {
        builder
            .libver_bounds(LibraryVersion::Earliest, LibraryVersion::latest())
            // Metadata in pages of the system: a process can be killed during a write, but not during the
            // write of a page.
            .alignment(PAGE / 2, PAGE)
            .meta_block_size(PAGE)
            // No chunk cache: each write is a whole chunk, or goes in place into an uncompressed one, and a
            // flush only writes metadata.
            .chunk_cache(1, 0, 1.0)
            .mdc_config(&MetadataCacheConfig {
                evictions_enabled: false,
                // The library requires these when evictions are off.
                incr_mode: hdf5::file::CacheIncreaseMode::Off,
                flash_incr_mode: hdf5::file::FlashIncreaseMode::Off,
                decr_mode: hdf5::file::CacheDecreaseMode::Off,
                ..MetadataCacheConfig::default()
            });
    }
    builder.finish()
}

/// Fails for files that are missing, unreadable or not HDF5.
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

/// Parts of a file: places and bytes.
fn parts(mut file: &fs::File, places: &[(u64, usize)]) -> io::Result<Vec<(u64, Vec<u8>)>> {
    let read = |&(start, size): &(u64, usize)| {
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(start))?;
        file.take(size as u64).read_to_end(&mut bytes)?;
        Ok((start, bytes))
    };
    places.iter().map(read).collect()
}

/// Opens a file for writing. A process that tests whether it is being written has a lock on it for an
/// instant, so a second attempt may succeed.
fn open_to_write(path: &Path) -> Result<hdf5::File, RecordError> {
    let mut attempts = 1;
    loop {
        let file = access(Purpose::Write)
            .and_then(|plist| hdf5::File::with_options().set_fapl(&plist)?.open_as(path, OpenMode::ReadWrite))
            .doing(path, OPEN);
        match file {
            Err(RecordError::InUse { .. }) if attempts < 10 => thread::sleep(Duration::from_millis(5)),
            result => return result,
        }
        attempts += 1;
    }
}

/// Opens a file and reads it by `read`: one state of it, also while a simulation is writing it.
pub(crate) fn read<T>(
    path: &Path,
    read: impl Fn(&hdf5::File) -> Result<T, RecordError>,
) -> Result<T, RecordError> {
    check_signature(path)?;
    let open = |purpose| {
        access(purpose)
            .and_then(|plist| hdf5::File::with_options().set_fapl(&plist)?.open_as(path, OpenMode::Read))
            .doing(path, OPEN)
    };
    handshake::read_one_state(path, || {
        let file = match open(Purpose::Read) {
            Err(RecordError::Io { reason, .. }) if reason.contains("file locking flag") => {
                open(Purpose::ReadOwn)
            }
            result => result,
        };
        read(&file?)
    })
}
