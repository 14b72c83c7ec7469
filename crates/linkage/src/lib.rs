/*!
Few bodies with joints: pendulums, springs, rods and adhesive contact, on flights in closed form where
possible.

```text
System + Joints ──check──▶ World ──┬─▶ flights: Mechanism → Motion (closed form, or one step of DOP853)
                                   └─▶ predictions: Key → instant
        next event ─▶ end the flights of its bodies ─▶ impact, string taut, release ─▶ regroup: which contacts
        and strings carry force? ─▶ new flights ─▶ new predictions of these bodies
```

| module | contains |
|---|---|
| [`model`] | joints between particles, as plain data |
| `check` | checks of joints against each other and their system |
| `mechanism` | constraints as rows: accelerations, forces, n·M⁻¹·n |
| `motion` | motions of the bodies of one mechanism: pendulum, circle, rod, springs on a line; otherwise numerical |
| `crossing` | the first zero of a function |
| `predict` | predictions of events |
| `resolve` | impacts |
| `regroup` | contacts after an event, and the bodies that move together |
| `simulation` | the run; `checkpoint`: the run as data |
| `any_simulation` | a linkage, or the granular engine for all other scenes |

# Rules

* **Bodies.** Particles that stuck together are one body, of the sum of their masses, that does not turn: all
  of its particles have one velocity. Between spheres of finite radius that breaks the balance of angular
  momentum, as sticking at a distance must.
* **Rods and taut strings transmit impulses within an impact**, strings only by pulling. **Contacts are
  resolved one after the other**, by time, then kind, then rows, each with its own restitution: a chain of
  touching equal spheres transmits the impulse, as in Newton's cradle.
* **Persistent contact.** Two bodies that touch and whose relative normal velocity is zero (10⁻¹³ of their
  speeds) are in contact as long as their force pushes; the instant at which it would pull is found like any
  other event, and they separate. Ties (no force, no acceleration) stay closed.
* **Series of bounces** whose next would rise by less than 10⁻¹³ of the contact's size are completed in closed
  form, as in the engine: their losses are counted when the series would have ended.
* **Ties in time** are ordered by kind, then by rows. Nothing depends on the order of a hash map or on the
  system's mathematical library.
*/

#![forbid(unsafe_code)]

mod accumulators;
mod any_simulation;
mod burst;
mod check;
mod checkpoint;
mod contacts;
mod crossing;
mod elliptic;
mod error;
mod flights;
mod instant;
mod linear;
mod mechanism;
pub mod model;
mod motion;
mod predict;
mod predictions;
mod regroup;
mod resolve;
mod settle;
mod simulation;
mod valid;
mod world;

pub use any_simulation::{AnySimulation, AnySimulationError, warnings};
pub use check::check;
pub use elliptic::complete_elliptic_integral;
pub use error::LinkageError;
pub use model::{Joints, Pendulum, Rod, Spring, SpringEnd, Tether};
pub use simulation::{Potential, Simulation};
