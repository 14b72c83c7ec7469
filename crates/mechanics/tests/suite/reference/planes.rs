//! A sphere and a plane wall, a centre and a cell face.

use haff_mechanics::{time_to_face, time_to_plane};

use super::big::{Big, abs, big, f64_of};
use super::cases::Draw;
use super::judge::{Exact, Worst};

/// Exact flight d + s t + ½ a t² against 0.
struct Line {
    d: Big,
    s: Big,
    a: Big,
    face: bool,
}

impl Line {
    /// Whether a flight from below the wall reaches it upwards, and falls back through it.
    fn rises_to_the_wall(&self) -> bool {
        let (zero, two) = (big(0.0), big(2.0));
        self.a < zero && self.s > zero && &self.s * &self.s > two * &self.a * &self.d
    }
}

impl Exact for Line {
    fn first_contact(&self, shrink: &Big) -> Option<Big> {
        let zero = big(0.0);
        let (s, a) = (&self.s, &self.a);
        let mut d = &self.d + shrink;
        if d < zero && !self.face && !self.rises_to_the_wall() {
            d.clone_from(&zero);
        }
        if d <= zero && (*s < zero || (*s == zero && *a < zero)) {
            return Some(zero);
        }
        if *a == zero {
            return (*s < zero).then(|| d / -s);
        }
        let disc = s * s - big(2.0) * a * &d;
        if *a < zero {
            // Below the face and not reaching it: the apex.
            let w = if disc > zero { disc.sqrt() } else { zero.clone() };
            return Some(if *s >= zero { (s + w) / -a } else { big(2.0) * d / (w - s) });
        }
        let reached = *s < zero && (disc > zero || (disc == zero && !self.face));
        reached.then(|| big(2.0) * d / (disc.sqrt() - s))
    }

    fn gap(&self, t: &Big) -> Big {
        let zero = big(0.0);
        // For a wall a start below it is a contact, at the distance of the start, unless the flight rises
        // above it; a flight that starts beyond a face and moves outward has left at its start.
        let below = self.d < zero && if self.face { self.s <= zero } else { !self.rises_to_the_wall() };
        let contact = if below { self.d.clone() } else { zero };
        &self.d + &self.s * t + &self.a * t * t / big(2.0) - contact
    }

    fn closing_speed(&self, t: &Big) -> Big {
        -(&self.s + &self.a * t)
    }

    fn scale(&self, t: &Big) -> Big {
        abs(&self.d) + abs(&self.s) * t + abs(&self.a) * t * t / big(2.0)
    }

    fn unit(&self) -> Big {
        self.scale(&big(0.0))
    }

    fn undecided_at_start(&self, _: f64) -> bool {
        // One coordinate is not rounded before the check: every start is decided.
        false
    }
}

/// Two roundings in each term of the discriminant, one in the root, two in sum and quotient.
const LIMIT: f64 = 4.0;

/// Flights towards and away from the plane, with gravity of all strengths; grazing to the last bit; from
/// contact.
fn lines(count: u32, seed: u64) -> impl Iterator<Item = (f64, f64, f64)> {
    let mut draw = Draw::new(seed);
    (0..count).map(move |k| {
        let d = match k % 8 {
            0 => 0.0,
            1 => draw.decades(-300.0, 300.0),
            _ => draw.decades(-16.0, 4.0),
        };
        let s = match draw.index(6) {
            0 => 0.0,
            1 => draw.sign() * draw.decades(-100.0, 100.0),
            2 => draw.decades(-9.0, 3.0),
            _ => -draw.decades(-9.0, 3.0),
        };
        let a = match k % 5 {
            0 => 0.0,
            // Turns back within the last digits of the wall.
            1 if d > 0.0 && s != 0.0 => (s / d) * (0.5 * s) * (1.0 + draw.sign() * draw.decades(-17.0, -1.0)),
            2 => draw.sign() * draw.decades(-200.0, 100.0),
            _ => -draw.decades(-6.0, 3.0),
        };
        (d, s, if a.is_finite() { a } else { -1.0 })
    })
}

fn run(name: &str, face: bool, cases: impl Iterator<Item = (f64, f64, f64)>) -> Worst {
    let mut worst = Worst::default();
    for (number, (d, s, a)) in cases.enumerate() {
        let result = if face { time_to_face(d, s, a) } else { time_to_plane(d, s, a) };
        let exact = Line { d: big(d), s: big(s), a: big(a), face };
        let reference = exact.first_contact(&big(0.0));
        // Times beyond the range of f64 are none.
        if reference.as_ref().is_some_and(|t| *t > big(f64::MAX)) {
            assert_eq!(result, None, "{name} {number}: d = {d:e}, s = {s:e}, a = {a:e}");
            continue;
        }
        // Subnormal times have fewer digits.
        if reference.as_ref().is_some_and(|t| *t > big(0.0) && *t < big(f64::MIN_POSITIVE)) {
            let (t, reference) = (result.expect("a contact"), f64_of(&reference.expect("a contact")));
            let quantum = f64::from_bits(1);
            assert!((t - reference).abs() <= 2.0 * quantum, "{name} {number}: {t:e} against {reference:e}");
            continue;
        }
        if let Err(message) = worst.judge(&exact, result, LIMIT) {
            panic!("{name} {number}: {message}\nd = {d:e}, s = {s:e}, a = {a:e}");
        }
    }
    worst.print(name);
    assert!(worst.hits > worst.cases / 5 && worst.misses > worst.cases / 50, "unbalanced cases: {worst:?}");
    worst
}

#[test]
fn wall_contacts_are_exact_to_a_few_ulp() {
    run("plane wall", false, lines(40_000, 0x5eed_0011));
}

#[test]
fn wall_contacts_from_below_by_rounding_return_to_the_wall_or_to_the_start() {
    let below = lines(10_000, 0x5eed_0012).map(|(d, s, a)| (-d.min(1.0) * f64::EPSILON, s, a));
    run("plane wall, from below by rounding", false, below);
}

#[test]
fn cell_exits_are_exact_to_a_few_ulp() {
    run("cell face", true, lines(30_000, 0x5eed_0013));
}

#[test]
fn cell_exits_of_flights_that_started_outside_are_exact_to_a_few_ulp() {
    // Every other flight enters and leaves again, some by the last digit; for those that turn back before the
    // face only the time of the apex is defined.
    let outside = lines(30_000, 0x5eed_0014).enumerate().map(|(k, (d, s, a))| match k % 2 {
        0 => (-d, s.abs(), -a.abs()),
        _ => (-d, s, a),
    });
    let rises = |d: f64, s: f64, a: f64| (s / -a) * (0.5 * s) >= d.abs() * (1.0 - f64::EPSILON);
    let reaching = outside.filter(move |&(d, s, a)| a >= 0.0 || s < 0.0 || rises(d, s, a));
    run("cell face, from outside", true, reaching);
}
