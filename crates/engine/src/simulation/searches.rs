//! Which searches can run a system, for people.

use super::choice::Choice;
use crate::{
    model::{Options, System},
    numerics::error::EngineError,
    search::{batch::Kernel, matrix::Search},
    state::world::World,
    support::geometry::present_system,
};

/// What a search can do with a system in its initial state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SearchSupport {
    /// Name of the search.
    pub name: &'static str,
    /// Name in `engine.neighbors` of a scene.
    pub choice: &'static str,
    /// Whether `auto` begins with it.
    pub chosen: bool,
    /// Why it cannot run the system; `None` if it can.
    pub refuses: Option<String>,
    /// Why it takes all events on one thread; `None` if it shares them.
    pub serial: Option<String>,
}

/// What each search can do with a system in its initial state. The system must have its bodies.
///
/// # Errors
/// The processor has no AVX2, and the options ask for it.
pub fn searches(system: &System, options: Options) -> Result<Vec<SearchSupport>, EngineError> {
    let kernel = Kernel::choose(options.simd).ok_or(EngineError::NoAvx2)?;
    let at_start;
    let system = if system.flow.is_some() {
        let ids: Vec<u32> = (0..system.bodies_at_start().len() as u32).collect();
        at_start = system.clone().with_bodies(&ids);
        &at_start
    } else {
        system
    };
    let world = World::new(system, 0);
    let system = &*present_system(system, &world);
    let choice = Choice::new(Options::default(), kernel, system, &world)?;
    let (chosen, case) = (choice.search(), choice.case(system, &world));
    let support = |search: Search| SearchSupport {
        name: search.name(),
        choice: search.choice().name(),
        chosen: search == chosen,
        refuses: search.can_run(&case).err().map(|reason| reason.text.into_owned()),
        serial: search.can_share(&world).err().map(ToOwned::to_owned),
    };
    Ok(Search::ALL.map(support).to_vec())
}
