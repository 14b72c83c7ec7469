//! Elements of arrays by their names, for overrides.

use std::collections::HashMap;

use crate::source::tree::{Node, Path, Value};

/// Elements of arrays by their names, looked up once for all overrides.
#[derive(Default)]
pub(crate) struct NamedElements(HashMap<Path, HashMap<String, Vec<usize>>>);

impl NamedElements {
    /// Removes entries that an override of `path` may change.
    pub(crate) fn forget(&mut self, path: &[String]) {
        // A key of an element other than its name changes no name; everything else may.
        let deep = self.0.keys().all(|list| path.len() > list.len() + 1);
        if !deep || path.last().is_some_and(|last| last == "name") {
            self.0.clear();
        }
    }

    /// Turns names of array elements into indices; a name that several particles share refers to all of
    /// them.
    pub(crate) fn expand(&mut self, root: &Node, path: &[String]) -> Result<Vec<Path>, String> {
        let mut targets: Vec<Path> = vec![Vec::new()];
        for segment in path {
            let mut next = Vec::with_capacity(targets.len());
            for mut target in targets {
                let Some(Node { value: Value::Array(array), .. }) = root.get(&target) else {
                    target.push(segment.clone());
                    next.push(target);
                    continue;
                };
                if let Ok(index) = segment.parse::<usize>() {
                    if index >= array.len() {
                        let (list, len) = (target.join("."), array.len());
                        return Err(format!("`{list}` has {len} elements, counted from 0"));
                    }
                    target.push(index.to_string());
                    next.push(target);
                    continue;
                }
                let names = self.0.entry(target.clone()).or_insert_with(|| by_name(array));
                let Some(named) = names.get(segment) else {
                    let list = target.join(".");
                    let known = crate::source::text::some_of(array.iter().filter_map(Node::name));
                    return Err(format!(
                        "nothing in `{list}` is named `{segment}`; take a name ({known}) or an index"
                    ));
                };
                next.extend(named.iter().map(|k| [target.as_slice(), &[k.to_string()]].concat()));
            }
            targets = next;
        }
        Ok(targets)
    }
}

fn by_name(array: &[Node]) -> HashMap<String, Vec<usize>> {
    let mut names: HashMap<String, Vec<usize>> = HashMap::new();
    for (k, node) in array.iter().enumerate() {
        if let Some(name) = node.name() {
            names.entry(name.to_owned()).or_default().push(k);
        }
    }
    names
}
