/*!
Impacts of rough spheres and walls, against the equations of Newton and Euler in 400-bit arithmetic.

The reference does not use the closed form. It applies a unit impulse at the contact, finds what it does to
the velocities and angular velocities of both bodies, and from them the compliance of the contact; then the
impulse after which the surfaces move as the law demands; and the energies as sums of ½ m w² + ½ I ω² before
and after. It takes `n` as an exact direction and normalizes it: that |n| is 1 but for rounding is a part of
the errors of the kernel, unless it does the same.

An error of half an ulp in an argument is not an error of the kernel. Bounds are therefore in units of
ε = 2⁻⁵² times what ε in every argument would do:

```text
S = |w1 − w2| + |R1 ω1| + |R2 ω2|          the terms of the slip g_t
N = (1 + e) |w1 − w2| / Λ                  the normal impulse, if all of the velocity were along n
Π = κ S / Λ_t (+ μ N if it slides)         the tangential impulse, |P_t| = κ g / Λ_t with g = |g_t|
Π / (q m R)                                a change of spin
|w| + (N + Π) / m                          a velocity afterwards
|ω| + Π / (q m R)                          an angular velocity afterwards
(1 − β) g Π, if it slides g Π              the energy lost: its derivatives times the errors of g_t and P_n
Λ_t |P_t| Π                                the energy of the lost velocities
Π (|w1 − w2| + Π (1/m1 + 1/m2))            the energy that translation loses
(1 ∓ e) v_n N + the same of P_t            the first two of these energies, of the whole impact
```

In the energies, g stands for g + ε S, |P_t| for |P_t| + ε Π, and v_n for v_n + ε |w1 − w2|: below that, they
are rounding.
*/

use super::big::{Big, BigVec, abs, big, f64_of};
use super::cases::Draw;
use glam::DVec3;
use haff_mechanics::{Impact, RoughBody, Roughness, TangentialImpact};
use haff_mechanics::{resolve_contact, slip_velocity, tangential_impact};

const EPS: f64 = f64::EPSILON;

/// Two bodies in contact and the law of their impact.
#[derive(Debug, Clone, Copy)]
struct Case {
    bodies: [RoughBody; 2],
    /// Unit vector from 1 to 2, but for rounding.
    n: DVec3,
    e: f64,
    law: Roughness,
}

/// What a kernel finds for a [`Case`].
struct Found {
    slip: DVec3,
    normal: Impact,
    tangential: TangentialImpact,
    /// After the impact.
    velocities: [DVec3; 2],
    angular_velocities: [DVec3; 2],
}

type Kernel = fn(&Case) -> Found;

fn kernel(case: &Case) -> Found {
    let [a, b] = &case.bodies;
    let (w1, w2, normal) =
        resolve_contact(a.velocity, b.velocity, a.inverse_mass, b.inverse_mass, case.n, case.e);
    let tangential = tangential_impact(a, b, case.n, normal.impulse, case.law);
    let impulse = tangential.impulse;
    Found {
        slip: slip_velocity(a, b, case.n),
        normal,
        tangential,
        velocities: [w1 - impulse * a.inverse_mass, w2 + impulse * b.inverse_mass],
        angular_velocities: [0, 1].map(|k| case.bodies[k].angular_velocity + tangential.spin_changes[k]),
    }
}

/// A body in 400-bit arithmetic.
#[derive(Clone)]
struct Body {
    velocity: BigVec,
    angular_velocity: BigVec,
    /// From the center to the contact.
    arm: BigVec,
    /// 1/m and 1/I; both zero for an infinite mass.
    inverse: [Big; 2],
}

impl Body {
    fn new(body: &RoughBody, outward: &BigVec) -> Self {
        let (zero, radius, inverse_mass) = (big(0.0), big(body.radius), big(body.inverse_mass));
        let inertia = big(body.inertia) * &radius * &radius; // per mass
        let inverse_inertia = if inverse_mass == zero { zero } else { &inverse_mass / inertia };
        Self {
            velocity: BigVec::new(body.velocity),
            angular_velocity: BigVec::new(body.angular_velocity),
            arm: outward.times(&radius),
            inverse: [inverse_mass, inverse_inertia],
        }
    }

    /// Velocity of the surface at the contact.
    fn surface(&self) -> BigVec {
        self.velocity.plus(&self.angular_velocity.cross(&self.arm), &big(1.0))
    }

