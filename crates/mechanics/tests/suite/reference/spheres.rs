//! Two spheres, with and without relative acceleration.

use glam::DVec3;
use haff_mechanics::{time_to_contact, time_to_contact_accelerated};

use super::big::{Big, BigVec, abs, big, f64_of, positive_zeros};
use super::cases::{self, Case};
use super::judge::{Exact, Worst};

/// Exact flight |r + v t + ½ a t²| against σ.
struct Spheres {
    r: BigVec,
    v: BigVec,
    a: BigVec,
    sigma: Big,
}

impl Spheres {
    fn new(case: &Case) -> Self {
        Self {
            r: BigVec::new(case.r),
            v: BigVec::new(case.v),
            a: BigVec::new(case.a),
            sigma: big(case.sigma),
        }
    }

    fn position(&self, t: &Big) -> BigVec {
        self.r.plus(&self.v, t).plus(&self.a, &(t * t / big(2.0)))
    }

    fn velocity(&self, t: &Big) -> BigVec {
        self.v.plus(&self.a, t)
    }

    /// Coefficients of |q|² − contact².
    fn polynomial(&self, contact2: &Big) -> Vec<Big> {
        let (r, v, a) = (&self.r, &self.v, &self.a);
        let mut p = vec![
            r.dot(r) - contact2,
            big(2.0) * r.dot(v),
            v.dot(v) + r.dot(a),
            v.dot(a),
            a.dot(a) / big(4.0),
        ];
        while p.len() > 1 && p[p.len() - 1] == big(0.0) {
            p.pop();
        }
        p
    }
}

impl Exact for Spheres {
    fn first_contact(&self, shrink: &Big) -> Option<Big> {
        let sigma = &self.sigma - shrink;
        if sigma <= big(0.0) {
            return None;
        }
        let rr = self.r.dot(&self.r);
        let mut contact2 = &sigma * &sigma;
        let touching = rr <= contact2;
        if touching {
            contact2 = rr;
        }
        let p = self.polynomial(&contact2);
        let zero = big(0.0);
        let falls_at_start = p[1..].iter().find(|c| **c != zero).is_some_and(|c| *c < zero);
        if touching && falls_at_start {
            return Some(zero);
        }
        // For a start in contact the constant term vanishes; the remaining polynomial starts above zero.
        let zeros = positive_zeros(if touching { &p[1..] } else { &p });
        // The first zero is falling: the polynomial is positive before it.
        zeros.into_iter().next()
    }

    fn gap(&self, t: &Big) -> Big {
        let start = self.r.length();
        let contact = if start < self.sigma { start } else { self.sigma.clone() };
        self.position(t).length() - contact
    }

    fn closing_speed(&self, t: &Big) -> Big {
        let q = self.position(t);
        -(q.dot(&self.velocity(t)) / q.length())
    }

    fn scale(&self, t: &Big) -> Big {
        self.r.length() + self.v.length() * t + self.a.length() * t * t / big(2.0) + &self.sigma
    }

    fn unit(&self) -> Big {
        self.sigma.clone()
    }

    fn undecided_at_start(&self, tolerance: f64) -> bool {
        let ulps = big(tolerance) * big(f64::EPSILON);
        let near = self.r.length() <= &self.sigma * (big(1.0) + &ulps);
        let slow = abs(&self.r.dot(&self.v)) <= self.r.length() * self.v.length() * &ulps;
        near && slow
    }
}

/// Bound for straight flights [ε scale]. In units of u = ε/2 a dot product has 3 roundings, a component of
/// the cross product 2 and its square 5 in all, the discriminant 6, root, denominator and quotient one each;
/// every one of them moves the contact by at most its share of `scale`: 12 u.
const STRAIGHT: f64 = 6.0;
/// Bound for curved flights: the position has 4 roundings more, and the iteration ends within an ulp of the
/// time.
const CURVED: f64 = 8.0;

type Kernel = fn(&Case) -> Option<f64>;

fn straight(case: &Case) -> Option<f64> {
    time_to_contact(case.r, case.v, case.sigma)
}

fn curved(case: &Case) -> Option<f64> {
    time_to_contact_accelerated(case.r, case.v, case.a, case.sigma)
}

/// The textbook form, with a discriminant that cancels far from contact.
fn textbook(case: &Case) -> Option<f64> {
    let (b, vv) = (case.r.dot(case.v), case.v.length_squared());
    let gap = case.r.length_squared() - case.sigma * case.sigma;
    let disc = b * b - vv * gap;
    (b < 0.0 && disc >= 0.0).then(|| (gap / (disc.sqrt() - b)).max(0.0))
}

