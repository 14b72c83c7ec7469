//! Commands written in Python, such as `haff plot`: passed on to the package haff.

use std::{
    env,
    ffi::OsString,
    mem,
    path::{Path, PathBuf},
    process::Command,
};

use clap::CommandFactory;

use crate::{
    arguments::Arguments,
    failure::{Failure, Status},
    output,
};

/// The program for the interpreter: `python -m haff`, with a special exit status if there is no package haff.
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

/// The state in a file of another program, as `haff.foreign.main` writes it.
pub fn foreign_state(path: &Path, index: i64) -> Result<Vec<u8>, String> {
    /// As [`PROGRAM`].
    const READ: &str = "\
import importlib.util, sys
if importlib.util.find_spec('haff') is None:
    sys.exit(127)
from haff import foreign
sys.exit(foreign.main(sys.argv[1], int(sys.argv[2])))";
    let done = Command::new(interpreter()).args(["-c", READ]).arg(path).arg(index.to_string()).output();
    let needs = "needs the Python package haff: pip install . in the sources of haff";
    let done = done.map_err(|error| format!("{}: {needs}; {error}", path.display()))?;
    match done.status.code() {
        Some(0) => Ok(done.stdout),
        Some(NO_PACKAGE) => Err(format!("{}: {needs}", path.display())),
        _ => Err(String::from_utf8_lossy(&done.stderr).lines().last().unwrap_or("cannot be read").to_owned()),
    }
}

/// Runs `python -m haff COMMAND …` and returns its exit status.
pub fn run(command: &str, arguments: &[OsString]) -> Result<u8, Failure> {
    let python = interpreter();
    let missing = |reason: String| {
        let needs =
            format!("`haff {command}` needs the Python package haff: pip install . in the sources of haff");
        Failure::new(Status::File, format!("{}: {}; {needs}", output::path(&python), output::shown(reason)))
    };
    let done = Command::new(&python).args(["-c", PROGRAM, command]).args(arguments).status();
    let failure = match done.map(|status| status.code()) {
        Ok(Some(NO_PACKAGE)) => missing("no package haff".to_owned()),
        Ok(code) => return Ok(code.map_or(1, |code| code as u8)),
        Err(error) => missing(error.to_string()),
    };
    // Without the package, --help prints the description known to clap.
    if arguments.iter().any(|word| word == "-h" || word == "--help")
        && let Some(known) = Arguments::command().find_subcommand_mut(command)
    {
        output::print(mem::take(known).bin_name(format!("haff {command}")).render_help())?;
        return Ok(0);
    }
    Err(failure)
}
