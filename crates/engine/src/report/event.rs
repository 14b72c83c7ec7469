//! Events, as rows of the log.

use glam::DVec3;
use haff_mechanics::Impact;

use crate::model::{system::System, wall_law::WallLaw};

/// The kind of an event in the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
#[repr(u8)]
pub enum EventKind {
    /// Two particles.
    #[default]
    Collision = 0,
    /// A particle and a wall.
    Wall = 1,
    /// A particle comes to rest: on a wall, at the end of a completed (Zeno) series of bounces; or at its
    /// position, slow and supported, by a settling scan.
    Rest = 2,
    /// A pendulum's string goes slack: bob and pendulum.
    Slack = 3,
    /// A slack string becomes taut, and the velocity along it is lost: bob and pendulum.
    Taut = 4,
    /// A persistent contact of two particles ends because its force would become attractive.
    Release = 5,
    /// Two particles stick together.
    Stick = 6,
    /// A persistent contact with a wall ends because its force would become attractive: particle and wall.
    /// Also of a grain that an oscillating wall carried.
    Lift = 7,
    /// End of a completed series of bounces of two particles.
    Settle = 8,
    /// The state was changed from outside: no particle, no partner.
    Change = 9,
    /// A stretch of sliding with friction on a wall ends: the grain rolls from now on, or has another event.
    Slide = 10,
    /// A particle comes in by an inlet: no partner.
    Enter = 11,
    /// An outlet takes a particle out: no partner.
    Leave = 12,
}

impl EventKind {
    /// Every kind; the index of a kind is its discriminant.
    pub const ALL: [Self; 13] = [
        Self::Collision,
        Self::Wall,
        Self::Rest,
        Self::Slack,
        Self::Taut,
        Self::Release,
        Self::Stick,
        Self::Lift,
        Self::Settle,
        Self::Change,
        Self::Slide,
        Self::Enter,
        Self::Leave,
    ];

    /// Whether its partner is another particle.
    #[must_use]
    pub fn is_of_two_particles(self) -> bool {
        matches!(self, Self::Collision | Self::Release | Self::Stick | Self::Settle)
    }

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Collision => "collision",
            Self::Wall => "wall",
            Self::Rest => "rest",
            Self::Slack => "slack",
            Self::Taut => "taut",
            Self::Release => "release",
            Self::Stick => "stick",
            Self::Lift => "lift",
            Self::Settle => "settle",
            Self::Change => "change",
            Self::Slide => "slide",
            Self::Enter => "enter",
            Self::Leave => "leave",
        }
    }
}

/// Value of [`EventRecord::j`] for an event without a partner.
pub const NO_PARTNER: u32 = u32::MAX;

/// One row of the event log.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EventRecord {
    /// Time of the event [time].
    pub time: f64,
    /// Kind of the event.
    pub kind: EventKind,
    /// Index of the particle.
    pub i: u32,
    /// Index of the partner (> `i`), of the wall or of the pendulum; [`NO_PARTNER`] for a particle that is
    /// put to rest and touches no wall.
    pub j: u32,
    /// v_n = (w_i − w_j)·n > 0 [length/time].
    pub approach_speed: f64,
    /// J = (1 + e) μ v_n [mass·length/time]; summed over the series for `Rest`.
    pub impulse: f64,
    /// ΔT = ½ μ v_n² (1 − e²), eq. (2.16), plus [`Self::tangential_loss`] [energy].
    pub energy_loss: f64,
    /// E'_c = J²/(2μ), eq. (2.31), plus that of the tangential impulse of a rough contact [energy].
    pub carnot_energy: f64,
    /// Contact normal: unit vector from i to j, or into the wall.
    pub normal: DVec3,
    /// Contact point [length], wrapped into the box along periodic axes.
    pub position: DVec3,
    /// Impulse on j, or on the wall, with its tangential component [mass·length/time].
    pub impulse_vector: DVec3,
    /// The part of `energy_loss` by the tangential impulse, of translation and rotation [energy].
    pub tangential_loss: f64,
}

/// A column of the event log: a field of [`EventRecord`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventColumn {
    /// [`EventRecord::time`].
    Time,
    /// [`EventRecord::kind`].
    Kind,
    /// [`EventRecord::i`].
    I,
    /// [`EventRecord::j`].
    J,
    /// [`EventRecord::approach_speed`].
    ApproachSpeed,
    /// [`EventRecord::impulse`].
    Impulse,
    /// [`EventRecord::energy_loss`].
    EnergyLoss,
    /// [`EventRecord::carnot_energy`].
    CarnotEnergy,
    /// [`EventRecord::normal`].
    Normal,
    /// [`EventRecord::position`].
    Position,
    /// [`EventRecord::impulse_vector`].
    ImpulseVector,
    /// [`EventRecord::tangential_loss`].
    TangentialLoss,
}

impl EventColumn {
    /// Every column, in the order of files.
    pub const ALL: [Self; 12] = [
        Self::Time,
        Self::Kind,
        Self::I,
        Self::J,
        Self::ApproachSpeed,
        Self::Impulse,
        Self::EnergyLoss,
        Self::CarnotEnergy,
        Self::Normal,
        Self::Position,
        Self::ImpulseVector,
        Self::TangentialLoss,
    ];

    /// Whether a complete log of this system has the column: the impulse is along the normal, and nothing is
    /// lost by a tangential one, unless contacts are rough or walls thermal.
    pub fn exists(self, system: &System) -> bool {
        let is_rough = system.spin.is_some();
        match self {
            Self::ImpulseVector => is_rough || system.contacts.wall.iter().any(WallLaw::is_thermal),
            Self::TangentialLoss => is_rough,
            _ => true,
        }
    }

    /// The name in scenes and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Kind => "kind",
            Self::I => "i",
            Self::J => "j",
            Self::ApproachSpeed => "approach_speed",
            Self::Impulse => "impulse",
            Self::EnergyLoss => "energy_loss",
            Self::CarnotEnergy => "carnot_energy",
            Self::Normal => "normal",
            Self::Position => "position",
            Self::ImpulseVector => "impulse_vector",
            Self::TangentialLoss => "tangential_loss",
        }
    }
}

pub(crate) fn row(
    time: f64,
    kind: EventKind,
    [i, j]: [u32; 2],
    impact: &Impact,
    normal: DVec3,
    position: DVec3,
) -> EventRecord {
    EventRecord {
        time,
        kind,
        i,
        j,
        approach_speed: impact.approach_speed,
        impulse: impact.impulse,
        energy_loss: impact.energy_loss,
        carnot_energy: impact.carnot_energy,
        normal,
        position,
        impulse_vector: normal * impact.impulse,
        tangential_loss: 0.0,
    }
}
