//! Physical events. Each scheduler has a type for exactly those events that can occur in it, so that its
//! event loop contains no others.

use crate::{
    laws::{carried, resolve, resting, series, slide, wall_impact},
    model::features::Features,
    numerics::error::EngineError,
    report::Observer,
    state::State,
};

/// A physical event: the event loop resolves it, and the collapse detector counts it.
pub(crate) trait PhysicalEvent: Copy {
    /// The two particles of the event, twice the same if there is only one; and the wall, if there is one.
    fn participants(self) -> ([u32; 2], Option<u32>);

    /// Whether it is a contact.
    #[inline(always)]
    fn is_contact(self) -> bool {
        true
    }

    /// Resolves the event at `time` \[ticks\]. Returns the grains that wake.
    fn resolve<F: Features, const EVENTS: bool>(
        self,
        state: &mut State,
        time: i64,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError>;

    /// The reason to pause the event loop after this event, if there is one.
    fn pause<F: Features>(self, state: &mut State, time: i64) -> Option<Pause>;
}

/// The reason why the event loop has paused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pause {
    /// All events up to the limit of time have been resolved; the present is that time.
    Time,
    /// The limit of collisions is reached.
    Collisions,
    /// The limit of calendar entries is reached.
    Entries,
    /// Nothing moves, and no completed series of bounces is pending.
    Rest,
    /// Grains are jammed: without any room they would collide without end. A settling scan must follow now.
    Jam,
    /// The scheduler does not support the present state.
    Unsupported,
}

/// A collision of two particles; the first is the owner of the calendar entry.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Collision(pub [u32; 2]);

/// A collision of two particles, or of a particle with a wall.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Impact {
    Pair(Collision),
    Wall { i: u32, wall: u32 },
}

/// An impact, the end of a completed series of bounces of a particle, its release by the wall that carries
/// it, or the end of its slide on a wall.
#[derive(Debug, Clone, Copy)]
pub(crate) enum AnyEvent {
    Impact(Impact),
    EndOfBounces(u32),
    Release(u32),
    EndOfSlide(u32),
}

impl PhysicalEvent for Collision {
    #[inline(always)]
    fn participants(self) -> ([u32; 2], Option<u32>) {
        (self.0, None)
    }

    #[inline(always)]
    fn resolve<F: Features, const EVENTS: bool>(
        self,
        state: &mut State,
        time: i64,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        let Self([i, j]) = self;
        let woken = if F::REST { resting::wake_if_hit(state, i, j, time) } else { Vec::new() };
        resolve::collision::<F, EVENTS>(state, [i, j], time, observer)?;
        Ok(woken)
    }

    #[inline(always)]
    fn pause<F: Features>(self, state: &mut State, time: i64) -> Option<Pause> {
        (F::REST && state.settling.count_contact(&state.world, time)).then_some(Pause::Jam)
    }
}

impl PhysicalEvent for Impact {
    #[inline(always)]
    fn participants(self) -> ([u32; 2], Option<u32>) {
        match self {
            Self::Pair(collision) => collision.participants(),
            Self::Wall { i, wall } => ([i, i], Some(wall)),
        }
    }

    #[inline(always)]
    fn resolve<F: Features, const EVENTS: bool>(
        self,
        state: &mut State,
        time: i64,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        match self {
            Self::Pair(collision) => collision.resolve::<F, EVENTS>(state, time, observer),
            Self::Wall { i, wall } => {
                let asleep = F::REST && state.world.is_asleep(i);
                let woken = if asleep { resting::wake(state, i, time) } else { Vec::new() };
                wall_impact::wall::<F, EVENTS>(state, i, wall, time, observer)?;
                Ok(woken)
            }
        }
    }

    #[inline(always)]
    fn pause<F: Features>(self, state: &mut State, time: i64) -> Option<Pause> {
        (F::REST && state.settling.count_contact(&state.world, time)).then_some(Pause::Jam)
    }
}

impl From<Impact> for AnyEvent {
    #[inline(always)]
    fn from(impact: Impact) -> Self {
        Self::Impact(impact)
    }
}

impl PhysicalEvent for AnyEvent {
    #[inline(always)]
    fn participants(self) -> ([u32; 2], Option<u32>) {
        match self {
            Self::Impact(impact) => impact.participants(),
            Self::EndOfBounces(i) | Self::Release(i) | Self::EndOfSlide(i) => ([i, i], None),
        }
    }

    #[inline(always)]
    fn is_contact(self) -> bool {
        matches!(self, Self::Impact(_))
    }

    #[inline(always)]
    fn resolve<F: Features, const EVENTS: bool>(
        self,
        state: &mut State,
        time: i64,
        observer: &mut dyn Observer,
    ) -> Result<Vec<u32>, EngineError> {
        match self {
            Self::Impact(impact) => impact.resolve::<F, EVENTS>(state, time, observer),
            Self::EndOfBounces(i) => {
                series::end_of_bounces::<EVENTS>(state, i, time, observer);
                slide::begin(state, i, time);
                Ok(Vec::new())
            }
            Self::Release(i) => {
                series::end_of_bounces_early::<EVENTS>(state, i, time, observer);
                carried::release::<EVENTS>(state, i, time, observer)?;
                Ok(Vec::new())
            }
            Self::EndOfSlide(i) => {
                slide::end::<EVENTS>(state, i, time, observer);
                Ok(Vec::new())
            }
        }
    }

    #[inline(always)]
    fn pause<F: Features>(self, state: &mut State, time: i64) -> Option<Pause> {
        match self {
            Self::Impact(impact) => impact.pause::<F>(state, time),
            Self::EndOfBounces(_) | Self::EndOfSlide(_) => state.is_at_rest().then_some(Pause::Rest),
            Self::Release(_) => None,
        }
    }
}
