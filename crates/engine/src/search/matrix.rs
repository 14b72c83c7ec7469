//! Which search can run which system, and which of them shares events among threads.
//!
//! Each search says both in one function of its own; the choice, errors, `haff check -v`, the reason for one
//! thread and the table of docs/searches.md ask here.

use super::{
    case::{Case, Reason},
    lists, windows,
};
use crate::{model::NeighborChoice, state::world::World};

/// A search for the next event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Search {
    AllPairs,
    Cells,
    /// Those of [`lists`].
    Lists,
    Windows,
}

impl Search {
    pub const ALL: [Self; 4] = [Self::AllPairs, Self::Cells, Self::Lists, Self::Windows];

    /// As `engine.neighbors` names it.
    pub fn choice(self) -> NeighborChoice {
        match self {
            Self::AllPairs => NeighborChoice::AllPairs,
            Self::Cells => NeighborChoice::Cells,
            Self::Lists => NeighborChoice::Lists,
            Self::Windows => NeighborChoice::Windows,
        }
    }

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::AllPairs => "all pairs",
            Self::Cells => "cells",
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
            Self::Lists => lists::can_run(case),
            Self::Windows => windows::can_run(case),
        }
    }

    /// Whether this search shares the events of a state that it can run among threads.
    ///
    /// # Errors
    /// Why one thread takes all of them.
    pub fn can_share(self, world: &World) -> Result<(), &'static str> {
        match self {
            Self::AllPairs | Self::Cells => Err("this search takes events one after the other"),
            Self::Lists => lists::can_share(world),
            Self::Windows => windows::can_share(world),
        }
    }

    /// The search with a name in scenes, if it can run a case.
    ///
    /// # Errors
    /// Why it cannot.
    pub fn of(choice: NeighborChoice, case: &Case) -> Result<Self, Reason> {
        let search = match choice {
            NeighborChoice::AllPairs => Self::AllPairs,
            NeighborChoice::Windows => Self::Windows,
            NeighborChoice::Lists => Self::Lists,
            NeighborChoice::Auto | NeighborChoice::Cells => Self::Cells,
        };
        search.can_run(case).map(|()| search)
    }
}
