//! Motions of walls: oscillations, times and positions.

use std::f64::consts::TAU;

use glam::DVec3;
use haff_engine::{Domain, Instant, Oscillating, Shape, Wall, WallMotion};
use haff_mechanics::{Oscillation, Waveform};

use super::names::wall_indices;
use super::particles::Rows;
use super::shape::Turns;
use super::values::{LARGEST, at, item, positive};
use super::{Assembler, Start};
use crate::config::{MotionConfig, MotionKindConfig, WallConfig};

/// A wall of the domain is outside by at most this part of the edge: the searches for partners have
/// coordinates for the box and its surroundings.
const FARTHEST: f64 = 0.5;

/// Whether a wall of the domain is displaced from its face.
pub(super) fn is_displaced(wall: &Wall, domain: &Domain) -> bool {
    // The upper faces have normals to the lower side.
    let face = (domain.size * wall.normal.min(DVec3::ZERO)).element_sum();
    wall.point.dot(wall.normal) != face
}

/// Where a wall is at an instant if it moves on and on, and otherwise on average.
fn mean_position(wall: &Wall, at: Instant) -> DVec3 {
    match wall.motion {
        WallMotion::Constant(_) => wall.point + wall.motion.displacement(wall.normal, at),
        WallMotion::Fixed
        | WallMotion::Oscillating(_)
        | WallMotion::Rotating(_)
        | WallMotion::Piston(_)
        | WallMotion::Shrinking(_) => wall.point,
    }
}

/// The normal of the face of the box with this name.
fn normal_of_face(name: &str) -> Option<DVec3> {
    let axis = "xyz".find(name.get(..1)?)?;
    match name.get(1..)? {
        "-" => Some(DVec3::AXES[axis]),
        "+" => Some(-DVec3::AXES[axis]),
        _ => None,
    }
}

