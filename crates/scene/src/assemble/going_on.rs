//! Walls of a run that goes on with changed keys: their entries in the scene become those of walls that go on
//! from where they are.

use std::f64::consts::TAU;

use glam::DVec3;
use haff_engine::{Instant, Oscillating, Shape, Wall, WallMotion};
use haff_mechanics::{Oscillation, Waveform};

use super::names::wall_indices;
use super::values::item;
use super::{Assembler, Start};
use crate::config::{MotionConfig, MotionKindConfig, WallConfig};

/// Which keys of an entry of `[[wall]]` the change has set. A table that is set as a whole sets all of its
/// keys.
// A bool for each key.
#[allow(clippy::struct_excessive_bools)]
#[derive(Debug, Clone, Copy)]
struct Changed {
    velocity: bool,
    motion: bool,
    phase: bool,
    /// The position: `plane.point`, or `displacement` of a wall of the domain.
    position: bool,
    reference_time: bool,
}

impl Assembler<'_> {
    /// Completes changed entries of `[[wall]]` by the positions, phases and times that follow from the
    /// present. `of_domain`: names of the walls of the domain.
    pub(super) fn walls_go_on(&mut self, of_domain: &[String]) {
        let Start::Present(present) = self.start else { return };
        let configs = self.config.wall.clone().unwrap_or_default();
        let is_plane = |config: &&WallConfig| !of_domain.iter().any(|name| config.names_boundary(name));
        let planes = configs.iter().filter(is_plane).map(|config| config.name.clone().unwrap_or_default());
        let names: Vec<String> = of_domain.iter().cloned().chain(planes).collect();
        for (k, index) in wall_indices(&configs, &names).into_iter().enumerate() {
            let Some(wall) = index.and_then(|index| present.walls.get(index)) else { continue };
            if configs[k].mass.is_some() && !matches!(wall.motion, WallMotion::Piston(_)) {
                let why = "no wall becomes a piston in a run that goes on";
                self.document.report(&item("wall", k, "mass"), why);
            }
            let changed = self.changed(k, &configs[k]);
            if let (Some(changed), Some(walls)) = (changed, &mut self.config.wall) {
                goes_on(&mut walls[k], changed, wall, present.at);
            }
        }
    }

    /// Whether the change sets where the piston of entry `k` is, or how fast.
    pub(super) fn sets_piston(&self, k: usize) -> bool {
        let is_set = |key: &str| self.document.is_overridden(&item("wall", k, key));
        is_set("plane.point") || is_set("velocity")
    }

    /// The changed keys of entry `k`; `None` if its motion and its position stay as they are.
    fn changed(&self, k: usize, config: &WallConfig) -> Option<Changed> {
        let is_set = |key: &str| self.document.is_overridden(&item("wall", k, key));
        let position = match &config.plane {
            Some(plane) => plane.point.is_some() && is_set("plane.point"),
            None if config.has_shape() => {
                config.shapes().iter().any(|(key, _)| is_set(key)) || is_set("offset")
            }
            None => config.displacement.is_some() && is_set("displacement"),
        };
        let phase = config.motion.as_ref().is_some_and(|motion| motion.phase.is_some());
        let changed = Changed {
            velocity: is_set("velocity"),
            motion: is_set("motion"),
            phase: phase && is_set("motion.phase"),
            position,
            reference_time: config.reference_time.is_some() && is_set("reference_time"),
        };
        let Changed { velocity, motion, phase: _, position, reference_time } = changed;
        (velocity || motion || position || reference_time).then_some(changed)
    }
}

