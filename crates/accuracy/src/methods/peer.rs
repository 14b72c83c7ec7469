/*!
Another program as a method: a command that reads a scene as one line of JSON on standard input for each run,
and replies with one line of JSON on standard output.

```text
→ {"size": [x, y, z], "boundary": ["periodic" | "wall" | "open", …], "gravity": [x, y, z], "restitution": e,
   "wall_restitution": e, "radius": […], "mass": […], "position": [[x, y, z], …], "velocity": [[x, y, z], …],
   "walls": [{"point": [x, y, z], "normal": [x, y, z]}, …], "times": […], "parameter": p}
← {"states": [{"position": [[x, y, z], …], "velocity": […]}, …], "seconds": s, "steps": n,
   "compressibility": Z | null}
← {"error": "why the scene cannot be run"}
```

`walls` includes those of the boundary. `seconds` is the wall time of the set-up and the integration, without
that of the program's own start. `parameter` is a time that determines the program's error: a step, or the
duration of a contact.
*/

use std::{
    cell::RefCell,
    io::{BufRead, BufReader, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
    time::Duration,
};

use glam::DVec3;
use haff_engine::{Boundary, System};
use serde::Deserialize;
use serde_json::json;

use super::{Method, Run, State};
use crate::Error;

/// A program that runs scenes, with one value of its parameter.
pub struct Peer<'a> {
    /// The program.
    pub program: &'a Program,
    /// A step or a contact time [time].
    pub parameter: f64,
}

/// A running program. It ends when this is dropped.
pub struct Program {
    name: String,
    pipes: RefCell<(ChildStdin, BufReader<ChildStdout>)>,
    child: Child,
}

#[derive(Deserialize)]
struct Reply {
    error: Option<String>,
    #[serde(default)]
    states: Vec<Frame>,
    #[serde(default)]
    seconds: f64,
    #[serde(default)]
    steps: u64,
    compressibility: Option<f64>,
}

#[derive(Deserialize)]
struct Frame {
    position: Vec<[f64; 3]>,
    velocity: Vec<[f64; 3]>,
}

impl Program {
    /// Starts `command`, its words separated by blanks, with a name for tables.
    pub fn start(name: &str, command: &str) -> Result<Self, Error> {
        let failed = |what: String| Error::Peer { name: name.to_owned(), what };
        let mut words = command.split_whitespace();
        let program = words.next().ok_or_else(|| failed("the command is empty".to_owned()))?;
        let mut child = Command::new(program)
            .args(words)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| failed(format!("cannot start {program}: {error}")))?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(failed("no pipes".to_owned()));
        };
        let pipes = RefCell::new((input, BufReader::new(output)));
        Ok(Self { name: name.to_owned(), pipes, child })
    }

    /// The name given at its start.
    pub fn name(&self) -> &str {
        &self.name
    }

    fn request(&self, scene: &str) -> std::io::Result<String> {
        let (input, output) = &mut *self.pipes.borrow_mut();
        writeln!(input, "{scene}")?;
        input.flush()?;
        let mut line = String::new();
        output.read_line(&mut line)?;
        Ok(line)
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // A program that waits for scenes may be killed; it may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Method for Peer<'_> {
    fn name(&self) -> &str {
        &self.program.name
    }

    fn parameter(&self) -> String {
        format!("p = {:.0e}", self.parameter)
    }

    fn value(&self) -> Option<f64> {
        Some(self.parameter)
    }

    fn run(&self, system: &System, times: &[f64]) -> Result<Run, Error> {
        let failed = |what: String| Error::Peer { name: self.program.name.clone(), what };
        let scene = scene(system, times, self.parameter, &self.program.name)?;
        let line = self.program.request(&scene).map_err(|error| failed(error.to_string()))?;
        let reply: Reply = serde_json::from_str(&line)
            .map_err(|error| failed(format!("replied {:?}: {error}", line.trim())))?;
        if let Some(what) = reply.error {
            return Err(failed(what));
        }
        let count = system.bodies.len();
        let whole = |frame: &Frame| frame.position.len() == count && frame.velocity.len() == count;
        if reply.states.len() != times.len() || !reply.states.iter().all(whole) {
            return Err(failed(format!(
                "replied with {} states for {} times",
                reply.states.len(),
                times.len()
            )));
        }
        if !(reply.seconds.is_finite() && reply.seconds >= 0.0) {
            return Err(failed(format!("replied with {} seconds", reply.seconds)));
        }
        let vectors = |list: Vec<[f64; 3]>| list.into_iter().map(DVec3::from_array).collect();
        let state =
            |frame: Frame| State { position: vectors(frame.position), velocity: vectors(frame.velocity) };
        Ok(Run {
            states: reply.states.into_iter().map(state).collect(),
            wall: Duration::from_secs_f64(reply.seconds),
            steps: reply.steps,
            compressibility: reply.compressibility,
        })
    }
}

/// A scene as a line of JSON.
fn scene(system: &System, times: &[f64], parameter: f64, name: &str) -> Result<String, Error> {
    let (restitution, wall_restitution) = crate::reference::one_restitution(system, name)?;
    let class = |body: &haff_engine::Body| system.classes[body.class as usize];
    let boundary = system.domain.boundary.map(|boundary| match boundary {
        Boundary::Periodic => "periodic",
        Boundary::Wall => "wall",
        Boundary::Open => "open",
    });
    let bodies = &system.bodies;
    let walls: Vec<_> = system
        .walls
        .iter()
        .map(|wall| json!({"point": wall.point.to_array(), "normal": wall.normal.to_array()}))
        .collect();
    let scene = json!({
        "size": system.domain.size.to_array(),
        "boundary": boundary,
        "gravity": system.domain.gravity.to_array(),
        "restitution": restitution,
        "wall_restitution": wall_restitution,
        "radius": bodies.iter().map(|body| class(body).radius).collect::<Vec<_>>(),
        "mass": bodies.iter().map(|body| class(body).mass).collect::<Vec<_>>(),
        "position": bodies.iter().map(|body| body.position.to_array()).collect::<Vec<_>>(),
        "velocity": bodies.iter().map(|body| body.velocity.to_array()).collect::<Vec<_>>(),
        "walls": walls,
        "times": times,
        "parameter": parameter,
    });
    Ok(scene.to_string())
}
