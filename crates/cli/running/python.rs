//! Commands written in Python, such as `haff plot`: passed on to the package haff.

use std::{
    env,
    ffi::OsString,
    mem,
    os::unix::process::CommandExt,
    path::{Path, PathBuf},
    process::Command,
};

use clap::CommandFactory;

use crate::{
    arguments::Arguments,
    terminal::{
        failure::{Failure, Status},
        output,
    },
};

/// The program for the interpreter: `python -m haff`. Without a package haff it prints its first argument, or
/// ends with a special exit status if that is empty.
const PROGRAM: &str = "\
import importlib.util, runpy, sys
missing = sys.argv.pop(1)
if importlib.util.find_spec('haff') is None:
    if missing:
        print(missing, file=sys.stderr)
    sys.exit(4 if missing else 127)
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

/// The state in a file of another program, as `haff.files.foreign.main` writes it.
pub fn foreign_state(path: &Path, index: i64) -> Result<Vec<u8>, String> {
    /// As [`PROGRAM`].
    const READ: &str = "\
import importlib.util, sys
if importlib.util.find_spec('haff') is None:
    sys.exit(127)
from haff.files import foreign
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
///
/// The interpreter replaces this process, so that signals reach it.
pub fn run(command: &str, arguments: &[OsString]) -> Result<u8, Failure> {
    let python = interpreter();
    let missing = |reason: &str| {
        let needs =
            format!("`haff {command}` needs the Python package haff: pip install . in the sources of haff");
        format!("{}: {}; {needs}", output::path(&python), output::shown(reason))
    };
    let no_package = missing("no package haff");
    let program = |missing: &str| {
        let mut program = Command::new(&python);
        program.args(["-c", PROGRAM, missing, command]).args(arguments);
        program
    };
    let helps = arguments.iter().any(|word| word == "-h" || word == "--help");
    if !helps {
        let error = program(&format!("error: {no_package}")).exec();
        return Err(Failure::new(Status::File, missing(&error.to_string())));
    }
    let failure = match program("").status().map(|status| status.code()) {
        Ok(Some(NO_PACKAGE)) => no_package,
        Ok(code) => return Ok(code.map_or(1, |code| code as u8)),
        Err(error) => missing(&error.to_string()),
    };
    // Without the package, --help prints the description known to clap.
    if helps && let Some(known) = Arguments::command().find_subcommand_mut(command) {
        output::print(mem::take(known).bin_name(format!("haff {command}")).render_help())?;
        return Ok(0);
    }
    Err(Failure::new(Status::File, failure))
}
