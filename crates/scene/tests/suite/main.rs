//! All tests of the scene model in one binary, which is linked once.

mod compression;
mod configs;
mod errors;
mod hostile;
mod packing;
mod scaling;
mod shear;
