/*!
Motion between events: where particles, images and walls are at a time, and when they touch.

*What is here.* Methods of the world that evaluate flights ([`flight`]), periodic and moving images
([`images`]), grains that a wall carries ([`carried`]) or that slide ([`friction`]), spins ([`rotation`]),
distances from walls ([`walls`]), which walls support a grain ([`support`]), and the largest speed and extent
([`scale`]). [`flights`], [`flow_work`] and [`drag`] add the integrals over a flight when it ends.

*What to change here.* A new boundary: its images in [`images`], beside `state/periodicity.rs` and
`state/deformation.rs`; every search must visit the same images (`haff_neighbors`,
`search/windows/moving.rs`, a set in `model/features.rs`), and `support/overlap.rs` their overlaps. A new
shape of wall is a `Surface` of `haff_mechanics`, which [`walls`] asks for distances and contacts; what
assumes a plane is in `support/geometry.rs`, `search/planes.rs` and `model/conserved.rs`. Evaluating a
flight changes nothing, so that any number of evaluations gives the same bits: only `wrap_anchor` and
`move_anchor` set an anchor.

*May import* `numerics`, `model`, `report` and `state`.

*Begin with* [`flight`].
*/

pub(crate) mod carried;
pub(crate) mod drag;
pub(crate) mod flight;
pub(crate) mod flights;
pub(crate) mod flow_work;
pub(crate) mod friction;
pub(crate) mod images;
pub(crate) mod pair_flight;
pub(crate) mod pistons;
pub(crate) mod rotation;
pub(crate) mod scale;
pub(crate) mod support;
pub(crate) mod view;
pub(crate) mod wall_forces;
pub(crate) mod walls;
