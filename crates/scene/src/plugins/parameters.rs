//! The parameters of a plug-in in a scene.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::source::error::{Code, Why};

/// As in the scene, by key.
pub(crate) type Given = BTreeMap<String, Value>;

/// What is wrong with a parameter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Fault {
    pub key: String,
    pub why: Why,
}

/// The parameters that a scene gives to a plug-in.
///
/// Each method reads one of them and checks its range. Faults are collected: the method then returns a value
/// in the range, and the scene is refused with the place, the value and what is allowed. So are parameters
/// that nothing has read.
#[derive(Debug)]
pub struct Parameters<'a> {
    given: &'a Given,
    read: Vec<&'static str>,
    faults: Vec<Fault>,
}

impl<'a> Parameters<'a> {
    pub(super) fn new(given: &'a Given) -> Self {
        Self { given, read: Vec::new(), faults: Vec::new() }
    }

    /// Whether a parameter is given: for one that may be left out.
    pub fn has(&mut self, key: &'static str) -> bool {
        self.note(key);
        self.given.contains_key(key)
    }

    /// A finite number.
    pub fn number(&mut self, key: &'static str) -> f64 {
        self.checked(key, "must be a finite number", 0.0, |_| true)
    }

    /// A number above 0.
    pub fn positive(&mut self, key: &'static str) -> f64 {
        self.checked(key, "must be a positive number", 1.0, |value| value > 0.0)
    }

    /// A number that is 0 or more.
    pub fn not_negative(&mut self, key: &'static str) -> f64 {
        self.checked(key, "must be 0 or a positive number", 0.0, |value| value >= 0.0)
    }

    /// A number from 0 to 1.
    pub fn fraction(&mut self, key: &'static str) -> f64 {
        self.checked(key, "must be in [0, 1]", 0.0, |value| (0.0..=1.0).contains(&value))
    }

    /// A fault that only the plug-in knows, of a parameter that is given; `why` is the end of a sentence,
    /// such as "must be below speed".
    pub fn refuse(&mut self, key: &'static str, why: impl Into<String>) {
        self.note(key);
        self.faults.push(Fault { key: key.to_owned(), why: Why::stated(why) });
    }

    fn note(&mut self, key: &'static str) {
        if !self.read.contains(&key) {
            self.read.push(key);
        }
    }

    fn checked(&mut self, key: &'static str, must: &str, instead: f64, allows: impl Fn(f64) -> bool) -> f64 {
        self.note(key);
        let fault = |why: Why| Fault { key: key.to_owned(), why };
        let Some(value) = self.given.get(key) else {
            self.faults.push(fault(Why::new(Code::Missing, "missing: this model needs it")));
            return instead;
        };
        let value = value.as_f64().filter(|value| value.is_finite() && allows(*value));
        value.unwrap_or_else(|| {
            self.faults.push(fault(Why::value(must)));
            instead
        })
    }

    /// What is wrong, besides parameters that nothing has read.
    pub(super) fn end(mut self) -> Result<(), Vec<Fault>> {
        let known = if self.read.is_empty() { "it has none".to_owned() } else { self.read.join(", ") };
        for key in self.given.keys().filter(|key| !self.read.contains(&key.as_str())) {
            let why = format!("is no parameter of this model: {known}");
            let why = Why { allowed: Some(known.clone()), ..Why::new(Code::UnknownKey, why) };
            self.faults.push(Fault { key: key.clone(), why });
        }
        if self.faults.is_empty() { Ok(()) } else { Err(self.faults) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_faults_are_collected_with_their_keys() {
        let given = |text: &str| -> Given { serde_json::from_str(text).unwrap() };
        let ends = |text: &str, read: fn(&mut Parameters)| {
            let given = given(text);
            let mut parameters = Parameters::new(&given);
            read(&mut parameters);
            parameters.end().map_err(|faults| {
                faults
                    .into_iter()
                    .map(|fault| format!("{}: {}", fault.key, fault.why.message))
                    .collect::<Vec<_>>()
            })
        };
        assert_eq!(
            ends(r#"{"e": 1, "v": 2.5}"#, |p| assert_eq!(p.fraction("e") + p.positive("v"), 3.5)),
            Ok(())
        );
        let faults = ends(r#"{"e": 1.5, "v": "fast", "w": null, "x": 0}"#, |p| {
            let read = [p.fraction("e"), p.not_negative("v"), p.number("w"), p.positive("u")];
            assert_eq!(read, [0.0, 0.0, 0.0, 1.0]);
        });
        let expected = [
            "e: must be in [0, 1]",
            "v: must be 0 or a positive number",
            "w: must be a finite number",
            "u: missing: this model needs it",
            "x: is no parameter of this model: e, v, w, u",
        ];
        assert_eq!(faults, Err(expected.map(str::to_owned).to_vec()));
        let faults = ends(r#"{"e": 1}"#, |p| {
            assert!(p.has("e") && !p.has("f"));
            p.refuse("e", "must be below f");
        });
        assert_eq!(faults, Err(vec!["e: must be below f".to_owned()]));
    }
}
