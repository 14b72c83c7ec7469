/*!
Dense random packings: particles are placed without overlap in a larger box, which is then compressed until
it is the one that is wanted (Lubachevsky–Stillinger growth, B. D. Lubachevsky, F. H. Stillinger, J. Stat.
Phys. 60, 561 (1990)). They are elastic and move all the time, so that they find their way around each
other.

Fast growth jams at a lower packing fraction than slow growth: what jams too early is tried again at a lower
rate.
*/

use std::{
    hash::{DefaultHasher, Hash, Hasher},
    path::Path,
};

use glam::DVec3;
use haff_engine::{
    Body, Boundary, Checkpoint, Class, Compression, ConstantVelocity, Contacts, Dimension, Domain, Drive,
    DriveKind, EngineError, Group, Measure, Options, Silent, Simulation, Stop, System, TRAJECTORY_VERSION,
    Until, Wall, WallLaw, WallMotion, significant,
};
use haff_mechanics::Restitution;

use crate::StateSource;
use crate::model::scene::{GrowthEnd, GrowthRun};
use haff_placement::{
    loose,
    random::Stream,
    room::Room,
    velocity::{Bath, equilibrate, maxwell},
};

/// Growth of the largest diameter in a unit of time by the thermal speed, one after the other.
const RATES: [f64; 4] = [0.1, 0.03, 0.01, 0.003];

/// Growth that has ended too early: the largest packing fraction that was reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Jammed {
    pub(crate) packing_fraction: f64,
}

/// The part of a box that spheres of these radii fill.
pub(crate) fn packing_fraction(dimension: Dimension, size: DVec3, radius: &[f64]) -> f64 {
    let filled: f64 = radius.iter().map(|&radius| dimension.volume(radius)).sum();
    filled / size.to_array()[..dimension.count()].iter().product::<f64>()
}

/// What accompanies a growth: who is told how far it is, and keeps checkpoints of it.
#[derive(Clone, Copy)]
pub(crate) struct Company<'a> {
    pub(crate) states: &'a dyn StateSource,
    /// The output file of the scene.
    pub(crate) output: Option<&'a Path>,
}

/// A growth from a dilute start, at one of several rates.
struct Growth<'a> {
    larger: &'a Domain,
    dimension: Dimension,
    radius: &'a [f64],
    position: &'a [DVec3],
    /// By which the box becomes smaller.
    scale: f64,
    seed: u64,
    company: Company<'a>,
}

/// Centres for spheres of these radii in a box with periodic or walled axes, whatever its packing fraction.
///
/// `stream` gives the random numbers of the placement of each particle, `seed` those of velocities. The
/// result depends on nothing else: not on where the growth has been interrupted.
///
/// # Errors
/// The growth jams before, at every rate.
pub(crate) fn dense(
    domain: &Domain,
    dimension: Dimension,
    radius: &[f64],
    seed: u64,
    stream: impl Fn(usize) -> Stream,
    company: Company<'_>,
) -> Result<Vec<DVec3>, Jammed> {
    let wanted = packing_fraction(dimension, domain.size, radius);
    let start = wanted.min(GrowthRun::FLUID[dimension.count() - 2]);
    let scale = libm::pow(wanted / start, 1.0 / dimension.count() as f64);
    let mut larger = Domain { shear: None, compression: None, gravity: DVec3::ZERO, ..*domain };
    for axis in 0..dimension.count() {
        larger.size[axis] *= scale;
    }
    let room = Room { dimension, domain: &larger, planes: &[], obstacles: &[], regions: &[] };
    let position = loose::random(&room, radius, &stream).map_err(|_| Jammed { packing_fraction: 0.0 })?;
    if scale == 1.0 {
        return Ok(position);
    }
    let growth = Growth { larger: &larger, dimension, radius, position: &position, scale, seed, company };
    // An interrupted growth goes on at its rate: the faster ones have jammed.
    let Company { states, output } = company;
    let found = RATES
        .iter()
        .enumerate()
        .find_map(|(k, &rate)| Some((k, states.kept_growth(output, &growth.key(rate))?)));
    let (first, mut kept) = found.map_or((0, None), |(k, checkpoint)| (k, Some(checkpoint)));
    let mut most: f64 = start;
    for &rate in &RATES[first..] {
        match growth.grow(rate, kept.take()) {
            Ok(position) => return Ok(into(domain, dimension, position)),
            Err(Jammed { packing_fraction }) => most = most.max(packing_fraction),
        }
    }
    Err(Jammed { packing_fraction: most })
}

