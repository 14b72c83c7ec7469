//! A pipe that is closed to a ring: grains inside of a torus.

use haff_cli::{DVec3, Parameters, Surface};

/// A torus around the axis z, with the grains inside.
#[derive(Debug)]
struct Torus {
    center: DVec3,
    /// Radius of the ring, from the center to the middle of the pipe \[length\].
    ring: f64,
    /// Radius of the pipe \[length\].
    pipe: f64,
}

impl Torus {
    /// The vector from the nearest point of the circle in the middle of the pipe.
    fn off_middle(&self, position: DVec3) -> DVec3 {
        let r = position - self.center;
        let outward = DVec3::new(r.x, r.y, 0.0).normalize_or(DVec3::X);
        r - outward * self.ring
    }
}

impl Surface for Torus {
    fn distance(&self, position: DVec3) -> f64 {
        self.pipe - self.off_middle(position).length()
    }

    fn normal(&self, position: DVec3) -> DVec3 {
        -self.off_middle(position).normalize_or(DVec3::Z)
    }

    /// At the distance s from the middle the curvatures are 1/s across the pipe and at most 1/(R − s) along.
    fn curvature(&self, low: f64, high: f64) -> f64 {
        let (least, most) = (self.pipe - high, self.pipe - low);
        if least > 0.0 && most < self.ring {
            (1.0 / least).max(1.0 / (self.ring - most))
        } else {
            f64::INFINITY
        }
    }

    fn bounds(&self) -> (DVec3, f64) {
        (self.center, self.ring + self.pipe)
    }
}

/// The surface with the parameters of a scene.
pub fn make(parameters: &mut Parameters) -> Box<dyn Surface> {
    let center = ["x", "y", "z"].map(|key| parameters.number(key));
    let (ring, pipe) = (parameters.positive("ring"), parameters.positive("pipe"));
    if pipe >= ring {
        parameters.refuse("pipe", "must be below ring");
    }
    Box::new(Torus { center: DVec3::from_array(center), ring, pipe })
}
