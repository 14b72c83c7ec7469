//! The queue to the writer thread: bounded in bytes, so that a slow disk slows the simulation instead of
//! filling the memory, and the error of the writer until it is returned.

use std::{
    path::Path,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
};

use haff_engine::{Checkpoint, Correlation, EventRecord, Frame, ProfileRow, Sample};

use crate::{entered::Entered, error::RecordError};

/// Largest number of bytes in the queue; a single message may be larger.
pub(crate) const LIMIT: usize = 64 << 20;
/// Largest number of messages in the queue.
const MESSAGES: usize = 4096;
/// Bytes of a particle in a frame, and in a checkpoint.
pub(crate) const FRAME_BYTES: usize = 24 + 24 + 12;
pub(crate) const CHECKPOINT_BYTES: usize = 24 + 24 + 12 + 8 + 4 + 4;
/// Largest number of free buffers for event rows.
const MAX_FREE_BUFFERS: usize = 4;

/// A task of the writer.
#[derive(Debug)]
pub(crate) enum Message {
    Frame(Frame),
    Sample(Box<Sample>),
    Events(Vec<EventRecord>),
    Profile(ProfileRow),
    Correlations(Vec<Correlation>),
    Checkpoint(Box<Checkpoint>),
    /// Particles that take places kept for them.
    Entered(Vec<Entered>),
    /// Write everything so far to the file, and reply.
    Flush(SyncSender<()>),
    Finish {
        summary: String,
        complete: bool,
    },
}

impl Message {
    /// Approximate size of the message [bytes].
    fn bytes(&self) -> usize {
        match self {
            Self::Frame(frame) => frame.position.len() * FRAME_BYTES,
            Self::Sample(sample) => {
                size_of::<Sample>() + 8 * (sample.species_temperature.len() + 4 * sample.wall_force.len())
            }
            Self::Events(events) => size_of_val(events.as_slice()),
            Self::Profile(row) => 8 * (4 * row.density.len() + 3 * row.velocity.len() + row.pressure.len()),
            Self::Correlations(correlations) => 32 * correlations.iter().map(|c| c.lag.len()).sum::<usize>(),
            Self::Checkpoint(state) => {
                state.position.len() * CHECKPOINT_BYTES
                    + 64 * state.scalars.len()
                    + size_of_val(state.measured.as_slice())
            }
            Self::Entered(particles) => size_of_val(particles.as_slice()),
            Self::Flush(_) => 0,
            Self::Finish { summary, .. } => summary.len(),
        }
    }
}

#[derive(Debug, Default)]
struct State {
    bytes: usize,
    closed: bool,
    error: Option<RecordError>,
    /// Free buffers for event rows: new ones would cost the simulation a page fault every 40 rows.
    free_buffers: Vec<Vec<EventRecord>>,
}

/// State shared by both ends.
#[derive(Debug, Default)]
pub(crate) struct Shared {
    state: Mutex<State>,
    space: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The writer's error, if there was one.
    pub fn error(&self) -> Option<RecordError> {
        self.lock().error.clone()
    }

    /// An empty buffer for event rows.
    pub fn buffer(&self) -> Vec<EventRecord> {
        self.lock().free_buffers.pop().unwrap_or_default()
    }

    /// Returns a buffer of event rows that have been written.
    pub fn recycle(&self, mut events: Vec<EventRecord>) {
        events.clear();
        let mut state = self.lock();
        if state.free_buffers.len() < MAX_FREE_BUFFERS {
            state.free_buffers.push(events);
        }
    }

    /// Stores the writer's first error.
    pub fn fail(&self, error: RecordError) {
        self.lock().error.get_or_insert(error);
    }
}

/// The end of the queue for the simulation.
#[derive(Debug)]
pub(crate) struct Producer {
    sender: SyncSender<(Message, usize)>,
    shared: Arc<Shared>,
}

impl Producer {
    /// Sends a message; waits while the queue is full. Returns the writer's error, if there was one in any
    /// earlier message.
    pub fn send(&self, message: Message, path: &Path) -> Result<(), RecordError> {
        let bytes = message.bytes();
        let mut state = self.wait_for_space(bytes)?;
        if state.closed {
            // The receiver may not have been dropped yet; the message would be lost.
            drop(state);
            return Err(self.ended(path));
        }
        state.bytes += bytes;
        drop(state);
        self.sender.send((message, bytes)).map_err(|_| self.ended(path))
    }

    /// An empty buffer for event rows, reused if possible.
    pub fn buffer(&self) -> Vec<EventRecord> {
        self.shared.buffer()
    }

