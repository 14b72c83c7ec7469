//! Rapier, a rigid-body engine for games and robotics, as a peer of `haff bench --accuracy`; docs/accuracy.md
//! has the fields of the lines of JSON. The parameter is its time step.
//!
//!     cargo build --release --manifest-path benches/peers/rapier/Cargo.toml
//!     haff bench --accuracy --json --peer "Rapier=benches/peers/rapier/target/release/haff-peer-rapier"
//!
//! Double precision, balls without friction and rotation, continuous collision detection off: with it, a step
//! is cut at the first contact of a body, and restitution is lost.

use std::{
    io::{BufRead, Write},
    time::Instant,
};

use rapier3d_f64::{na::Unit, prelude::*};
use serde::{Deserialize, Serialize};

#[derive(Deserialize)]
struct Scene {
    boundary: [String; 3],
    gravity: [f64; 3],
    restitution: f64,
    wall_restitution: f64,
    radius: Vec<f64>,
    mass: Vec<f64>,
    position: Vec<[f64; 3]>,
    velocity: Vec<[f64; 3]>,
    walls: Vec<Wall>,
    times: Vec<f64>,
    parameter: f64,
}

#[derive(Deserialize)]
struct Wall {
    point: [f64; 3],
    normal: [f64; 3],
}

#[derive(Serialize)]
struct State {
    position: Vec<[f64; 3]>,
    velocity: Vec<[f64; 3]>,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Answer {
    Done { states: Vec<State>, seconds: f64, steps: u64 },
    Failed { error: String },
}

fn vector([x, y, z]: [f64; 3]) -> Vector {
    Vector::new(x, y, z)
}

fn run(scene: &Scene) -> Answer {
    if scene.boundary.iter().any(|boundary| boundary == "periodic") {
        return Answer::Failed { error: "it has no periodic boundaries".to_owned() };
    }
    let start = Instant::now();
    let mut world = PhysicsWorld::new();
    world.gravity = vector(scene.gravity);
    // Coefficients are multiplied: two balls have e, and a ball and a wall the wall's.
    let ball = scene.restitution.max(1e-30).sqrt();
    for wall in &scene.walls {
        let body = world.insert_body(RigidBodyBuilder::fixed().translation(vector(wall.point)));
        let shape = ColliderBuilder::halfspace(Unit::new_unchecked(vector(wall.normal)))
            .restitution(scene.wall_restitution / ball)
            .restitution_combine_rule(CoefficientCombineRule::Multiply)
            .friction(0.0)
            .friction_combine_rule(CoefficientCombineRule::Min);
        world.insert_collider(shape, Some(body));
    }
    let mut balls = Vec::new();
    for i in 0..scene.mass.len() {
        let body = RigidBodyBuilder::dynamic()
            .translation(vector(scene.position[i]))
            .linvel(vector(scene.velocity[i]))
            .lock_rotations()
            .can_sleep(false);
        let shape = ColliderBuilder::ball(scene.radius[i])
            .mass(scene.mass[i])
            .restitution(ball)
            .restitution_combine_rule(CoefficientCombineRule::Multiply)
            .friction(0.0)
            .friction_combine_rule(CoefficientCombineRule::Min);
        balls.push(world.insert(body, shape).0);
    }
    let (mut states, mut steps, mut now) = (Vec::new(), 0, 0.0);
    for &time in &scene.times {
        let count = ((time - now) / scene.parameter * (1.0 - 1e-9)).ceil();
        world.integration_parameters.dt = (time - now) / count;
        for _ in 0..count as u64 {
            world.step();
        }
        (steps, now) = (steps + count as u64, time);
        let of = |read: &dyn Fn(&RigidBody) -> Vector| {
            balls.iter().map(|ball| read(&world.bodies[*ball])).map(|v| [v.x, v.y, v.z]).collect()
        };
        states.push(State { position: of(&|body| body.translation()), velocity: of(&|body| body.linvel()) });
    }
    Answer::Done { states, seconds: start.elapsed().as_secs_f64(), steps }
}

fn main() -> std::io::Result<()> {
    for line in std::io::stdin().lock().lines() {
        let answer = match serde_json::from_str(&line?) {
            Ok(scene) => run(&scene),
            Err(error) => Answer::Failed { error: error.to_string() },
        };
        let mut output = std::io::stdout().lock();
        serde_json::to_writer(&mut output, &answer)?;
        output.write_all(b"\n")?;
        output.flush()?;
    }
    Ok(())
}
