/*!
The scene file as written: its keys, and the JSON Schema that follows from them.

*What is here.* `keys` (with the folder `keys/` for contacts, walls, particles, measurements and output) and
[`joints`] have every key with its type and description, `shapes` values of several forms, `named` the names
that plug-ins add. `document` makes the keys of a tree of values, with `--set`, and refuses unknown and
[misplaced] ones; `schema` prints them, `templates` are the shipped scenes.

*What to change here.* A new key: its field in `keys` or `keys/`. Nothing is checked here beyond types.

*May import* `source` and `plugins`.

*Begin with* [`SceneConfig`].

[misplaced]: misplaced::Misplaced
*/

pub(crate) mod document;
pub mod joints;
pub(crate) mod keys;
pub(crate) mod misplaced;
pub(crate) mod named;
pub(crate) mod names;
pub(crate) mod schema;
pub(crate) mod shapes;
pub(crate) mod templates;
pub(crate) mod whole;

pub use keys::*;
