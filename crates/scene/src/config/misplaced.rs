//! Hints for unknown keys: where a key belongs, or its name here.

use std::sync::OnceLock;

use serde_json::Value;

use crate::config::schema::schema;

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

/// A key of scene files: the table that it is in, and whether this is an array of tables.
#[derive(Debug, PartialEq)]
struct Place {
    table: Vec<String>,
    array: bool,
    key: String,
}

impl Place {
    /// The key with its table: "`run.until`, in [run]".
    fn show(&self) -> String {
        if self.table.is_empty() {
            return format!("`{}`, above all tables", self.key);
        }
        let table = self.table.join(".");
        let header = if self.array { format!("[[{table}]]") } else { format!("[{table}]") };
        format!("`{table}.{}`, in {header}", self.key)
    }
}

/// A hint for an unknown key of the table `path`, as "`run.until`, in [run]"; `None` if no table has the key
/// or one that it may stand for. Positions of an array are left out of the path of a table.
pub(crate) fn hint(path: &[String], key: &str, known: &[&str]) -> Option<String> {
    let key = key.to_lowercase();
    let meant = SYNONYMS.iter().find(|(name, _)| *name == key).map(|(_, meant)| *meant);
    let own: Vec<&String> = path.iter().filter(|part| part.parse::<usize>().is_err()).collect();
    if let Some(meant) = meant.filter(|meant| known.contains(meant)) {
        let full: Vec<&str> = own.iter().map(|part| part.as_str()).chain([meant]).collect();
        return Some(format!("`{}`", full.join(".")));
    }
    let mut found: Vec<&Place> = Vec::new();
    for name in [Some(&*key), meant].into_iter().flatten() {
        let places = places().iter().filter(|place| place.key == name);
        found.extend(places.filter(|place| !place.table.iter().eq(own.iter().copied())));
        if !found.is_empty() {
            break;
        }
    }
    let depth = |place: &Place| (place.table.len(), place.array);
    let least = found.iter().map(|place| depth(place)).min()?;
    let nearest = found.iter().filter(|place| depth(place) == least).take(NAMED);
    let near: Vec<String> = nearest.map(|place| place.show()).collect();
    Some(near.join(" or "))
}

/// All keys of scene files.
fn places() -> &'static [Place] {
    static PLACES: OnceLock<Vec<Place>> = OnceLock::new();
    PLACES.get_or_init(|| {
        let schema = schema();
        let mut places = Vec::new();
        collect(&schema, &schema, &mut Vec::new(), false, &mut places);
        places
    })
}

/// Adds the keys of a table and of the tables in it.
fn collect(schema: &Value, node: &Value, table: &mut Vec<String>, array: bool, places: &mut Vec<Place>) {
    for (key, value) in node["properties"].as_object().into_iter().flatten() {
        places.push(Place { table: table.clone(), array, key: key.clone() });
        if table.len() < DEPTH {
            table.push(key.clone());
            descend(schema, value, table, false, places);
            table.pop();
        }
    }
}

/// Follows references, choices and arrays to tables.
fn descend(schema: &Value, node: &Value, table: &mut Vec<String>, array: bool, places: &mut Vec<Place>) {
    if let Some(name) = node["$ref"].as_str().and_then(|path| path.strip_prefix("#/$defs/")) {
        descend(schema, &schema["$defs"][name], table, array, places);
    }
    for choices in ["anyOf", "oneOf", "allOf"] {
        for choice in node[choices].as_array().into_iter().flatten() {
            descend(schema, choice, table, array, places);
        }
    }
    if node["items"].is_object() {
        descend(schema, &node["items"], table, true, places);
    }
    collect(schema, node, table, array, places);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(path: &[&str], key: &str, known: &[&str]) -> Option<String> {
        let path: Vec<String> = path.iter().map(|&part| part.to_owned()).collect();
        hint(&path, key, known)
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
    fn synonyms_are_in_order_and_stand_for_keys() {
        assert!(SYNONYMS.is_sorted());
        for (name, meant) in SYNONYMS {
            assert!(places().iter().any(|place| place.key == meant), "{meant}");
            assert!(!places().iter().any(|place| place.key == name), "{name} is a key");
        }
    }
}
