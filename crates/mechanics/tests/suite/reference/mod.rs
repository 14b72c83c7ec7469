//! Contact times against 400-bit arithmetic, on more than 10⁵ random and adversarial flights, and impacts of
//! rough bodies, on 10⁵.
//!
//! `cargo test -p haff-mechanics --test suite reference -- --nocapture` prints the largest errors found; the
//! crate's README records them.

mod big;
mod cases;
mod judge;
mod oscillations;
mod planes;
mod rough;
mod spheres;
