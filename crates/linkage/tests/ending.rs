//! Scenes of random bodies whose series of impacts have to come to an end.

mod common;

use common::Scene;
use glam::DVec3;
use haff_engine::{EventRecord, Observer, Until};
use haff_linkage::{SpringEnd, Tether};
use haff_testing::Random;

const G: f64 = 9.81;

/// Balls that fall one after the other between two walls onto a floor that they stick to.
fn sticking_floor(seed: u64, n: usize, width: f64, e: f64) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new(e);
    scene.gravity = -DVec3::Y * G;
    scene.wall([0.0; 3], [1.0, 0.0, 0.0]);
    scene.wall([width, 0.0, 0.0], [-1.0, 0.0, 0.0]);
    let floor = scene.wall([0.0; 3], [0.0, 1.0, 0.0]);
    for k in 0..n {
        let x = random.uniform(0.25, width - 0.25);
        let ball = scene.particle([x, 1.0 + 0.6 * k as f64, 0.0], [0.0; 3], 1.0, 0.2);
        scene.joints.sticking_to_walls.push([ball as u32, floor as u32]);
    }
    scene
}

/// Balls and dumbbells of random sizes in a box, of which some stick to the floor.
fn dumbbells(seed: u64, n: usize, e: f64) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new(e);
    scene.gravity = -DVec3::Y * G;
    scene.wall([0.0; 3], [1.0, 0.0, 0.0]);
    scene.wall([4.0, 0.0, 0.0], [-1.0, 0.0, 0.0]);
    let floor = scene.wall([0.0; 3], [0.0, 1.0, 0.0]);
    for k in 0..n {
        let y = 1.0 + 0.6 * k as f64;
        let x = random.uniform(0.3, 3.0);
        let r = random.uniform(0.1, 0.25);
        let a = scene.particle([x, y, 0.0], [random.normal(), 0.0, 0.0], random.uniform(0.5, 2.0), r);
        if k % 2 == 0 {
            let b =
                scene.particle([x + 0.6, y, 0.0], [scene.particles[a].1.x, random.normal(), 0.0], 1.0, 0.15);
            scene.rod(a, b, 0.6);
        } else if k % 3 == 0 {
            scene.joints.sticking_to_walls.push([a as u32, floor as u32]);
        }
    }
    if scene.joints.sticking_to_walls.is_empty() && scene.joints.rods.is_empty() {
        scene.joints.sticking_to_walls.push([0, floor as u32]);
    }
    scene
}

/// Bobs side by side, some of them released, beside a wall.
fn bobs(seed: u64, n: usize, e: f64, tether: Tether) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new(e);
    scene.gravity = -DVec3::Y * G;
    scene.wall([-0.2, 0.0, 0.0], [1.0, 0.0, 0.0]);
    let length = 1.0;
    let mut x = 0.0;
    for k in 0..n {
        let r = random.uniform(0.05, 0.1);
        x += r;
        let angle = if k + 1 == n { random.uniform(0.2, 1.2) } else { 0.0 };
        let pivot = DVec3::new(x, 1.0, 0.0);
        let at = pivot + DVec3::new(f64::sin(angle), -f64::cos(angle), 0.0) * length;
        let bob = scene.particle(at.to_array(), [0.0; 3], random.uniform(0.5, 2.0), r);
        scene.pendulum(pivot, length, bob, tether);
        x += r + if random.index(2) == 0 { 0.0 } else { 0.01 };
    }
    scene
}

/// Bodies on springs above a floor (which may move), hit by falling balls.
fn springs(seed: u64, n: usize, e: f64, lift: f64, gravity: f64) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new(e);
    scene.gravity = -DVec3::Y * gravity;
    let floor = scene.wall([0.0; 3], [0.0, 1.0, 0.0]);
    scene.walls[floor].motion = (DVec3::Y * lift).into();
    for k in 0..n {
        let x = k as f64;
        let m = random.uniform(0.5, 2.0);
        let held = scene.particle([x, 0.5, 0.0], [0.0, -random.uniform(0.5, 2.0), 0.0], m, 0.2);
        // It presses the body on the floor.
        scene.spring(
            SpringEnd::Point(DVec3::new(x, 3.0, 0.0)),
            SpringEnd::Particle(held),
            random.uniform(20.0, 200.0),
            3.5,
        );
        scene.particle([x + random.uniform(-0.05, 0.05), 1.5, 0.0], [0.0, -1.0, 0.0], 1.0, 0.15);
    }
    scene
}

