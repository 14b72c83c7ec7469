//! Particles that take places in a file that were kept for them.

use hdf5::Group;
use ndarray::s;

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
    Ok(())
}
