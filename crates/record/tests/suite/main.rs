//! Tests of the record that start no other processes, in one binary: the HDF5 library is linked once.

mod common;
mod refusals;
mod round_trip;
