//! All tests of the linkages in one binary, which is linked once.

mod chapter;
mod checkpoints;
mod common;
mod ending;
mod invalid;
mod motion;
mod sticking;
