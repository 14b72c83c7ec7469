/*!
Starts that need more than a packing: growth to a dense one, states of other programs.

*What is here.* [`growth`] makes dense packings by the engine itself, from a loose one of `haff_placement`,
which also has lattices, velocities and random numbers; [`import`] says which files are read.

*What to change here.* A start that needs the engine, or a file.

*May import* `source`, `config` and `model`.

*Begin with* [`growth`].
*/

pub(crate) mod growth;
pub mod import;
