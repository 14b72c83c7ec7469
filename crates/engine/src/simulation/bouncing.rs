//! Scenes whose grains bounce on the floor for ever.

use haff_mechanics::Restitution;

use crate::{
    laws::bounces::REST_HEIGHT,
    model::{System, WallLaw, rest_speed::rest_speed_of_diameter},
    numerics::number::significant,
};

/// A warning for a scene under gravity whose bounces on a floor never end, as text without a final point.
///
/// * With the TC model a contact within `tc` of the last one is elastic. A grain with the speed u is back on
///   the floor after 2u/g, so its bounces stay as they are from u = g tc/2 on, at most g tc²/8 high; unless
///   this is so low that the series of bounces is completed before.
/// * A restitution that reaches 1 at a low speed, or tends to 1 as fast as 1 − e ∝ v or faster, never takes
///   the last of the speed.
pub fn endless_bounces_warning(system: &System) -> Option<String> {
    let g = system.domain.gravity.length();
    let radius = system
        .classes
        .iter()
        .filter(|class| class.mass.is_finite())
        .map(|class| class.radius)
        .fold(f64::INFINITY, f64::min);
    let floors = floors(system);
    let fixed = system.classes.iter().any(|class| class.mass.is_infinite());
    if g == 0.0 || !radius.is_finite() || (floors.is_empty() && !fixed) {
        return None;
    }
    let walls = floors.iter().copied().map(WallLaw::restitution);
    let laws: Vec<Restitution> = walls.clone().chain(system.contacts.pair.iter().copied()).collect();
    let tc = system.contacts.tc;
    let height = g * tc * tc / 8.0;
    if height > REST_HEIGHT * radius && laws.iter().any(|law| !law.is_elastic()) {
        let instead = if system.contacts.rest_speed > 0.0 {
            "leave contact.tc out: contact.rest_speed alone ends their bounces".to_owned()
        } else {
            format!(
                "leave contact.tc out, and set contact.rest_speed, for example {}, or a restitution that \
                 depends on the speed (model = \"viscoelastic\")",
                rest_speed_of_diameter(g, 2.0 * radius)
            )
        };
        return Some(format!(
            "contact.tc with gravity: a contact within tc of the last one is elastic, so grains on the floor do \
             not come to rest; they go on bouncing, up to {} high (g tc²/8), with at least {} contacts each per \
             unit time (1/tc); {instead}",
            significant(height, 2),
            significant(1.0 / tc, 2)
        ));
    }
    // From the speed of a fall by a diameter.
    let speed = (4.0 * g * radius).sqrt();
    let is_known = |law: &Restitution| !matches!(law, Restitution::Law(_));
    let endless = walls.filter(is_known).any(|law| law.loses_energy() && law.bounces(speed).is_none());
    (endless && system.contacts.rest_speed == 0.0).then(|| {
        format!(
            "the restitution on the floor becomes elastic at low speed so fast that bounces under gravity do not \
             end in a finite time; set contact.rest_speed, for example {}, or a law with a finite series of \
             bounces: a table that is below 1 at its lowest speed, or an exponent below 1",
            rest_speed_of_diameter(g, 2.0 * radius)
        )
    })
}

/// Laws of impact with walls that grains fall onto.
fn floors(system: &System) -> Vec<&WallLaw> {
    let walls = &system.walls;
    let laws = system.contacts.wall.iter().enumerate();
    laws.filter(|(k, law)| {
        let wall = &walls[k % walls.len()];
        wall.normal.dot(system.domain.gravity) < 0.0 && wall.shape.is_none() && !law.is_thermal()
    })
    .map(|(_, law)| law)
    .collect()
}