    /// After an impulse at the contact.
    fn hit(&self, impulse: &BigVec) -> Self {
        let [by_mass, by_inertia] = &self.inverse;
        Self {
            velocity: self.velocity.plus(impulse, by_mass),
            angular_velocity: self.angular_velocity.plus(&self.arm.cross(impulse), by_inertia),
            ..self.clone()
        }
    }

    /// At rest.
    fn still(&self) -> Self {
        let zero = BigVec::new(DVec3::ZERO);
        Self { velocity: zero.clone(), angular_velocity: zero, ..self.clone() }
    }

    /// Energy of translation and rotation given up, and that of the lost velocities, in the change to `after`
    /// by an impulse.
    fn energies(&self, after: &Self, impulse: &BigVec) -> [Big; 3] {
        let (zero, half, minus) = (big(0.0), big(0.5), big(-1.0));
        let [by_mass, by_inertia] = &self.inverse;
        if *by_mass == zero {
            // The limit of ½ m w² − ½ m w'² = −P·(w + w')/2, and the same for the rotation.
            let torque = self.arm.cross(impulse);
            return [-impulse.dot(&self.velocity), -torque.dot(&self.angular_velocity), zero];
        }
        let energy = |v: &BigVec, inverse: &Big| {
            if *inverse == zero { zero.clone() } else { v.dot(v) / inverse * &half }
        };
        let loss = |v: &BigVec, after: &BigVec, inverse: &Big| energy(v, inverse) - energy(after, inverse);
        let lost = energy(&after.velocity.plus(&self.velocity, &minus), by_mass)
            + energy(&after.angular_velocity.plus(&self.angular_velocity, &minus), by_inertia);
        [
            loss(&self.velocity, &after.velocity, by_mass),
            loss(&self.angular_velocity, &after.angular_velocity, by_inertia),
            lost,
        ]
    }
}

/// The exact impact.
struct Exact {
    before: [Body; 2],
    after: [Body; 2],
    slip: BigVec,
    /// The tangential impulse, on body 2.
    impulse: BigVec,
    spin_changes: [BigVec; 2],
    /// Energy lost, energy of the lost velocities, and the loss of translation: of the whole impact and of
    /// its tangential part.
    whole: [Big; 3],
    tangential: [Big; 3],
    /// v_n, `P_n`, g, κ.
    approach: f64,
    normal_impulse: f64,
    speed: f64,
    kappa: f64,
    /// 1/Λ and 1/Λ_t.
    inverse_compliances: [f64; 2],
}

fn hit(bodies: &[Body; 2], impulse: &BigVec) -> [Body; 2] {
    [bodies[0].hit(&impulse.times(&big(-1.0))), bodies[1].hit(impulse)]
}

/// Relative velocity of the surfaces.
fn relative(bodies: &[Body; 2]) -> BigVec {
    bodies[0].surface().plus(&bodies[1].surface(), &big(-1.0))
}

/// Energy lost, that of the lost velocities, and the loss of translation.
fn energies(before: &[Body; 2], after: &[Body; 2], impulse: &BigVec) -> [Big; 3] {
    let [t1, r1, lost1] = before[0].energies(&after[0], &impulse.times(&big(-1.0)));
    let [t2, r2, lost2] = before[1].energies(&after[1], impulse);
    let translation = t1 + t2;
    [&translation + r1 + r2, lost1 + lost2, translation]
}

