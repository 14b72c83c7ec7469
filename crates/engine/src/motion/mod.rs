/*!
Motion between events: where particles, images and walls are at a time, and when they touch.

*What is here.* Methods of the world that evaluate flights ([`flight`]), periodic and sliding images
([`images`]), grains that a wall carries ([`carried`]) or that slide ([`friction`]), spins ([`rotation`]),
distances from walls ([`walls`]), which walls support a grain ([`support`]), and the largest speed and extent
([`scale`]). [`flights`] and [`shear_work`] add the integrals over a flight when it ends.

*What to change here.* A new motion of the box or of what carries a particle. An evaluation at two times must
give the bits of one evaluation at the later time only if the anchor has not moved: no method changes an
anchor, but for `wrap_anchor` and `move_anchor`.

*May import* `numerics`, `model`, `report` and `state`.

*Begin with* [`flight`].
*/

pub(crate) mod carried;
pub(crate) mod flight;
pub(crate) mod flights;
pub(crate) mod friction;
pub(crate) mod images;
pub(crate) mod pair_flight;
pub(crate) mod rotation;
pub(crate) mod scale;
pub(crate) mod shear_work;
pub(crate) mod support;
pub(crate) mod wall_forces;
pub(crate) mod walls;
