//! When particles leave their skin spheres.

use super::{Lists, dot};
use crate::{model::features::Features, search::compact::CompactParticle};

use super::super::frame::FilterFrame;

impl Lists {
    /// Displacement of a particle from its reference position [largest contact distances].
    #[inline(always)]
    fn displacement<F: Features>(
        &self,
        i: u32,
        frame: &FilterFrame,
        compact: &CompactParticle,
        fraction: f32,
    ) -> [f32; 3] {
        let reference = &self.references[i as usize];
        let mut d = [0.0; 3];
        for axis in 0..3 {
            d[axis] = compact.x[axis].wrapping_sub(reference.x[axis]) as f32 * self.unit[axis]
                + compact.v[axis] * fraction;
            if F::GRAVITY {
                d[axis] += frame.fall[axis] * (fraction * fraction);
            }
        }
        if F::DEFORMS {
            let path = frame.motion.path(compact.v, fraction);
            for axis in 0..3 {
                let x = compact.x[axis].wrapping_sub(reference.x[axis]) as f32 * self.unit[axis];
                d[axis] = x + path[axis] * frame.motion.to_lists[axis];
            }
            d[0] += self.tilt * d[1];
        }
        d
    }

    /// Time from now at which particle i may leave its skin sphere; `None` if this is later than `within`
    /// [spans]. `fraction` is the fraction of the span that has passed. Without gravity it leaves the sphere
    /// then.
    #[inline(always)]
    pub fn exit<F: Features>(
        &self,
        i: u32,
        frame: &FilterFrame,
        compact: &CompactParticle,
        fraction: f32,
        within: f32,
    ) -> Option<f32> {
        let (d, mut v) = (self.displacement::<F>(i, frame, compact, fraction), compact.v);
        let mut until = within;
        let is_bent = F::GRAVITY || F::DEFORMS;
        if F::GRAVITY {
            // The chord of the path instead of the path, which bends away from it by less than lists allow.
            until = within.min(frame.longest_chord);
            for axis in 0..3 {
                v[axis] += frame.fall[axis] * (2.0 * fraction + until);
            }
        }
        if F::DEFORMS {
            until = within.min(frame.longest_chord);
            let end = self.displacement::<F>(i, frame, compact, fraction + until);
            for axis in 0..3 {
                v[axis] = (end[axis] - d[axis]) / until;
            }
        }
        let mut end = [0.0; 3];
        for axis in 0..3 {
            end[axis] = d[axis] + v[axis] * until;
        }
        // A sphere is convex: a straight flight between two points inside stays inside.
        if dot(end, end) <= self.exit2 {
            (is_bent && until < within).then_some(until)
        } else {
            self.straight_exit(d, v)
                .filter(|delay| *delay < until)
                .or((is_bent && until < within).then_some(until))
        }
    }

    /// Distance of a position from the surface of the skin sphere of i [largest contact distances]; at least
    /// zero.
    pub fn depth(&self, i: u32, position: [i32; 3]) -> f64 {
        let reference = &self.references[i as usize];
        let d = [0, 1, 2].map(|axis| position[axis].wrapping_sub(reference.x[axis]) as f32 * self.unit[axis]);
        f64::from(self.exit2.sqrt() - dot(d, d).sqrt()).max(0.0)
    }

    /// Time at which a straight flight from d leaves the skin sphere; `None` at rest.
    #[inline(never)]
    fn straight_exit(&self, d: [f32; 3], v: [f32; 3]) -> Option<f32> {
        let (speed2, along) = (dot(v, v), dot(d, v));
        if speed2 == 0.0 {
            return None;
        }
        let gap = (self.exit2 - dot(d, d)).max(0.0);
        let root = (along * along + speed2 * gap).sqrt();
        // No difference of numbers of the same sign, so that no digits cancel.
        Some(if along > 0.0 { gap / (root + along) } else { (root - along) / speed2 })
    }
}