impl Exact {
    fn new(case: &Case) -> Self {
        let (zero, one, minus) = (big(0.0), big(1.0), big(-1.0));
        let inverse_of = |x: &Big| if *x == zero { zero.clone() } else { &one / x };
        let n = BigVec::new(case.n);
        let n = n.times(&inverse_of(&n.length()));
        let before = [Body::new(&case.bodies[0], &n), Body::new(&case.bodies[1], &n.times(&minus))];
        // A unit impulse along a direction changes the relative velocity by minus this along it.
        let still = [before[0].still(), before[1].still()];
        let compliance = |direction: &BigVec| -relative(&hit(&still, direction)).dot(direction);
        let g = relative(&before);
        let approach = g.dot(&n);
        let (e, beta) = (big(case.e), big(case.law.tangential_restitution));
        let lambda = compliance(&n);
        let approaching = approach > zero;
        let normal_impulse =
            if approaching { (&one + &e) * &approach * inverse_of(&lambda) } else { zero.clone() };
        let slip = g.plus(&n, &-approach.clone());
        let speed = slip.length();
        let tangent = slip.times(&inverse_of(&speed));
        let lambda_t = if speed == zero { zero.clone() } else { compliance(&tangent) };
        let stick = (&one + &beta) * &speed * inverse_of(&lambda_t);
        let friction = case.law.friction;
        let bound = if friction.is_finite() { big(friction) * &normal_impulse } else { stick.clone() };
        let slides = bound < stick;
        let size = if slides { bound } else { stick };
        let (normal, impulse) = (n.times(&normal_impulse), tangent.times(&size));
        let bounced = hit(&before, &normal);
        let after = hit(&bounced, &impulse);
        let whole = energies(&before, &after, &impulse.plus(&normal, &one));
        let tangential = energies(&bounced, &after, &impulse);
        let exact = Self {
            approach: f64_of(&approach),
            normal_impulse: f64_of(&normal_impulse),
            speed: f64_of(&speed),
            kappa: f64_of(&if slides { &size * &lambda_t / &speed } else { &one + &beta }),
            inverse_compliances: [f64_of(&inverse_of(&lambda)), f64_of(&inverse_of(&lambda_t))],
            spin_changes: [0, 1]
                .map(|k| after[k].angular_velocity.plus(&bounced[k].angular_velocity, &minus)),
            before,
            after,
            slip,
            impulse,
            whole,
            tangential,
        };
        if lambda != zero && approaching {
            exact.check_law(case, &n, &g, slides);
        }
        exact
    }

    /// The reference itself does what the law demands.
    fn check_law(&self, case: &Case, n: &BigVec, g: &BigVec, slides: bool) {
        let (e, beta) = (big(case.e), big(case.law.tangential_restitution));
        let now = relative(&self.after);
        let departure = now.dot(n);
        let slip = now.plus(n, &-departure.clone());
        let mut size = g.length();
        for body in self.before.iter().chain(&self.after) {
            size += body.velocity.length() + body.angular_velocity.length() * body.arm.length();
        }
        let rounding = size * big(1e-100);
        assert!(abs(&(departure + e * g.dot(n))) <= rounding, "normal: {case:?}");
        if slides {
            // Along the slip, and not as far as −β.
            let along = slip.dot(&self.slip);
            assert!(along > -beta * self.slip.dot(&self.slip), "sliding: {case:?}");
            assert!(slip.cross(&self.slip).length() <= rounding * self.slip.length(), "direction: {case:?}");
        } else {
            assert!(slip.plus(&self.slip, &beta).length() <= rounding, "sticking: {case:?}");
        }
    }
}

const NAMES: [&str; 9] = [
    "slip",
    "impulse",
    "changes of spin",
    "velocities",
    "angular velocities",
    "energy lost",
    "energy of the lost velocities",
    "loss of translation",
    "energies of the whole impact",
];

/// Bounds in the units of the table, at most twice the largest error of a million cases, which are 2.1, 3.0,
/// 3.5, 2.8, 3.4, 2.5, 2.6, 2.8 and 2.6.
///
/// Each rounding adds at most ½. The slip has a chain of 11: w1 − w2, its product with n (3), divided by n²
/// (3 and the quotient), times n, and two differences. The impulse has 5 more: κ, the unit, Λ_t in it,
/// quotient and product; a change of spin in place of the last one 2 of 1/(q m R), 2 of the cross product, 2
/// of |n| and 3 of quotient and products. These would add up to 5.5, 8 and 12 if all had the same sign.
const BOUNDS: [f64; 9] = [4.0, 5.0, 6.0, 5.0, 6.0, 4.0, 4.0, 5.0, 4.0];

#[derive(Default, Debug)]
struct Worst {
    cases: u32,
    slides: u32,
    none: u32,
    /// Bodies of infinite mass that spin.
    spinning: u32,
    errors: [f64; 9],
}

fn distance(found: DVec3, exact: &BigVec) -> f64 {
    f64_of(&BigVec::new(found).plus(exact, &big(-1.0)).length())
}

fn deviation(found: f64, exact: &Big) -> f64 {
    f64_of(&abs(&(big(found) - exact)))
}

