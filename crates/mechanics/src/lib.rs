/*!
Impact laws, free flight and contact times of hard spheres: what happens in a contact, and when.

Everything here is a pure function of its arguments: no state, no allocation, no I/O. Units are the
caller's own, as long as they are consistent. Numbers in parentheses, (2.x), are the equations of the
chapter *Particle Impact* on which the simulator rests.

| module | question |
|---|---|
| [`restitution`] | how elastic is a contact at this approach speed? |
| [`mod@impact`] | which impulse acts, and which energy is lost? |
| [`contact`] | when do two spheres in straight relative flight touch? |
| [`curved`] | when do they touch under a relative acceleration (a fixed sphere in gravity)? |
| [`plane`] | when does a sphere reach a wall, or a centre leave its cell? |
| [`flight`] | where is a body after a given time? |

# Sign conventions

The contact normal `n` points from body 1 to body 2, or into the wall; the approach speed
`v_n = (w1 − w2)·n` is positive in a contact; the impulse acts as `−J n` on body 1. Relative quantities of a
pair are those of `j` seen from `i`: `r = r_j − r_i`, `v = v_j − v_i`.

# Reproducible bits

Only `+ − × ÷ √`, each rounded once, and functions of the `libm` crate are used: no fused multiply-add, no
function of the system's mathematical library. Equal input gives equal bits on every machine. Contact times
of a pair are even functions: `(r, v, a)` and `(−r, −v, −a)` give the same bits, so a pair may be predicted
from either side.
*/

#![forbid(unsafe_code)]

pub mod bounces;
pub mod contact;
pub mod curved;
pub mod flight;
pub mod impact;
pub mod plane;
pub mod restitution;
mod roots;
mod scale;

pub use bounces::Bounces;
pub use contact::{is_rounding_noise, time_to_contact};
pub use curved::time_to_contact_accelerated;
pub use flight::{drift, free_flight, free_flight_velocity, free_flight_without_preference};
pub use impact::{
    Impact, StickingImpact, approach_speed, impact, reduced_mass, resolve_contact, resolve_pair,
    resolve_sticking, resolve_wall, work_of_moving_body,
};
pub use plane::{time_to_face, time_to_plane};
pub use restitution::{Restitution, RestitutionError};

/// The examples of the README are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