impl Growth<'_> {
    /// A name of all that a growth at a rate depends on.
    fn key(&self, rate: f64) -> String {
        // Another compiler may give other keys: then the growth begins again.
        let mut hasher = DefaultHasher::new();
        for number in self.radius.iter().copied().chain(self.position.iter().flat_map(DVec3::to_array)) {
            number.to_bits().hash(&mut hasher);
        }
        self.larger.size.to_array().map(f64::to_bits).hash(&mut hasher);
        let (hash, Self { scale, seed, .. }) = (hasher.finish(), self);
        format!(
            "growth of the packing {hash:016x} by {scale}, seed {seed}, rate {rate}, trajectory {TRAJECTORY_VERSION}"
        )
    }

    /// Compresses the larger box, from a checkpoint of that if there is one. Returns positions by edge.
    fn grow(&self, rate: f64, kept: Option<Checkpoint>) -> Result<Vec<DVec3>, Jammed> {
        let &Self { dimension, radius, scale, company: Company { states, output }, .. } = self;
        let largest = radius.iter().copied().fold(0.0, f64::max);
        let gamma = rate / (2.0 * largest);
        let end = (1.0 - 1.0 / scale) / gamma;
        let system = self.system(gamma);
        let fraction = |time: f64| packing_fraction(dimension, system.domain.edges(time), radius);
        let failed = |time: f64| Jammed { packing_fraction: fraction(time) };
        let growth = GrowthRun::new(radius.len(), Some(GrowthEnd::PackingFraction(fraction(end))));
        let key = self.key(rate);
        let options = Options::default();
        // A file that does not fit is none.
        let kept = kept.and_then(|kept| Simulation::restore(system.clone(), options, &kept).ok());
        let mut simulation = if let Some(simulation) = kept {
            simulation
        } else {
            let mut new = Simulation::new(system.clone(), options).map_err(|_: EngineError| failed(0.0))?;
            new.sample();
            new
        };
        loop {
            let collisions = growth.next(simulation.counters().collisions);
            match simulation.advance(Until { time: end, collisions, ..Until::default() }, &mut Silent) {
                Ok(Stop::Time) => break,
                Ok(Stop::Collisions | Stop::Slice) => {}
                Ok(Stop::Rest) | Err(_) => return Err(failed(simulation.time())),
            }
            simulation.sample();
            let last = simulation.take_compressed();
            if last.is_some_and(|last| growth.grown(&last, collisions).is_some()) {
                return Err(failed(simulation.time()));
            }
            states.keep_growth(output, &key, &system, &|| simulation.checkpoint());
            states.progress(
                &format!("growing to φ = {}", significant(fraction(end), 4)),
                simulation.time() / end,
            );
        }
        let frame = simulation.frame();
        let edges = DVec3::new(frame.edges[0].x, frame.edges[1].y, frame.edges[2].z);
        Ok(frame.position.iter().map(|position| *position / edges).collect())
    }

    /// Elastic spheres of mass 1 and temperature 1 in a box that is compressed.
    fn system(&self, gamma: f64) -> System {
        let &Self { larger, dimension, radius, position, seed, .. } = self;
        let d = dimension.count();
        let rates = DVec3::from_array([0, 1, 2].map(|axis| if axis < d { gamma } else { 0.0 }));
        let mut domain = Domain { compression: Some(Compression { rates, inside: 1.0 }), ..*larger };
        if dimension == Dimension::Two {
            domain.boundary[2] = Boundary::Open;
        }
        let mut velocity: Vec<DVec3> =
            (0..radius.len()).map(|i| maxwell(seed, "", i, 1.0, dimension)).collect();
        let bath = Bath { temperature: 1.0, members: (0..radius.len()).collect() };
        equilibrate(&mut velocity, &vec![1.0; radius.len()], &[bath], dimension);
        let mut classes: Vec<Class> = Vec::new();
        let mut class_of = std::collections::BTreeMap::new();
        let mut class = |radius: f64| {
            *class_of.entry(radius.to_bits()).or_insert_with(|| {
                classes.push(Class { radius, mass: 1.0, group: 0 });
                classes.len() as u32 - 1
            })
        };
        let is_periodic = |axis: usize| domain.boundary[axis] == Boundary::Periodic;
        let flow =
            DVec3::from_array([0, 1, 2].map(|axis| if is_periodic(axis) { -rates[axis] } else { 0.0 }));
        let bodies: Vec<Body> = position
            .iter()
            .zip(&velocity)
            .zip(radius)
            .map(|((&position, &velocity), &radius)| Body {
                position,
                velocity: velocity + flow * position,
                image: [0; 3],
                class: class(radius),
                species: 0,
            })
            .collect();
        let mut walls = Vec::new();
        for axis in (0..d).filter(|&axis| domain.boundary[axis] == Boundary::Wall) {
            let normal = DVec3::AXES[axis];
            let edge = normal * domain.size[axis];
            let moving =
                WallMotion::Constant(ConstantVelocity { velocity: -gamma * edge, reference_time: 0.0 });
            for (point, normal, motion) in [(DVec3::ZERO, normal, WallMotion::Fixed), (edge, -normal, moving)]
            {
                walls.push(Wall { name: String::new(), point, normal, motion, shape: None });
            }
        }
        let elastic = Restitution::Constant(1.0);
        // The same for every rate: heating by a hundredth of the growth at first.
        let kind = DriveKind::Hold { temperature: 1.0, longest: 0.01 / gamma };
        System {
            dimension,
            domain,
            bodies,
            classes,
            groups: vec![Group { name: "grain".to_owned() }],
            species: vec!["grain".to_owned()],
            contacts: Contacts {
                pair: vec![elastic],
                wall: walls.iter().map(|_| WallLaw::Restitution(elastic)).collect(),
                tc: 0.0,
                rest_speed: 0.0,
            },
            walls,
            spin: None,
            drag: None,
            drives: vec![Drive { kind, species: vec![0], rotational: false }],
            seed,
            measure: Measure::default(),
            flow: None,
        }
    }
}

/// Positions by edge, in a domain.
fn into(domain: &Domain, dimension: Dimension, mut position: Vec<DVec3>) -> Vec<DVec3> {
    for position in &mut position {
        *position *= domain.size;
        for axis in 0..dimension.count() {
            // By rounding at the upper face.
            if domain.boundary[axis] == Boundary::Periodic && position[axis] >= domain.size[axis] {
                position[axis] -= domain.size[axis];
            }
        }
        if dimension == Dimension::Two {
            position.z = 0.0;
        }
    }
    position
}
