//! A scene file as a tree of values in which every key remembers where it stands, with overrides applied.

use std::collections::BTreeMap;
use std::ops::Range;

use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use crate::config::SceneConfig;
use crate::error::{Place, SceneError};

/// Dotted path of a key, array elements by index.
pub(crate) type Path = Vec<String>;

/// More errors than this help nobody; reading stops there.
const MAX_ERRORS: usize = 100;

/// Keys nest at most four deep; deeper overrides only cost stack.
const MAX_DEPTH: usize = 16;

#[derive(Debug, Clone, Default)]
struct Origin {
    span: Option<Range<usize>>,
    overridden_by: Option<usize>,
    children: BTreeMap<String, Origin>,
}

/// Values, their origins, and the errors found so far.
pub(crate) struct Document {
    file: String,
    source: String,
    overrides: Vec<String>,
    root: Value,
    origins: Origin,
    /// Errors of syntax and shape.
    pub(crate) errors: Vec<SceneError>,
    /// Paths that were reported and taken out; what is missing there is not missing by the user's fault.
    reported: Vec<Path>,
}

impl Document {
    /// Parses `text` and applies `overrides` in order. Errors are collected in `errors`.
    pub(crate) fn new(file: &str, text: &str, overrides: &[String]) -> Self {
        let mut document = Self {
            file: file.to_owned(),
            source: text.to_owned(),
            overrides: overrides.to_vec(),
            root: Value::Table(Table::new()),
            origins: Origin::default(),
            errors: Vec::new(),
            reported: Vec::new(),
        };
        match DeTable::parse(text) {
            Ok(table) => {
                let mut origins = Origin::default();
                let converted = document.table(table.get_ref(), &mut origins, &mut Vec::new());
                document.root = Value::Table(converted);
                document.origins = origins;
            }
            Err(error) => {
                let place = error.span().map_or(Place::Whole, |span| document.place_of(span));
                document.push(place, &[], None, one_line(error.message()));
                return document;
            }
        }
        for (k, given) in overrides.iter().enumerate() {
            if let Err(message) = document.apply(k) {
                document.push(Place::Override(given.clone()), &[], None, message);
            }
        }
        document
    }

    /// Reads the tree as a [`SceneConfig`]. A key that does not fit is reported, taken out, and the rest read
    /// again, so that every error is found.
    pub(crate) fn config(&mut self) -> SceneConfig {
        loop {
            let error = match serde_path_to_error::deserialize::<_, SceneConfig>(self.root.clone()) {
                Ok(config) => return config,
                Err(error) => error,
            };
            let path: Path = error
                .path()
                .iter()
                .map_while(|segment| match segment {
                    serde_path_to_error::Segment::Seq { index } => Some(index.to_string()),
                    serde_path_to_error::Segment::Map { key } => Some(key.clone()),
                    serde_path_to_error::Segment::Enum { .. } | serde_path_to_error::Segment::Unknown => None,
                })
                .collect();
            let path = self.existing(path);
            self.report(&path, shape_message(error.inner().message(), path.last()));
            self.reported.push(path.clone());
            if self.errors.len() >= MAX_ERRORS || !self.remove(path) {
                return SceneConfig::default();
            }
        }
    }

    /// Adds an error at `path`, placed at the key or at the nearest table above it.
    pub(crate) fn report(&mut self, path: &[String], message: impl Into<String>) {
        let value = get(&self.root, path).map(show);
        let place = self.place(path);
        self.push(place, path, value, message.into());
    }

    /// Adds an error that something at `path` is missing, unless it was there and has been reported.
    pub(crate) fn report_missing(&mut self, path: &[String], message: impl Into<String>) {
        if !self.was_reported(path) {
            let place = self.place(path);
            self.push(place, path, None, message.into());
        }
    }

    /// Whether `path`, something in it or something around it has been reported for its shape.
    pub(crate) fn was_reported(&self, path: &[String]) -> bool {
        self.reported.iter().any(|r| r.starts_with(path) || path.starts_with(r))
    }

    /// Whether something is written at `path`.
    pub(crate) fn get_is_some(&self, path: &[String]) -> bool {
        get(&self.root, path).is_some()
    }

    /// The errors in the order of the file; overrides last.
    pub(crate) fn into_errors(mut self) -> (Vec<SceneError>, String) {
        self.errors.sort_by_key(|error| match &error.place {
            Place::Whole => (0, 0),
            Place::File { span, .. } => (1, span.start),
            Place::Override(text) => (2, self.overrides.iter().position(|o| o == text).unwrap_or(0)),
        });
        self.errors.dedup();
        (self.errors, self.source)
    }

    fn push(&mut self, place: Place, path: &[String], value: Option<String>, message: String) {
        if self.errors.len() < MAX_ERRORS {
            let path = path.join(".");
            self.errors.push(SceneError { file: self.file.clone(), place, path, value, message });
        }
    }