    /// Waits until the queue has space for a message of this many bytes. Returns the writer's error, if there
    /// was one in any earlier message.
    pub fn wait(&self, bytes: usize) -> Result<(), RecordError> {
        self.wait_for_space(bytes).map(drop)
    }

    fn wait_for_space(&self, bytes: usize) -> Result<MutexGuard<'_, State>, RecordError> {
        let mut state = self.shared.lock();
        while state.bytes > 0 && state.bytes + bytes > LIMIT && !state.closed {
            state = self.shared.space.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.error.clone().map_or(Ok(state), Err)
    }

    /// Drops this end, so that the writer ends; returns the shared state.
    pub fn close(self) -> Arc<Shared> {
        self.shared
    }

    /// The error to return when the writer has ended.
    pub fn ended(&self, path: &Path) -> RecordError {
        self.shared.error().unwrap_or_else(|| RecordError::Io {
            path: path.to_owned(),
            action: "write",
            reason: "the writer has ended".to_owned(),
        })
    }
}

/// The end of the queue for the writer; dropping it wakes all waiting threads.
#[derive(Debug)]
pub(crate) struct Consumer {
    pub receiver: Receiver<(Message, usize)>,
    pub shared: Arc<Shared>,
}

impl Consumer {
    /// Frees the space of a message that has been processed.
    pub fn done(&self, bytes: usize) {
        self.shared.lock().bytes -= bytes;
        self.shared.space.notify_one();
    }
}

impl Drop for Consumer {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.space.notify_all();
    }
}

/// A new queue.
pub(crate) fn queue() -> (Producer, Consumer) {
    let (sender, receiver) = sync_channel(MESSAGES);
    let shared = Arc::new(Shared::default());
    (Producer { sender, shared: shared.clone() }, Consumer { receiver, shared })
}

#[cfg(test)]
mod tests {
    use std::{thread, time::Duration};

    use super::*;

    fn batch(bytes: usize) -> Message {
        let event = EventRecord {
            time: 0.0,
            kind: haff_engine::EventKind::Wall,
            i: 0,
            j: 0,
            approach_speed: 0.0,
            impulse: 0.0,
            energy_loss: 0.0,
            carnot_energy: 0.0,
            normal: glam::DVec3::ZERO,
            position: glam::DVec3::ZERO,
            impulse_vector: glam::DVec3::ZERO,
            tangential_loss: 0.0,
        };
        Message::Events(vec![event; bytes / size_of::<EventRecord>()])
    }

    #[test]
    fn a_slow_writer_blocks_the_sender() {
        let (producer, consumer) = queue();
        let writer = thread::spawn(move || {
            let mut most = 0;
            let mut count = 0;
            while let Ok((_, bytes)) = consumer.receiver.recv() {
                // The sender fills the queue before it waits.
                while count == 0 && consumer.shared.lock().bytes <= LIMIT / 2 {
                    thread::yield_now();
                }
                most = most.max(consumer.shared.lock().bytes);
                count += 1;
                consumer.done(bytes);
            }
            (most, count)
        });
        for _ in 0..40 {
            producer.send(batch(LIMIT / 8), Path::new("x")).expect("the writer runs");
        }
        drop(producer);
        let (most, count) = writer.join().expect("the writer ends");
        assert_eq!(count, 40);
        assert!(most <= LIMIT, "{most} bytes waited; the limit is {LIMIT}");
        assert!(most > LIMIT / 2, "{most} bytes waited: the queue was never full, the test is inconclusive");
    }

    #[test]
    fn a_message_above_the_limit_is_sent_alone() {
        let (producer, consumer) = queue();
        let writer = thread::spawn(move || {
            let mut sizes = Vec::new();
            while let Ok((_, bytes)) = consumer.receiver.recv() {
                sizes.push(bytes);
                consumer.done(bytes);
            }
            sizes
        });
        for size in [LIMIT * 2, 1000, LIMIT * 2] {
            producer.send(batch(size), Path::new("x")).expect("the writer runs");
        }
        drop(producer);
        assert_eq!(writer.join().expect("the writer ends").len(), 3);
    }

    #[test]
    fn senders_do_not_wait_for_a_writer_that_has_ended() {
        let (producer, consumer) = queue();
        producer.send(batch(LIMIT), Path::new("x")).expect("room for one");
        let killer = thread::spawn(move || {
            thread::sleep(Duration::from_millis(50));
            drop(consumer);
        });
        let error = producer.send(batch(LIMIT), Path::new("x")).expect_err("the writer has ended");
        assert!(matches!(error, RecordError::Io { .. }), "{error}");
        killer.join().expect("the thread ends");
    }
}
