//! `haff man` and `haff completions`: the command line as clap describes it, for manuals and shells.

use std::{fs, path::Path};

use clap::CommandFactory;

use crate::{
    arguments::{Arguments, Completions, Man},
    terminal::{
        failure::{Failure, Status},
        output,
    },
};

/// Writes `haff.1` and a page for each subcommand into a folder.
pub fn man(options: &Man) -> Result<u8, Failure> {
    let folder: &Path = &options.folder;
    fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(Arguments::command(), folder))
        .map_err(|error| {
            Failure::new(Status::File, format!("{}: {}", output::path(folder), output::shown(error)))
        })?;
    Ok(0)
}

/// Prints the completions of a shell.
pub fn completions(options: &Completions) -> Result<u8, Failure> {
    let mut text = Vec::new();
    clap_complete::generate(options.shell, &mut Arguments::command(), "haff", &mut text);
    output::print(String::from_utf8_lossy(&text)).map(|()| 0)
}
