//! The JSON Schema of scene files.

use serde_json::Value;

use crate::config::SceneConfig;

/// JSON Schema (2020-12) of scene files: every key with its description and range.
pub fn schema() -> Value {
    let mut schema = schemars::schema_for!(SceneConfig).to_value();
    drop_null(&mut schema);
    if let Some(root) = schema.as_object_mut() {
        root.insert("title".into(), "haff scene".into());
    }
    schema
}

/// Optional keys are left out in TOML, which has no null; schemars allows null for them.
fn drop_null(value: &mut Value) {
    match value {
        Value::Object(map) => {
            map.values_mut().for_each(drop_null);
            if let Some(Value::Array(types)) = map.get_mut("type") {
                types.retain(|kind| kind != "null");
                if let [only] = types.as_slice() {
                    let only = only.clone();
                    map.insert("type".into(), only);
                }
            }
            if let Some(Value::Array(choices)) = map.get_mut("anyOf") {
                choices.retain(|choice| choice.get("type").is_none_or(|kind| kind != "null"));
            }
            // serde writes `null` for missing keys.
            if map.get("default").is_some_and(Value::is_null) {
                map.remove("default");
            }
        }
        Value::Array(values) => values.iter_mut().for_each(drop_null),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn required_keys_are_named_and_exist() {
        let schema = schema();
        let required = |table: &str| schema["$defs"][table]["required"].as_array().map_or(0, Vec::len);
        assert_eq!((required("ShearConfig"), required("PlaneConfig"), required("RodConfig")), (3, 2, 1));
        for (name, table) in schema["$defs"].as_object().unwrap() {
            for key in table["required"].as_array().into_iter().flatten() {
                let key = key.as_str().unwrap();
                assert!(table["properties"].get(key).is_some(), "{name}.{key}");
            }
        }
    }
}
