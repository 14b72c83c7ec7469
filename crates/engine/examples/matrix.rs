//! Prints the table of docs/searches.md: which search can run which feature, and on how many threads.

#[path = "../tests/suite/common/mod.rs"]
mod common;

fn main() {
    print!("{}", common::features::table());
}
