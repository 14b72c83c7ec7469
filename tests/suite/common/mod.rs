//! Runs the command in tests.

use std::{
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus, Output, Stdio},
    time::Duration,
};

use serde_json::Value;

pub mod textbook;

/// The repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A scene of the repository.
pub fn config(name: &str) -> String {
    root().join("configs").join(name).display().to_string()
}

/// The command in a temporary folder.
pub struct Haff {
    folder: tempfile::TempDir,
}

impl Haff {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file and returns its name.
    pub fn write(&self, name: &str, text: &str) -> String {
        std::fs::write(self.path(name), text).expect("a file in a temporary folder");
        name.to_owned()
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_haff"));
        command.args(arguments).current_dir(self.folder.path()).stdin(Stdio::null());
        command
    }

    pub fn output(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the command starts")
    }

    /// Exit status, standard output and standard error.
    pub fn run(&self, arguments: &[&str]) -> (i32, String, String) {
        let output = self.output(arguments);
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.code().unwrap_or(-1), text(&output.stdout), text(&output.stderr))
    }

    /// Time of the last checkpoint in a file; negative if there is none.
    pub fn checkpoint_time(&self, file: &str) -> f64 {
        let (_, out, _) = self.run(&["info", file, "--json"]);
        let info: Value = serde_json::from_str(&out).unwrap_or_default();
        info["checkpoint_time"].as_f64().unwrap_or(-1.0)
    }

    /// Waits until a run has written a checkpoint later than `time`, however slow the machine is; returns its
    /// exit status if it has ended before.
    pub fn wait_for_checkpoint(&self, run: &mut Child, file: &str, time: f64) -> Option<ExitStatus> {
        loop {
            let ended = run.try_wait().expect("a child of the test");
            if ended.is_some() || self.checkpoint_time(file) > time {
                return ended;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Runs with `--json` and returns the report; the exit status must be 0.
    pub fn report(&self, arguments: &[&str]) -> Value {
        let all = [arguments, &["--json", "-q"]].concat();
        let (status, out, err) = self.run(&all);
        assert_eq!(status, 0, "{arguments:?}: {err}");
        serde_json::from_str(&out).unwrap_or_else(|error| panic!("{arguments:?}: {error} in {out:?}"))
    }
}

/// A small gas for tests.
pub const GAS: &str = include_str!("../../gas.toml");

/// All keys that a report must contain.
pub const PROMISED: [&str; 16] = [
    "particles",
    "collisions",
    "wall_collisions",
    "events",
    "simulated_time",
    "wall_seconds",
    "collisions_per_second",
    "ledger_residual",
    "max_overlap",
    "peak_memory_bytes",
    "threads",
    "seed",
    "version",
    "trajectory_version",
    "state_hash",
    "stopped",
];
