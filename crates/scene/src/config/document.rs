//! A scene file as a tree of values with the position of every key, with overrides applied; and the errors
//! found in it.
//!
//! The time taken is linear in the length of the text and in the number of errors. Only the first errors are
//! kept.

use std::collections::HashSet;

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};

use crate::config::joints::{PendulumConfig, RodConfig, SpringConfig};
use crate::config::misplaced::meant;
use crate::config::names::NamedElements;
use crate::config::{
    DriveConfig, InletConfig, OutletConfig, PairConfig, ParticleConfig, SceneConfig, SpeciesConfig,
    WallConfig,
};
use crate::source::error::{Code, Place, SceneError, SceneErrors, Why};
use crate::source::read::{Reading, Unknown, read};
pub(crate) use crate::source::tree::Path;
use crate::source::tree::{Converter, Node, Origin, Table, Value};
use crate::source::weight::Weight;

/// Limit of nesting of overrides, which bounds the stack; keys nest at most four deep.
const MAX_DEPTH: usize = 16;

/// Arrays of any length, whose elements are read one by one, so that the others are not read again after an
/// invalid one.
const LISTS: [&[&str]; 10] = [
    &["species"],
    &["particle"],
    &["wall"],
    &["pendulum"],
    &["spring"],
    &["rod"],
    &["contact", "pair"],
    &["drive"],
    &["inlet"],
    &["outlet"],
];

/// Values with their sources, and the errors found so far.
pub(crate) struct Document {
    file: String,
    source: String,
    overrides: Vec<String>,
    root: Node,
    errors: Errors,
    reported: Reported,
    /// Whether the text or an override could not be parsed, so that missing keys may in fact be written.
    garbled: bool,
}

/// Order of errors in the list: those of the file as a whole, those in the file by position, those of
/// overrides; then in the order found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    Whole,
    File { start: u32, end: u32 },
    Override(u32),
}

/// The first errors in the order of [`Rank`], and their total number.
#[derive(Default)]
struct Errors {
    first: Vec<(Rank, Draft)>,
    count: usize,
}

/// An error before its line has been looked up.
#[derive(PartialEq, Eq)]
struct Draft {
    path: Path,
    value: Option<String>,
    why: Why,
}

impl Errors {
    /// Counts an error; its message is formatted only if it is among the first.
    fn add(&mut self, rank: Rank, make: impl FnOnce() -> Draft) {
        self.count += 1;
        if self.first.len() == SceneErrors::MOST && self.first.last().is_some_and(|(last, _)| *last <= rank) {
            return;
        }
        let index = self.first.partition_point(|(other, _)| *other <= rank);
        let draft = make();
        // The same message from two checks is one error.
        if self.first.iter().any(|(other, known)| (*other, known) == (rank, &draft)) {
            self.count -= 1;
            return;
        }
        self.first.insert(index, (rank, draft));
        self.first.truncate(SceneErrors::MOST);
    }
}

/// Paths that were reported and removed; keys missing there are not reported again.
#[derive(Default)]
struct Reported {
    themselves: HashSet<Path>,
    /// All their ancestors.
    above: HashSet<Path>,
}

impl Reported {
    /// A path that was removed.
    fn add(&mut self, path: &[String]) {
        self.add_above(path);
        self.themselves.insert(path.to_vec());
    }

    /// A path at or below which something was removed.
    fn add_above(&mut self, path: &[String]) {
        for k in (0..=path.len()).rev() {
            if !self.above.insert(path[..k].to_vec()) {
                break;
            }
        }
    }

    /// Whether `path`, a descendant or an ancestor of it is among them.
    fn touch(&self, path: &[String]) -> bool {
        !self.above.is_empty()
            && (self.above.contains(path) || (0..=path.len()).any(|k| self.themselves.contains(&path[..k])))
    }
}

impl Document {
    /// The name of the scene file.
    pub(crate) fn name(&self) -> &str {
        &self.file
    }

