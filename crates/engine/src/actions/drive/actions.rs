//! The actions of all drives of a system.

use crate::{
    actions::{drive::driven::Driven, timed::TimedAction},
    model::{
        System,
        drive::{Drive, DriveKind, KickTimes},
    },
};

use super::{
    action::NamedDrive,
    andersen::Andersen,
    hold::Hold,
    rescale::Rescale,
    times::{Poisson, Regular},
    white_noise::{IntervalNoise, Kicks, PoissonNoise},
};

/// The actions of all drives of a system. The system must still have its bodies.
pub(crate) fn actions(system: &System) -> Vec<Box<dyn TimedAction>> {
    let action = |(index, drive): (usize, &Drive)| -> Box<dyn TimedAction> {
        let driven = Driven::new(system, drive);
        let poisson = |rate: f64| Poisson::new(index, driven.particles.len(), rate, system.seed);
        match drive.kind {
            DriveKind::Named(action) => Box::new(NamedDrive::new(index, action, driven, system.seed)),
            DriveKind::Rescale { temperature, interval } => {
                Box::new(Rescale::new(Regular::new(index, interval), driven, temperature))
            }
            DriveKind::Hold { temperature, longest } => {
                Box::new(Hold::new(index, driven, temperature, longest))
            }
            DriveKind::Andersen { temperature, rate } => {
                Box::new(Andersen::new(poisson(rate), driven, temperature, system.seed))
            }
            DriveKind::WhiteNoise { strength, kicks: KickTimes::Poisson { rate } } => {
                let times = poisson(rate);
                Box::new(PoissonNoise { times, kicks: Kicks::new(driven, strength / rate, system.seed) })
            }
            DriveKind::WhiteNoise { strength, kicks: KickTimes::Regular { interval } } => {
                let kicks = Kicks::new(driven, strength * interval, system.seed);
                Box::new(IntervalNoise { times: Regular::new(index, interval), kicks })
            }
        }
    };
    system.drives.iter().enumerate().map(action).collect()
}
