//! A body and an oscillating plane: contact times against 400-bit arithmetic.

use std::f64::consts::{PI, TAU};

use haff_mechanics::{Oscillation, Waveform};

use super::big::{Big, abs, big, f64_of};
use super::cases::Draw;

/// Pieces of a cycle that the reference looks for a change of sign in, before it refines.
const PIECES: u32 = 4096;

/// π to 400 bits, by Machin's formula.
fn pi() -> Big {
    let arctan_of_inverse = |n: u32| {
        let (n, mut sum) = (big(f64::from(n)), big(0.0));
        let mut power = big(1.0) / &n;
        let square = &n * &n;
        for k in 0..400_u32 {
            let term = &power / big(f64::from(2 * k + 1));
            sum = if k % 2 == 0 { sum + term } else { sum - term };
            power /= &square;
        }
        sum
    };
    big(4.0) * (big(4.0) * arctan_of_inverse(5) - arctan_of_inverse(239))
}

/// sin and cos of 2π `cycles`, by Taylor's series of a hundredth of the angle.
fn sin_cos(cycles: &Big, pi: &Big) -> (Big, Big) {
    let whole = big(f64_of(cycles).floor());
    let x = (cycles - whole) * pi * big(2.0) / big(128.0);
    let (mut sin, mut cos) = (big(0.0), big(0.0));
    let mut term = big(1.0);
    for k in 0..80_u32 {
        match k % 4 {
            0 => cos += &term,
            1 => sin += &term,
            2 => cos -= &term,
            _ => sin -= &term,
        }
        term = term * &x / big(f64::from(k + 1));
    }
    for _ in 0..7 {
        (sin, cos) = (big(2.0) * &sin * &cos, &cos * &cos - &sin * &sin);
    }
    (sin, cos)
}

/// A flight over an oscillating plate.
struct Case {
    plate: Oscillation,
    distance: f64,
    speed: f64,
    acceleration: f64,
    cycles: f64,
}

impl Case {
    fn shift(&self, cycles: &Big, pi: &Big) -> Big {
        let wave = match self.plate.waveform {
            Waveform::Sine => sin_cos(cycles, pi).0,
            Waveform::Triangle => {
                let ahead = cycles + big(0.25);
                let u = &ahead - big(f64_of(&ahead).floor());
                big(1.0) - abs(&(big(4.0) * u - big(2.0)))
            }
        };
        big(self.plate.amplitude) * wave
    }

    fn gap(&self, t: &Big, pi: &Big) -> Big {
        let start = big(self.cycles);
        let now = &start + big(self.plate.frequency) * t;
        big(self.distance) + (big(self.speed) + big(0.5) * big(self.acceleration) * t) * t
            - self.shift(&now, pi)
            + self.shift(&start, pi)
    }

    /// The gap in double precision, for finding changes of sign.
    fn rough_gap(&self, t: f64) -> f64 {
        let wave = |cycles: f64| {
            let sine = libm::sin(TAU * cycles.fract());
            if self.plate.waveform == Waveform::Sine { sine } else { 2.0 / PI * libm::asin(sine) }
        };
        let moved = wave(self.cycles + self.plate.frequency * t) - wave(self.cycles);
        self.distance + (self.speed + 0.5 * self.acceleration * t) * t - self.plate.amplitude * moved
    }

    /// First change of sign of the gap before `end`, and before it the smallest gap on the grid.
    fn first_contact(&self, end: f64, pi: &Big) -> Option<Big> {
        let step = 1.0 / (self.plate.frequency * f64::from(PIECES));
        let mut t = 0.0;
        let mut before = false;
        while t < end + step {
            let now = self.rough_gap(t);
            if now < 0.0 && before {
                let (mut low, mut high) = (big(t - step), big(t));
                // 2⁻⁷⁰ of the step is left.
                for _ in 0..70 {
                    let middle = (&low + &high) * big(0.5);
                    if self.gap(&middle, pi) > big(0.0) {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                return Some(high);
            }
            before = now > 0.0;
            t += step;
        }
        None
    }
}

/// Bodies that fall onto plates: the first contact is found, and its time is exact to 1e-12 of the time of
/// flight and of the period.
fn check(waveform: Waveform, name: &str) {
    let pi = pi();
    let mut draw = Draw::new(41);
    let (mut worst, mut contacts, mut grazing) = (0.0_f64, 0, 0);
    // `HAFF_IMPACTS=10000` for the long run.
    let impacts = std::env::var("HAFF_IMPACTS").map_or(500, |n| n.parse().expect("a number of impacts"));
    for _ in 0..impacts {
        let frequency = draw.decades(-1.0, 1.0);
        let period = 1.0 / frequency;
        let gravity = draw.decades(-1.0, 1.0);
        // Γ = A ω²/g between 0.1 and 100.
        let gamma = draw.decades(-1.0, 2.0);
        let amplitude = gamma * gravity / (TAU * frequency).powi(2);
        let case = Case {
            plate: Oscillation { waveform, amplitude, frequency },
            distance: amplitude * draw.decades(-6.0, 1.0),
            speed: draw.uniform(-2.0, 4.0) * gravity * period,
            acceleration: -gravity,
            cycles: draw.uniform(0.0, 1.0),
        };
        let found = case
            .plate
            .time_to_contact(case.distance, case.speed, case.acceleration, case.cycles)
            .expect("a falling body touches the plate");
        let Some(exact) = case.first_contact(found + period, &pi) else {
            panic!("found {found}, where the reference has none");
        };
        let error = f64_of(&abs(&(&exact - big(found)))) / (found + period);
        // A gap that only just closes: both answers are first contacts of flights an ulp away.
        let near = f64_of(&abs(&case.gap(&big(found.min(f64_of(&exact))), &pi)));
        if error > 1e-12 && near < 1e-14 * (amplitude + case.distance) {
            grazing += 1;
            continue;
        }
        worst = worst.max(error);
        contacts += 1;
        assert!(
            error < 1e-12,
            "found {found}, exact {}: {error:e}; Γ = {gamma}, {frequency}, gap there {:e}",
            f64_of(&exact),
            f64_of(&case.gap(&big(found), &pi)) / amplitude
        );
    }
    println!("{name}: {contacts} contacts, {grazing} grazing, largest error {worst:.1e} of the time");
    assert!(contacts > impacts * 95 / 100 && grazing < impacts / 100 + 2, "{contacts}, {grazing}");
}

#[test]
#[ignore = "long: scripts/test all"]
fn contacts_with_a_sine_plate_are_those_of_400_bits() {
    check(Waveform::Sine, "sine plates");
}

#[test]
fn contacts_with_a_triangle_plate_are_those_of_400_bits() {
    check(Waveform::Triangle, "triangle plates");
}
