/*!
Oscillating planes: shift and velocity at a phase, and the first contact with a flight.

A plane is shifted along its normal by A w(θ), with w = sin, or the triangle of the same phase and amplitude.
Between zeros of the relative acceleration the relative velocity is monotonic, so the gap has at most one
extremum there, and its first zero is found by brackets: no contact is missed, however short.
*/

use std::f64::consts::TAU;

use crate::{plane::time_to_plane, roots::bracketed_root};

/// Form of an oscillation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Waveform {
    /// A sin θ
    Sine,
    /// Between ±A at the constant speed 4 A f; zero, rising, at θ = 0.
    Triangle,
}

/// The motion of a plane along its normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oscillation {
    /// Form.
    pub waveform: Waveform,
    /// A > 0 \[length\].
    pub amplitude: f64,
    /// Cycles in a unit of time, f > 0 [1/time].
    pub frequency: f64,
}

/// Some roundings of a phase [cycles].
const LATER: f64 = 8.0 * f64::EPSILON;

/// A phase in cycles reduced to 0 ≤ u < 1.
fn reduced(cycles: f64) -> f64 {
    let u = cycles - cycles.floor();
    if u < 1.0 { u } else { 0.0 }
}

/// sin and cos of 2π `cycles`, exact at quarters of a cycle.
fn sin_cos(cycles: f64) -> (f64, f64) {
    // The nearest quarter is taken off exactly, so that only |x| ≤ π/4 is rounded.
    let quarters = (4.0 * cycles).round_ties_even();
    let (sin, cos) = libm::sincos(TAU * (cycles - 0.25 * quarters));
    match quarters.rem_euclid(4.0) as u8 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// x − sin x, for small x by its series.
fn less_sine(x: f64) -> f64 {
    if x.abs() > 0.5 {
        return x - libm::sin(x);
    }
    let square = x * x;
    // x³/3! − x⁵/5! + …: the next factor is 1 ∓ 2⁻⁶⁴.
    let factor = [210.0, 156.0, 110.0, 72.0, 42.0, 20.0].iter().fold(1.0, |rest, k| 1.0 - rest * square / k);
    x * square / 6.0 * factor
}

impl Oscillation {
    /// Shift at a phase in `cycles` \[length\].
    #[must_use]
    pub fn shift(&self, cycles: f64) -> f64 {
        let wave = match self.waveform {
            Waveform::Sine => sin_cos(cycles).0,
            Waveform::Triangle => {
                let u = reduced(cycles + 0.25);
                1.0 - (4.0 * u - 2.0).abs()
            }
        };
        self.amplitude * wave
    }

    /// Velocity at a phase in `cycles` [length/time]. At a corner of the triangle, that after it.
    #[must_use]
    pub fn velocity(&self, cycles: f64) -> f64 {
        match self.waveform {
            Waveform::Sine => self.max_speed() * sin_cos(cycles).1,
            Waveform::Triangle => {
                if reduced(cycles + 0.25) < 0.5 {
                    self.max_speed()
                } else {
                    -self.max_speed()
                }
            }
        }
    }

    /// Acceleration at a phase in `cycles` [length/time²]; zero for a triangle, also at its corners.
    #[must_use]
    pub fn acceleration(&self, cycles: f64) -> f64 {
        match self.waveform {
            Waveform::Sine => -self.max_acceleration() * sin_cos(cycles).0,
            Waveform::Triangle => 0.0,
        }
    }

    /// Time until a body that the plane carries leaves it \[time\], or `None`: until the plane falls faster
    /// than the body's own `acceleration` [length/time²] (positive away from the plane, so that of a weight
    /// is negative), or until a corner of a triangle.
    ///
    /// The time is later by a few roundings of the phase: then the plane recedes, and a corner has gone by.
    ///
    /// ```
    /// use haff_mechanics::{Oscillation, Waveform};
    /// let plate = Oscillation { waveform: Waveform::Sine, amplitude: 1.0, frequency: 1.0 };
    /// // With a weight of half the largest acceleration it is left where sin θ = ½.
    /// let t = plate.time_to_release(-0.5 * plate.max_acceleration(), 0.0).unwrap();
    /// assert!((t - 1.0 / 12.0).abs() < 1e-14);
    /// ```
    #[must_use]
    pub fn time_to_release(&self, acceleration: f64, cycles: f64) -> Option<f64> {
        let now = reduced(cycles);
        let wait = match self.waveform {
            Waveform::Sine => {
                let sine = -acceleration / self.max_acceleration();
                if sine >= 1.0 {
                    return None;
                }
                if sin_cos(now).0 >= sine {
                    return Some(0.0);
                }
                reduced(libm::asin(sine.max(-1.0)) / TAU - now)
            }
            // A corner that rounding has just passed is the next one for a body that is released there, so it
            // is not excluded.
            Waveform::Triangle => return Some(self.time_to_corner(cycles)),
        };
        Some((wait + LATER) / self.frequency)
    }

    /// Time until the velocity of the plane next jumps \[time\]: until a corner of a triangle; infinite for a
    /// sine. The time is later by a few roundings of the phase, so that the corner has gone by.
    #[must_use]
    pub fn time_to_corner(&self, cycles: f64) -> f64 {
        match self.waveform {
            Waveform::Sine => f64::INFINITY,
            Waveform::Triangle => {
                let now = reduced(cycles);
                (reduced(0.25 - now).min(reduced(0.75 - now)) + LATER) / self.frequency
            }
        }
    }

    /// Integrals over a time of length `duration` around the phase `middle`, in cycles: of the velocity, of
    /// the velocity times the time since the middle, and of the square of the velocity. They are exact to
    /// rounding for short and for long times.
    ///
    /// ```
    /// use haff_mechanics::{Oscillation, Waveform};
    /// let plate = Oscillation { waveform: Waveform::Sine, amplitude: 0.5, frequency: 2.0 };
    /// // Over a whole cycle the plane returns, and the mean square of a cosine is 1/2.
    /// let [moved, _, square] = plate.integrals(0.3, 0.5);
    /// assert!(moved.abs() < 1e-15);
    /// assert!((square / 0.5 - 0.5 * plate.max_speed().powi(2)).abs() < 1e-13);
    /// ```
    #[must_use]
    pub fn integrals(&self, middle: f64, duration: f64) -> [f64; 3] {
        let half = 0.5 * duration;
        let speed = self.max_speed();
        match self.waveform {
            Waveform::Sine => {
                let omega = TAU * self.frequency;
                let (sin, cos) = sin_cos(middle);
                let angle = omega * half;
                // Short times need the small differences y − sin y and sin y − y cos y without cancellation.
                let excess = less_sine(angle);
                let sine_less = 2.0 * angle * libm::sin(0.5 * angle).powi(2) - excess;
                let double = (cos - sin) * (cos + sin);
                [
                    2.0 * self.amplitude * cos * (angle - excess),
                    -2.0 * (self.amplitude / omega) * sin * sine_less,
                    speed * speed * (duration * cos * cos - double * less_sine(2.0 * angle) / (2.0 * omega)),
                ]
            }
            Waveform::Triangle => {
                let reach = self.frequency * half;
                let (first, last) = (middle - reach, middle + reach);
                let square = speed * speed * duration;
                let corner = |cycles: f64| (2.0 * (cycles + 0.25)).floor();
                let before = self.velocity(0.5 * corner(first));
                let corners = corner(last) - corner(first);
                if corners == 0.0 {
                    return [before * duration, 0.0, square];
                }
                if corners == 1.0 {
                    let turn = (0.5 * corner(last) - 0.25 - middle) / self.frequency;
                    return [2.0 * before * turn, before * (turn - half) * (turn + half), square];
                }
                let (start, end) = (self.shift(first), self.shift(last));
                let area = self.triangle_area(last) - self.triangle_area(first);
                [end - start, half * (start + end) - area / self.frequency, square]
            }
        }
    }

    /// The integral of the shift of a triangle over the phase, from the last lower corner on
    /// [length·cycles].
    fn triangle_area(&self, cycles: f64) -> f64 {
        let u = reduced(cycles + 0.25);
        let area = if u < 0.5 { (2.0 * u - 1.0) * u } else { (3.0 - 2.0 * u) * u - 1.0 };
        self.amplitude * area
    }

    /// Largest speed [length/time].
    #[must_use]
    pub fn max_speed(&self) -> f64 {
        match self.waveform {
            Waveform::Sine => TAU * self.frequency * self.amplitude,
            Waveform::Triangle => 4.0 * self.frequency * self.amplitude,
        }
    }

    /// Largest acceleration [length/time²]; zero for a triangle.
    #[must_use]
    pub fn max_acceleration(&self) -> f64 {
        match self.waveform {
            Waveform::Sine => TAU * self.frequency * self.max_speed(),
            Waveform::Triangle => 0.0,
        }
    }

    /// Time until a body touches the plane \[time\], or `None`.
    ///
    /// `distance` of the body's surface from the plane \[length\], its `speed` [length/time] and its constant
    /// `acceleration` [length/time²], positive away from the plane, both in the frame of the mean position of
    /// the plane; `cycles`: the phase now.
    ///
    /// * The first time t ≥ 0 at which the gap falls through zero.
    /// * Touching or behind the plane by rounding, and approaching it: `Some(0.0)`.
    /// * Behind the plane by rounding and separating, but turning back before the gap is positive: the time
    ///   when it turns.
    /// * Not reached, or an argument that is not finite: `None`.
    ///
    /// ```
    /// use haff_mechanics::{Oscillation, Waveform};
    /// let plate = Oscillation { waveform: Waveform::Sine, amplitude: 0.5, frequency: 1.0 };
    /// // A body at rest at the height of the mean position is touched when the plate rises through it.
    /// let t = plate.time_to_contact(0.5, 0.0, 0.0, 0.75).unwrap();
    /// assert!((t - 0.25).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn time_to_contact(&self, distance: f64, speed: f64, acceleration: f64, cycles: f64) -> Option<f64> {
        if !(distance.is_finite() && speed.is_finite() && acceleration.is_finite() && cycles.is_finite()) {
            return None;
        }
        let start =
            Start { height: distance + self.shift(cycles), speed, acceleration, cycles: reduced(cycles) };
        let mut piece = Piece { time: 0.0, gap: distance };
        // A flight within reach of the plane is touched within about a cycle; a flight at rest need not be.
        let mut idle = 0;
        loop {
            let (height, velocity) = start.at(piece.time);
            if height > self.reach() {
                // The plane cannot touch the body before it is this near.
                let wait = time_to_plane(height - self.reach(), velocity, acceleration)?;
                if wait > 0.0 {
                    piece = self.piece(&start, piece.time + wait);
                }
            }
            let length = self.piece_length(&start, piece.time);
            if let Some(delay) = self.contact_within(&start, &piece, length) {
                return Some(piece.time + delay).filter(|t| t.is_finite());
            }
            if !length.is_finite() {
                return None;
            }
            let next = piece.time + length;
            idle += 1;
            // Time does not advance any more, or nothing moves but the plane.
            if next <= piece.time || (idle > 8 && velocity == 0.0 && acceleration == 0.0) {
                return None;
            }
            piece = self.piece(&start, next);
        }
    }

    /// Bodies further from the mean position are not touched: the amplitude without its rounding, so that a
    /// body that approaches ever more slowly does not take endless cycles.
    fn reach(&self) -> f64 {
        self.amplitude * (1.0 - 4.0 * f64::EPSILON)
    }

    fn piece(&self, start: &Start, time: f64) -> Piece {
        Piece { time, gap: start.at(time).0 - self.shift(self.phase(start, time)) }
    }

    fn phase(&self, start: &Start, time: f64) -> f64 {
        reduced(start.cycles + self.frequency * time)
    }

    /// Time from `time` to the next zero of the relative acceleration, or corner of a triangle; infinite if
    /// there is none.
    fn piece_length(&self, start: &Start, time: f64) -> f64 {
        let now = self.phase(start, time);
        let ends = match self.waveform {
            Waveform::Triangle => [0.25, 0.75],
            Waveform::Sine => {
                // a + A ω² sin θ = 0
                let sine = -start.acceleration / self.max_acceleration();
                if sine.abs() >= 1.0 {
                    return f64::INFINITY;
                }
                let angle = libm::asin(sine) / TAU;
                [reduced(angle), reduced(0.5 - angle)]
            }
        };
        // A zero at the start itself, or before it by rounding, is not the next one.
        let ahead = |end: f64| {
            let cycles = reduced(end - now);
            if cycles > 1e-9 { cycles } else { cycles + 1.0 }
        };
        ahead(ends[0]).min(ahead(ends[1])) / self.frequency
    }

    /// Time from the start of the piece to the first contact within its length.
    fn contact_within(&self, start: &Start, piece: &Piece, length: f64) -> Option<f64> {
        let acceleration = start.acceleration;
        let (_, speed) = start.at(piece.time);
        if self.waveform == Waveform::Triangle {
            // The velocity of the plane within the piece: at its corners rounding would choose the side.
            let rate = speed - self.velocity(self.phase(start, piece.time + 0.5 * length));
            return time_to_plane(piece.gap, rate, acceleration).filter(|&t| t <= length);
        }
        let cycles = self.phase(start, piece.time);
        let omega = TAU * self.frequency;
        let rate = |t: f64| {
            let (sin, cos) = sin_cos(reduced(cycles + self.frequency * t));
            let rate = speed + acceleration * t - self.max_speed() * cos;
            (rate, acceleration + self.max_acceleration() * sin)
        };
        let gap = |t: f64| {
            // The difference of two sines as a product, so that short times are exact.
            let half = 0.5 * self.frequency * t;
            let moved = 2.0 * self.amplitude * libm::sin(0.5 * omega * t) * sin_cos(reduced(cycles + half)).1;
            (piece.gap + (speed + 0.5 * acceleration * t) * t - moved, rate(t).0)
        };
        let length = if length < f64::INFINITY {
            length
        } else if acceleration < 0.0 {
            // The relative velocity is monotonic without end: until the body is certainly behind the plane,
            let (height, _) = start.at(piece.time);
            time_to_plane(height + 2.0 * self.amplitude, speed, acceleration)?
        } else {
            // or is certainly faster than the plane.
            ((2.0 * self.max_speed() - speed) / acceleration).max(0.0)
        };
        let (first, last) = (rate(0.0).0, rate(length).0);
        // The part of the piece in which the gap decreases.
        let (from, to) = match (first < 0.0, last < 0.0) {
            (true, true) => (0.0, length),
            (false, false) => {
                return (piece.gap <= 0.0 && first == 0.0 && rate(0.0).1 < 0.0).then_some(0.0);
            }
            (true, false) => (0.0, bracketed_root(0.0, length, true, rate)),
            (false, true) => (bracketed_root(0.0, length, false, rate), length),
        };
        if (if from == 0.0 { piece.gap } else { gap(from).0 }) <= 0.0 {
            return Some(from);
        }
        (gap(to).0 <= 0.0).then(|| bracketed_root(from, to, false, gap))
    }
}

/// A flight at the start of the search.
struct Start {
    /// Above the mean position of the plane.
    height: f64,
    speed: f64,
    acceleration: f64,
    /// 0 ≤ phase < 1.
    cycles: f64,
}

impl Start {
    /// Height and speed after `time`.
    fn at(&self, time: f64) -> (f64, f64) {
        let change = self.acceleration * time;
        (self.height + (self.speed + 0.5 * change) * time, self.speed + change)
    }
}

/// The start of a piece of the flight in which the relative velocity is monotonic.
struct Piece {
    /// Since the start of the search.
    time: f64,
    gap: f64,
}