/// The errors of one impact in the units of the table, and whether it slides, or may by rounding.
fn errors(case: &Case, found: &Found) -> ([f64; 9], bool) {
    let exact = Exact::new(case);
    let [a, b] = &case.bodies;
    let relative = f64_of(&exact.before[0].velocity.plus(&exact.before[1].velocity, &big(-1.0)).length());
    let terms = relative + a.angular_velocity.length() * a.radius + b.angular_velocity.length() * b.radius;
    let normal = (1.0 + case.e) * relative * exact.inverse_compliances[0];
    let (kappa, friction) = (exact.kappa, case.law.friction);
    let stick = (1.0 + case.law.tangential_restitution) * exact.speed * exact.inverse_compliances[1];
    // Where rounding of P_n may decide that it slides, too.
    let slides = friction < f64::INFINITY && friction * (exact.normal_impulse - 4.0 * EPS * normal) < stick;
    let impulse = kappa * terms * exact.inverse_compliances[1] + if slides { friction * normal } else { 0.0 };
    let per_spin = |body: &RoughBody| {
        if body.inverse_mass == 0.0 { 0.0 } else { body.inverse_mass / (body.inertia * body.radius) }
    };
    let slip = exact.speed + EPS * terms;
    let loss = slip * impulse * if slides { 1.0 } else { 1.0 - case.law.tangential_restitution };
    let size = kappa * exact.speed * exact.inverse_compliances[1];
    let lost = (size + EPS * impulse) * impulse / exact.inverse_compliances[1];
    let inverse_mass = a.inverse_mass + b.inverse_mass;
    let translation = impulse * (relative + impulse * inverse_mass);
    let approach = (exact.approach.max(0.0) + EPS * relative) * normal;
    // Less than 1e-100 is the rounding of the reference, where the exact value is zero.
    let ratio = |error: f64, scale: f64| if error < 1e-100 { 0.0 } else { error / (EPS * scale) };
    let (mut spin_change, mut velocity, mut angular) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (k, body) in case.bodies.iter().enumerate() {
        let after = &exact.after[k];
        let of_spin = impulse * per_spin(body);
        spin_change = spin_change
            .max(ratio(distance(found.tangential.spin_changes[k], &exact.spin_changes[k]), of_spin));
        let scale = body.velocity.length() + (normal + impulse) * body.inverse_mass;
        velocity = velocity.max(ratio(distance(found.velocities[k], &after.velocity), scale));
        let scale = body.angular_velocity.length() + of_spin;
        angular = angular.max(ratio(distance(found.angular_velocities[k], &after.angular_velocity), scale));
    }
    let (n, t) = (&found.normal, &found.tangential);
    let whole =
        ratio(deviation(n.energy_loss + t.energy_loss, &exact.whole[0]), (1.0 - case.e) * approach + loss)
            .max(ratio(
                deviation(n.carnot_energy + t.carnot_energy, &exact.whole[1]),
                (1.0 + case.e) * approach + lost,
            ));
    let errors = [
        ratio(distance(found.slip, &exact.slip), terms),
        ratio(distance(t.impulse, &exact.impulse), impulse),
        spin_change,
        velocity,
        angular,
        ratio(deviation(t.energy_loss, &exact.tangential[0]), loss),
        ratio(deviation(t.carnot_energy, &exact.tangential[1]), lost),
        ratio(deviation(t.translational_loss, &exact.tangential[2]), translation),
        whole,
    ];
    (errors, slides)
}

impl Worst {
    fn print(&self, name: &str) {
        let Self { cases, slides, none, spinning, errors } = self;
        println!(
            "{name}: {cases} cases, {slides} slide, {none} without impulse, {spinning} with a spinning body of infinite mass"
        );
        for (quantity, error) in NAMES.iter().zip(errors) {
            println!("{name}, {quantity}: {error:.2}");
        }
    }

    /// Checks one impact; the error names the largest excess.
    fn judge(&mut self, case: &Case, found: &Found) -> Result<(), String> {
        let (errors, slides) = errors(case, found);
        self.cases += 1;
        self.slides += u32::from(slides);
        self.none += u32::from(found.tangential.impulse == DVec3::ZERO);
        let spins = |b: &RoughBody| b.inverse_mass == 0.0 && b.radius > 0.0;
        self.spinning += u32::from(case.bodies.iter().any(spins));
        for k in 0..9 {
            self.errors[k] = self.errors[k].max(errors[k]);
            if errors[k].is_nan() || errors[k] > BOUNDS[k] {
                return Err(format!("{}: {:.2} units", NAMES[k], errors[k]));
            }
        }
        Ok(())
    }
}

