//! All tests of the formulas of mechanics in one binary, which is linked once.

mod contact_times;
mod impact_drift;
mod impact_laws;
mod oscillations;
mod reference;
