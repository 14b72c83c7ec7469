//! Simultaneous contacts at the start of a run.

use std::collections::HashMap;

use haff_engine::{EventKind, EventRecord, Observer, Stop, Until};
use haff_linkage::AnySimulation;
use haff_scene::Scene;
use tracing::subscriber::NoSubscriber;

/// Contacts of the start that are looked through, for each particle and at most.
const EACH: u64 = 4;
const MOST: u64 = 1_000;
/// Entries of the calendar in the same time: a scene in which nothing touches has many.
const ENTRIES: u64 = 100_000;
/// More particles are not looked through: their predictions alone take as long as a whole check.
const LARGEST: usize = 100_000;

/// The first contacts of one body at one instant.
pub struct Tie {
    /// \[time\]
    pub time: f64,
    /// The body that has both of them.
    pub body: u32,
}

/// The last contacts of bodies, and the first of them at one time.
struct Contacts {
    /// Bodies of infinite mass: no contact changes them.
    fixed: Vec<bool>,
    last: HashMap<u32, f64>,
    seen: u64,
    first: Option<Tie>,
}

impl Observer for Contacts {
    fn wants_events(&self) -> bool {
        true
    }

    fn event(&mut self, row: &EventRecord) {
        if !matches!(row.kind, EventKind::Collision | EventKind::Wall | EventKind::Stick) {
            return;
        }
        self.seen += 1;
        let partner = row.kind.is_of_two_particles().then_some(row.j);
        for body in [Some(row.i), partner].into_iter().flatten().filter(|&body| !self.fixed[body as usize]) {
            if self.last.insert(body, row.time) == Some(row.time) && self.first.is_none() {
                self.first = Some(Tie { time: row.time, body });
            }
        }
    }
}

/// The first body of a scene that has two contacts at one instant, if there is one among the first contacts
/// of the run. `None` also for very large systems, and if the run cannot start.
pub fn first_tie(scene: &Scene) -> Option<Tie> {
    let particles = scene.system.bodies.len();
    if particles > LARGEST {
        return None;
    }
    // What a run says on its way is said by the run.
    tracing::subscriber::with_default(NoSubscriber::default(), || {
        let mut simulation =
            AnySimulation::new(scene.system.clone(), scene.joints.clone(), scene.options).ok()?;
        let is_fixed = |class: u32| scene.system.classes[class as usize].mass.is_infinite();
        let fixed = scene.system.bodies.iter().map(|body| is_fixed(body.class)).collect();
        let mut contacts = Contacts { fixed, last: HashMap::new(), seen: 0, first: None };
        let until = Until {
            time: scene.run.until.unwrap_or(f64::INFINITY),
            collisions: scene.run.collisions.unwrap_or(u64::MAX),
            entries: 64,
        };
        let most = (EACH * particles as u64).min(MOST);
        for _ in 0..ENTRIES / until.entries {
            let stop = simulation.advance(until, &mut contacts);
            if contacts.first.is_some() || contacts.seen >= most || !matches!(stop, Ok(Stop::Slice)) {
                break;
            }
        }
        contacts.first
    })
}
