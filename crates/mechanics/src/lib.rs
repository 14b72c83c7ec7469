//! Impact laws, free flight and contact times of hard spheres.

pub mod restitution;

pub use restitution::Restitution;
