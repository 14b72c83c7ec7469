//! All tests of shapes in one binary, which is linked once.

mod big;
mod contact_times;
mod meshes;
mod shapes;