impl Assembler<'_> {
    /// The reference time of an entry of `[[wall]]`, if it is given and valid.
    pub(super) fn reference_time(&mut self, k: usize, config: &WallConfig) -> Option<f64> {
        let time = config.reference_time?;
        let path = item("wall", k, "reference_time");
        if config.velocity.is_none() {
            self.document
                .report(&path, "is for walls with a velocity: an oscillation has its phase at time 0");
        } else if time.is_nan() || time.abs() > LARGEST {
            self.document.refuse(&path, "must be a finite time, at most 1e50 in size");
        } else {
            return Some(time);
        }
        None
    }

    /// The displacement of a wall of the domain; 0 if it is not valid.
    pub(super) fn displacement(&mut self, k: usize, config: &WallConfig) -> f64 {
        let displacement = config.displacement.unwrap_or(0.0);
        if displacement.is_nan() || displacement.abs() > LARGEST {
            self.document
                .refuse(&item("wall", k, "displacement"), "must be a finite length, at most 1e50 in size");
            return 0.0;
        }
        displacement
    }

    /// Displaces walls of the domain from their faces, and checks that a particle fits between them.
    pub(super) fn displace(&mut self, walls: &mut [Wall], names: &[String], domain: &Domain, rows: &Rows) {
        let configs = self.config.wall.clone().unwrap_or_default();
        let displaced: Vec<(usize, usize, f64)> = wall_indices(&configs, names)
            .into_iter()
            .enumerate()
            .filter_map(|(k, index)| Some((k, index?, configs[k].displacement?)))
            .collect();
        for &(k, index, displacement) in &displaced {
            let normal = walls[index].normal;
            walls[index].point += normal * displacement;
            let edge = (domain.size * normal.abs()).element_sum();
            if displacement < -FARTHEST * edge {
                let why = format!("must be at least {}, half the edge of the box outside", -FARTHEST * edge);
                self.document.refuse(&item("wall", k, "displacement"), why);
            }
        }
        let diameter = 2.0 * rows.largest_radius();
        for (k, index, _) in displaced {
            // Lower and upper walls of an axis are neighbors.
            let (wall, other) = (&walls[index], &walls[index ^ 1]);
            let room = (other.point - wall.point).dot(wall.normal);
            if room < diameter {
                let why = format!("leaves {room} between the walls, the largest diameter is {diameter}");
                self.document.report(&item("wall", k, "displacement"), why);
            }
        }
    }

    /// The motion of each entry of `[[wall]]` that has one.
    pub(super) fn wall_motions(&mut self) -> Vec<Option<WallMotion>> {
        let configs = self.config.wall.clone().unwrap_or_default();
        let mut motions = Vec::with_capacity(configs.len());
        for (k, config) in configs.iter().enumerate() {
            let Some(motion) = &config.motion else {
                // Other walls turn by their shapes.
                let of_domain = !config.has_shape() && config.rotation.is_some();
                let normal = config.name.as_deref().and_then(normal_of_face).filter(|_| of_domain);
                let turns = normal.map(|normal| Turns::AlongNormal(DVec3::ZERO, normal));
                let rotation = turns.and_then(|turns| self.rotation(k, config, turns));
                let turning = rotation.map(WallMotion::Rotating);
                motions.push(turning.or_else(|| self.velocity_of_face(k, config)));
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

    /// The velocity of a wall of the domain, which is along the wall.
    fn velocity_of_face(&mut self, k: usize, config: &WallConfig) -> Option<WallMotion> {
        let normal = config.name.as_deref().and_then(normal_of_face).filter(|_| !config.has_shape())?;
        let path = item("wall", k, "velocity");
        if config.rotation.is_some() && config.velocity.is_some() {
            self.document.report(&path, format!("contradicts wall.{k}.rotation: give one of the two"));
            return None;
        }
        let velocity = self.vector(&path, config.velocity.as_ref()?);
        if velocity.dot(normal) != 0.0 {
            let why = "must be along the wall, which closes the box: for one that leaves its place give a plane, and \
                       open that axis";
            self.document.refuse(&path, why);
            return None;
        }
        Some(WallMotion::from(velocity))
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
            self.document.refuse(&path("phase"), "must be a finite number of radians");
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
        let (now, fixed): (Instant, Vec<(usize, DVec3, f64)>) = match self.start {
            // Checked when the scene was written. What moved on may be anywhere now.
            Start::Recorded => return,
            Start::Scene => {
                let fixed = rows.bodies.iter().enumerate().filter(|(row, _)| rows.is_fixed(*row));
                (Instant::ZERO, fixed.map(|(row, body)| (row, body.position, rows.radius(row))).collect())
            }
            Start::Present(_) if !self.document.is_overridden(&at(["wall"])) => return,
            Start::Present(present) => (present.at, present.fixed.clone()),
        };
        for (k, (index, motion)) in indices.iter().zip(motions).enumerate() {
            let (Some(index), Some(motion)) = (*index, motion) else { continue };
            let wall = &walls[index];
            let mean = mean_position(wall, now);
            let amplitude = motion.sweep(wall.normal);
            let path = item("wall", k, "motion.amplitude");
            let is_named = |wall: &Wall| matches!(wall.shape, Some(Shape::Named(_)));
            if amplitude == 0.0 {
                continue;
            }
            let others = walls.iter().enumerate().filter(|(j, other)| *j != index && !is_named(other));
            for (_, other) in others.filter(|_| !is_named(wall)) {
                let gap = (mean_position(other, now) - mean).dot(wall.normal);
                let sweep =
                    Some(other.motion.sweep(other.normal)).filter(|sweep| sweep.is_finite()).unwrap_or(0.0);
                if other.normal.dot(wall.normal) < -1.0 + 1e-12 && amplitude + sweep >= gap {
                    let own =
                        if sweep > 0.0 { format!(", less its amplitude {sweep}") } else { String::new() };
                    let why = format!(
                        "must be less than the distance {gap} from the opposite wall \"{}\"{own}",
                        other.name
                    );
                    self.document.refuse(&path, why);
                }
            }
            for (row, position, radius) in &fixed {
                let gap = if is_named(wall) {
                    Wall { motion: WallMotion::Fixed, ..wall.clone() }.distance(*position, now) - radius
                } else {
                    (*position - mean).dot(wall.normal) - radius
                };
                if gap < amplitude {
                    let why = format!(
                        "must be at most {gap}: the wall would sweep through the fixed particle {row}"
                    );
                    self.document.refuse(&path, why);
                }
            }
        }
    }
}
