/*!
What an event does: impacts of particles and walls, rough contacts, series of bounces, slides and rest.

*What is here.* [`event`] has the physical events and their order of resolution. [`contact`] and
[`wall_contact`] find who touches where; [`pair_law`] and [`wall_impact`] give the velocities after an impact;
[`resolve`] sets anchors and adds losses. [`rough`] adds the tangential part, [`sheared`] the work of a shear,
[`series`] completes bounces, [`hop`] ends them where no closed form exists, [`carried`] and [`slide`] are
what follows on a wall, [`resting`] are contacts of grains that come to rest on each other.

*What to change here.* A new law of impact of particles implements `PairLaw`, one of walls is a variant of
`WallLaw`. A law may read the contact and the world, and returns velocities: it never sets an anchor.

*May import* all rooms below: `numerics`, `model`, `report`, `state`, `motion`, `support`.

*Begin with* [`resolve`], which is a whole impact from its contact to its row in the log.
*/

pub(crate) mod bounces;
pub(crate) mod carried;
pub(crate) mod contact;
pub(crate) mod event;
pub(crate) mod hop;
pub(crate) mod pair_law;
pub(crate) mod resolve;
pub(crate) mod resting;
pub(crate) mod rough;
pub(crate) mod series;
pub(crate) mod sheared;
pub(crate) mod slide;
pub(crate) mod wall_contact;
pub(crate) mod wall_impact;
