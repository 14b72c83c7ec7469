//! Commands written in Python, such as `haff plot`: handed over to the package haff.

use std::{env, ffi::OsString, path::PathBuf, process::Command};

use crate::failure::{Failure, Status};

/// What the interpreter runs: `python -m haff`, and an exit status of its own if there is no package haff.
const PROGRAM: &str = "\
import importlib.util, runpy, sys
if importlib.util.find_spec('haff') is None:
    sys.exit(127)
runpy.run_module('haff', run_name='__main__', alter_sys=True)";

const NO_PACKAGE: i32 = 127;

/// The Python interpreter of the environment that this command is installed in, or the one on the path.
fn interpreter() -> PathBuf {
    let beside = env::current_exe().ok().and_then(|path| path.parent().map(PathBuf::from));
    beside
        .into_iter()
        .flat_map(|folder| ["python3", "python", "python.exe"].map(|name| folder.join(name)))
        .find(|path| path.is_file())
        .unwrap_or_else(|| PathBuf::from("python3"))
}

/// Runs `python -m haff COMMAND …` and returns its exit status.
pub fn run(command: &str, arguments: &[OsString]) -> Result<u8, Failure> {
    let python = interpreter();
    let missing = |reason: String| {
        let needs = format!(
            "`haff {command}` needs the Python package haff: pip install haff, or pip install . in its sources"
        );
        Failure::new(Status::File, format!("{}: {reason}; {needs}", python.display()))
    };
    let status = Command::new(&python)
        .args(["-c", PROGRAM, command])
        .args(arguments)
        .status()
        .map_err(|error| missing(error.to_string()))?;
    match status.code() {
        Some(NO_PACKAGE) => Err(missing("no package haff".to_owned())),
        code => Ok(code.map_or(1, |code| code as u8)),
    }
}
