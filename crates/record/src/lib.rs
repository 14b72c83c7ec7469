/*! Output files of haff: [H5MD 1.1](https://h5md.nongnu.org/) in HDF5, with an event log and checkpoints.

This is the only crate that links HDF5. [`Recorder`] writes, off the hot path and with back-pressure; [`info`] and
[`last_state`] read.

# Layout

| path | content |
|---|---|
| `h5md` | `version` = \[1, 1\], `author`, `creator` |
| `particles/all/{position,velocity,image}` | `value` \[F\]\[N\]\[3\], `step` \[F\], `time` \[F\]; one `step` and one `time` dataset, hard-linked |
| `particles/all/box` | attributes `dimension` = 3 and `boundary`; `edges` \[F\]\[3\] at the frames' steps and times |
| `particles/all/{id,species,mass,radius}` | \[N\] |
| `observables/…` | `value` \[S\] or \[S\]\[k\], `step` \[S\], `time` \[S\], the last two hard-linked |
| `events/…` | one column per dataset, \[E\] or \[E\]\[3\]: `time`, and those the scene asks for; `kind` is an HDF5 enum |
| `parameters/…` | `scene` (TOML), `title`, `seed`, `version`, `git_revision`, `schema`, `trajectory_version`, `dimension`, `box_origin`, `species_names`, `wall_names`; after the run `summary` (JSON) |
| `checkpoint/{0,1}` | two slots, written in turn |

Nothing carries a `unit`: all units are the user's own. Disks are written with D = 3 and z = 0.

# Surviving a kill

HDF5 keeps a file's bookkeeping (extents, chunk indices) in memory and rewrites it in place. A process that is killed
leaves whatever had been written by then. Four rules make that a file which opens and is right up to its last flush:

1. Library version bounds are `earliest`: newer superblocks carry a flag that forbids opening a file that was not closed.
2. Evictions from the metadata cache are off, so that bookkeeping reaches the file during a flush and at no other
   time. Data go to places that the bookkeeping on disk does not know yet.
3. A compressed chunk is written once, whole: rewriting one moves it, and the index on disk points to where it was. It is
   compressed here (`pack`), by libdeflate and outside the library's lock, to what HDF5's own shuffle and deflate undo.
   What grows row by row (observables, trajectories of few particles) is not compressed and is extended in place.
4. A flush has two phases: first all `value`s, then, when they are in the file, `step` and `time`. **A row exists when
   its `time` does**; a file killed between the phases has a `value` longer than its `time`. Readers take the shorter
   length (`MDAnalysis` does: it stops at the last `step`), and [`Recorder::append`] cuts all to it. A kill within
   the second phase can leave an extent that is ahead of its index, once per chunk: such rows have the time NaN, and
   do not count.

Before each flush the file's space is reserved on disk, so that a full disk is noticed while the file is still whole,
not in the middle of rewriting its index; after an error nothing more is written, not even on exit. And the end of
that space is put into the superblock before the flush: HDF5 does it last, and would refuse, in a file killed before,
to follow an index that points beyond the end it knows.

Measured: of 1800 writers that took 40 checkpoints a second, killed at random instants, all left files that opened,
held every frame up to the last flush and were resumed (`tests/killed.rs`; `HAFF_RECORD_KILLS` sets the number). What
remains is the instant in which a flush rewrites an index that has just outgrown a node, every 64 chunks: of more than
1000 writers that flushed without a pause through such splits, two left a trajectory with a broken index. At one flush a
second that is less than one kill in a hundred thousand.

The kernel keeps what a killed process has written. Against power loss the file is as safe as the page cache: nothing
here calls `fsync` but [`Recorder::finish`].

# Events that do not fill a chunk

Event rows are collected until a chunk of [`EVENT_CHUNK`] rows is complete. Rows in waiting when a checkpoint is
taken are kept, uncompressed, in the checkpoint's slot, so that a resumed run loses none; [`Recorder::finish`], and
dropping the recorder, write them as the last, partial chunk. An event row, too, exists when its `time` does.
*/

mod checkpoint;
mod declared;
mod error;
mod events;
mod file;
mod header;
mod heap;
mod info;
mod pack;
mod queue;
mod recorder;
mod resume;
mod series;
mod size;
mod skeleton;
mod writer;

pub use error::RecordError;
pub use events::EVENT_CHUNK;
pub use file::is_being_written;
pub use header::{Header, SCHEMA};
pub use info::{Info, State, info, last_state};
pub use recorder::Recorder;
pub use resume::{Resumed, resumable};
pub use size::{FileSize, estimate_file_size};
