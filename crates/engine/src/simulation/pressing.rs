//! Scenes in which a piston presses grains together for ever.

use crate::{
    model::{System, WallLaw},
    numerics::number::significant,
    simulation::clustering::suitable_contact_duration,
};

/// A warning for a scene in which an elastic piston presses grains together that lose energy, as text without
/// a final point.
///
/// Once they are at rest on each other, the piston hops on them: each hop takes as long as the one before, or
/// less, since only contacts of grains take energy. Walls and drives that give energy may prevent this, and
/// the TC model ends it.
pub fn pressing_piston_warning(system: &System) -> Option<String> {
    let walls = &system.walls;
    let laws = |k: usize| system.contacts.wall.iter().skip(k).step_by(walls.len());
    let presses = |k: &usize| {
        let presses = walls[*k].piston().is_some_and(|piston| piston.acceleration > 0.0);
        presses && laws(*k).any(WallLaw::is_elastic)
    };
    let piston = (0..walls.len()).find(presses)?;
    let is_fed = !system.drives.is_empty()
        || system.contacts.wall.iter().any(WallLaw::is_thermal)
        || walls.iter().any(|wall| wall.piston().is_none() && wall.motion.is_moving());
    let loses = system.contacts.pair.iter().any(|law| !law.is_elastic());
    if is_fed || !loses || system.contacts.tc > 0.0 {
        return None;
    }
    let suitable = suitable_contact_duration(system)
        .map_or(String::new(), |tc| format!(", for example {}", significant(tc, 2)));
    Some(format!(
        "the wall {} has the restitution 1 and presses grains together that lose energy: in the end they hop \
         under it in ever shorter times; set contact.tc{suitable}",
        walls[piston].name
    ))
}