/// Completes an entry with `changed` keys; `old` is its wall until now. Values that are not valid are left to
/// the checks that follow.
fn goes_on(config: &mut WallConfig, changed: Changed, old: &Wall, now: Instant) {
    if config.mass.is_some() {
        piston_goes_on(config, changed, old, now);
        return;
    }
    // A velocity replaces an oscillation, and the other way round.
    if changed.motion && !changed.velocity {
        config.velocity = None;
        if !changed.reference_time {
            config.reference_time = None;
        }
    } else if changed.velocity && !changed.motion {
        config.motion = None;
    }
    let is_zero = |velocity: &Vec<f64>| velocity.iter().all(|&component| component == 0.0);
    if !config.has_shape() && changed.velocity && config.velocity.as_ref().is_some_and(is_zero) {
        // A wall of the domain has no velocity, but it can be stopped.
        config.velocity = None;
    }
    let Some(motion) = new_motion(config) else { return };
    let new = old.going_on(&motion, now);
    if let (Some(config), WallMotion::Oscillating(new)) = (&mut config.motion, &new.motion) {
        complete_phase(config, changed, &old.motion, new);
    }
    if !changed.reference_time {
        config.reference_time = match new.motion {
            // The given position is the present one.
            WallMotion::Constant(_) if changed.position => Some(now.high),
            WallMotion::Constant(motion) => Some(motion.reference_time),
            WallMotion::Fixed
            | WallMotion::Oscillating(_)
            | WallMotion::Rotating(_)
            | WallMotion::Piston(_)
            | WallMotion::Shrinking(_) => None,
        }
        .filter(|&time| time != 0.0 && config.has_shape());
    }
    if changed.position || changed.reference_time {
        return;
    }
    let point = match (&old.motion, changed.phase) {
        (_, false) => new.point,
        // A given phase is a jump about the mean position, which a wall that did not oscillate has now.
        (WallMotion::Oscillating(_), true) => old.point,
        (_, true) => old.going_on(&WallMotion::Fixed, now).point,
    };
    if point == old.point {
        return;
    }
    match &mut config.plane {
        _ if matches!(old.shape, Some(Shape::Named(_))) => config.offset = Some(point.to_array().to_vec()),
        Some(plane) => {
            let given = plane.point.iter_mut().flatten();
            given.zip(point.to_array()).for_each(|(component, value)| *component = value);
        }
        None => *config.displacement.get_or_insert(0.0) += (point - old.point).dot(old.normal),
    }
}

/// Completes the entry of a piston whose position or velocity is set: the other one is that of now. Where
/// neither is set, it goes on in the engine.
fn piston_goes_on(config: &mut WallConfig, changed: Changed, old: &Wall, now: Instant) {
    let (WallMotion::Piston(piston), Some(plane)) = (&old.motion, &mut config.plane) else { return };
    let (displacement, speed) = piston.at(now);
    let point = plane.point.iter_mut().flatten();
    if !changed.position {
        let present = old.point + old.normal * displacement;
        point.zip(present.to_array()).for_each(|(component, value)| *component = value);
    }
    if !changed.velocity {
        let components = plane.normal.as_ref().map_or(3, Vec::len);
        config.velocity = Some((old.normal * speed).to_array()[..components.min(3)].to_vec());
    }
}

/// The motion of an entry, without phase and reference time; `None` if it is not valid.
fn new_motion(config: &WallConfig) -> Option<WallMotion> {
    if let Some(MotionConfig { kind, amplitude, frequency, .. }) = config.motion {
        let waveform = match kind? {
            MotionKindConfig::Sine => Waveform::Sine,
            MotionKindConfig::Triangle => Waveform::Triangle,
        };
        let (amplitude, frequency) = (amplitude?, frequency?);
        let is_valid = |value: f64| value > 0.0 && value.is_finite();
        let oscillation = Oscillation { waveform, amplitude, frequency };
        return (is_valid(amplitude) && is_valid(frequency))
            .then_some(WallMotion::Oscillating(Oscillating { oscillation, cycles: 0.0 }));
    }
    let mut velocity = DVec3::ZERO;
    for (k, &component) in config.velocity.iter().flatten().enumerate().take(3) {
        velocity[k] = component;
    }
    velocity.is_finite().then_some(velocity.into())
}

/// Sets the phase of an oscillation, unless the change has set it or it stays as it is written.
fn complete_phase(config: &mut MotionConfig, changed: Changed, old: &WallMotion, new: &Oscillating) {
    let is_the_same = matches!(old, WallMotion::Oscillating(old) if old.cycles == new.cycles);
    let stays = changed.phase || is_the_same && config.phase.is_some();
    if !stays {
        config.phase = Some(TAU * new.cycles);
    }
}
