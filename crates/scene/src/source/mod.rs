/*!
The text of a scene file: reading it, a tree of values with their places, and errors that name them.

*What is here.* [`text`] shows text of others safely, [`tree`] is TOML with line numbers, [`read`] takes
values of types and names out of it, [`weight`] bounds what a text costs before it is parsed, [`error`] are
all errors found, with their places. [`mesh`] reads the triangles that walls name.

*What to change here.* How an error is written, or a value is read.

*May import* other crates only.

*Begin with* [`tree`].
*/

pub(crate) mod error;
pub mod mesh;
pub(crate) mod read;
pub mod text;
pub(crate) mod tree;
pub(crate) mod weight;