    /// Parses `text` and applies `overrides` in order; `memory` is what reading them may take [bytes].
    pub(crate) fn new(file: &str, text: &str, overrides: &[String], memory: u64) -> Self {
        let mut document = Self {
            file: file.to_owned(),
            source: String::new(),
            overrides: overrides.to_vec(),
            root: Node { origin: Origin::Implied, value: Value::Table(Table::default()) },
            errors: Errors::default(),
            reported: Reported::default(),
            garbled: false,
        };
        if let Err(message) = Weight::of_document(text).check(memory) {
            document.whole(message);
            return document;
        }
        text.clone_into(&mut document.source);
        match DeTable::parse(text) {
            Ok(table) => {
                let mut converter = Converter::default();
                document.root.value = Value::Table(converter.table(table.into_inner()));
                document.oversized(converter);
            }
            Err(error) => {
                let message = one_line(error.message());
                match error.span() {
                    Some(span) => {
                        let rank = Rank::File { start: span.start as u32, end: span.end as u32 };
                        document.garble(rank, message);
                    }
                    None => document.whole(message),
                }
                return document;
            }
        }
        document.apply_all(memory);
        document
    }

    /// An error of a text that cannot be read.
    fn garble(&mut self, rank: Rank, message: String) {
        self.garbled = true;
        let why = Why::new(Code::Syntax, message);
        self.errors.add(rank, || Draft { path: Vec::new(), value: None, why });
    }

    /// Adds an error of the file as a whole.
    fn whole(&mut self, message: String) {
        self.garble(Rank::Whole, message);
    }

    /// Reports integers out of range, whose keys have been left out.
    fn oversized(&mut self, converter: Converter) {
        for integer in converter.oversized {
            let allowed = match integer.path.as_slice() {
                [key] if key == "seed" => "must be in 0..=9223372036854775807",
                _ => "must be in -9223372036854775808..=9223372036854775807, as every integer of TOML",
            };
            self.reported.add(&integer.path);
            let rank = Rank::of(integer.origin).unwrap_or(Rank::Whole);
            let (path, value) =
                (integer.path, Some(crate::source::text::cut(&integer.text, 60).into_owned()));
            self.errors.add(rank, || Draft { path, value, why: Why::value(allowed) });
        }
    }

    /// Whether no error has been found.
    pub(crate) fn is_sound(&self) -> bool {
        self.errors.count == 0
    }

    /// Number of errors found so far.
    pub(crate) fn count(&self) -> usize {
        self.errors.count
    }

    /// Whether checks for missing keys are pointless.
    pub(crate) fn is_garbled(&self) -> bool {
        self.garbled
    }

    /// Reads the tree as a [`SceneConfig`]. Invalid keys are reported and removed.
    pub(crate) fn config(&mut self) -> SceneConfig {
        let mut config: SceneConfig = self.read(&[], &LISTS);
        config.species = self.list::<SpeciesConfig>(LISTS[0]).or(config.species);
        config.particle = self.list::<ParticleConfig>(LISTS[1]).or(config.particle);
        config.wall = self.list::<WallConfig>(LISTS[2]).or(config.wall);
        config.pendulum = self.list::<PendulumConfig>(LISTS[3]).or(config.pendulum);
        config.spring = self.list::<SpringConfig>(LISTS[4]).or(config.spring);
        config.rod = self.list::<RodConfig>(LISTS[5]).or(config.rod);
        config.drive = self.list::<DriveConfig>(LISTS[7]).or(config.drive);
        config.inlet = self.list::<InletConfig>(LISTS[8]).or(config.inlet);
        config.outlet = self.list::<OutletConfig>(LISTS[9]).or(config.outlet);
        if let Some(pairs) = self.list::<PairConfig>(LISTS[6]) {
            config.contact.get_or_insert_default().pair = Some(pairs);
        }
        config
    }

    /// Reads the elements of an array one by one. An invalid one is reported and read as an empty table.
    fn list<T: DeserializeOwned + Default>(&mut self, path: &[&str]) -> Option<Vec<T>> {
        let mut path: Path = path.iter().map(|&segment| segment.to_owned()).collect();
        let Value::Array(array) = &self.root.get(&path)?.value else { return None };
        let count = array.len();
        let mut out = Vec::with_capacity(count);
        for k in 0..count {
            path.push(k.to_string());
            out.push(self.read(&path, &[]));
            path.pop();
        }
        Some(out)
    }

    /// Reads the value at `path`. An invalid key is reported and removed, and the rest is read again, so that
    /// every error is found. This repeats at most as often as the structure has keys, since unknown keys are
    /// removed all at once.
    fn read<T: DeserializeOwned + Default>(&mut self, path: &[String], skipped: &[&[&str]]) -> T {
        loop {
            let Some(node) = self.root.get(path) else { return T::default() };
            let Reading { result, unknown } = read::<T>(node, path, skipped);
            for unknown in unknown {
                self.report_unknown(unknown);
            }
            let misfit = match result {
                Ok(value) => return value,
                Err(misfit) => misfit,
            };
            let at = misfit.path.unwrap_or_else(|| path.to_vec());
            self.report_why(&at, misfit.why);
            self.reported.add(&at);
            if !self.root.take_out(&at, path.len()) {
                return T::default();
            }
        }
    }

