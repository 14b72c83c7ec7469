//! Which search can run which system, and which of them shares events among threads.
//!
//! Each search says both in one function of its own; the choice, errors, `haff check -v`, the reason for one
//! thread and the table of docs/searches.md ask here.

use haff_neighbors::Lists;

use super::{
    case::{Case, Reason, SLIDING_IMAGES},
    nearby, windows,
};
use crate::{model::NeighborChoice, state::world::World};

/// A search for the next event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Search {
    AllPairs,
    Cells,
    /// The lists of [`haff_neighbors`], with one entry per particle in a calendar.
    GeneralLists,
    /// Those of [`nearby`].
    Lists,
    Windows,
}

impl Search {
    pub const ALL: [Self; 5] = [Self::AllPairs, Self::Cells, Self::GeneralLists, Self::Lists, Self::Windows];

    /// As `engine.neighbors` names it.
    pub fn choice(self) -> NeighborChoice {
        match self {
            Self::AllPairs => NeighborChoice::AllPairs,
            Self::Cells => NeighborChoice::Cells,
            Self::GeneralLists | Self::Lists => NeighborChoice::Lists,
            Self::Windows => NeighborChoice::Windows,
        }
    }

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::AllPairs => "all pairs",
            Self::Cells => "cells",
            Self::GeneralLists => "general lists",
            Self::Lists => "lists",
            Self::Windows => "windows",
        }
    }

    /// Whether this search can run a case.
    ///
    /// # Errors
    /// Why it cannot.
    pub fn can_run(self, case: &Case) -> Result<(), Reason> {
        match self {
            Self::AllPairs | Self::Cells => Ok(()),
            Self::GeneralLists => can_run_general_lists(case),
            Self::Lists => nearby::can_run(case),
            Self::Windows => windows::can_run(case),
        }
    }

    /// Whether this search shares the events of a state that it can run among threads.
    ///
    /// # Errors
    /// Why one thread takes all of them.
    pub fn can_share(self, world: &World) -> Result<(), &'static str> {
        match self {
            Self::AllPairs | Self::Cells | Self::GeneralLists => {
                Err("this search takes events one after the other")
            }
            Self::Lists => nearby::can_share(world),
            Self::Windows => windows::can_share(world),
        }
    }

    /// The first search of those with a name in scenes that can run a case; of lists those that share events
    /// among threads come first.
    ///
    /// # Errors
    /// Why the last one cannot.
    pub fn of(choice: NeighborChoice, case: &Case) -> Result<Self, Reason> {
        let first = match choice {
            NeighborChoice::AllPairs => Self::AllPairs,
            NeighborChoice::Windows => Self::Windows,
            NeighborChoice::Lists if Self::Lists.can_run(case).is_ok() => Self::Lists,
            NeighborChoice::Lists => Self::GeneralLists,
            NeighborChoice::Auto | NeighborChoice::Cells => Self::Cells,
        };
        first.can_run(case).map(|()| first)
    }
}

fn can_run_general_lists(case: &Case) -> Result<(), Reason> {
    if case.system.domain.shear.is_some() {
        return Err(Reason::new(SLIDING_IMAGES));
    }
    if case.summary.count > Lists::MAX_PARTICLES {
        return Err(Reason::new(format!("there are more than {} particles", Lists::MAX_PARTICLES)));
    }
    Ok(())
}
