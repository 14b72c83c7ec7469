//! Particles that take places in a file that were kept for them.

use hdf5::{Dataset, Group};
use ndarray::s;

use crate::declared::read_attribute;

/// A particle that takes a place in a file that was kept for one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entered {
    /// The row in the file.
    pub row: u32,
    /// Index of the species.
    pub species: u32,
    /// Mass, infinite of a fixed body.
    pub mass: f64,
    /// Radius \[length\].
    pub radius: f64,
    /// q = I/(m R²), where there is spin.
    pub inertia: f64,
}

/// Attribute of the species: how many rows have, or have had, a particle.
const USED: &str = "used";

/// Writes how many rows have a particle at the start, if others are kept.
pub(crate) fn begin(all: &Group, used: usize) -> hdf5::Result<()> {
    let species = all.dataset("species")?;
    if used < species.shape().iter().product() {
        species.new_attr::<u64>().create(USED)?.write_scalar(&(used as u64))?;
    }
    Ok(())
}

/// How many of the rows of species have, or have had, a particle.
pub(crate) fn used(species: &Dataset) -> hdf5::Result<usize> {
    let all = species.shape().iter().product();
    if !species.attr_names()?.iter().any(|name| name == USED) {
        return Ok(all);
    }
    Ok(read_attribute::<u64>(&species.attr(USED)?, 1)?.first().map_or(all, |&used| all.min(used as usize)))
}

/// Writes what particles are that take places kept for them.
pub(crate) fn write(root: &Group, particles: &[Entered]) -> hdf5::Result<()> {
    let all = root.group("particles/all")?;
    let rough = all.link_exists("inertia");
    for particle in particles {
        let row = s![particle.row as usize..=particle.row as usize];
        all.dataset("species")?.write_slice(&[particle.species], row)?;
        all.dataset("mass")?.write_slice(&[particle.mass], row)?;
        all.dataset("radius")?.write_slice(&[particle.radius], row)?;
        if rough {
            all.dataset("inertia")?.write_slice(&[particle.inertia], row)?;
        }
    }
    let last = particles.iter().map(|particle| u64::from(particle.row) + 1).max().unwrap_or(0);
    let species = all.dataset("species")?;
    if (used(&species)? as u64) < last {
        species.attr(USED)?.write_scalar(&last)?;
    }
    Ok(())
}