    fn place(&self, path: &[String]) -> Place {
        let mut origin = &self.origins;
        let mut place = Place::Whole;
        for segment in path {
            let Some(child) = origin.children.get(segment) else { break };
            if let Some(k) = child.overridden_by {
                return Place::Override(self.overrides[k].clone());
            }
            if let Some(span) = &child.span {
                place = self.place_of(span.clone());
            }
            origin = child;
        }
        place
    }

    fn place_of(&self, span: Range<usize>) -> Place {
        let before = self.source.get(..span.start).unwrap_or(&self.source);
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |tail| tail.chars().count()) + 1;
        Place::File { line, column, span }
    }

    fn table(&mut self, table: &DeTable, origin: &mut Origin, path: &mut Path) -> Table {
        let mut out = Table::new();
        for (key, value) in table {
            let name = key.get_ref().to_string();
            let mut child = Origin { span: Some(key.span()), ..Origin::default() };
            path.push(name.clone());
            if let Some(value) = self.value(value, &mut child, path) {
                out.insert(name.clone(), value);
            }
            path.pop();
            origin.children.insert(name, child);
        }
        out
    }

    fn value(&mut self, value: &Spanned<DeValue>, origin: &mut Origin, path: &mut Path) -> Option<Value> {
        Some(match value.get_ref() {
            DeValue::String(text) => Value::String(text.to_string()),
            DeValue::Boolean(value) => Value::Boolean(*value),
            DeValue::Datetime(value) => Value::Datetime(*value),
            DeValue::Integer(integer) => {
                let Ok(integer) = i64::from_str_radix(integer.as_str(), integer.radix()) else {
                    let place = self.place_of(value.span());
                    let text = Some(integer.to_string());
                    self.push(place, path, text, "this integer does not fit into 64 bits".into());
                    self.reported.push(path.clone());
                    return None;
                };
                Value::Integer(integer)
            }
            DeValue::Float(float) => Value::Float(float.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Table(table) => Value::Table(self.table(table, origin, path)),
            DeValue::Array(array) => {
                let mut out = Vec::with_capacity(array.len());
                for (k, element) in array.iter().enumerate() {
                    let mut child = Origin { span: Some(element.span()), ..Origin::default() };
                    path.push(k.to_string());
                    out.push(self.value(element, &mut child, path).unwrap_or(Value::Integer(0)));
                    path.pop();
                    origin.children.insert(k.to_string(), child);
                }
                Value::Array(out)
            }
        })
    }

    fn apply(&mut self, k: usize) -> Result<(), String> {
        let text = self.overrides[k].clone();
        let (key, value_text) =
            text.split_once('=').ok_or("must read KEY=VALUE, for example contact.restitution=0.8")?;
        let path: Path = key.trim().split('.').map(|s| s.trim().to_owned()).collect();
        if path.len() > MAX_DEPTH || path.iter().any(String::is_empty) {
            return Err(format!("`{}` is not a dotted key such as contact.restitution", key.trim()));
        }
        let mut origin = Origin { overridden_by: Some(k), ..Origin::default() };
        let value = match DeValue::parse(value_text.trim()) {
            Ok(value) => self
                .value(&value, &mut origin, &mut path.clone())
                .ok_or("this integer does not fit into 64 bits")?,
            // Shells eat quotes: a bare word is meant as text.
            Err(error) if value_text.trim_start().starts_with(['[', '{', '"', '\'']) => {
                return Err(format!("not a TOML value: {}", one_line(error.message())));
            }
            Err(_) => Value::String(value_text.trim().to_owned()),
        };
        origin.children.clear();
        for target in expand(&self.root, &path)? {
            set(&mut self.root, &target, value.clone())?;
            let mut place = &mut self.origins;
            for segment in &target {
                place = place.children.entry(segment.clone()).or_default();
            }
            *place = origin.clone();
        }
        Ok(())
    }

    /// Cuts `path` back to what exists.
    fn existing(&self, mut path: Path) -> Path {
        while !path.is_empty() && get(&self.root, &path).is_none() {
            path.pop();
        }
        path
    }

    /// Takes out the key at `path`; of an array, all of it, so that no other index changes.
    fn remove(&mut self, mut path: Path) -> bool {
        while let Some(last) = path.pop() {
            if let Some(Value::Table(table)) = get_mut(&mut self.root, &path) {
                return table.remove(&last).is_some();
            }
        }
        false
    }
}

