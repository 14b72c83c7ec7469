//! The calendars and blocks of the steps of a run with lists.

use haff_calendar::{Calendar, Ladder};

use crate::{
    model::features::Features,
    search::{
        blocks::{Metric, Round, Settings, WorkingSpace},
        lists::block::{ListBlock, Places},
        queue::Queue,
        search_event::SearchEvent,
    },
};

use super::Entry;

/// The steps of a run with lists.
pub(super) struct Steps<F> {
    pub settings: Settings,
    /// Entries after [`ListSearch::horizon`], besides those in the queue, for each block; and those that
    /// have not been added yet.
    pub calendars: Vec<Ladder<Entry>>,
    pub incoming: Vec<Vec<Entry>>,
    /// The entries of the present step, in all and of each calendar.
    pub known: Vec<Entry>,
    pub collected: Vec<Vec<Entry>>,
    pub working_space: WorkingSpace<Entry>,
    /// The span for which space has been cut.
    pub span: Option<i64>,
    pub metric: Metric,
    pub places: Places,
    pub rounds: Vec<Round>,
    pub blocks: Vec<ListBlock<F>>,
    /// Begin of the present step [ticks].
    pub from: i64,
    /// Length of the next step [ticks].
    pub ticks: f64,
    /// Number of steps that blocks have begun.
    pub attempts: usize,
    /// Why the last steps were not taken by blocks.
    pub reason: Option<&'static str>,
}

impl<F: Features> Steps<F> {
    /// No steps yet, for this number of blocks, if it is given.
    pub fn new(blocks: Option<u16>) -> Self {
        let mut settings = Settings::new(blocks);
        if settings.blocks.is_none() {
            settings.thickness = [THICKNESS, 0.0];
        }
        Self {
            settings,
            calendars: Vec::new(),
            incoming: Vec::new(),
            known: Vec::new(),
            collected: Vec::new(),
            working_space: WorkingSpace::new(),
            span: None,
            metric: Metric::default(),
            places: Places::default(),
            rounds: Vec::new(),
            blocks: Vec::new(),
            from: 0,
            ticks: 0.0,
            attempts: 0,
            reason: None,
        }
    }

    /// Removes all entries and blocks.
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.calendars.clear();
        self.incoming.clear();
        self.span = None;
    }

    /// Whether no calendar has an entry.
    pub fn is_empty(&self) -> bool {
        self.calendars.iter().all(Calendar::is_empty) && self.incoming.iter().all(Vec::is_empty)
    }

    /// Prepares the calendars for one entry of each particle, given some of them.
    pub fn prepare(&mut self, some: &[Entry], particles: usize) {
        let events: Vec<Entry> = some.iter().copied().filter(|entry| entry.time < i64::MAX).collect();
        let each = particles.div_ceil(self.calendars.len().max(1));
        self.calendars.iter_mut().for_each(|calendar| calendar.prepare(&events, each));
    }

    /// Adds the first entry of a particle, which is later than the present.
    pub fn push(&mut self, entry: Entry, particles: usize) {
        let calendar = entry.owner as usize * self.calendars.len() / particles;
        if entry.time < i64::MAX {
            self.calendars[calendar].push(entry);
        }
    }

    /// Moves all entries to a queue.
    pub fn move_to(&mut self, queue: &mut Queue<SearchEvent>) {
        for calendar in &mut self.calendars {
            while let Some(entry) = calendar.pop_until(i64::MAX) {
                queue.push(entry);
            }
        }
        self.calendars.clear();
        self.incoming.drain(..).flatten().for_each(|entry| queue.push(entry));
    }
}

/// Smallest thickness of a block [largest contact distances]: with thinner ones too much is at faces
/// (threads.md).
const THICKNESS: f32 = 27.0;