fn run(name: &str, bound: f64, kernel: Kernel, cases: impl Iterator<Item = Case>) {
    let mut worst = Worst::default();
    for (number, case) in cases.enumerate() {
        let result = kernel(&case);
        let mirrored = kernel(&Case { r: -case.r, v: -case.v, a: -case.a, ..case });
        assert_eq!(result.map(f64::to_bits), mirrored.map(f64::to_bits), "not even: {case:?}");
        if let Err(message) = worst.judge(&Spheres::new(&case), result, bound) {
            panic!("{name} {number}: {message}\n{case:?}");
        }
    }
    worst.print(name);
    assert!(worst.hits > worst.cases / 5, "too few contacts for a conclusion: {worst:?}");
    assert!(worst.misses > worst.cases / 50, "too few misses for a conclusion: {worst:?}");
}

#[test]
#[ignore = "long: scripts/test all"]
fn straight_contacts_are_exact_to_a_few_ulp() {
    run("spheres, straight", STRAIGHT, straight, cases::straight(40_000));
}

#[test]
fn straight_contacts_are_exact_in_extreme_units() {
    let cases = cases::straight(6_000).map(cases::extreme_units);
    run("spheres, straight, extreme units", STRAIGHT, straight, cases);
}

#[test]
#[ignore = "long: scripts/test all"]
fn curved_contacts_are_exact_to_a_few_ulp() {
    run("spheres, accelerated", CURVED, curved, cases::curved(20_000));
}

#[test]
fn curved_contacts_are_exact_in_extreme_units() {
    let cases = cases::curved(4_000).map(cases::extreme_units);
    run("spheres, accelerated, extreme units", CURVED, curved, cases);
}

#[test]
#[ignore = "long: scripts/test all"]
fn grazing_curved_contacts_are_found_exactly_when_they_exist() {
    run("spheres, accelerated, grazing", CURVED, curved, cases::curved_grazing(12_000));
}

#[test]
#[ignore = "long: scripts/test all"]
fn bounces_from_contact_return_at_the_exact_time() {
    run("spheres, accelerated, from contact", CURVED, curved, cases::curved_from_contact(12_000));
}

/// The accelerated kernel finds the contacts of straight flights where the acceleration is zero or nearly so.
#[test]
fn contacts_under_negligible_acceleration_are_those_of_straight_flights() {
    for case in cases::straight(4_000) {
        let none = time_to_contact_accelerated(case.r, case.v, DVec3::ZERO, case.sigma);
        assert_eq!(none, straight(&case), "{case:?}");
        for strength in [1e-120, 1e-60] {
            let weak = DVec3::splat(case.v.length_squared() / case.sigma * strength);
            let weak = time_to_contact_accelerated(case.r, case.v, weak, case.sigma);
            // Beyond 10⁵⁰ σ even such an acceleration reverses a flight.
            if weak.is_none_or(|t| t * case.v.length() < 1e50 * case.sigma) {
                let verdict = Worst::default().judge(&Spheres::new(&case), weak, CURVED);
                verdict.unwrap_or_else(|message| panic!("{message}\n{case:?}"));
            }
        }
    }
}

/// Check of the criteria: on the same flights they reject the textbook discriminant, which loses a digit for
/// every factor of ten in distance.
#[test]
fn the_criteria_reject_the_cancelling_discriminant() {
    let mut rejected = 0;
    for case in cases::straight(4_000) {
        let verdict = Worst::default().judge(&Spheres::new(&case), textbook(&case), STRAIGHT);
        rejected += u32::from(verdict.is_err());
    }
    assert!(rejected > 100, "only {rejected} of 4000 rejected");
}

/// Largest contact error in σ by distance of the start, for both discriminants: the table of the README.
#[test]
fn contact_error_grows_with_the_distance_of_the_start_only_linearly() {
    for (log, bound) in [(0.5, 4e-15), (1.0, 1e-14), (2.0, 1e-13), (3.0, 1e-12), (4.0, 1e-11)] {
        let error = |kernel: Kernel| {
            let mut largest = 0f64;
            for case in cases::aimed(2_000, 10f64.powf(log)) {
                if let Some(t) = kernel(&case) {
                    let exact = Spheres::new(&case);
                    largest = largest.max(f64_of(&(abs(&exact.gap(&big(t))) / exact.unit())));
                }
            }
            largest
        };
        let (ours, other) = (error(straight), error(textbook));
        println!("|r| = 10^{log} σ: contact error {ours:.1e} σ, with b² − v²(r² − σ²) {other:.1e} σ");
        assert!(ours <= bound, "{ours:e} σ at 10^{log} σ, bound {bound:e}");
    }
}
