//! The `haff` command.
fn main() {}
