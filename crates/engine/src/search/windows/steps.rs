//! The steps of a window, whose events are taken by blocks.

use crate::search::{
    blocks::{Metric, Round, Settings, WorkingSpace},
    windows::{block::WindowBlock, window_event::WindowEvent},
};

/// The steps of the present window.
pub(super) struct Steps<F> {
    /// Contacts of the steps that have not begun, by step.
    pub contacts: Vec<Vec<WindowEvent>>,
    /// Those of the step that blocks take, and its number.
    pub known: Vec<WindowEvent>,
    pub known_of: usize,
    pub working_space: WorkingSpace<WindowEvent>,
    /// The end of each step [ticks], and the next step.
    pub ends: Vec<i64>,
    pub next: usize,
    /// Number of steps that blocks have begun in the window.
    pub attempts: usize,
    /// End of the last step [ticks].
    pub end: i64,
    /// Whether particles have been changed since then by something other than a block.
    pub is_serial: bool,
    /// Whether all changes of the window have been made by blocks.
    pub has_noted: bool,
    pub metric: Option<Metric>,
    pub rounds: Vec<Round>,
    pub blocks: Vec<WindowBlock<F>>,
    pub settings: Settings,
}

impl<F> Steps<F> {
    /// No steps yet, for this number of blocks, if it is given.
    pub fn new(blocks: Option<u16>) -> Self {
        Self {
            contacts: Vec::new(),
            known: Vec::new(),
            known_of: 0,
            working_space: WorkingSpace::new(),
            ends: Vec::new(),
            next: 0,
            attempts: 0,
            end: 0,
            is_serial: false,
            has_noted: false,
            metric: None,
            rounds: Vec::new(),
            blocks: Vec::new(),
            settings: Settings::new(blocks),
        }
    }

    /// The step in which a time falls.
    pub fn step_of(&self, begin: i64, time: i64) -> usize {
        let last = self.ends.len() - 1;
        let part = (time - begin) as f64 / (self.ends[last] - begin) as f64;
        let mut step = ((part * self.ends.len() as f64) as usize).min(last);
        // By rounding, the time can be in a neighboring step.
        while step > 0 && time <= self.ends[step - 1] {
            step -= 1;
        }
        while step < last && time > self.ends[step] {
            step += 1;
        }
        step
    }

    /// Drops the aliases of the window's arrays.
    pub fn drop_blocks(&mut self) {
        self.blocks.clear();
    }
}
