/*!
What the command prints, and how it ends: text, numbers, bars, logs, signals and exit codes.

*What is here.* [`failure`] has the exit codes of docs/reference/command.md, [`output`] prints, and shows
text of others without its control characters, [`numbers`], [`progress`], [`watch`] and [`screen`] are what a
terminal shows, [`signals`] ends a run that can be resumed, [`memory`] ends the command when an allocation
fails, [`threads`] says how many threads took the events, [`machine`] on which machine, [`words`] has the
two forms of messages that name options.

*What to change here.* How something is shown. What is shown is computed in the rooms above.

*May import* other crates only.

*Begin with* [`output`] and [`failure`].
*/

pub mod failure;
pub mod log;
pub mod machine;
pub mod memory;
pub mod numbers;
pub mod output;
pub mod overwrite;
pub mod progress;
pub mod screen;
pub mod signals;
pub mod table;
pub mod threads;
pub mod watch;
pub mod words;
