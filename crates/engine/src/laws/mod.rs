/*!
What an event does: impacts of particles and walls, rough contacts, series of bounces, slides and rest.

*What is here.* [`event`] has the physical events. [`contact`] and [`wall_contact`] find who touches where;
[`pair_law`] and [`wall_impact`] give the velocities after an impact; [`resolve`] for pairs, and
[`wall_impact`] itself, set anchors and add losses. [`rough`] adds the tangential part, [`deforming`] the work
of the flow, [`series`] completes bounces, [`hop`] ends them where no closed form exists, [`carried`] and
[`slide`] are what follows on a wall, [`resting`] are contacts of grains that come to rest on each other.

*What to change here.* A new law of impact of two particles implements `PairLaw` and gets an arm of
`pair_law::resolve`; its parameters are in `Contacts` (`model/system.rs`) and in the world. It returns
velocities and the impact, and sets no anchor. A coefficient that depends on the speed alone is a
`Restitution` of `haff_mechanics`. A law of walls is a variant of `WallLaw` and an arm of
`collide_with_wall`. A physical event is a `PhysicalEvent`, in the type of events of each scheduler that has
it; its kind in the log is in `report/event.rs`, its entry in a queue in `search/search_event.rs`.

*May import* all rooms below: `numerics`, `model`, `report`, `state`, `motion`, `support`.

*Begin with* [`resolve`], which is a whole impact from its contact to its row in the log.
*/

pub(crate) mod bounces;
pub(crate) mod carried;
pub(crate) mod contact;
pub(crate) mod deforming;
pub(crate) mod event;
pub(crate) mod hop;
pub(crate) mod pair_law;
pub(crate) mod resolve;
pub(crate) mod resting;
pub(crate) mod rough;
pub(crate) mod series;
pub(crate) mod slide;
pub(crate) mod wall_contact;
pub(crate) mod wall_impact;
