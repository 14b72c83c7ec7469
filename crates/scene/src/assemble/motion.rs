//! Motions of walls that oscillate.

use std::f64::consts::TAU;

use glam::DVec3;
use haff_engine::{Instant, Oscillating, Wall, WallMotion};
use haff_mechanics::{Oscillation, Waveform};

use super::Assembler;
use super::names::wall_indices;
use super::particles::Rows;
use super::values::{item, positive};
use crate::config::{MotionConfig, MotionKindConfig};

/// Where a wall is at time 0.
pub(super) fn at_start(wall: &Wall) -> DVec3 {
    wall.point + wall.motion.displacement(wall.normal, Instant::ZERO)
}

impl Assembler<'_> {
    /// The motion of each entry of `[[wall]]` that has one.
    pub(super) fn wall_motions(&mut self) -> Vec<Option<WallMotion>> {
        let configs = self.config.wall.clone().unwrap_or_default();
        let mut motions = Vec::with_capacity(configs.len());
        for (k, config) in configs.iter().enumerate() {
            let Some(motion) = &config.motion else {
                motions.push(None);
                continue;
            };
            for (key, given) in
                [("velocity", config.velocity.is_some()), ("sticks", config.sticks == Some(true))]
            {
                if given {
                    let why = format!("contradicts wall.{k}.motion: give one of the two");
                    self.document.report(&item("wall", k, key), why);
                }
            }
            if self.has_joints() && config.sticks != Some(true) {
                let why =
                    "a wall that oscillates does not work with pendulums, springs, rods or sticking contacts";
                self.document.report(&item("wall", k, "motion"), why);
            }
            motions.push(self.wall_motion(k, motion));
        }
        motions
    }

    fn wall_motion(&mut self, k: usize, motion: &MotionConfig) -> Option<WallMotion> {
        let path = |key: &str| item("wall", k, &format!("motion.{key}"));
        let waveform = match motion.kind {
            Some(MotionKindConfig::Sine) => Waveform::Sine,
            Some(MotionKindConfig::Triangle) => Waveform::Triangle,
            None => {
                let why = "missing: a motion needs a kind: \"sine\" or \"triangle\"";
                self.document.report_missing(&path("kind"), why);
                return None;
            }
        };
        let mut number = |key: &str, value: Option<f64>| {
            let Some(value) = value else {
                self.document.report_missing(&path(key), "missing: a motion needs it");
                return None;
            };
            positive(&mut self.document, &path(key), value).then_some(value)
        };
        let (amplitude, frequency) =
            (number("amplitude", motion.amplitude), number("frequency", motion.frequency));
        let phase = motion.phase.unwrap_or(0.0);
        if !phase.is_finite() {
            self.document.report(&path("phase"), "must be a finite number of radians");
            return None;
        }
        if let Some(motion) = self.config.wall.as_mut().and_then(|walls| walls[k].motion.as_mut()) {
            motion.phase = Some(phase);
        }
        let oscillation = Oscillation { waveform, amplitude: amplitude?, frequency: frequency? };
        let cycles = phase / TAU;
        Some(WallMotion::Oscillating(Oscillating { oscillation, cycles: cycles - cycles.floor() }))
    }

    /// Sets the motions of the walls, and checks what they sweep through.
    pub(super) fn set_motions(
        &mut self,
        walls: &mut [Wall],
        names: &[String],
        motions: &[Option<WallMotion>],
        rows: &Rows,
    ) {
        let configs = self.config.wall.clone().unwrap_or_default();
        let indices = wall_indices(&configs, names);
        for (index, motion) in indices.iter().zip(motions) {
            if let (Some(index), Some(motion)) = (index, motion) {
                walls[*index].motion = *motion;
            }
        }
        for (k, (index, motion)) in indices.iter().zip(motions).enumerate() {
            let (Some(index), Some(motion)) = (*index, motion) else { continue };
            let wall = &walls[index];
            let amplitude = motion.sweep(wall.normal);
            let path = item("wall", k, "motion.amplitude");
            for other in walls.iter().enumerate().filter(|(j, _)| *j != index).map(|(_, other)| other) {
                let gap = (other.point - wall.point).dot(wall.normal);
                let sweep =
                    Some(other.motion.sweep(other.normal)).filter(|sweep| sweep.is_finite()).unwrap_or(0.0);
                if other.normal.dot(wall.normal) < -1.0 + 1e-12 && amplitude + sweep >= gap {
                    let own =
                        if sweep > 0.0 { format!(", less its amplitude {sweep}") } else { String::new() };
                    let why = format!(
                        "must be less than the distance {gap} from the opposite wall \"{}\"{own}",
                        other.name
                    );
                    self.document.report(&path, why);
                }
            }
            let fixed = rows.bodies.iter().enumerate().filter(|(row, _)| rows.is_fixed(*row));
            for (row, body) in fixed {
                let gap = (body.position - wall.point).dot(wall.normal) - rows.radius(row);
                if gap < amplitude {
                    let why = format!(
                        "must be at most {gap}: the wall would sweep through the fixed particle {row}"
                    );
                    self.document.report(&path, why);
                }
            }
        }
    }
}
