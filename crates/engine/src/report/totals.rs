//! The totals of a run. Reports of `haff run`, rows of sweeps, `haff info` and Python take their names from
//! here, so that all of them have the same ones.

use crate::report::{
    Counters,
    ledger::{Ledger, Term},
};

/// How a total follows from the counters and the energies of a run.
#[derive(Debug, Clone, Copy)]
pub enum Total {
    /// A number of events.
    Count(fn(&Counters) -> u64),
    /// An energy, or the residual of their balance.
    Energy(fn(&Ledger) -> f64),
    /// A term of the balance of energies.
    Term(Term),
}

/// Totals beside the terms of the balance, in the order of reports.
const ROWS: [(&str, Total); 13] = [
    ("collisions", Total::Count(|counters| counters.collisions)),
    ("wall_collisions", Total::Count(|counters| counters.wall_collisions)),
    ("events", Total::Count(|counters| counters.collisions + counters.wall_collisions)),
    ("simultaneous_contacts", Total::Count(|counters| counters.simultaneous)),
    ("rests", Total::Count(|counters| counters.rests)),
    ("wakes", Total::Count(|counters| counters.wakes)),
    ("kinetic_energy", Total::Energy(|ledger| ledger.kinetic)),
    ("rotational_energy", Total::Energy(|ledger| ledger.rotational)),
    ("potential_energy", Total::Energy(|ledger| ledger.potential)),
    ("spring_energy", Total::Energy(|ledger| ledger.spring)),
    ("dissipated_energy", Total::Energy(|ledger| ledger.dissipated)),
    ("carnot_energy", Total::Energy(|ledger| ledger.carnot)),
    ("ledger_residual", Total::Energy(|ledger| ledger.residual)),
];

/// Numbers of a run that are neither counts of its events nor energies.
pub const RUN_NUMBERS: [&str; 5] =
    ["particles", "simulated_time", "max_overlap", "wall_seconds", "collisions_per_second"];

/// All counts and energies: names, and how they follow.
pub fn totals() -> impl Iterator<Item = (&'static str, Total)> {
    let terms = Term::ALL.into_iter().map(|term| (term.name(), Total::Term(term)));
    ROWS.into_iter().chain(terms)
}

/// Names of all energies, with their values.
pub fn energies(ledger: &Ledger) -> impl Iterator<Item = (&'static str, f64)> {
    totals().filter_map(|(name, total)| match total {
        Total::Count(_) => None,
        Total::Energy(of) => Some((name, of(ledger))),
        Total::Term(term) => Some((name, ledger.term(term))),
    })
}

/// Names of all counts of events, with their values.
pub fn counts(counters: &Counters) -> impl Iterator<Item = (&'static str, u64)> {
    totals().filter_map(|(name, total)| match total {
        Total::Count(of) => Some((name, of(counters))),
        Total::Energy(_) | Total::Term(_) => None,
    })
}

/// Names of all totals that are numbers.
pub fn total_names() -> impl Iterator<Item = &'static str> {
    RUN_NUMBERS.into_iter().chain(totals().map(|(name, _)| name))
}
