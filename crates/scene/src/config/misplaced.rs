//! Hints for unknown keys: where a key belongs, or its name here.

use std::sync::OnceLock;

use serde_json::Value;

use crate::config::schema::schema;
use crate::source::text::nearest;

/// Deepest table that is searched: `wall.motion.…`.
const DEPTH: usize = 3;
/// Places that a hint names, at most.
const NAMED: usize = 3;
/// Names of the field and of other programs, and the key here.
const SYNONYMS: [(&str, &str); 22] = [
    ("alpha", "restitution"),
    ("beta", "tangential_restitution"),
    ("boundaries", "boundary"),
    ("box", "size"),
    ("coefficient_of_restitution", "restitution"),
    ("cor", "restitution"),
    ("diameter", "radius"),
    ("duration", "until"),
    ("e", "restitution"),
    ("epsilon", "restitution"),
    ("filename", "file"),
    ("g", "gravity"),
    ("l", "size"),
    ("m", "mass"),
    ("mu", "friction"),
    ("n", "count"),
    ("number", "count"),
    ("phi", "packing_fraction"),
    ("r", "radius"),
    ("t_end", "until"),
    ("t_max", "until"),
    ("volume_fraction", "packing_fraction"),
];

/// A key of scene files.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Key {
    /// The table that it is in; empty above all tables.
    table: Vec<String>,
    /// How many of the first names of `table` make an array of tables; 0 for none.
    array: usize,
    name: String,
    /// Whether its table needs it.
    is_required: bool,
}

/// A key that an unknown one may stand for.
#[derive(Debug, PartialEq)]
pub(crate) enum Meant {
    /// Of the same table, with its full name.
    Beside(Key),
    /// Of the same table, and nearly the same.
    Near(String),
    /// Of another table.
    Elsewhere(Key),
}

impl Meant {
    /// The key for messages: "`run.until`, in [run]".
    pub(crate) fn show(&self) -> String {
        match self {
            Self::Near(name) => format!("`{name}`"),
            Self::Beside(key) => format!("`{}`", key.dotted()),
            Self::Elsewhere(key) if key.table.is_empty() => format!("`{}`, above all tables", key.name),
            Self::Elsewhere(key) => {
                let table = key.table.join(".");
                let header =
                    if key.array == key.table.len() { format!("[[{table}]]") } else { format!("[{table}]") };
                format!("`{}`, in {header}", key.dotted())
            }
        }
    }

    /// The path of the key for an unknown one of the table `path`: of another array of tables in the first
    /// one.
    pub(crate) fn path(&self, path: &[String]) -> String {
        let (mut table, name) = match self {
            Self::Near(name) | Self::Beside(Key { name, .. }) => (path.to_vec(), name),
            Self::Elsewhere(key) => (key.table.clone(), &key.name),
        };
        if let Self::Elsewhere(Key { array: depth @ 1.., .. }) = self {
            table.insert(*depth, "0".to_owned());
        }
        table.push(name.clone());
        table.join(".")
    }
}

impl Key {
    fn dotted(&self) -> String {
        self.table.iter().chain([&self.name]).map(String::as_str).collect::<Vec<_>>().join(".")
    }
}

/// What an unknown key of the table `path` may stand for: a name of the field, a key of another table, or a
/// key of this one with nearly the same name. Positions in an array are no part of the path of a table.
pub(crate) fn meant(path: &[String], key: &str, known: &[&str]) -> Vec<Meant> {
    let written = key;
    let key = key.to_lowercase();
    let synonym = SYNONYMS.iter().find(|(name, _)| *name == key).map(|(_, meant)| *meant);
    let own: Vec<String> = path.iter().filter(|part| part.parse::<usize>().is_err()).cloned().collect();
    if let Some(meant) = synonym.filter(|meant| known.contains(meant)) {
        return vec![Meant::Beside(Key { table: own, array: 0, name: meant.to_owned(), is_required: false })];
    }
    let mut found: Vec<&Key> = Vec::new();
    for name in [synonym, Some(&*key)].into_iter().flatten() {
        found.extend(keys().iter().filter(|other| other.name == name && other.table != own));
        if !found.is_empty() {
            break;
        }
    }
    let depth = |key: &Key| (key.table.len(), key.array > 0 && key.array == key.table.len());
    let Some(least) = found.iter().map(|key| depth(key)).min() else {
        let near = nearest(written, known.iter().copied());
        return near.map(|name| Meant::Near(name.to_owned())).into_iter().collect();
    };
    found.retain(|key| depth(key) == least);
    found.sort_by_key(|key| !key.is_required);
    let first = found.into_iter().take(NAMED);
    first.map(|key| Meant::Elsewhere(key.clone())).collect()
}

