//! The rows of the events of several blocks, in the order of one queue.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, HashMap},
};

use crate::report::{EventRecord, Exchange, Observer, Partner, VelocityChange};

/// The rows of an event.
pub(crate) struct Row {
    /// Time \[ticks\], and rank among simultaneous events.
    pub time: i64,
    pub rank: (u32, u32, u32),
    /// The particles that the event has changed.
    pub changed: [Option<u32>; 2],
    exchange: Option<(f64, [Option<VelocityChange>; 2], Partner)>,
    event: Option<EventRecord>,
}

/// The rows of one block, in the order in which it has taken the events.
#[derive(Default)]
pub(crate) struct Rows {
    rows: Vec<Row>,
    /// The row at which each round begins.
    rounds: Vec<usize>,
}

impl Rows {
    /// Removes all rows.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.rounds.clear();
    }

    /// Begins a round.
    pub fn begin_round(&mut self) {
        self.rounds.push(self.rows.len());
    }

    /// Begins an event.
    pub fn begin_event(&mut self, time: i64, rank: (u32, u32, u32), changed: [Option<u32>; 2]) {
        self.rows.push(Row { time, rank, changed, exchange: None, event: None });
    }
}

impl Observer for Rows {
    fn event(&mut self, event: &EventRecord) {
        if let Some(row) = self.rows.last_mut() {
            row.event = Some(*event);
        }
    }

    fn exchange(&mut self, exchange: &Exchange) {
        let change = |k: usize| exchange.changes.get(k).copied();
        if let Some(row) = self.rows.last_mut() {
            row.exchange = Some((exchange.time, [change(0), change(1)], exchange.partner));
        }
    }
}

impl Row {
    fn deliver(&self, observer: &mut dyn Observer) {
        if let Some((time, changes, partner)) = self.exchange {
            let changes: Vec<VelocityChange> = changes.into_iter().flatten().collect();
            observer.exchange(&Exchange { time, changes: &changes, partner });
        }
        if let Some(event) = &self.event {
            observer.event(event);
        }
    }
}

/// Gives the rows of all blocks to an observer, in the order of the events.
pub(crate) fn deliver<'a>(blocks: impl Iterator<Item = &'a Rows>, observer: &mut dyn Observer) {
    let mut sorted: Vec<(i64, usize, usize, usize)> = Vec::new();
    let blocks: Vec<&Rows> = blocks.collect();
    for (k, Rows { rows, rounds }) in blocks.iter().enumerate() {
        let mut round = 0;
        sorted.extend(rows.iter().enumerate().map(|(index, row)| {
            while rounds.get(round + 1).is_some_and(|&start| start <= index) {
                round += 1;
            }
            (row.time, round, k, index)
        }));
    }
    sorted.sort_unstable();
    for group in sorted.chunk_by(|a, b| a.0 == b.0) {
        let rows: Vec<&Row> = group.iter().map(|&(_, _, k, index)| &blocks[k].rows[index]).collect();
        match rows[..] {
            [row] => row.deliver(observer),
            _ => in_order(&rows).into_iter().for_each(|k| rows[k].deliver(observer)),
        }
    }
}

/// The order in which a single queue takes simultaneous events. `rows` are in the order of the rounds.
///
/// Events of the same particle keep their order: one has led to the next. Of the others, the one with the
/// lowest rank comes first.
fn in_order(rows: &[&Row]) -> Vec<usize> {
    let mut last = HashMap::new();
    let mut followers = vec![Vec::new(); rows.len()];
    let mut waits = vec![0; rows.len()];
    for (k, row) in rows.iter().enumerate() {
        for body in row.changed.into_iter().flatten() {
            if let Some(previous) = last.insert(body, k) {
                followers[previous].push(k);
                waits[k] += 1;
            }
        }
    }
    let mut order = Vec::new();
    let free = (0..rows.len()).filter(|&k| waits[k] == 0);
    let mut next: BinaryHeap<_> = free.map(|k| Reverse((rows[k].rank, k))).collect();
    while let Some(Reverse((_, k))) = next.pop() {
        order.push(k);
        for &follower in &followers[k] {
            waits[follower] -= 1;
            if waits[follower] == 0 {
                next.push(Reverse((rows[follower].rank, follower)));
            }
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simultaneous_events_keep_the_order_of_causes() {
        let row = |changed: [u32; 2], rank: u32| Row {
            time: 7,
            rank: (0, rank, 0),
            changed: changed.map(Some),
            exchange: None,
            event: None,
        };
        // The first event leads to the third one, which has a lower rank.
        let rows = [row([1, 2], 5), row([3, 4], 4), row([2, 6], 3), row([7, 8], 9)];
        let rows: Vec<&Row> = rows.iter().collect();
        assert_eq!(in_order(&rows), [1, 0, 2, 3]);
    }
}
