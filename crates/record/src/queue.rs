//! The queue to the writer thread: bounded in bytes, so that a slow disk slows the simulation instead of filling the
//! memory, and the place where the writer's error waits to be told.

use std::{
    path::Path,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
};

use haff_engine::{Checkpoint, EventRecord, Frame, Sample};

use crate::error::RecordError;

/// Most bytes in the queue; one message may be larger than that if it is alone.
pub(crate) const LIMIT: usize = 64 << 20;
/// Most messages in the queue.
const MESSAGES: usize = 4096;
/// Bytes of a particle in a frame, and in a checkpoint.
pub(crate) const FRAME_BYTES: usize = 24 + 24 + 12;
pub(crate) const CHECKPOINT_BYTES: usize = 24 + 24 + 12 + 8 + 4 + 4;
/// Most buffers of event rows kept to be filled again.
const SPARE: usize = 4;

/// What the writer is asked to do.
#[derive(Debug)]
pub(crate) enum Message {
    Frame(Frame),
    Sample(Sample),
    Events(Vec<EventRecord>),
    Checkpoint(Box<Checkpoint>),
    /// Bring everything so far to the file, and answer.
    Flush(SyncSender<()>),
    Finish {
        summary: String,
        complete: bool,
    },
}

impl Message {
    /// Bytes that the message holds, nearly.
    fn bytes(&self) -> usize {
        match self {
            Self::Frame(frame) => frame.position.len() * FRAME_BYTES,
            Self::Sample(sample) => size_of::<Sample>() + 8 * sample.species_temperature.len(),
            Self::Events(events) => size_of_val(events.as_slice()),
            Self::Checkpoint(state) => state.position.len() * CHECKPOINT_BYTES + 64 * state.scalars.len(),
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
    /// Buffers of event rows to be filled again: fresh ones would cost the simulation a page fault every 40 rows.
    spare: Vec<Vec<EventRecord>>,
}

/// What both ends share.
#[derive(Debug, Default)]
pub(crate) struct Shared {
    state: Mutex<State>,
    room: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The writer's error, if it had one.
    pub fn error(&self) -> Option<RecordError> {
        self.lock().error.clone()
    }

    /// An empty buffer for event rows.
    pub fn spare(&self) -> Vec<EventRecord> {
        self.lock().spare.pop().unwrap_or_default()
    }

    /// Takes back a buffer of event rows that are written.
    pub fn recycle(&self, mut events: Vec<EventRecord>) {
        events.clear();
        let mut state = self.lock();
        if state.spare.len() < SPARE {
            state.spare.push(events);
        }
    }

    /// Notes the writer's first error.
    pub fn fail(&self, error: RecordError) {
        self.lock().error.get_or_insert(error);
    }
}

/// The end of the queue that the simulation holds.
#[derive(Debug)]
pub(crate) struct Producer {
    sender: SyncSender<(Message, usize)>,
    shared: Arc<Shared>,
}

impl Producer {
    /// Hands over a message, and waits while the queue is full. Tells an error of the writer, of any message before.
    pub fn send(&self, message: Message, path: &Path) -> Result<(), RecordError> {
        let bytes = message.bytes();
        self.room(bytes)?.bytes += bytes;
        self.sender.send((message, bytes)).map_err(|_| self.ended(path))
    }

    /// An empty buffer for event rows, one that the writer has dealt with if there is one.
    pub fn spare(&self) -> Vec<EventRecord> {
        self.shared.spare()
    }

    /// Waits until a message of so many bytes has room. Tells an error of the writer, of any message before.
    pub fn wait(&self, bytes: usize) -> Result<(), RecordError> {
        self.room(bytes).map(drop)
    }

    fn room(&self, bytes: usize) -> Result<MutexGuard<'_, State>, RecordError> {
        let mut state = self.shared.lock();
        while state.bytes > 0 && state.bytes + bytes > LIMIT && !state.closed {
            state = self.shared.room.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.error.clone().map_or(Ok(state), Err)
    }

    /// Drops this end, which lets the writer end; what both share stays.
    pub fn close(self) -> Arc<Shared> {
        self.shared
    }

    /// The error to tell when the writer is gone.
    pub fn ended(&self, path: &Path) -> RecordError {
        self.shared.error().unwrap_or_else(|| RecordError::Io {
            path: path.to_owned(),
            action: "write",
            reason: "the writer has ended".to_owned(),
        })
    }
}

/// The end of the queue that the writer holds; dropping it lets nobody wait any longer.
#[derive(Debug)]
pub(crate) struct Consumer {
    pub receiver: Receiver<(Message, usize)>,
    pub shared: Arc<Shared>,
}

impl Consumer {
    /// Makes room: a message of so many bytes is dealt with.
    pub fn done(&self, bytes: usize) {
        self.shared.lock().bytes -= bytes;
        self.shared.room.notify_one();
    }
}

impl Drop for Consumer {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.room.notify_all();
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
        };
        Message::Events(vec![event; bytes / size_of::<EventRecord>()])
    }

    #[test]
    fn a_slow_writer_holds_back_whoever_hands_over() {
        let (producer, consumer) = queue();
        let writer = thread::spawn(move || {
            let mut most = 0;
            let mut count = 0;
            while let Ok((_, bytes)) = consumer.receiver.recv() {
                thread::sleep(Duration::from_millis(5));
                most = most.max(consumer.shared.lock().bytes);
                count += 1;
                consumer.done(bytes);
            }
            (most, count)
        });
        for _ in 0..40 {
            producer.send(batch(LIMIT / 8), Path::new("x")).expect("the writer lives");
        }
        drop(producer);
        let (most, count) = writer.join().expect("the writer ends");
        assert_eq!(count, 40);
        assert!(most <= LIMIT, "{most} bytes waited; the limit is {LIMIT}");
        assert!(most > LIMIT / 2, "{most} bytes waited: the queue was never full, so this showed nothing");
    }

    #[test]
    fn a_message_above_the_limit_passes_alone() {
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
            producer.send(batch(size), Path::new("x")).expect("the writer lives");
        }
        drop(producer);
        assert_eq!(writer.join().expect("the writer ends").len(), 3);
    }

    #[test]
    fn nobody_waits_for_a_writer_that_is_gone() {
        let (producer, consumer) = queue();
        producer.send(batch(LIMIT), Path::new("x")).expect("room for one");
        let killer = thread::spawn(move || {
            thread::sleep(Duration::from_millis(50));
            drop(consumer);
        });
        let error = producer.send(batch(LIMIT), Path::new("x")).expect_err("nobody writes");
        assert!(matches!(error, RecordError::Io { .. }), "{error}");
        killer.join().expect("the thread ends");
    }
}