/// Bodies over many decades; `wall`: the second one is a wall; `infinite`: which one has infinite mass.
fn case(draw: &mut Draw, wall: bool, infinite: [bool; 2]) -> Case {
    let mut body = |infinite: bool| {
        let radius = draw.decades(-3.0, 3.0);
        let inertia = match draw.index(4) {
            0 => 0.4,
            1 => 2.0 / 3.0,
            2 => draw.uniform(0.0, 2.0 / 3.0).max(1e-9),
            _ => draw.decades(-6.0, -0.2),
        };
        RoughBody {
            velocity: draw.direction() * draw.decades(-3.0, 3.0),
            angular_velocity: draw.direction() * (draw.decades(-3.0, 3.0) / radius),
            radius,
            inverse_mass: if infinite { 0.0 } else { draw.decades(-6.0, 6.0) },
            inertia,
        }
    };
    let mut bodies = infinite.map(&mut body);
    if draw.index(4) == 0 {
        // Equal bodies, and a common size of velocities.
        let inverse_mass =
            if infinite == [false, false] { bodies[0].inverse_mass } else { bodies[1].inverse_mass };
        bodies[1] = RoughBody { velocity: bodies[1].velocity, ..bodies[0] };
        bodies[1].velocity *= bodies[0].velocity.length() / bodies[1].velocity.length();
        bodies[1].inverse_mass = inverse_mass;
    }
    if draw.index(4) == 0 {
        bodies[draw.index(2) as usize].angular_velocity = DVec3::ZERO;
    }
    if wall {
        let velocity = if draw.index(2) == 0 { DVec3::ZERO } else { bodies[1].velocity };
        bodies[1] = RoughBody {
            velocity,
            angular_velocity: DVec3::ZERO,
            radius: 0.0,
            inverse_mass: 0.0,
            inertia: 0.4,
        };
    }
    let mut n = draw.direction();
    if (bodies[0].velocity - bodies[1].velocity).dot(n) < 0.0 {
        n = -n;
    }
    if draw.index(6) == 0 {
        // Almost no slip, or none.
        let left = if draw.index(4) == 0 { 0.0 } else { draw.decades(-20.0, -1.0) };
        bodies[0].velocity -= slip_velocity(&bodies[0], &bodies[1], n) * (1.0 - left);
    }
    let tangential_restitution = match draw.index(8) {
        0 => 1.0,
        1 => -1.0,
        2 => 0.0,
        3 => draw.sign() * (1.0 - draw.decades(-17.0, -1.0)),
        _ => draw.uniform(-1.0, 1.0),
    };
    let friction = match draw.index(8) {
        0 => 0.0,
        1..=3 => f64::INFINITY,
        4 => draw.uniform(0.0, 1.0),
        _ => draw.decades(-6.0, 4.0),
    };
    let e = match draw.index(4) {
        0 => 1.0,
        1 => 0.0,
        _ => draw.uniform(0.0, 1.0),
    };
    Case { bodies, n, e, law: Roughness { tangential_restitution, friction } }
}

/// Two bodies of finite mass.
fn pair(draw: &mut Draw) -> Case {
    case(draw, false, [false, false])
}

/// A body and a wall.
fn wall(draw: &mut Draw) -> Case {
    case(draw, true, [false, false])
}

/// Bodies one of which has infinite mass, rarely both. They spin.
fn fixed(draw: &mut Draw) -> Case {
    let infinite = match draw.index(64) {
        0 => [true, true],
        k if k % 2 == 1 => [true, false],
        _ => [false, true],
    };
    case(draw, false, infinite)
}

/// A share of 100,000 impacts in all, or of `HAFF_IMPACTS` if that is more.
fn run(name: &str, share: f64, seed: u64, case: fn(&mut Draw) -> Case) -> Worst {
    let (mut worst, mut draw) = (Worst::default(), Draw::new(seed));
    let impacts: f64 = std::env::var("HAFF_IMPACTS").map_or(0.0, |n| n.parse().expect("a number of impacts"));
    for number in 0..(share * impacts.max(1e5)) as u32 {
        let case = case(&mut draw);
        if let Err(message) = worst.judge(&case, &kernel(&case)) {
            panic!("{name} {number}: {message}\n{case:?}");
        }
    }
    worst.print(name);
    worst
}

