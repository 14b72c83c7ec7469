//! All tests of the command in one binary, which is linked once.

mod accuracy;
mod bench;
mod command_line;
mod common;
mod compare;
mod compression;
mod continued;
mod determinism;
mod growing_sweeps;
mod numbers_and_warnings;
mod simultaneous;
mod sweep;
mod textbook_impacts;
mod textbook_linkages;
