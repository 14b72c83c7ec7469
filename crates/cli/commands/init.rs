//! `haff init` and `haff schema`.

use std::{fmt::Write as _, fs, path::Path};

use haff_scene::{Template, template, templates};

use crate::{
    arguments::Init,
    terminal::{
        failure::{Failure, Status},
        output::{line, message, path, print},
    },
};

/// Prints a shipped scene, or the list of them.
pub fn init(options: &Init) -> Result<u8, Failure> {
    if options.list {
        return print(list()).map(|()| 0);
    }
    let first = || templates().next().map_or("", |template| template.name);
    let requested = options.template.as_deref().unwrap_or_else(first);
    let Some(template) = template(requested) else {
        let message = format!("no template {requested:?}: haff init --list has their names");
        return Err(Failure::new(Status::Invalid, message));
    };
    write_files(template)?;
    print(template.text).map(|()| 0)
}

/// The names of the templates and what they are, by group.
fn list() -> String {
    let width = templates().map(|template| template.name.len()).max().unwrap_or(0);
    let (mut text, mut group) = (String::new(), "");
    for template in templates() {
        if template.group != group {
            let above = if group.is_empty() { "" } else { "\n" };
            let _ = writeln!(text, "{above}{}", template.group);
            group = template.group;
        }
        let _ = writeln!(text, "  {:width$}  {}", template.name, template.title());
    }
    text
}

/// Writes the files that a scene names into the working directory. One that has other contents stays.
fn write_files(template: &Template) -> Result<(), Failure> {
    for &(name, text) in template.files {
        let file = Path::new(name);
        match fs::read_to_string(file) {
            Ok(present) if present == text => continue,
            Ok(_) => {
                let why = "exists with other contents, and the scene needs its own: use another folder";
                return Err(Failure::new(Status::Invalid, format!("{}: {why}", path(file))));
            }
            Err(_) => {}
        }
        let written = file.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(file, text));
        written.map_err(|error| Failure::new(Status::File, format!("{}: {error}", path(file))))?;
        message(format_args!("{} written: the scene names it", path(file)));
    }
    Ok(())
}

/// Prints the JSON Schema of scene files.
pub fn schema() -> Result<u8, Failure> {
    line(format_args!("{:#}", haff_scene::schema())).map(|()| 0)
}
