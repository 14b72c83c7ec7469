//! The start of a run: states that its scene reads, and the growth of its packing.

use std::{
    cell::{Cell, RefCell},
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use haff_engine::{Checkpoint, System};
use haff_record::{Header, RecordError, Recorder};
use haff_scene::{State, StateSource};

use crate::{
    running::{
        session::{CHECKPOINT_EVERY, CHECKPOINT_PARTICLE},
        states::States,
    },
    terminal::progress::Progress,
};

/// [`States`] for a run that begins: with a progress bar while its packing grows, and checkpoints of the
/// growth in a file beside the output, from which the same command goes on.
pub struct Starting {
    progress: Progress,
    /// The output file, if the command names one; else the scene does.
    output: Option<PathBuf>,
    /// When the newest checkpoint was written, or the growth began.
    saved: Cell<Instant>,
    /// The file with checkpoints, if there is one.
    kept: RefCell<Option<PathBuf>>,
    /// Time between two checkpoints.
    every: Duration,
}

impl Starting {
    pub fn new(progress: Progress, output: Option<PathBuf>) -> Self {
        let (saved, kept) = (Cell::new(Instant::now()), RefCell::default());
        Self { progress, output, saved, kept, every: CHECKPOINT_EVERY }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.progress.finish();
    }

    /// Removes the checkpoints of a growth that has ended.
    pub fn remove_kept(&self) {
        if let Some(path) = self.kept.take() {
            // What cannot be removed is not read again: the next growth has another key, or the same result.
            let _ = fs::remove_file(path);
        }
    }

    /// The file of the checkpoints.
    fn beside(&self, output: Option<&Path>) -> Option<PathBuf> {
        let mut path = self.output.as_deref().or(output)?.to_owned().into_os_string();
        path.push(".growing");
        Some(path.into())
    }

    fn write(path: &Path, key: &str, system: &System, checkpoint: Checkpoint) -> Result<(), RecordError> {
        let title = "a packing that grows, for the start of a run".to_owned();
        let scene_toml = key.to_owned();
        let header =
            Header { title, scene_toml, frames: false, observables: false, ..Header::from_system(system) };
        let recorder = Recorder::create(path, header, true)?;
        recorder.checkpoint(checkpoint)?;
        recorder.finish("", false)
    }
}

impl StateSource for Starting {
    fn state(&self, path: &Path, index: i64) -> Result<State, String> {
        States.state(path, index)
    }

    fn progress(&self, work: &str, part: f64) {
        self.progress.show_work(work, part);
    }

    fn kept_growth(&self, output: Option<&Path>, key: &str) -> Option<Checkpoint> {
        let path = self.beside(output).filter(|path| path.exists())?;
        let found = haff_record::resumable(&path).ok().filter(|found| found.scene_toml == key)?;
        tracing::info!(file = %path.display(), "the packing goes on growing");
        self.kept.replace(Some(path));
        Some(found.checkpoint)
    }

    fn keep_growth(&self, output: Option<&Path>, key: &str, system: &System, take: &dyn Fn() -> Checkpoint) {
        let every = self.every.max(CHECKPOINT_PARTICLE * system.bodies.len() as u32);
        let Some(path) = self.beside(output).filter(|_| self.saved.get().elapsed() >= every) else { return };
        // Without checkpoints the growth goes on, and has to begin again if it is interrupted.
        match Self::write(&path, key, system, take()) {
            Ok(()) => {
                self.kept.replace(Some(path));
            }
            Err(error) => tracing::warn!("no checkpoint of the growing packing: {error}"),
        }
        self.saved.set(Instant::now());
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const SCENE: &str = "schema = 1\n[[species]]\nname = \"grain\"\ncount = 300\nradius = 0.5\nmass = 1.0\n\
        [initial]\npositions = { packing = 0.58 }\ntemperature = 1.0\n[contact]\nrestitution = 1.0\n\
        [run]\nuntil = 1.0\n";

    /// Keeps every checkpoint, and fails after some of them: what is kept then is what a kill leaves.
    struct Killed<'a> {
        starting: &'a Starting,
        left: Cell<u32>,
    }

    impl StateSource for Killed<'_> {
        fn state(&self, path: &Path, index: i64) -> Result<State, String> {
            self.starting.state(path, index)
        }

        fn kept_growth(&self, output: Option<&Path>, key: &str) -> Option<Checkpoint> {
            self.starting.kept_growth(output, key)
        }

        fn keep_growth(
            &self,
            output: Option<&Path>,
            key: &str,
            system: &System,
            take: &dyn Fn() -> Checkpoint,
        ) {
            if self.left.get() > 0 {
                self.left.set(self.left.get() - 1);
                self.starting.keep_growth(output, key, system, take);
            }
        }
    }

    fn positions(states: &dyn StateSource) -> Vec<DVec3> {
        let scene = haff_scene::parse("scene", SCENE, &[], states).expect("the scene is valid");
        scene.system.bodies.iter().map(|body| body.position).collect()
    }

    #[test]
    fn an_interrupted_growth_goes_on_with_the_same_bits() {
        let folder = tempfile::tempdir().expect("a folder");
        let output = folder.path().join("out.h5");
        let starting = Starting {
            every: Duration::ZERO,
            ..Starting::new(Progress::on_terminal(true), Some(output.clone()))
        };
        let whole = positions(&States);
        // 300 particles: 60 µs of a particle are 18 ms, so that the first steps are kept or not by the clock.
        std::thread::sleep(Duration::from_millis(30));
        assert_eq!(positions(&Killed { starting: &starting, left: Cell::new(1) }), whole);
        let kept = folder.path().join("out.h5.growing");
        assert!(kept.is_file());
        assert!(haff_record::resumable(&kept).is_ok_and(|found| found.checkpoint.position.len() == 300));
        // From the checkpoint, and then with another one.
        assert_eq!(positions(&Killed { starting: &starting, left: Cell::new(0) }), whole);
        starting.remove_kept();
        assert!(!kept.exists());
        // A file that is none is no checkpoint.
        fs::write(&kept, "no HDF5").expect("a file");
        assert_eq!(positions(&starting), whole);
    }
}
