//! Messages in the words of their reader: options for a user of the command, arguments for a caller in
//! Python.
//!
//! The Python package sets `HAFF_WORDS=python` for the commands that it runs. Where a message names an
//! option, both forms are beside each other.

use std::{env, fmt::Display, sync::OnceLock};

pub use haff_scene::Words;

/// Whose words messages are in.
pub fn words() -> Words {
    static WORDS: OnceLock<Words> = OnceLock::new();
    *WORDS.get_or_init(|| match env::var_os("HAFF_WORDS") {
        Some(name) if name == "python" => Words::Python,
        _ => Words::Command,
    })
}

/// One of two forms of a message or of a part of it.
pub fn say<T>(command: T, python: T) -> T {
    match words() {
        Words::Command => command,
        Words::Python => python,
    }
}

/// "(-o)", or "(NAME=…)" with the argument of Python.
pub fn output_option(argument: &str) -> String {
    say("(-o)".to_owned(), format!("({argument}=…)"))
}

/// A key and its value: `--set KEY=VALUE`, or `KEY=VALUE`.
pub fn set(text: impl Display) -> String {
    format!("{}{text}", say("--set ", ""))
}
