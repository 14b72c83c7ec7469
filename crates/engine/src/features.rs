//! What a scene needs of the engine, as type parameters: each combination is compiled on its own, so that a
//! scene pays only for what it has.

/// A combination of features.
pub(crate) trait Features: Send + Sync + 'static {
    /// Bodies may be accelerated.
    const GRAVITY: bool;
    /// All particles share one radius and one finite mass.
    const UNIFORM: bool;
    /// Grains may be put to rest; never with `UNIFORM`, because grains at rest count as of infinite mass.
    const REST: bool;
    /// No contact loses energy: all laws are e = 1.
    const ELASTIC: bool;
}

/// The combination with these features.
pub(crate) struct With<
    const GRAVITY: bool,
    const UNIFORM: bool,
    const REST: bool = false,
    const ELASTIC: bool = false,
>;

impl<const GRAVITY: bool, const UNIFORM: bool, const REST: bool, const ELASTIC: bool> Features
    for With<GRAVITY, UNIFORM, REST, ELASTIC>
{
    const GRAVITY: bool = GRAVITY;
    const UNIFORM: bool = UNIFORM;
    const REST: bool = REST;
    const ELASTIC: bool = ELASTIC;
}

/// Elastic particles of one size and mass, without gravity.
pub(crate) type ElasticMonodisperse = With<false, true, false, true>;
/// Particles of one size and mass, without gravity.
pub(crate) type Monodisperse = With<false, true>;
/// Any particles, without gravity.
pub(crate) type Polydisperse = With<false, false>;
/// Particles of one size and mass under gravity.
pub(crate) type FallingMonodisperse = With<true, true>;
/// Any particles under gravity.
pub(crate) type FallingPolydisperse = With<true, false>;
/// Any grains under gravity, which may be put to rest.
pub(crate) type Settling = With<true, false, true>;
