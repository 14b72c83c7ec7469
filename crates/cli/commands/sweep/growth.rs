//! A sweep that grows: more values or seeds in the same folder.
//!
//! A member is the same run if its parameters and its number among the seeds are the same. Runs that the
//! folder has keep their files, whatever their number is now; new ones get file names that no run has.
//!
//! A run of a sweep is its parameters and its number among the seeds, whatever its index; it keeps its file
//! when values or seeds are added.

use std::collections::HashMap;

use super::{
    plan::{Member, Plan},
    row::Row,
    values::canonical,
};

/// The parameters of a member in the order of their keys, and its number among the seeds.
fn identity(member: &Member) -> (Vec<String>, Option<u32>) {
    let parameters = member.parameters.iter().map(|(key, value)| format!("{key}={}", canonical(key, value)));
    let mut parameters: Vec<String> = parameters.collect();
    parameters.sort_unstable();
    (parameters, member.replica)
}

/// The rows of a plan, in its order, with those that are known from an earlier plan; `None` if a member of
/// the earlier plan is not in this one.
pub fn rows(plan: &Plan, earlier: &Plan, known: Vec<Row>) -> Option<Vec<Row>> {
    let mut known: HashMap<usize, Row> = known.into_iter().map(|row| (row.index, row)).collect();
    let mut by_identity = HashMap::with_capacity(known.len());
    for member in earlier.members() {
        let row = known.remove(&member.index).filter(has_own_file).unwrap_or_else(|| Row::missing(&member));
        by_identity.insert(identity(&member), row);
    }
    let mut next = by_identity.values().filter_map(number).max().map_or(0, |last| last + 1);
    let rows = plan.members().map(|member| {
        if let Some(row) = by_identity.remove(&identity(&member)) {
            return Row { index: member.index, ..row };
        }
        let row = Row { file: plan.file(next), ..Row::missing(&member) };
        next += 1;
        row
    });
    let rows: Vec<Row> = rows.collect();
    by_identity.is_empty().then_some(rows)
}

/// Whether the file of a row has a name as a sweep gives them: a manifest may have been edited.
pub fn has_own_file(row: &Row) -> bool {
    number(row).is_some()
}

/// The number in the name of the file of a row.
fn number(row: &Row) -> Option<usize> {
    let digits = row.file.strip_prefix("run-")?.strip_suffix(".h5")?;
    if digits.bytes().all(|digit| digit.is_ascii_digit()) { digits.parse().ok() } else { None }
}
