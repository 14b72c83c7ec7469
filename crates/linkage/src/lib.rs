/*!
Few bodies that hang, swing, pull and stick: pendulums, springs, rods and adhesive contact, on flights that are exact.

```text
System + Joints ──check──▶ World ──┬─▶ flights: Mechanism → Motion (closed form, or one step of DOP853)
                                   └─▶ predictions: Key → instant
        next event ─▶ take its bodies out of their flights ─▶ impact, catch, release ─▶ reform: what is in
        contact, what is taut? ─▶ new flights ─▶ new predictions of these bodies
```

| module | question |
|---|---|
| [`model`] | what holds particles together? |
| `check` | can it be? |
| `mechanism` | constraints as rows: accelerations, forces, n·M⁻¹·n |
| `motion` | how do the bodies of one mechanism move? pendulum, circle, rod, springs on a line; else numerically |
| `crossing` | when does a function first fall to zero? |
| `predict` | what happens next? |
| `resolve` | what does an impact do? |
| `reform` | what is in contact after an event, and who moves together? |
| `simulation` | the run; `checkpoint`: the run as data |
| `any_simulation` | a linkage, or the granular engine for all other scenes |

# Rules

* **Bodies.** Particles that stuck together are one body, of the sum of their masses, that does not turn: all of its particles have
  one velocity. Between spheres of finite radius that breaks the balance of angular momentum, as sticking at a distance must.
* **Rods and taut strings answer within an impact**, strings only by pulling. **Contacts are resolved one after the other**, by
  time, then kind, then rows, each with its own restitution: a chain of touching equal spheres hands the impulse on, as in
  Newton's cradle.
* **Persistent contact.** Two bodies that touch and whose relative normal velocity is zero (10⁻¹³ of their speeds) are in contact
  as long as their force pushes; the instant at which it would pull is found like any other event, and they part. Ties (no
  force, no acceleration) stay closed.
* **Series of bounces** whose next would rise by less than 10⁻¹³ of the contact's size are completed in closed form, as in the
  engine: their losses are booked when the series would have ended.
* **Ties in time** go by kind, then by rows. Nothing depends on the order of a hash map or on the system's mathematical library.
*/

#![forbid(unsafe_code)]

mod any_simulation;
mod book;
mod check;
mod checkpoint;
mod crossing;
mod elliptic;
mod error;
mod instant;
mod linear;
mod mechanism;
pub mod model;
mod motion;
mod predict;
mod reform;
mod resolve;
mod simulation;
mod sum;
mod valid;
mod world;

pub use any_simulation::{AnySimulation, AnySimulationError};
pub use check::check;
pub use elliptic::complete_elliptic_integral;
pub use error::LinkageError;
pub use model::{Joints, Pendulum, Rod, Spring, SpringEnd, Tether};
pub use simulation::{Potential, Simulation};
