//! A tree of TOML values, each with its source.

use std::fmt::Write;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// Dotted path of a key, array elements by index.
pub(crate) type Path = Vec<String>;

/// Source of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Origin {
    /// The scene file: bytes of the key, or of the array element. Files are far shorter than 4 GiB.
    File { start: u32, end: u32 },
    /// The override of this number.
    Override(u32),
    /// A table created by an override above its key.
    Implied,
}

impl Origin {
    fn file(span: Range<usize>) -> Self {
        Self::File { start: span.start as u32, end: span.end as u32 }
    }
}

/// A value and its source.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    pub(crate) origin: Origin,
    pub(crate) value: Value,
}

#[derive(Debug, Clone)]
pub(crate) enum Value {
    Text(Box<str>),
    Integer(i64),
    Float(f64),
    Boolean(bool),
    /// Kept for messages: no key of a scene is a date.
    Date(Box<str>),
    Array(Vec<Node>),
    Table(Table),
}

/// Keys in alphabetical order.
#[derive(Debug, Clone, Default)]
pub(crate) struct Table(pub(crate) Vec<(Box<str>, Node)>);

impl Table {
    fn position(&self, key: &str) -> Result<usize, usize> {
        self.0.binary_search_by(|(name, _)| (**name).cmp(key))
    }

    pub(crate) fn get(&self, key: &str) -> Option<&Node> {
        self.position(key).ok().map(|k| &self.0[k].1)
    }

    pub(crate) fn get_mut(&mut self, key: &str) -> Option<&mut Node> {
        self.position(key).ok().map(|k| &mut self.0[k].1)
    }

    /// The value of a key, an implied table if there was none.
    fn entry(&mut self, key: &str) -> &mut Node {
        let k = self.position(key).unwrap_or_else(|k| {
            let node = Node { origin: Origin::Implied, value: Value::Table(Self::default()) };
            self.0.insert(k, (key.into(), node));
            k
        });
        &mut self.0[k].1
    }

    pub(crate) fn remove(&mut self, key: &str) -> bool {
        self.position(key).is_ok_and(|k| {
            self.0.remove(k);
            true
        })
    }
}

/// An integer that a `i64` does not hold.
pub(crate) struct Oversized {
    pub(crate) path: Path,
    pub(crate) origin: Origin,
    pub(crate) text: String,
}

/// Makes trees from the output of the TOML parser, and collects integers out of range; their keys are left
/// out.
#[derive(Default)]
pub(crate) struct Converter {
    path: Path,
    /// The override that is converted; none: the file.
    overridden_by: Option<u32>,
    pub(crate) oversized: Vec<Oversized>,
}

impl Converter {
    /// For the value of an override at `path`.
    pub(crate) fn of_override(number: u32, path: Path) -> Self {
        Self { path, overridden_by: Some(number), oversized: Vec::new() }
    }

    fn origin(&self, span: Range<usize>) -> Origin {
        self.overridden_by.map_or_else(|| Origin::file(span), Origin::Override)
    }

    pub(crate) fn table(&mut self, table: DeTable) -> Table {
        // In alphabetical order already.
        let mut out = Vec::with_capacity(table.len());
        for (key, value) in table {
            let origin = self.origin(key.span());
            let name = key.into_inner();
            self.path.push(name.to_string());
            if let Some(value) = self.value(value.into_inner(), origin) {
                out.push((name.into(), Node { origin, value }));
            }
            self.path.pop();
        }
        Table(out)
    }

    fn array(&mut self, array: DeArray) -> Vec<Node> {
        let mut out = Vec::with_capacity(array.len());
        for (k, element) in array.into_iter().enumerate() {
            let origin = self.origin(element.span());
            self.path.push(k.to_string());
            // A placeholder for the missing element, so that no other index changes.
            let value = self.value(element.into_inner(), origin).unwrap_or(Value::Integer(0));
            out.push(Node { origin, value });
            self.path.pop();
        }
        out
    }

    pub(crate) fn spanned(&mut self, value: Spanned<DeValue>) -> Option<Node> {
        let origin = self.origin(value.span());
        self.value(value.into_inner(), origin).map(|value| Node { origin, value })
    }

    fn value(&mut self, value: DeValue, origin: Origin) -> Option<Value> {
        Some(match value {
            DeValue::String(text) => Value::Text(text.into()),
            DeValue::Boolean(value) => Value::Boolean(value),
            DeValue::Datetime(value) => Value::Date(value.to_string().into()),
            DeValue::Integer(integer) => {
                let Ok(integer) = i64::from_str_radix(integer.as_str(), integer.radix()) else {
                    let (path, text) = (self.path.clone(), integer.to_string());
                    self.oversized.push(Oversized { path, origin, text });
                    return None;
                };
                Value::Integer(integer)
            }
            DeValue::Float(float) => Value::Float(float.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Table(table) => Value::Table(self.table(table)),
            DeValue::Array(array) => Value::Array(self.array(array)),
        })
    }
}

/// Values at paths.
impl Node {
    pub(crate) fn child(&self, segment: &str) -> Option<&Self> {
        match &self.value {
            Value::Table(table) => table.get(segment),
            Value::Array(array) => array.get(segment.parse::<usize>().ok()?),
            _ => None,
        }
    }

