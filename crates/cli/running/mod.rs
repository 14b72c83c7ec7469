/*!
One run: its state, its schedule, its files, and its report.

*What is here.* [`session`] advances a simulation and records it, [`single`] runs a scene or resumes a file
in that way, for `haff run` and for each member of a sweep, [`continued`] goes on with changed keys in a new
file. [`report`] is what a run prints, [`parts`] are the stretches between stops, [`states`] reads states of
other files, [`ties`] finds simultaneous contacts at the start, [`starting`] also keeps the growth of a
packing, [`warnings`] says what a scene will probably do, [`estimate`] how much memory it takes.
[`controls`] what ends a run from outside, [`compressing`] the ends
of runs whose box shrinks.

*What to change here.* What a run does at its times, and what it reports.

*May import* `terminal` and `arguments`.

*Begin with* [`session`].
*/

pub mod compressing;
pub mod continued;
pub mod controls;
pub mod estimate;
pub mod parts;
pub mod python;
pub mod report;
pub mod session;
pub mod single;
pub mod starting;
pub mod states;
pub mod ties;
pub mod warnings;
