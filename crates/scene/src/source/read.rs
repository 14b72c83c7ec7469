//! Deserializes structures from a tree of values. All unknown keys are collected, and an error has the path
//! of its value.
//!
//! serde's `deny_unknown_fields` ends at the first unknown key. Here only known keys are passed to a
//! structure.

use std::cell::{Cell, RefCell};
use std::fmt;
use std::marker::PhantomData;

use serde::de::{
    self, Deserialize, DeserializeSeed, Deserializer, Expected, IntoDeserializer, MapAccess, SeqAccess,
    Unexpected, Visitor,
};
use serde::forward_to_deserialize_any;

use crate::source::error::{Code, Why};
use crate::source::tree::{Node, Path, Table, Value};

/// Unknown keys of one table.
pub(crate) struct Unknown {
    pub(crate) table: Path,
    /// As in the tree, in alphabetical order.
    pub(crate) keys: Vec<Box<str>>,
    pub(crate) known: &'static [&'static str],
}

/// A value of the wrong type, with a message for users.
#[derive(Debug)]
pub(crate) struct Misfit {
    pub(crate) why: Why,
    /// Set when the error is returned through its value.
    pub(crate) path: Option<Path>,
}

/// Result of reading.
pub(crate) struct Reading<T> {
    pub(crate) result: Result<T, Misfit>,
    pub(crate) unknown: Vec<Unknown>,
}

/// Reads the value `node` at `path`. Arrays that `skipped` names are read as empty ones.
pub(crate) fn read<'de, T: Deserialize<'de>>(
    node: &'de Node,
    path: &[String],
    skipped: &[&[&str]],
) -> Reading<T> {
    let notes = Notes { unknown: RefCell::new(Vec::new()), skipped };
    let result = T::deserialize(Reader { node, place: &Place::Start(path), notes: &notes });
    Reading { result, unknown: notes.unknown.into_inner() }
}

struct Notes<'x> {
    unknown: RefCell<Vec<Unknown>>,
    skipped: &'x [&'x [&'x str]],
}

/// A path as a linked list on the stack, which is built only for errors.
enum Place<'x> {
    Start(&'x [String]),
    Key(&'x Place<'x>, &'x str),
    Index(&'x Place<'x>, usize),
}

impl Place<'_> {
    fn path(&self) -> Path {
        match self {
            Self::Start(path) => path.to_vec(),
            Self::Key(outer, key) => {
                let mut path = outer.path();
                path.push((*key).to_owned());
                path
            }
            Self::Index(outer, index) => {
                let mut path = outer.path();
                path.push(index.to_string());
                path
            }
        }
    }

    fn is(&self, path: &[&str]) -> bool {
        match (self, path) {
            (Self::Start(start), path) => start.iter().map(String::as_str).eq(path.iter().copied()),
            (Self::Key(outer, key), [rest @ .., last]) => key == last && outer.is(rest),
            (Self::Key(..), []) | (Self::Index(..), _) => false,
        }
    }
}

#[derive(Clone, Copy)]
struct Reader<'de, 'x> {
    node: &'de Node,
    place: &'x Place<'x>,
    notes: &'x Notes<'x>,
}

impl<'de> Reader<'de, '_> {
    fn table<V: Visitor<'de>>(
        self,
        table: &'de Table,
        known: Option<&'static [&'static str]>,
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        if let Some(known) = known {
            let strange = |key: &str| !known.contains(&key);
            if table.0.iter().any(|(key, _)| strange(key)) {
                let keys = table.0.iter().map(|(key, _)| key).filter(|key| strange(key)).cloned().collect();
                let table = self.place.path();
                self.notes.unknown.borrow_mut().push(Unknown { table, keys, known });
            }
        }
        visitor.visit_map(Entries { rest: table.0.iter(), value: None, known, reader: self })
    }

    fn visit<V: Visitor<'de>>(
        self,
        known: Option<&'static [&'static str]>,
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        let result = match &self.node.value {
            Value::Text(text) => visitor.visit_borrowed_str(text),
            Value::Integer(value) => visitor.visit_i64(*value),
            Value::Float(value) => visitor.visit_f64(*value),
            Value::Boolean(value) => visitor.visit_bool(*value),
            Value::Date(_) => Err(de::Error::invalid_type(Unexpected::Other("a date"), &visitor)),
            Value::Array(array) => {
                let skipped = self.notes.skipped.iter().any(|path| self.place.is(path));
                let rest = if skipped { [].iter() } else { array.iter() };
                visitor.visit_seq(Elements { rest, index: 0, reader: self })
            }
            Value::Table(table) => self.table(table, known, visitor),
        };
        result.map_err(|misfit: Misfit| misfit.at(self.place))
    }
}

