//! `haff init` and `haff schema`.

use crate::{
    arguments::Init,
    terminal::{
        failure::{Failure, Status},
        output::{line, print},
    },
};

/// Prints a starter scene, or the list of them.
pub fn init(options: &Init) -> Result<u8, Failure> {
    let templates = haff_scene::templates();
    let list = || {
        let width = templates.iter().map(|template| template.0.len()).max().unwrap_or(0);
        let lines = templates.iter().map(|(name, description, _)| format!("{name:width$}  {description}"));
        lines.collect::<Vec<_>>().join("\n")
    };
    if options.list {
        return line(list()).map(|()| 0);
    }
    let requested = options.template.as_deref().unwrap_or_else(|| templates[0].0);
    let Some((_, _, text)) = templates.iter().find(|template| template.0 == requested) else {
        let names: Vec<&str> = templates.iter().map(|template| template.0).collect();
        let message = format!("no template {requested:?}: must be one of {}", names.join(", "));
        return Err(Failure::new(Status::Invalid, message));
    };
    print(text).map(|()| 0)
}

/// Prints the JSON Schema of scene files.
pub fn schema() -> Result<u8, Failure> {
    line(format_args!("{:#}", haff_scene::schema())).map(|()| 0)
}
