/*!
Drives: actions that add energy to the particles, or remove it, at stated times.

A new drive is one more variant of [`DriveKind`](crate::model::DriveKind) and a `TimedAction` in a file of
its own; one that another crate adds is an [`Action`](crate::model::Action), which `action` calls.
*/

mod action;
pub(crate) mod actions;
mod andersen;
pub(crate) mod driven;
mod hold;
mod rescale;
mod times;
mod white_noise;

pub(crate) use actions::actions;