    fn child_mut(&mut self, segment: &str) -> Option<&mut Self> {
        match &mut self.value {
            Value::Table(table) => table.get_mut(segment),
            Value::Array(array) => array.get_mut(segment.parse::<usize>().ok()?),
            _ => None,
        }
    }

    pub(crate) fn get(&self, path: &[String]) -> Option<&Self> {
        path.iter().try_fold(self, |node, segment| node.child(segment))
    }

    pub(crate) fn get_mut(&mut self, path: &[String]) -> Option<&mut Self> {
        path.iter().try_fold(self, |node, segment| node.child_mut(segment))
    }

    /// Sets the value at a path, and creates the tables above it.
    pub(crate) fn set(&mut self, path: &[String], value: Self) -> Result<(), String> {
        let mut here = self;
        for (k, segment) in path.iter().enumerate() {
            here = match &mut here.value {
                Value::Table(table) => table.entry(segment),
                Value::Array(array) => {
                    let index = segment.parse::<usize>().map_err(|_| "not an index".to_owned())?;
                    array.get_mut(index).ok_or("no such element")?
                }
                other => {
                    let outer = path[..k].join(".");
                    return Err(format!("`{outer}` is {}, not a table: set it as a whole", other.kind()));
                }
            };
        }
        *here = value;
        Ok(())
    }

    /// Removes the key at `path`; an array is removed as a whole, so that no other index changes. The first
    /// `fixed` segments are never removed.
    pub(crate) fn take_out(&mut self, path: &[String], fixed: usize) -> bool {
        for k in (fixed..path.len()).rev() {
            if let Some(Self { value: Value::Table(table), .. }) = self.get_mut(&path[..k]) {
                return table.remove(&path[k]);
            }
        }
        false
    }

    /// Whether an override has set this value or one in it.
    pub(crate) fn has_override(&self) -> bool {
        matches!(self.origin, Origin::Override(_))
            || match &self.value {
                Value::Table(table) => table.0.iter().any(|(_, node)| node.has_override()),
                Value::Array(array) => array.iter().any(Self::has_override),
                _ => false,
            }
    }

    /// The `name` of an array element.
    pub(crate) fn name(&self) -> Option<&str> {
        match &self.child("name")?.value {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }
}

/// Longest value in a message [characters].
const SHOWN: usize = 60;

impl Value {
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Text(_) => "a string",
            Self::Integer(_) => "an integer",
            Self::Float(_) => "a number",
            Self::Boolean(_) => "a boolean",
            Self::Date(_) => "a date",
            Self::Array(_) => "an array",
            Self::Table(_) => "a table",
        }
    }

    /// The value as TOML on one line, cut after a maximum length.
    pub(crate) fn show(&self) -> String {
        let mut out = String::new();
        match self {
            Self::Table(Table(keys)) => {
                let keys: Vec<_> =
                    keys.iter().take(6).map(|(key, _)| crate::source::text::cut(key, SHOWN)).collect();
                out = format!("{{ {} … }}", keys.join(", "));
            }
            Self::Array(array) if array.iter().any(|node| matches!(node.value, Self::Table(_))) => {
                out = format!("[{} tables]", array.len());
            }
            other => other.write(&mut out),
        }
        crate::source::text::cut(&out, SHOWN).into_owned()
    }

    /// Appends the value up to the maximum length.
    fn write(&self, out: &mut String) {
        match self {
            Self::Text(text) => out.push_str(&quoted(text)),
            Self::Integer(value) => *out += &value.to_string(),
            Self::Float(value) if value.is_nan() => out.push_str("nan"),
            // Writing to a string cannot fail.
            Self::Float(value) => drop(write!(out, "{value:?}")),
            Self::Boolean(value) => out.push_str(if *value { "true" } else { "false" }),
            Self::Date(text) => out.push_str(text),
            Self::Array(array) => {
                out.push('[');
                for (k, node) in array.iter().enumerate() {
                    if out.len() > 4 * SHOWN {
                        break;
                    }
                    if k > 0 {
                        out.push_str(", ");
                    }
                    node.value.write(out);
                }
                out.push(']');
            }
            Self::Table(_) => out.push_str("{ … }"),
        }
    }
}

/// The text as a TOML string up to the maximum length. Control characters are escaped when it is printed.
fn quoted(text: &str) -> String {
    let text = crate::source::text::cut(text, SHOWN);
    if text.contains(char::is_control) {
        return format!("\"{text}\"");
    }
    toml::Value::String(text.into_owned()).to_string()
}