/// Balls between two plates of infinite mass that approach each other, one ball on a spring.
fn row(seed: u64, n: usize, e: f64) -> Scene {
    let mut random = Random(seed);
    let mut scene = Scene::new(e);
    scene.wall([0.0; 3], [1.0, 0.0, 0.0]);
    let mut x = 0.3;
    for _ in 0..n {
        x += random.uniform(0.4, 0.8);
        scene.particle([x, 0.0, 0.0], [-random.uniform(0.2, 2.0), 0.0, 0.0], random.uniform(0.5, 2.0), 0.2);
    }
    let last = n - 1;
    scene.spring(SpringEnd::Particle(last), SpringEnd::Point(DVec3::new(x + 2.0, 0.0, 0.0)), 50.0, 3.0);
    scene
}

struct Counter(u64, f64, f64);
impl Observer for Counter {
    fn wants_events(&self) -> bool {
        true
    }
    fn event(&mut self, event: &EventRecord) {
        self.0 += 1;
        if std::env::var("LOG").is_ok() {
            println!(
                "{} {:.17} {} {}-{} v {:.3e} J {:.2e} loss {:.2e} n {:.3} {:.3}",
                self.0,
                event.time,
                event.kind.name(),
                event.i,
                event.j,
                event.approach_speed,
                event.impulse,
                event.energy_loss,
                event.normal.x,
                event.normal.y
            );
        }
        self.1 += event.energy_loss;
        self.2 = self.2.min(event.energy_loss);
    }
}

fn report(name: &str, scene: &Scene, until: f64, limit: u64) {
    let start = std::time::Instant::now();
    let mut simulation = match scene.try_start() {
        Ok(s) => s,
        Err(e) => {
            println!("{name}: NOT STARTED {e}");
            return;
        }
    };
    let mut counter = Counter(0, 0.0, 0.0);
    let mut worst = 0.0_f64;
    let mut time = 0.0;
    let mut what = String::from("ok");
    let mut overlap = String::new();
    let steps = 50;
    let mut entries = 0;
    'run: for k in 1..=steps {
        let target = until * f64::from(k) / f64::from(steps);
        loop {
            match simulation.advance(Until { time: target, entries: 1000, ..Until::default() }, &mut counter)
            {
                Ok(haff_engine::Stop::Slice) => entries += 1000,
                Ok(_) => break,
                Err(e) => {
                    what = e.to_string();
                    break 'run;
                }
            }
            if counter.0 > limit {
                what = "HANGS".into();
                break 'run;
            }
            if start.elapsed().as_secs() > 20 {
                what = "SLOW".into();
                break 'run;
            }
        }
        time = target;
        worst = worst.max(simulation.ledger().residual.abs());
        if let Err(e) = simulation.measure_overlap() {
            overlap = e.to_string();
            break;
        }
    }
    let ledger = simulation.ledger();
    println!(
        "{name}: t {time:.3} events {} entries {entries} rests {} residual {worst:.1e} overlap {:.1e} {overlap} rows-ledger {:.1e} least {:.1e} K {:.1e} {what} {:.2}s",
        counter.0,
        simulation.counters().rests,
        simulation.max_overlap(),
        (counter.1 - ledger.dissipated) / ledger.dissipated.max(1e-300),
        counter.2,
        ledger.kinetic,
        start.elapsed().as_secs_f64()
    );
}

#[test]
#[ignore = "prints the ends of many random scenes"]
fn experiment() {
    let only = std::env::var("ONLY").unwrap_or_default();
    let until: f64 = std::env::var("UNTIL").ok().and_then(|x| x.parse().ok()).unwrap_or(20.0);
    let go = |name: String, scene: Scene, limit: u64| {
        if name.contains(&only) {
            report(&name, &scene, until, limit);
        }
    };
    for (k, e) in [0.0, 0.2, 0.4, 0.6, 0.8, 0.9].into_iter().enumerate() {
        for seed in 0..3 {
            let s = seed + 10 * k as u64;
            go(format!("floor e {e} seed {s}"), sticking_floor(s, 6 + 2 * seed as usize, 4.0, e), 300_000);
            go(format!("dumbbells e {e} seed {s}"), dumbbells(s, 4 + seed as usize, e), 300_000);
            go(format!("strings e {e} seed {s}"), bobs(s, 3 + seed as usize, e, Tether::String), 300_000);
            go(format!("rods e {e} seed {s}"), bobs(s, 3 + seed as usize, e, Tether::Rod), 300_000);
            go(format!("springs e {e} seed {s}"), springs(s, 1 + seed as usize, e, 0.0, G), 300_000);
            go(format!("lifted e {e} seed {s}"), springs(s, 1 + seed as usize, e, 0.05, 0.0), 300_000);
            go(format!("row e {e} seed {s}"), row(s, 3 + seed as usize, e), 300_000);
        }
    }
    go("many narrow".into(), sticking_floor(1, 300, 8.0, 0.4), 3_000_000);
    go("many wide".into(), sticking_floor(1, 300, 60.0, 0.4), 3_000_000);
    go("some".into(), sticking_floor(1, 30, 4.0, 0.4), 3_000_000);
}
