/*!
A file, or a folder, for each subcommand.

*What is here.* [`run`], [`check`], [`init`], [`info`], [`compare`],
[`bench`], [`pack`], [`sweep`] and [`manual`], which
writes man pages and completions. `plot`, `export` and `view` are handed to the Python package by
`running/python.rs`.

*What to change here.* A new subcommand: its arguments in `arguments.rs`, and a file here. A new figure or
export format is made in Python: `KINDS` of `figures/__init__.py`, `FORMATS` of `export/__init__.py`, and
their copies in `command/main.py`; `arguments.rs` has the examples of the help.

*May import* all rooms below: `terminal`, `arguments` and `running`.

*Begin with* [`check`].
*/

pub mod bench;
pub mod check;
pub mod compare;
pub mod info;
pub mod init;
pub mod manual;
pub mod pack;
pub mod run;
pub mod sweep;
