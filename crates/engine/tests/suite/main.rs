//! All tests of the engine in one binary: the engine is compiled into it and linked once.

mod carried;
mod changes;
mod checkpoints;
mod common;
mod compression;
mod drives;
mod endless;
mod free_times;
mod hops;
mod laws;
mod measurements;
mod named;
mod oscillating_walls;
mod overflow;
mod pressures;
mod profile_times;
mod properties;
mod replay;
mod rest;
mod rough;
mod rounding;
mod searches;
mod shear;
mod thermal_walls;
mod unsafe_code;
mod wall_changes;