    /// Reports unknown keys of a table, and removes them.
    fn report_unknown(&mut self, unknown: Unknown) {
        let Unknown { table: path, keys, known } = unknown;
        self.reported.add_above(&path);
        let Some(Node { value: Value::Table(table), .. }) = self.root.get(&path) else { return };
        let mut found: Vec<(Option<Rank>, &str, &Node)> = keys
            .iter()
            .filter_map(|key| table.get(key).map(|node| (Rank::of(node.origin), &**key, node)))
            .collect();
        // In the order of the file, so that those beyond the first are only counted.
        found.sort_by_key(|(rank, ..)| *rank);
        for (rank, key, node) in found {
            let rank = rank.unwrap_or_else(|| self.rank(&path));
            self.errors.add(rank, || Draft {
                path: [path.as_slice(), &[key.to_owned()]].concat(),
                value: Some(node.value.show()),
                why: unknown_key(&path, key, known),
            });
        }
        if let Some(Node { value: Value::Table(table), .. }) = self.root.get_mut(&path) {
            table.0.retain(|(key, _)| known.contains(&&**key));
        }
    }

    /// Adds an error at `path`, placed at the key or at the nearest table above it: a value that other keys,
    /// the particles or a state exclude.
    pub(crate) fn report(&mut self, path: &[String], message: impl Into<String>) {
        self.report_why(path, Why::new(Code::Conflict, message));
    }

    /// Adds an error at `path` for a value that is not allowed; `must` is what is: "must be in [0, 1]".
    pub(crate) fn refuse(&mut self, path: &[String], must: impl Into<String>) {
        self.report_why(path, Why::value(must));
    }

    /// As [`Self::refuse`] for a number in the array at `path`.
    pub(crate) fn refuse_part(&mut self, path: &[String], part: f64, must: &str) {
        self.report_why(path, Why { message: format!("{part} {must}"), ..Why::value(must) });
    }

    /// Adds an error at `path`.
    pub(crate) fn report_why(&mut self, path: &[String], why: Why) {
        let value = self.root.get(path).map(|node| node.value.show());
        self.push(path, value, why);
    }

    /// Adds an error for a missing key at `path`, unless an invalid one has been reported there.
    pub(crate) fn report_missing(&mut self, path: &[String], message: impl Into<String>) {
        if !self.was_reported(path) {
            self.push(path, None, Why::new(Code::Missing, message));
        }
    }

    /// Whether `path`, a descendant or an ancestor of it has been reported for its type.
    pub(crate) fn was_reported(&self, path: &[String]) -> bool {
        self.reported.touch(path)
    }

    /// Whether there is a value at `path`.
    pub(crate) fn get_is_some(&self, path: &[String]) -> bool {
        self.root.get(path).is_some()
    }

    /// Whether an override has set the value at `path`, a table above it, or something below it.
    pub(crate) fn is_overridden(&self, path: &[String]) -> bool {
        let mut node = &self.root;
        for segment in path {
            let Some(child) = node.child(segment) else { return false };
            if matches!(child.origin, Origin::Override(_)) {
                return true;
            }
            node = child;
        }
        node.has_override()
    }

    /// Refuses overrides of other keys than these, and those below them.
    pub(crate) fn allow_overrides(&mut self, allowed: &[&str]) {
        for k in 0..self.overrides.len() {
            let key = self.overrides[k].split('=').next().unwrap_or_default().trim();
            let is_in = |part: &&str| {
                key == *part || key.strip_prefix(*part).is_some_and(|rest| rest.starts_with('.'))
            };
            if !allowed.iter().any(is_in) {
                let message =
                    format!("cannot change in a run that goes on (allowed: {})", allowed.join(", "));
                self.garble(Rank::Override(k as u32), message);
            }
        }
    }

