/*!
The simulated system: particles, walls, contact laws and the domain, as plain validated data.

*What is here.* [`System`] and all that it contains; each feature has a file with its data (`drive`,
`measure`, `shear`, `spin`, `thermal`, `wall_motion`). [`bounds`] has the ranges of values that scenes and
live simulations share, `conserved` the axes along which momentum is conserved, `thresholds` the conditions
of rest, `features` the sets of features that loops are compiled for.

*What to change here.* The data of a new law, drive or measurement: a file, a field or variant, and its
bounds; what it does belongs to the rooms above. A periodic motion of walls is a `Waveform` of
`haff_mechanics`, any other a variant of `WallMotion` (`wall_motion.rs`), which computes displacement and
contact itself; `wall_change.rs` has how it goes on when it is changed. What other crates implement is
[`Action`], [`Probe`] and, in `haff_mechanics`, `ContactLaw` and `Surface`.

*May import* `numerics`, and `haff_mechanics` for laws of impact, oscillations and partitions.

*Begin with* [`System`].
*/

pub(crate) mod action;
pub mod bounds;
pub(crate) mod compression;
pub(crate) mod conserved;
pub(crate) mod drag;
pub(crate) mod drive;
pub(crate) mod exchange;
pub(crate) mod features;
pub(crate) mod flow;
pub(crate) mod measure;
pub(crate) mod particles;
pub(crate) mod piston;
pub(crate) mod probe;
pub(crate) mod rest_speed;
pub(crate) mod shear;
pub(crate) mod spin;
pub(crate) mod system;
pub(crate) mod thermal;
pub(crate) mod thresholds;
pub(crate) mod wall_change;
pub(crate) mod wall_law;
pub(crate) mod wall_motion;

pub use system::{
    Body, Boundary, Class, Contacts, Dimension, Domain, Group, NeighborChoice, Options, SimdChoice, System,
    Wall,
};

pub use haff_mechanics::{Hole, Partition, Restitution, Shape, Surface};

pub use action::{Action, NamedAction, named_action};
pub use compression::Compression;
pub use conserved::{common_velocity, conserved_momentum};
pub use drag::Drag;
pub use drive::{Drive, DriveKind, KickTimes};
pub use exchange::{Exchange, Partner, VelocityChange};
pub use flow::{Cuboid, Flow, Inlet, Outlet, Supply};
pub use measure::{Correlations, Followed, Grid, GridAxis, Measure};
pub use particles::{DrivenParticles, Particles};
pub use piston::Piston;
pub use probe::{Column, NamedProbe, Probe};
pub use rest_speed::rest_speed_of_diameter;
pub use shear::Shear;
pub use spin::Spin;
pub use thermal::ThermalWall;
pub use wall_law::WallLaw;
pub use wall_motion::{ConstantVelocity, Oscillating, Rotation, Shrinking, WallMotion, WallTime};
