/*!
The state that events read and change: particles, accumulators, and everything else on which future events
depend.

*What is here.* [`world::World`] has the particles ([`particle`], one cache line each), and beside them the
box and the walls ([`surroundings`]), the laws of contacts ([`laws`]), who rests on walls ([`supported`]) and
what clock and coordinates are fine enough for ([`resolution`]). Data of a feature is in a struct of its
own, absent when unused ([`spin`], [`sliding_images`], [`contact_times`], [`wall_sums`], [`population`]).
[`accumulators`] are the sums over events, [`State`] is both together with what is pending. A checkpoint
stores exactly this.

*What to change here.* A feature that needs data for each particle gets a struct beside [`spin`], and an
`Option` in the world. Fields are set here; what they mean in a flight or an impact is in `motion` and
`laws`.

*May import* `numerics`, `model` and `report`.

*Begin with* [`particle`], then [`world`].
*/

pub(crate) mod accumulators;
pub(crate) mod center;
pub(crate) mod contact_times;
pub(crate) mod deformation;
pub(crate) mod flight_sums;
pub(crate) mod force;
pub(crate) mod laws;
pub(crate) mod particle;
pub(crate) mod periodicity;
pub(crate) mod population;
pub(crate) mod resolution;
pub(crate) mod settling;
pub(crate) mod slide;
pub(crate) mod sliding_images;
pub(crate) mod spin;
pub(crate) mod stall;
pub(crate) mod supported;
pub(crate) mod surroundings;
pub(crate) mod wall_sums;
pub(crate) mod whole;
pub(crate) mod world;

pub(crate) use whole::{Pending, State};
