/*!
Output files of haff: [H5MD 1.1](https://h5md.nongnu.org/) in HDF5, with an event log and checkpoints.

This is the only crate that links HDF5. [`Recorder`] writes on its own thread, with back-pressure; [`info`]
and [`last_state`] read.

# Layout

| path | content |
|---|---|
| `h5md` | `version` = \[1, 1\], `author`, `creator` |
| `particles/all/{position,velocity,image}` | `value` \[F\]\[N\]\[3\], `step` \[F\], `time` \[F\]; one `step` and one `time` dataset, hard-linked |
| `particles/all/box` | attributes `dimension` = 3 and `boundary`; `edges` \[F\]\[3\] at the frames' steps and times |
| `particles/all/angular_velocity` | the same as `velocity`, with spin |
| `particles/all/present` | with inlets or outlets: `value` \[F\]\[N\], 1 if a particle is there, else 0: then its position and velocity are NaN |
| `particles/all/pistons/{position,velocity}` | with pistons: `value` \[F\]\[P\]\[3\], a point of each plane and its velocity |
| `particles/all/{id,species,mass,radius}` | \[N\]; with spin also `inertia` |
| `observables/…` | `value` \[S\] or \[S\]\[k\], `step` \[S\], `time` \[S\], the last two hard-linked |
| `profiles/…/{density,mass_density,velocity,temperature,pressure}` | `value` \[R\]\[bins…\]\[…\], `step` \[R\], `time` \[R\]; `position/value` \[bins\], of several axes \[bins…\]\[axes\] |
| `correlations/{msd,vacf,stress,helfand}` | `lag`, `value`, `error`, `count` \[L\], replaced with every checkpoint |
| `events/…` | one column per dataset, \[E\] or \[E\]\[3\]: `time`, and those selected by the scene; `kind` is an HDF5 enum |
| `parameters/…` | `scene` (TOML), `title`, `seed`, `version`, `git_revision`, `schema`, `trajectory_version`, `dimension`, `box_origin`, `conserved_momentum`, `species_names`, `wall_names`, with pistons `pistons` \[P\], their indices among the walls; after the run `summary` (JSON) |
| `checkpoint/{0,1}` | two slots, written alternately |
| `checkpoint/flushes` | \[5\]: a counter at a fixed address, for readers of a file that is being written |

Units are expressions in the user's own: attributes `unit`. Disks are written with D = 3 and z = 0.

# Killed processes

HDF5 keeps a file's metadata (extents, chunk indices) in memory and rewrites them in place. A process that is
killed leaves whatever had been written by then. Four rules ensure that such a file opens and is correct up to
its last flush:

1. Library version bounds are `earliest`: newer superblocks contain a flag that forbids opening a file that
   was not closed.
2. Evictions from the metadata cache are off, so that metadata are written during a flush and at no other
   time. Data are written to addresses that the metadata on disk do not refer to yet.
3. A compressed chunk is written once, as a whole: rewriting one moves it, and the index on disk would point
   to its old address. It is compressed here (`pack`), by libdeflate and outside the library's lock, into the
   format of HDF5's own shuffle and deflate filters. Data that grow row by row (observables, trajectories of
   few particles) are not compressed and are extended in place.
4. A flush has two phases: first all `value`s, then, when they are in the file, `step` and `time`. **A row
   exists when its `time` does**; in a file killed between the phases, `value` is longer than `time`. Readers
   use the shorter length (`MDAnalysis` does: it stops at the last `step`), and [`Recorder::append`] truncates
   all to it. A kill during the second phase can leave an extent beyond its index, once per chunk: such rows
   have the time NaN, and do not count.

Before each flush the file's space is reserved on disk, so that a full disk is detected while the file is
still consistent, not while its index is being rewritten; after an error nothing more is written, not even on
exit. And the end of that space is written into the superblock before the flush: HDF5 does so last, and in a
file killed before that, it would refuse to follow an index that points beyond the end in the superblock.

Measured: 1800 writers that took 40 checkpoints a second were killed at random instants; all files opened,
contained every frame up to the last flush and were resumed (`tests/killed.rs`; `HAFF_RECORD_KILLS` sets the
number). One case remains: a kill while a flush rewrites an index that has just outgrown a node, every 64
chunks. Of more than 1000 writers that flushed without a pause through such splits, two left a trajectory with
a broken index. At one flush a second that is less than one kill in a hundred thousand.

# Readers of a running simulation

A flush rewrites the index of the file. What is read meanwhile is read again, and readers that would not come
to an end are waited for (`handshake.rs`). [`info`] and the other functions here read all they need at once;
Python reads the whole index at once and keeps it, so that it reads only rows later, which do not change.
Correlations, which are replaced in place, are written during a flush.

# Files that cannot be continued

[`Recorder::append`] first checks, in a file opened for reading, that every dataset is stored as it was
created and that no two share space (`growth.rs`). What HDF5 then changes before the first flush, while rows
are dropped, is put back if that fails.

The kernel keeps what a killed process has written. Against power loss the file is as safe as the page cache:
only [`Recorder::finish`] calls `fsync`.

# Events that do not fill a chunk

Event rows are collected until a chunk of [`EVENT_CHUNK`] rows is complete. Rows that are still in memory when
a checkpoint is taken are stored, uncompressed, in the checkpoint's slot, so that a resumed run loses none;
[`Recorder::finish`], and dropping the recorder, write them as the last, partial chunk. An event row, too,
exists when its `time` does.
*/

// The synthetic run of the tests in `tests/`, also for those here.
#[cfg(test)]
extern crate self as haff_record;
#[cfg(test)]
#[path = "../tests/suite/common/mod.rs"]
mod common;

mod checkpoint;
mod clock;
mod datasets;
mod declared;
mod entered;
mod error;
mod event_log;
mod events;
mod file;
mod growth;
mod handshake;
mod header;
mod heap;
mod info;
mod measured;
mod meshes;
mod pack;
mod queue;
mod recorder;
mod resume;
mod series;
mod size;
mod state;
mod writer;

pub use entered::Entered;
pub use error::RecordError;
pub use event_log::EventLog;
pub use events::EVENT_CHUNK;
pub use handshake::is_being_written;
pub use header::{Header, SCHEMA};
pub use info::{Info, NamedMean, info, means};
pub use meshes::{StoredMesh, mesh};
pub use recorder::Recorder;
pub use resume::{Resumed, resumable};
pub use size::{FileSize, estimate_file_size};
pub use state::{State, last_state, state};
