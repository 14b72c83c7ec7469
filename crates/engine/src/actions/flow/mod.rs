/*!
Inlets and outlets: particles come in and go out.

*What is here.* [`passage`] is the timed action of all of them: when it acts, and what it saves. [`leave`]
books what a particle takes with it, [`arrive`] finds a place for one that comes in, and books what it
brings; [`replace`] changes the world. Which particles are there is in `state/population.rs`; the simulation
builds its search again when they have changed.

*What to change here.* Another way to supply an inlet: a variant of `Supply` in `model/flow.rs`, and its
arm in [`passage`].

*Begin with* [`passage`].
*/

mod arrive;
mod leave;
pub(crate) mod passage;
mod replace;
