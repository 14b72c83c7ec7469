//! Features of a scene as type parameters. The engine is compiled separately for each combination, so that a
//! scene has no cost for features that it does not use.
//!
//! Features are compiled in or out: gravity, drag, one-size systems, elastic ones and grains at rest are type
//! parameters, and the event log; `choice::compile` chooses. Velocity-dependent restitution, the TC model
//! and walls cost a branch where they occur.

/// A combination of features.
pub(crate) trait Features: Send + Sync + 'static {
    /// Bodies can be accelerated.
    const GRAVITY: bool;
    /// All particles share one radius and one finite mass.
    const UNIFORM: bool;
    /// Grains can be put to rest. Never with `UNIFORM`, because a grain at rest has infinite mass.
    const REST: bool;
    /// No contact loses energy: e = 1 in all laws.
    const ELASTIC: bool;
    /// The box deforms: its images move. Never with `GRAVITY`.
    const DEFORMS: bool;
    /// There are pistons. Only with `GRAVITY`: their flights are accelerated.
    const PISTONS: bool;
    /// A drag acts on the particles. Never with `GRAVITY` or `DEFORMS`.
    const DAMPED: bool;
}

/// The combination of these features.
pub(crate) struct With<
    const GRAVITY: bool,
    const UNIFORM: bool,
    const REST: bool = false,
    const ELASTIC: bool = false,
    const DEFORMS: bool = false,
    const PISTONS: bool = false,
    const DAMPED: bool = false,
>;

impl<
    const GRAVITY: bool,
    const UNIFORM: bool,
    const REST: bool,
    const ELASTIC: bool,
    const DEFORMS: bool,
    const PISTONS: bool,
    const DAMPED: bool,
> Features for With<GRAVITY, UNIFORM, REST, ELASTIC, DEFORMS, PISTONS, DAMPED>
{
    const GRAVITY: bool = GRAVITY;
    const UNIFORM: bool = UNIFORM;
    const REST: bool = REST;
    const ELASTIC: bool = ELASTIC;
    const DEFORMS: bool = DEFORMS;
    const PISTONS: bool = PISTONS;
    const DAMPED: bool = DAMPED;
}

/// Any particles, without gravity.
pub(crate) type Polydisperse = With<false, false>;
/// Any particles under gravity.
pub(crate) type FallingPolydisperse = With<true, false>;
/// Any grains under gravity that can be put to rest.
pub(crate) type Settling = With<true, false, true>;
/// Any particles between or beside pistons.
pub(crate) type Pressed = With<true, false, false, false, false, true>;
/// Any particles under a drag.
pub(crate) type Damped = With<false, false, false, false, false, false, true>;
/// Any particles in a box that deforms.
pub(crate) type DeformingPolydisperse = With<false, false, false, false, true>;
#[cfg(not(test))]
pub(crate) use fast::{DeformingMonodisperse, ElasticMonodisperse, FallingMonodisperse, Monodisperse};

/// Combinations that are only faster than those above, with the same bits.
#[cfg(not(test))]
mod fast {
    /// Elastic particles of one size and mass, without gravity.
    pub(crate) type ElasticMonodisperse = super::With<false, true, false, true>;
    /// Particles of one size and mass, without gravity.
    pub(crate) type Monodisperse = super::With<false, true>;
    /// Particles of one size and mass under gravity.
    pub(crate) type FallingMonodisperse = super::With<true, true>;
    /// Particles of one size and mass in a box that deforms.
    pub(crate) type DeformingMonodisperse = super::With<false, true, false, false, true>;
}

/// The unit tests of this crate are compiled in half the time without them; tests/ runs all combinations.
#[cfg(test)]
pub(crate) use self::{
    DeformingPolydisperse as DeformingMonodisperse, FallingPolydisperse as FallingMonodisperse,
    Polydisperse as ElasticMonodisperse, Polydisperse as Monodisperse,
};
