/*!
Impact laws, free flight and contact times of hard spheres: the result of a contact, and its time.

Everything here is a pure function of its arguments: no state, no allocation, no I/O. Any consistent units may
be used. Numbers in parentheses, (2.x), are the equations of the chapter *Particle Impact* on which the
simulator is based.

| module | computes |
|---|---|
| [`restitution`] | the coefficient of restitution at an approach speed |
| [`law`] | the seam for laws in files of their own, or of another crate |
| [`added_speed`] | contacts that add to the speed of separation |
| [`scatter`] | coefficients that are drawn anew in each contact |
| [`random`] | random numbers as hashes |
| [`mod@impact`] | the impulse of an impact, the velocities after it, and the energy loss |
| [`contact`] | the contact time of two spheres in straight relative flight |
| [`curved`] | their contact time under a relative acceleration (a fixed sphere in gravity) |
| [`plane`] | the time at which a sphere touches a wall, or a centre leaves its cell |
| [`oscillation`] | the shift of an oscillating wall, and the time at which a sphere touches it |
| [`bounces`] | the sums over an infinite series of bounces |
| [`rough`] | the tangential part of the impact of rough spheres |
| [`flight`] | the state of a body after a given time |
| [`drag`] | the same under a linear drag |
| [`surface`] | shapes of walls, built in ([`partition`]) or of another crate, and the times at which spheres touch them |
| [`named`] | what another crate adds, with its name in scenes |

# Sign conventions

The contact normal `n` points from body 1 to body 2, or into the wall; the approach speed `v_n = (w1 − w2)·n`
is positive in a contact; the impulse is `−J n` on body 1. Relative quantities of a pair are those of `j`
relative to `i`: `r = r_j − r_i`, `v = v_j − v_i`.

# Reproducible bits

Only `+ − × ÷ √`, each rounded once, and functions of the `libm` crate are used: no fused multiply-add, no
function of the system's mathematical library. Equal input gives equal bits on every machine. Contact times of
a pair are even functions: `(r, v, a)` and `(−r, −v, −a)` give the same bits, so a pair may be predicted in
either order.
*/

#![forbid(unsafe_code)]

pub mod added_speed;
pub mod bounces;
pub mod bounded;
pub mod contact;
pub mod curved;
pub mod drag;
pub mod flight;
pub mod impact;
pub mod law;
pub mod named;
pub mod oscillation;
pub mod partition;
pub mod plane;
pub mod random;
pub mod restitution;
mod roots;
pub mod rough;
mod scale;
pub mod scatter;
pub mod surface;

pub use bounces::Bounces;
pub use bounded::first_contact_bounded;
pub use contact::{is_rounding_noise, time_to_contact, time_to_contact_unscaled};
pub use curved::time_to_contact_accelerated;
pub use flight::{drift, duration, free_flight, free_flight_stochastic, free_flight_velocity};
pub use impact::{
    Impact, StickingImpact, approach_speed, impact, reduced_mass, resolve_contact, resolve_pair,
    resolve_sticking, resolve_wall, work_of_moving_body,
};
pub use law::{ContactLaw, NamedLaw, NormalContact};
pub use named::{Named, NamedOnce};
pub use oscillation::{Oscillation, Waveform};
pub use partition::{Hole, Partition};
pub use plane::{time_to_face, time_to_plane};
pub use restitution::{Restitution, RestitutionError, RestitutionTable};
pub use rough::{RoughBody, Roughness, RoughnessError, TangentialImpact, slip_velocity, tangential_impact};
pub use scatter::Scatter;
pub use surface::{NamedSurface, RelativeFlight, Shape, Surface, Swing};

/// The README's examples are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
