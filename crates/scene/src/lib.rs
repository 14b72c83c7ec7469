//! Scene files of haff: TOML to a validated system.