#[test]
#[ignore = "long: scripts/test all"]
fn impacts_of_rough_pairs_are_those_of_newton_and_euler() {
    let worst = run("rough pairs", 0.5, 0x5eed_0031, pair);
    assert!(worst.slides > worst.cases / 5 && worst.none < worst.cases / 3, "unbalanced cases: {worst:?}");
}

#[test]
#[ignore = "long: scripts/test all"]
fn impacts_on_rough_walls_are_those_of_newton_and_euler() {
    let worst = run("rough walls", 0.25, 0x5eed_0032, wall);
    assert!(worst.slides > worst.cases / 5 && worst.none < worst.cases / 3, "unbalanced cases: {worst:?}");
}

#[test]
#[ignore = "long: scripts/test all"]
fn impacts_on_spinning_bodies_of_infinite_mass_are_those_of_newton_and_euler() {
    let worst = run("rough bodies of infinite mass", 0.25, 0x5eed_0033, fixed);
    assert!(worst.slides > worst.cases / 5 && worst.none < worst.cases / 3, "unbalanced cases: {worst:?}");
    assert!(worst.spinning > worst.cases / 2, "too few that spin: {worst:?}");
}

/// Check of the criteria: on the same cases they reject wrong formulae, and right ones that lose digits.
#[test]
#[ignore = "long: scripts/test all"]
fn the_criteria_reject_wrong_tangential_impacts() {
    let one_inertia: Kernel = |case| {
        let [a, b] = case.bodies;
        kernel(&Case { bodies: [a, RoughBody { inertia: a.inertia, ..b }], ..*case })
    };
    // Of an odd power of n, in slip and torque.
    let opposite_side: Kernel = |case| {
        let [a, b] = &case.bodies;
        let tangential = tangential_impact(a, b, -case.n, kernel(case).normal.impulse, case.law);
        Found { tangential, ..kernel(case) }
    };
    let opposite_spin: Kernel = |case| {
        let mut found = kernel(case);
        found.tangential.spin_changes[1] *= -1.0;
        found
    };
    let without_bound: Kernel =
        |case| kernel(&Case { law: Roughness { friction: f64::INFINITY, ..case.law }, ..*case });
    let difference_of_energies: Kernel = |case| {
        let mut found = kernel(case);
        let mut loss = -found.normal.energy_loss;
        for (k, body) in case.bodies.iter().enumerate() {
            let energy = |velocity: DVec3, spin: DVec3| {
                let spin = (spin * body.radius).length_squared() * body.inertia;
                0.5 * (velocity.length_squared() + spin) / body.inverse_mass
            };
            loss += energy(body.velocity, body.angular_velocity)
                - energy(found.velocities[k], found.angular_velocities[k]);
        }
        found.tangential.energy_loss = loss;
        found
    };
    // It loses digits only in nearly elastic contacts, which are few.
    let loss_of_rounded_kappa: Kernel = |case| {
        let mut found = kernel(case);
        let kappa = 1.0 + case.law.tangential_restitution;
        let slides = case.law.friction < f64::INFINITY;
        if !slides && kappa > 0.0 {
            found.tangential.energy_loss = found.tangential.carnot_energy * ((2.0 - kappa) / kappa);
        }
        found
    };
    for (name, wrong, least) in [
        ("q of the first body for both", one_inertia, 0.3),
        ("n of the opposite sign", opposite_side, 0.5),
        ("spin of the second body of the opposite sign", opposite_spin, 0.5),
        ("no bound of the friction", without_bound, 0.2),
        ("energy lost as a difference", difference_of_energies, 0.5),
        ("energy lost of a rounded 1 + β", loss_of_rounded_kappa, 0.004),
    ] {
        let mut draw = Draw::new(0x5eed_0034);
        let mut rejected = 0;
        for _ in 0..2000 {
            let case = pair(&mut draw);
            rejected += u32::from(Worst::default().judge(&case, &wrong(&case)).is_err());
        }
        println!("{name}: {rejected} of 2000 rejected");
        assert!(f64::from(rejected) > least * 2000.0, "{name}: only {rejected} of 2000 rejected");
    }
}