impl<'de> Deserializer<'de> for Reader<'de, '_> {
    type Error = Misfit;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        self.visit(None, visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        visitor.visit_some(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        known: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        self.visit(Some(known), visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        let result = match &self.node.value {
            Value::Text(text) => visitor.visit_enum((**text).into_deserializer()),
            other => Err(Misfit::kind("a string", other.kind())),
        };
        result.map_err(|misfit| misfit.at(self.place))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct
        newtype_struct seq tuple tuple_struct map identifier ignored_any
    }
}

struct Entries<'de, 'x> {
    rest: std::slice::Iter<'de, (Box<str>, Node)>,
    value: Option<(&'de str, &'de Node)>,
    known: Option<&'static [&'static str]>,
    reader: Reader<'de, 'x>,
}

impl<'de> MapAccess<'de> for Entries<'de, '_> {
    type Error = Misfit;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, Misfit> {
        let known = self.known;
        let Some((key, node)) = self.rest.find(|(key, _)| known.is_none_or(|known| known.contains(&&**key)))
        else {
            return Ok(None);
        };
        self.value = Some((key, node));
        seed.deserialize((**key).into_deserializer()).map(Some)
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, Misfit> {
        let Some((key, node)) = self.value.take() else {
            return Err(de::Error::custom("a value was read before its key"));
        };
        let place = Place::Key(self.reader.place, key);
        seed.deserialize(Reader { node, place: &place, notes: self.reader.notes })
    }
}

struct Elements<'de, 'x> {
    rest: std::slice::Iter<'de, Node>,
    index: usize,
    reader: Reader<'de, 'x>,
}

impl<'de> SeqAccess<'de> for Elements<'de, '_> {
    type Error = Misfit;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Misfit> {
        let Some(node) = self.rest.next() else { return Ok(None) };
        let place = Place::Index(self.reader.place, self.index);
        self.index += 1;
        seed.deserialize(Reader { node, place: &place, notes: self.reader.notes }).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.rest.len())
    }
}

impl Misfit {
    fn kind(expected: &str, found: &str) -> Self {
        let why = Why::new(Code::Type, format!("must be {expected}, not {found}"));
        Self { why: Why { allowed: Some(expected.to_owned()), ..why }, path: None }
    }

    /// An error belongs to the innermost value that it is returned through.
    fn at(mut self, place: &Place) -> Self {
        self.path.get_or_insert_with(|| place.path());
        self
    }
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.why.message)
    }
}

impl std::error::Error for Misfit {}

/// serde's errors as messages for users.
impl de::Error for Misfit {
    fn custom<M: fmt::Display>(message: M) -> Self {
        Self { why: Why::new(Code::Value, message.to_string()), path: None }
    }

    fn invalid_type(found: Unexpected, expected: &dyn Expected) -> Self {
        let found = match found {
            Unexpected::Str(_) => "a string",
            Unexpected::Signed(_) | Unexpected::Unsigned(_) => "an integer",
            Unexpected::Float(_) => "a number with a fraction",
            Unexpected::Bool(_) => "a boolean",
            Unexpected::Seq => "an array",
            Unexpected::Map => "a table",
            Unexpected::Other(found) => found,
            _ => "something else",
        };
        let expected = expected.to_string();
        let expected = match expected.as_str() {
            "f64" => "a number",
            "i64" => "an integer",
            "a sequence" => "an array",
            text if text.starts_with("struct ") => "a table",
            text => text,
        };
        Self::kind(expected, found)
    }

    fn invalid_value(_: Unexpected, expected: &dyn Expected) -> Self {
        Self { why: Why::value(format!("must be {expected}")), path: None }
    }

    fn unknown_variant(_: &str, known: &'static [&'static str]) -> Self {
        let known: Vec<String> = known.iter().map(|name| format!("\"{name}\"")).collect();
        Self { why: Why::value(format!("must be one of {}", known.join(", "))), path: None }
    }
}

/// The keys of a structure, for values that may be written as a table or in another shape.
pub(crate) fn keys_of<'de, T: Deserialize<'de>>() -> &'static [&'static str] {
    let keys = Cell::new(&[][..]);
    // The probe gives no value: it only records the fields requested.
    let _ = T::deserialize(Probe { keys: &keys, value: PhantomData });
    keys.get()
}

struct Probe<'x, 'de> {
    keys: &'x Cell<&'static [&'static str]>,
    value: PhantomData<&'de ()>,
}

impl<'de> Deserializer<'de> for Probe<'_, 'de> {
    type Error = de::value::Error;

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Self::Error> {
        Err(de::Error::custom("a probe"))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        keys: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Self::Error> {
        self.keys.set(keys);
        self.deserialize_any(visitor)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map enum identifier ignored_any
    }
}
