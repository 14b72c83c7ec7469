//! Arithmetic with 400 bits, and positive zeros of polynomials of degree ≤ 4 in it.

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use glam::DVec3;

/// A number of 400 significant bits: products of products of f64 numbers of similar size are exact, and
/// rounding errors are 340 bits below the last bit of an f64.
pub type Big = FBig<HalfEven, 2>;
pub const BITS: usize = 400;

/// The exact value of an f64.
pub fn big(x: f64) -> Big {
    Big::try_from(x).expect("finite").with_precision(BITS).value()
}

/// Nearest f64.
pub fn f64_of(x: &Big) -> f64 {
    x.to_f64().value()
}

/// x · 2^k.
pub fn ldexp(x: &Big, k: i32) -> Big {
    if k >= 0 { x.clone() << (k as isize) } else { x.clone() >> (-k as isize) }
}

/// Magnitude.
pub fn abs(x: &Big) -> Big {
    if *x < Big::ZERO { -x.clone() } else { x.clone() }
}

/// Three components.
#[derive(Clone)]
pub struct BigVec(pub [Big; 3]);

impl BigVec {
    pub fn new(v: DVec3) -> Self {
        Self([big(v.x), big(v.y), big(v.z)])
    }

    pub fn dot(&self, other: &Self) -> Big {
        let ([a, b, c], [x, y, z]) = (&self.0, &other.0);
        a * x + b * y + c * z
    }

    /// self + other · factor
    pub fn plus(&self, other: &Self, factor: &Big) -> Self {
        let ([a, b, c], [x, y, z]) = (&self.0, &other.0);
        Self([a + x * factor, b + y * factor, c + z * factor])
    }

    pub fn times(&self, factor: &Big) -> Self {
        let [x, y, z] = &self.0;
        Self([x * factor, y * factor, z * factor])
    }

    pub fn cross(&self, other: &Self) -> Self {
        let ([a, b, c], [x, y, z]) = (&self.0, &other.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }

    pub fn length(&self) -> Big {
        self.dot(self).sqrt()
    }
}

/// Value of a polynomial, coefficients in ascending order.
pub fn evaluate(p: &[Big], t: &Big) -> Big {
    p.iter().rev().skip(1).fold(p[p.len() - 1].clone(), |sum, c| sum * t + c)
}

pub fn derivative(p: &[Big]) -> Vec<Big> {
    p.iter().enumerate().skip(1).map(|(k, c)| c * Big::from(k)).collect()
}

/// Positive zeros at which the polynomial changes sign, in ascending order, to 200 bits.
///
/// The zeros of the derivative divide the half-line into monotone pieces, recursively down to degree one.
pub fn positive_zeros(p: &[Big]) -> Vec<Big> {
    let degree = p.iter().rposition(|c| *c != Big::ZERO).unwrap_or(0);
    let p = &p[..=degree];
    if degree == 0 {
        return Vec::new();
    }
    let slope = derivative(p);
    let mut points = vec![Big::ZERO];
    points.extend(positive_zeros(&slope));
    points.push(cauchy_bound(p));
    let mut zeros = Vec::new();
    for pair in points.windows(2) {
        let (low, high) = (&pair[0], &pair[1]);
        let (at_low, at_high) = (evaluate(p, low), evaluate(p, high));
        if high > low
            && at_low != Big::ZERO
            && at_high != Big::ZERO
            && (at_low < Big::ZERO) != (at_high < Big::ZERO)
        {
            zeros.push(refine(p, &slope, low.clone(), high.clone(), at_high > Big::ZERO));
        } else if at_high == Big::ZERO {
            zeros.push(high.clone());
        }
    }
    zeros
}

/// A power of two above every zero.
fn cauchy_bound(p: &[Big]) -> Big {
    let lead = p.len() - 1;
    let log =
        |x: &Big| if *x == Big::ZERO { None } else { Some(x.repr().exponent() + x.repr().digits() as isize) };
    let top = log(&p[lead]).expect("leading coefficient");
    // Zeros are below 2 max |c_k/c_n|^{1/(n−k)}, and |x| is in [2^(log − 1), 2^log).
    let bound =
        (0..lead).filter_map(|k| log(&p[k]).map(|l| (l - top + 1).div_euclid((lead - k) as isize) + 1)).max();
    ldexp(&Big::ONE.with_precision(BITS).value(), bound.unwrap_or(0) as i32 + 1)
}

/// Newton's method within a bracket; a step that leaves it or that does not halve the previous one is
/// replaced by a bisection, of the order of magnitude first.
fn refine(p: &[Big], slope: &[Big], mut low: Big, mut high: Big, rises: bool) -> Big {
    let log = |x: &Big| x.repr().exponent() + x.repr().digits() as isize;
    let mut t = (&low + &high) >> 1;
    let mut last = &high - &low;
    for _ in 0..3000 {
        let value = evaluate(p, &t);
        if value == Big::ZERO {
            return t;
        }
        if (value < Big::ZERO) == rises {
            low.clone_from(&t);
        } else {
            high.clone_from(&t);
        }
        let s = evaluate(slope, &t);
        let mut next = None;
        if s != Big::ZERO {
            let step = -(&value / &s);
            let newton = &t + &step;
            if newton > low && newton < high && abs(&step) <= last.clone() >> 1 {
                last = abs(&step);
                next = Some(newton);
            }
        }
        let next = next.unwrap_or_else(|| {
            last = &high - &low;
            let floor = if low == Big::ZERO { log(&high) - 400 } else { log(&low) };
            if log(&high) - floor > 2 {
                ldexp(&Big::ONE.with_precision(BITS).value(), (isize::midpoint(floor, log(&high))) as i32)
            } else {
                (&low + &high) >> 1
            }
        });
        let (change, size) = (abs(&(&next - &t)), abs(&next));
        if change <= size >> 200 {
            return next;
        }
        t = next;
    }
    panic!("no convergence between {} and {}", f64_of(&low), f64_of(&high));
}

#[test]
fn zeros_of_a_quartic_with_a_nearly_double_zero_are_separated() {
    // (t − 1)(t − 2)(t − 2 − 2^-60)(t + 3)
    let factors = [big(-1.0), big(-2.0), big(-2.0) - big(2f64.powi(-60)), big(3.0)];
    let mut p = vec![big(1.0)];
    for f in &factors {
        let mut next = vec![big(0.0); p.len() + 1];
        for (k, c) in p.iter().enumerate() {
            next[k] = &next[k] + c * f;
            next[k + 1] = &next[k + 1] + c;
        }
        p = next;
    }
    let zeros = positive_zeros(&p);
    assert_eq!(zeros.len(), 3);
    for (zero, f) in zeros.iter().zip(&factors) {
        let error = f64_of(&abs(&(zero + f)));
        assert!(error < 1e-50, "{} misses a zero by {error:e}", f64_of(zero));
    }
}
