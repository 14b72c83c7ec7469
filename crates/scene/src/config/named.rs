//! Schemas of names that plug-ins can add.

use crate::plugins::{drive_names, law_names, probe_names, surface_names};

/// The schema of a name; of any, if there is none: an empty choice is not valid in some drafts.
pub(crate) fn one_of(names: &[&str]) -> schemars::Schema {
    if names.is_empty() {
        return schemars::json_schema!({ "type": "string" });
    }
    schemars::json_schema!({ "type": "string", "enum": names })
}

/// The schema of the name of a law of restitution.
pub(crate) fn names_of_laws(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    one_of(&law_names())
}

/// The schema of the name of a surface.
pub(crate) fn names_of_surfaces(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    one_of(&surface_names())
}

/// The schema of the name of a probe.
pub(crate) fn names_of_probes(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    one_of(&probe_names())
}

/// Adds the drives of plug-ins to the schema of those of haff.
pub(crate) fn add_names_of_drives(schema: &mut schemars::Schema) {
    if !drive_names().is_empty()
        && let Some(choices) = schema.get_mut("anyOf").and_then(serde_json::Value::as_array_mut)
    {
        choices.push(serde_json::json!({ "type": "string", "enum": drive_names() }));
    }
}