    /// The first errors in the order of the file, overrides last; how many more there are; and the text.
    pub(crate) fn into_errors(self) -> (Vec<SceneError>, usize, String) {
        let more = self.errors.count - self.errors.first.len();
        let lines = Lines::of(&self.source);
        let errors = self.errors.first.into_iter().map(|(rank, draft)| SceneError {
            file: self.file.clone(),
            place: match rank {
                Rank::Whole => Place::Whole,
                Rank::File { start, end } => lines.place(&self.source, start as usize..end as usize),
                Rank::Override(k) => Place::Override(self.overrides[k as usize].clone()),
            },
            path: draft.path.join("."),
            value: draft.value,
            code: draft.why.code,
            message: draft.why.message,
            allowed: draft.why.allowed,
            meant: draft.why.meant,
        });
        (errors.collect(), more, self.source)
    }

    fn push(&mut self, path: &[String], value: Option<String>, why: Why) {
        let rank = self.rank(path);
        self.errors.add(rank, || Draft { path: path.to_vec(), value, why });
    }

    /// The position of a key, or of the nearest table above it that has one.
    fn rank(&self, path: &[String]) -> Rank {
        let mut node = &self.root;
        let mut rank = Rank::Whole;
        for segment in path {
            let Some(child) = node.child(segment) else { break };
            rank = Rank::of(child.origin).unwrap_or(rank);
            node = child;
        }
        rank
    }

    fn apply_all(&mut self, memory: u64) {
        let mut names = NamedElements::default();
        for k in 0..self.overrides.len() {
            if let Err(message) = self.apply(k, memory, &mut names) {
                self.garble(Rank::Override(k as u32), message);
            }
        }
    }

    fn apply(&mut self, k: usize, memory: u64, names: &mut NamedElements) -> Result<(), String> {
        let text = &self.overrides[k];
        let (key, value_text) =
            text.split_once('=').ok_or("must read KEY=VALUE, for example contact.restitution=0.8")?;
        let path: Path = key.trim().split('.').map(|s| s.trim().to_owned()).collect();
        if path.len() > MAX_DEPTH || path.iter().any(String::is_empty) {
            return Err(format!("`{}` is not a dotted key such as contact.restitution", key.trim()));
        }
        Weight::of_value(value_text).check(memory)?;
        let number = k as u32;
        let mut converter = Converter::of_override(number, path.clone());
        let value = match DeValue::parse(value_text.trim()) {
            Ok(value) => converter.spanned(value),
            // Shells remove quotes: a bare word is text.
            Err(error) if value_text.trim_start().starts_with(['[', '{', '"', '\'']) => {
                return Err(format!("not a TOML value: {}", one_line(error.message())));
            }
            Err(_) => {
                Some(Node { origin: Origin::Override(number), value: Value::Text(value_text.trim().into()) })
            }
        };
        self.oversized(converter);
        let Some(value) = value else { return Ok(()) };
        let targets = names.expand(&self.root, &path)?;
        names.forget(&path);
        for target in targets {
            self.root.set(&target, value.clone())?;
        }
        Ok(())
    }
}

impl Rank {
    fn of(origin: Origin) -> Option<Self> {
        match origin {
            Origin::File { start, end } => Some(Self::File { start, end }),
            Origin::Override(k) => Some(Self::Override(k)),
            Origin::Implied => None,
        }
    }
}

/// Offsets of the lines of a text.
struct Lines(Vec<usize>);

impl Lines {
    fn of(text: &str) -> Self {
        Self(std::iter::once(0).chain(text.match_indices('\n').map(|(k, _)| k + 1)).collect())
    }

    fn place(&self, text: &str, span: std::ops::Range<usize>) -> Place {
        let start = span.start.min(text.len());
        let line = self.0.partition_point(|&begin| begin <= start);
        let column = text.get(self.0[line - 1]..start).map_or(0, |before| before.chars().count()) + 1;
        Place::File { line, column, span }
    }
}

fn one_line(text: &str) -> String {
    text.split('\n').map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
}

fn unknown_key(path: &[String], key: &str, known: &[&str]) -> Why {
    let (allowed, meant) = (known.join(", "), meant(path, key, known));
    let (hint, paths): (Vec<String>, Vec<String>) =
        meant.iter().map(|key| (key.show(), key.path(path))).unzip();
    let hint = if hint.is_empty() { String::new() } else { format!("; did you mean {}?", hint.join(" or ")) };
    let why = Why::new(Code::UnknownKey, format!("unknown key{hint} (allowed: {allowed})"));
    Why { allowed: Some(allowed), meant: paths, ..why }
}