/// All keys of scene files.
fn keys() -> &'static [Key] {
    static KEYS: OnceLock<Vec<Key>> = OnceLock::new();
    KEYS.get_or_init(|| {
        let schema = schema();
        let mut keys = Vec::new();
        collect(&schema, &schema, &mut Vec::new(), 0, &mut keys);
        keys
    })
}

/// Adds the keys of a table and of the tables in it.
fn collect(schema: &Value, node: &Value, table: &mut Vec<String>, array: usize, keys: &mut Vec<Key>) {
    for (key, value) in node["properties"].as_object().into_iter().flatten() {
        let is_required =
            node["required"].as_array().is_some_and(|names| names.iter().any(|name| name == key.as_str()));
        keys.push(Key { table: table.clone(), array, name: key.clone(), is_required });
        if table.len() < DEPTH {
            table.push(key.clone());
            descend(schema, value, table, array, keys);
            table.pop();
        }
    }
}

/// Follows references, choices and arrays to tables.
fn descend(schema: &Value, node: &Value, table: &mut Vec<String>, array: usize, keys: &mut Vec<Key>) {
    if let Some(name) = node["$ref"].as_str().and_then(|path| path.strip_prefix("#/$defs/")) {
        descend(schema, &schema["$defs"][name], table, array, keys);
    }
    for choices in ["anyOf", "oneOf", "allOf"] {
        for choice in node[choices].as_array().into_iter().flatten() {
            descend(schema, choice, table, array, keys);
        }
    }
    if node["items"].is_object() {
        descend(schema, &node["items"], table, table.len(), keys);
    }
    collect(schema, node, table, array, keys);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(path: &[&str], key: &str, known: &[&str]) -> Option<String> {
        let path: Vec<String> = path.iter().map(|&part| part.to_owned()).collect();
        meant(&path, key, known).first().map(Meant::show)
    }

    #[test]
    fn keys_of_other_tables_and_other_names_are_found() {
        let cases = [
            (&[][..], "until", "`run.until`, in [run]"),
            (&[], "restitution", "`contact.restitution`, in [contact]"),
            (&["contact"], "until", "`run.until`, in [run]"),
            (&["run"], "title", "`title`, above all tables"),
            (&[], "phi", "`domain.packing_fraction`, in [domain]"),
            (&["output"], "count", "`species.count`, in [[species]]"),
        ];
        for (path, key, hint) in cases {
            assert_eq!(found(path, key, &[]).as_deref(), Some(hint), "{path:?} {key}");
        }
        assert_eq!(found(&["contact"], "e", &["restitution"]).as_deref(), Some("`contact.restitution`"));
        assert_eq!(found(&["species", "0"], "N", &["count"]).as_deref(), Some("`species.count`"));
        assert_eq!(found(&["run"], "colour", &["until"]), None);
    }

    #[test]
    fn paths_have_the_position_in_arrays_of_tables() {
        let cases = [
            (&[][..], "until", &[][..], &["run.until"][..]),
            (&["run"], "title", &[], &["title"]),
            (&["species", "1"], "N", &["count"], &["species.1.count"]),
            (&["run"], "untl", &["until"], &["run.until"]),
            (&[], "amplitude", &[], &["wall.0.motion.amplitude"]),
            (&[], "mass", &[], &["particle.0.mass", "species.0.mass", "wall.0.mass"]),
            (&[], "between", &[], &["rod.0.between", "spring.0.between"]),
        ];
        for (path, key, known, expected) in cases {
            let path: Vec<String> = path.iter().map(|&part| part.to_owned()).collect();
            let paths: Vec<String> = meant(&path, key, known).iter().map(|key| key.path(&path)).collect();
            assert_eq!(paths, expected, "{path:?} {key}");
        }
    }

    #[test]
    fn synonyms_are_in_order_and_stand_for_keys() {
        assert!(SYNONYMS.is_sorted());
        for (name, meant) in SYNONYMS {
            assert!(keys().iter().any(|key| key.name == meant), "{meant}");
            // A key with this name is one of another table, such as the box of a region.
            for key in keys().iter().filter(|key| key.name == meant) {
                let is_beside = |other: &Key| other.name == name && other.table == key.table;
                assert!(!keys().iter().any(is_beside), "{name} is a key");
            }
        }
    }
}
