/*!
Where particles are at the start, and how fast: random numbers, packings, velocities.

| module | has |
|---|---|
| [`mod@random`] | a stream of random numbers for each purpose, species and particle |
| [`room`] | the box, planes, regions and other particles between which a packing is |
| [`mod@lattice`], [`loose`] | lattices and random packings |
| [`grid`] | close pairs among particles of any size ratio |
| [`velocity`] | Maxwell's velocities at an exact temperature |

Its loops are over all particles, so that it is compiled for speed, and `haff-scene`, which calls it, for a
short build (benches/record/building.md). Functions that take others take them by reference: generic ones
would be compiled in that crate. Dense packings grow there, by the engine itself.

*What to change here.* A new packing or distribution.
*/

#![forbid(unsafe_code)]
// Docs give units in brackets, as [length]: these are not links.
#![allow(rustdoc::broken_intra_doc_links)]

pub mod grid;
pub mod lattice;
pub mod loose;
pub mod random;
pub mod room;
pub mod velocity;
