/*!
Criteria for a contact time, compared with the exact one.

Arguments are f64 numbers, and an error of half an ulp in each is not an error of the kernel: its best result
is the exact answer to arguments a few ulp away. With the length `scale(t)` = sum of the magnitudes of all
terms that make up the position at the contact, a returned time is correct if, in 400-bit arithmetic,

* at that time the distance is σ within K ε scale (contact error), and
* either the time agrees with the exact first contact within K ε (scale/(closing speed) + t) (time error,
  condition number included), or with σ smaller by K ε scale the first contact is no earlier (grazing:
  backward error).

A returned `None` is correct if there is no exact contact, or none with σ smaller by K ε scale.
*/

use super::big::{Big, abs, big, f64_of};

/// The exact properties of one flight.
pub trait Exact {
    /// First contact if the contact distance is reduced by `shrink`.
    fn first_contact(&self, shrink: &Big) -> Option<Big>;
    /// Distance − contact distance at time t.
    fn gap(&self, t: &Big) -> Big;
    /// Rate at which the distance decreases at time t.
    fn closing_speed(&self, t: &Big) -> Big;
    /// Sum of the magnitudes of the terms of the position at time t.
    fn scale(&self, t: &Big) -> Big;
    /// Contact distance, or the unit of the contact error.
    fn unit(&self) -> Big;
    /// Whether, within rounding, the start is in contact and its speed along the normal is zero.
    fn undecided_at_start(&self, tolerance: f64) -> bool;
}

/// The largest errors found.
#[derive(Default, Debug, Clone)]
pub struct Worst {
    pub cases: u64,
    pub hits: u64,
    pub misses: u64,
    /// Contact error in units of ε scale.
    pub contact: f64,
    /// Contact error in units of σ, for starts within 10 σ.
    pub contact_near: f64,
    /// Time error in units of ε (scale/closing speed + t).
    pub time: f64,
    /// Hits and misses decided by the backward error.
    pub banded: u64,
}

impl Worst {
    /// Checks one result; the error describes the deviation.
    pub fn judge(&mut self, exact: &dyn Exact, result: Option<f64>, k: f64) -> Result<(), String> {
        self.cases += 1;
        let zero = big(0.0);
        let epsilon = big(f64::EPSILON);
        let reference = exact.first_contact(&zero);
        let shown = reference.as_ref().map(f64_of);
        let Some(t) = result else {
            self.misses += 1;
            let Some(reference) = reference else { return Ok(()) };
            self.banded += 1;
            let shrink = exact.scale(&reference) * big(k) * &epsilon;
            return match exact.first_contact(&shrink) {
                Some(t) if !exact.undecided_at_start(k) => {
                    Err(format!("None, but exact {shown:?}, and {:e} with smaller spheres", f64_of(&t)))
                }
                _ => Ok(()),
            };
        };
        if !(t >= 0.0 && t.is_finite()) {
            return Err(format!("time {t}, exact {shown:?}"));
        }
        self.hits += 1;
        let t = big(t);
        let ulps = exact.scale(&t) * &epsilon;
        if ulps == zero {
            return Ok(());
        }
        let gap = abs(&exact.gap(&t));
        let contact = f64_of(&(&gap / &ulps));
        self.contact = self.contact.max(contact);
        if exact.scale(&t) < exact.unit() * big(30.0) {
            self.contact_near = self.contact_near.max(f64_of(&(gap / exact.unit())));
        }
        if contact > k {
            return Err(format!("contact error {contact:.1} ε scale at {:e}, exact {shown:?}", f64_of(&t)));
        }
        if let Some(reference) = &reference {
            let closing = exact.closing_speed(reference);
            // Below this closing speed, rounding of the arguments decides whether there is a contact.
            if closing > zero {
                let unit = &epsilon * (exact.scale(reference) / closing + reference);
                let error = f64_of(&(abs(&(reference - &t)) / unit));
                if error <= k {
                    self.time = self.time.max(error);
                    return Ok(());
                }
            }
        }
        self.banded += 1;
        match exact.first_contact(&(ulps * big(k))) {
            Some(earlier) if earlier < t && !exact.undecided_at_start(k) => {
                Err(format!("{:e}, exact {shown:?}, {:e} with smaller spheres", f64_of(&t), f64_of(&earlier)))
            }
            _ => Ok(()),
        }
    }

    pub fn print(&self, name: &str) {
        println!(
            "{name}: {} cases, {} hits, {} misses, {} decided by backward error; max contact error {:.2} ε scale \
             ({:.1e} σ for starts within 10 σ), max time error {:.2} ε condition",
            self.cases, self.hits, self.misses, self.banded, self.contact, self.contact_near, self.time
        );
    }
}
