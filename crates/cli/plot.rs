//! `haff plot`: hands over to the Python package.

use std::{env, path::PathBuf, process::Command};

use crate::{
    arguments::Plot,
    failure::{Failure, Status},
};

/// The Python interpreter of the environment that this command is installed in, or the one on the path.
fn interpreter() -> PathBuf {
    let beside = env::current_exe().ok().and_then(|path| path.parent().map(PathBuf::from));
    beside
        .into_iter()
        .flat_map(|folder| ["python3", "python", "python.exe"].map(|name| folder.join(name)))
        .find(|path| path.is_file())
        .unwrap_or_else(|| PathBuf::from("python3"))
}

/// Runs `python -m haff plot …` and returns its exit status.
pub fn plot(options: &Plot) -> Result<u8, Failure> {
    let python = interpreter();
    let status =
        Command::new(&python).args(["-m", "haff", "plot"]).args(&options.arguments).status().map_err(
            |error| {
                Failure::new(
                    Status::File,
                    format!(
                        "{}: {error}; `haff plot` needs the Python package haff: pip install .",
                        python.display()
                    ),
                )
            },
        )?;
    Ok(status.code().map_or(1, |code| code as u8))
}