fn get<'v>(mut value: &'v Value, path: &[String]) -> Option<&'v Value> {
    for segment in path {
        value = match value {
            Value::Table(table) => table.get(segment)?,
            Value::Array(array) => array.get(segment.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    Some(value)
}

fn get_mut<'v>(mut value: &'v mut Value, path: &[String]) -> Option<&'v mut Value> {
    for segment in path {
        value = match value {
            Value::Table(table) => table.get_mut(segment)?,
            Value::Array(array) => array.get_mut(segment.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    Some(value)
}

/// Turns names of array elements into indices; a name that several particles share stands for all of them.
fn expand(root: &Value, path: &[String]) -> Result<Vec<Path>, String> {
    let mut targets: Vec<Path> = vec![Vec::new()];
    for segment in path {
        let mut next = Vec::new();
        for target in &targets {
            let mut step = |segment: String| {
                let mut longer = target.clone();
                longer.push(segment);
                next.push(longer);
            };
            let Some(Value::Array(array)) = get(root, target) else {
                step(segment.clone());
                continue;
            };
            if let Ok(index) = segment.parse::<usize>() {
                if index >= array.len() {
                    let (list, len) = (target.join("."), array.len());
                    return Err(format!("`{list}` has {len} elements, counted from 0"));
                }
                step(index.to_string());
                continue;
            }
            let name = |element: &Value| Some(element.get("name")?.as_str()?.to_owned());
            let before = next_len(array, &name, segment, &mut step);
            if before == 0 {
                let mut names: Vec<String> = array.iter().filter_map(name).collect();
                names.dedup();
                names.truncate(10);
                let list = target.join(".");
                return Err(format!(
                    "nothing in `{list}` is named `{segment}`; take a name ({}) or an index",
                    names.join(", ")
                ));
            }
        }
        targets = next;
    }
    Ok(targets)
}

fn next_len(
    array: &[Value],
    name: &impl Fn(&Value) -> Option<String>,
    wanted: &str,
    step: &mut impl FnMut(String),
) -> usize {
    let hits = array.iter().enumerate().filter(|(_, element)| name(element).as_deref() == Some(wanted));
    hits.map(|(k, _)| step(k.to_string())).count()
}

fn set(root: &mut Value, path: &[String], value: Value) -> Result<(), String> {
    let mut here = root;
    for (k, segment) in path.iter().enumerate() {
        here = match here {
            Value::Table(table) => table.entry(segment.clone()).or_insert_with(|| Value::Table(Table::new())),
            Value::Array(array) => {
                let index = segment.parse::<usize>().map_err(|_| "not an index".to_owned())?;
                array.get_mut(index).ok_or("no such element")?
            }
            other => {
                let outer = path[..k].join(".");
                return Err(format!("`{outer}` is {}, not a table: set it as a whole", a_type(other)));
            }
        };
    }
    *here = value;
    Ok(())
}

fn a_type(value: &Value) -> &'static str {
    match value {
        Value::String(_) => "a string",
        Value::Integer(_) | Value::Float(_) => "a number",
        Value::Boolean(_) => "a boolean",
        Value::Datetime(_) => "a date",
        Value::Array(_) => "an array",
        Value::Table(_) => "a table",
    }
}

/// The value as TOML on one line, cut where it gets long.
fn show(value: &Value) -> String {
    let text = match value {
        Value::Table(table) => {
            let keys: Vec<&str> = table.keys().take(6).map(String::as_str).collect();
            format!("{{ {} … }}", keys.join(", "))
        }
        Value::Array(array) if array.iter().any(Value::is_table) => format!("[{} tables]", array.len()),
        other => one_line(&other.to_string()),
    };
    if text.chars().count() > 60 { text.chars().take(59).chain(['…']).collect() } else { text }
}

fn one_line(text: &str) -> String {
    text.split('\n').map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
}

/// serde's words in those of a user.
fn shape_message(message: &str, key: Option<&String>) -> String {
    let message = one_line(message);
    if message.starts_with("unknown field") {
        let names: Vec<&str> = message.split('`').skip(3).step_by(2).collect();
        let near = key.and_then(|key| {
            let score = |name: &str| strsim::jaro_winkler(name, key);
            names
                .iter()
                .copied()
                .max_by(|a, b| score(a).total_cmp(&score(b)))
                .filter(|best| score(best) > 0.75)
        });
        let allowed = names.join(", ");
        return match near {
            Some(near) => format!("unknown key; did you mean `{near}`? (allowed: {allowed})"),
            None => format!("unknown key (allowed: {allowed})"),
        };
    }
    if message.starts_with("unknown variant") {
        let names: Vec<String> =
            message.split('`').skip(3).step_by(2).map(|name| format!("\"{name}\"")).collect();
        return format!("must be one of {}", names.join(", "));
    }
    if let Some((found, expected)) =
        message.strip_prefix("invalid type: ").and_then(|rest| rest.split_once(", expected "))
    {
        let found = match found.split([' ', '`']).next() {
            Some("string") => "a string",
            Some("integer") => "an integer",
            Some("floating") => "a number with a fraction",
            Some("boolean") => "a boolean",
            Some("sequence") => "an array",
            Some("map") => "a table",
            _ => found,
        };
        let expected = match expected {
            "f64" => "a number",
            "i64" => "an integer",
            "a sequence" => "an array",
            "string or table" => "a string",
            text if text.starts_with("struct ") => "a table",
            text => text,
        };
        return format!("must be {expected}, not {found}");
    }
    if let Some((_, expected)) =
        message.strip_prefix("invalid value: ").and_then(|rest| rest.split_once(", expected "))
    {
        return format!("must be {expected}");
    }
    message
}
