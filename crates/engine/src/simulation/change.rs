//! Changes of the state from outside: velocities, positions, particles added and removed.
//!
//! A change starts a new epoch at the present, with all particles in free flight: those that rested come to
//! rest again by their next contacts. Energy and momentum that it gives are terms of the balances, and the
//! event log has a row for it. It is a function of the state alone, so that the run stays reproducible.
//!
//! A change from outside makes a new world in a new epoch from the present state, checks it, and replaces
//! the old one; sums, times of drives and measurements go on. What its values can be
//! (`simulation/change/checks`) is what they can be in scenes: both use `bounds`. Classes that no particle
//! has any more are dropped. `Simulation::change_system` does the same with other laws, walls or gravity:
//! `cli/running/continued` goes on so from a checkpoint with changed keys, in a new file,
//! `haff.Simulation.set` in a live simulation. Where a wall is follows from its entry in the scene alone, so
//! a changed one gets an entry that puts it where it is (`Wall::going_on`, in the scene
//! `assemble/going_on.rs`); resumptions and readers need nothing else. A scene is assembled for a `Start`:
//! the scene's own at time 0, a recorded one, whose particles are in the checkpoint and are neither placed
//! nor checked, or the present.

mod checks;

use std::collections::BTreeMap;

use glam::DVec3;
use haff_mechanics::Impact;

use crate::{
    laws::{series, slide},
    measure::{sample::Species, totals::Totals},
    model::{Body, Class, Domain, System, Wall, WallMotion},
    motion::{drag, flights, flow_work},
    numerics::{clock::Clock, error::EngineError, instant::Instant},
    report::{
        EventKind, EventRecord, Exchange, NO_PARTNER, Observer, Partner, VelocityChange, ledger::Term, row,
    },
    simulation::{
        Simulation,
        choice::Choice,
        run::{actions, open_axes},
    },
    state::{
        State, accumulators::Accumulators, force::Force, settling::SettlingState, stall::Stall,
        wall_sums::WallSums, world::World,
    },
    support::{geometry::geometry, overlap},
};

/// A particle to be added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NewParticle {
    /// Position of the center \[length\].
    pub position: DVec3,
    /// Velocity [length/time].
    pub velocity: DVec3,
    /// Angular velocity [1/time]; zero without spin.
    pub angular_velocity: DVec3,
    /// Radius \[length\].
    pub radius: f64,
    /// Mass \[mass\]; infinite for a fixed or driven body.
    pub mass: f64,
    /// Index into [`System::species`].
    pub species: u32,
}

/// A change of the state.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Change {
    /// New positions of all particles \[length\].
    pub positions: Option<Vec<DVec3>>,
    /// New velocities of all particles [length/time].
    pub velocities: Option<Vec<DVec3>>,
    /// New angular velocities of all particles [1/time]; only with spin.
    pub angular_velocities: Option<Vec<DVec3>>,
    /// Indices of particles to be removed, each once.
    pub remove: Vec<u32>,
    /// Particles to be added, after all others.
    pub add: Vec<NewParticle>,
}

/// Keeps the rows of events until the change has succeeded.
#[derive(Default)]
struct Rows(Vec<EventRecord>);

impl Observer for Rows {
    fn wants_events(&self) -> bool {
        true
    }

    fn event(&mut self, event: &EventRecord) {
        self.0.push(*event);
    }
}

impl Simulation {
    /// Changes the state at the present time.
    ///
    /// # Errors
    /// [`EngineError::Change`] for a change that is not possible; the state is then as before.
    pub fn change(&mut self, change: &Change, observer: &mut dyn Observer) -> Result<(), EngineError> {
        self.has_fixed_population("particles, positions and velocities")?;
        let (system, survivors) = self.changed_system(change)?;
        self.replace_world(system, &survivors, observer)
    }

    /// Goes on with the present state in another system: other laws of contact, walls or gravity. Its bodies
    /// are the same particles, in the same box; their positions and velocities at the start do not count.
    /// Walls that go on from where they are come from [`Wall::going_on`](crate::Wall::going_on).
    ///
    /// # Errors
    /// [`EngineError::Change`] if the system has other particles, another box, other drives or other
    /// measurements, or if a particle would overlap with a wall of it now; the state is then as before.
    pub fn change_system(
        &mut self,
        mut system: System,
        observer: &mut dyn Observer,
    ) -> Result<(), EngineError> {
        self.has_fixed_population("laws, walls and gravity")?;
        let refuse =
            |what: &str| Err(EngineError::Change(format!("{what} cannot change in a run that goes on")));
        let (own, domain) = (&self.system, &system.domain);
        let world = &self.state.world;
        let box_of = |domain: &Domain| (domain.size, domain.boundary, domain.shear, domain.compression);
        if box_of(&own.domain) != box_of(domain) || own.dimension != system.dimension {
            return refuse("the box");
        }
        if own.drives != system.drives || own.seed != system.seed {
            return refuse("drives and their seed");
        }
        if own.measure != system.measure || own.walls.len() != system.walls.len() {
            return refuse("measurements, and the number of walls,");
        }
        let properties = self.properties();
        let kinds = |body: &Body| {
            let class = &system.classes[body.class as usize];
            (class.radius, class.mass, body.species)
        };
        if system.bodies.len() != properties.len()
            || !system.bodies.iter().zip(&properties).all(|(body, own)| kinds(body) == *own)
        {
            return refuse("particles, their sizes and masses");
        }
        let frame = self.frame();
        for (i, body) in system.bodies.iter_mut().enumerate() {
            (body.position, body.velocity) = (frame.position[i], frame.velocity[i]);
            body.image = world.image_from_box(frame.image[i], world.now);
        }
        if let Some(spin) = &mut system.spin {
            spin.angular_velocity =
                (0..properties.len() as u32).map(|i| world.angular_velocity(i, world.now)).collect();
        }
        let survivors: Vec<u32> = (0..properties.len() as u32).collect();
        self.replace_world(system, &survivors, observer)
    }

    /// Replaces the world by that of a system with the bodies at the present. `survivors`: indices before the
    /// change of the first particles of the system.
    fn replace_world(
        &mut self,
        mut system: System,
        survivors: &[u32],
        observer: &mut dyn Observer,
    ) -> Result<(), EngineError> {
        self.has_fixed_population("laws, walls and gravity")?;
        let time = self.time();
        let old = &self.state.world;
        let mut world = World::new(&system, 0);
        let extent = world.extent(open_axes(&system));
        let exponent = world.exponent_for(extent, world.largest_speed(extent));
        world.clock = Clock { drag: world.clock.drag, ..old.clock.restarted(old.now, exponent) };
        world.set_scale(extent, 0.0);
        world.resolution.longest_flight = old.resolution.longest_flight;
        for (new, &i) in survivors.iter().enumerate() {
            // The anchor is set anew: an own event, so that random numbers are not repeated.
            world.particles[new].count = old.particles[i as usize].count.wrapping_add(1);
        }
        world.pistons_go_on(old, &self.system.walls);
        for wall in &mut system.walls {
            if let WallMotion::Piston(piston) = &mut wall.motion {
                piston.since = Instant::ZERO;
            }
        }
        self.check_places(&system, &world)?;
        if let (Some(times), Some(others)) = (&mut world.laws.contact_times, &old.laws.contact_times) {
            times.take_over(others, survivors, (&old.clock, old.now), (&world.clock, world.now));
        }

        let mut rows = Rows::default();
        let mut state = self.state.clone();
        let pending: Vec<u32> = state.pending.keys().copied().collect();
        let now = state.world.now;
        for i in pending {
            series::end_of_bounces::<true>(&mut state, i, now, &mut rows);
        }
        for i in state.world.sliding() {
            slide::interrupt::<true>(&mut state, i, now, &mut rows);
        }
        for i in 0..state.world.particles.len() as u32 {
            let age = state.world.age(i, now);
            flow_work::end_flight_after(&mut state, i, age);
            drag::add(&mut state, &[i], now);
        }
        let flights = flights::take(&mut state);
        let (before, after) = (Totals::of(&state.world), Totals::of(&world));
        let sums = state.world.boundary.wall_sums.take();
        world.boundary.wall_sums = sums.map(|sums| Box::new(sums.without_support(&state.world, time)));
        let mut impulse = state.world.force.impulse;
        for (sum, total) in impulse.iter_mut().zip(&state.world.force.total) {
            sum.add(total.value() * (time - state.world.force.until));
        }
        world.force = Force { impulse, until: time, ..world.force };
        let mut accumulators: Accumulators = state.accumulators;
        let kinetic = accumulators.twice_kinetic(before.kinetic, time);
        let (work, momentum) = before.carried;
        accumulators.add_energy(Term::WallWork, time, work);
        accumulators.add_impulse(momentum);
        let energy = |totals: &Totals| totals.all_kinetic() + totals.potential;
        accumulators.add_energy(Term::Change, time, energy(&after) - energy(&before));
        accumulators.add_energy(Term::LoadWork, time, before.pistons.1 - after.pistons.1);
        accumulators.add_impulse(after.momentum - before.momentum);
        accumulators.counters.epochs += 1;
        accumulators.center.replace(&world, time);
        accumulators.go_on_with(&world, kinetic, after.kinetic, time);
        let exchanges = self.changed_velocities(&world, survivors);
        let state = State {
            world,
            accumulators,
            pending: BTreeMap::new(),
            stall: Stall::default(),
            settling: SettlingState::default(),
            blocks: self.state.blocks,
            population: None,
        };
        let actions = self.moved_actions(&system, time)?;
        let species = Species::new(&system);
        let mut changed = Self::start((system, species), self.options, state, actions, Vec::new())?;
        changed.measurements = std::mem::take(&mut self.measurements);
        changed.set_stop_time(time);
        *self = changed;
        if let Some(integral) = flights {
            self.measurements.iter_mut().for_each(|measurement| measurement.flights(&integral));
        }
        for change in exchanges {
            let exchange = Exchange { time, changes: &[change], partner: Partner::Drive };
            self.measurements.iter_mut().for_each(|measurement| measurement.exchange(&exchange));
            observer.exchange(&exchange);
        }
        let world = &self.state.world;
        for measurement in &mut self.measurements {
            measurement.replace(world, time);
            measurement.renumber(&self.species, world);
        }
        if observer.wants_events() {
            rows.0.iter().for_each(|row| observer.event(row));
            let ids = [NO_PARTNER; 2];
            let row = row(time, EventKind::Change, ids, &Impact::default(), DVec3::ZERO, DVec3::ZERO);
            observer.event(&row);
        }
        Ok(())
    }

    /// Fails where particles come and go.
    fn has_fixed_population(&self, what: &str) -> Result<(), EngineError> {
        if self.state.population.is_none() {
            return Ok(());
        }
        Err(EngineError::Change(format!("{what} cannot change in a run with inlets or outlets")))
    }

    /// The walls of the system, pistons where they are and as fast as they are now.
    pub fn present_walls(&self) -> Vec<Wall> {
        let now = self.instant();
        let mut walls = self.system.walls.clone();
        for (index, flight) in self.state.world.pistons() {
            if let WallMotion::Piston(piston) = &mut walls[index as usize].motion {
                *piston = flight.restarted(now);
            }
        }
        walls
    }

    /// The present instant.
    pub fn instant(&self) -> Instant {
        self.state.world.clock.instant(self.state.world.now)
    }

    /// The system with its bodies at the present, to be changed for [`Self::change_system`].
    ///
    /// # Errors
    /// If a velocity is not finite any more, and with inlets or outlets.
    pub fn present_system(&self) -> Result<System, EngineError> {
        self.has_fixed_population("laws, walls and gravity")?;
        Ok(self.changed_system(&Change::default())?.0)
    }

    /// Radius, mass and species of every particle, with those that have left or are still to come; the
    /// species is an index into [`System::species`].
    pub fn properties(&self) -> Vec<(f64, f64, u32)> {
        let world = &self.state.world;
        if let Some(population) = &self.state.population {
            let of = |&(class, species): &(u32, u32)| {
                let class = &world.classes[class as usize];
                (class.radius, class.mass, species)
            };
            return population.kinds.iter().map(of).collect();
        }
        let of = |i: u32| {
            let class = world.body(i);
            (class.radius, class.mass, self.species.of(world, i))
        };
        (0..world.particles.len() as u32).map(of).collect()
    }

    /// The changed system with its bodies at the present, and which of the particles are left.
    fn changed_system(&self, change: &Change) -> Result<(System, Vec<u32>), EngineError> {
        let refuse = |what: String| Err(EngineError::Change(what));
        let frame = self.frame();
        let count = frame.position.len();
        checks::given(&self.system, change, count).map_err(EngineError::Change)?;
        if (!change.add.is_empty() || !change.remove.is_empty()) && self.system.measure.correlations.any() {
            return refuse("correlations follow the particles: none can be added or removed".to_owned());
        }
        let mut removed = vec![false; count];
        for &i in &change.remove {
            match removed.get_mut(i as usize) {
                Some(flag) if !*flag => *flag = true,
                Some(_) => return refuse(format!("particle {i} is removed twice")),
                None => return refuse(format!("there is no particle {i} of {count}")),
            }
        }
        let world = &self.state.world;
        let spins = change.angular_velocities.is_some()
            || change.add.iter().any(|new| new.angular_velocity != DVec3::ZERO);
        if spins && world.spin.is_none() {
            let why = "the scene has no spin: give contact.tangential_restitution or initial.rotational_temperature";
            return refuse(why.to_owned());
        }
        let mut system = self.system.clone();
        let mut angular_velocities = Vec::new();
        let mut survivors = Vec::new();
        for i in (0..count as u32).filter(|&i| !removed[i as usize]) {
            let k = i as usize;
            let mut body = Body {
                position: frame.position[k],
                velocity: change.velocities.as_ref().map_or(frame.velocity[k], |v| v[k]),
                image: world.image_from_box(frame.image[k], world.now),
                class: world.system_class(i) as u32,
                species: self.species.of(world, i),
            };
            if let Some(positions) = &change.positions {
                (body.position, body.image) =
                    checks::wrapped(world, positions[k], body.image).map_err(EngineError::Change)?;
            }
            system.bodies.push(body);
            let spin = change.angular_velocities.as_ref().map(|spins| spins[k]);
            angular_velocities.push(spin.unwrap_or_else(|| world.angular_velocity(i, world.now)));
            survivors.push(i);
        }
        for new in &change.add {
            let class = added_class(&mut system, new);
            let (position, image) =
                checks::wrapped(world, new.position, [0; 3]).map_err(EngineError::Change)?;
            let body = Body { position, velocity: new.velocity, image, class, species: new.species };
            system.bodies.push(body);
            angular_velocities.push(new.angular_velocity);
        }
        if let Some(spin) = &mut system.spin {
            spin.angular_velocity = angular_velocities;
        }
        if system.bodies.is_empty() {
            return refuse("no particle is left".to_owned());
        }
        checks::places(&system, change, survivors.len()).map_err(EngineError::Change)?;
        checks::fixed_bodies(&system, survivors.len()).map_err(EngineError::Change)?;
        drop_unused_classes(&mut system);
        Ok((system, survivors))
    }

    /// Fails if a particle overlaps with another one or with a wall.
    fn check_places(&self, system: &System, world: &World) -> Result<(), EngineError> {
        let choice = Choice::new(self.options, self.kernel(), system, world)?;
        let found = overlap::deepest(world, &geometry(system, world, choice.filled()));
        let Some((i, partner)) = found.beyond.pair else { return Ok(()) };
        let depth = found.beyond.depth;
        let how = match partner {
            Some(j) => format!("particle {j} by {depth:.1e} contact distances"),
            None => format!("{} by {depth:.1e} radii", nearest_wall(system, world, i)),
        };
        Err(EngineError::Change(format!("particle {i} would overlap with {how}")))
    }

    /// The change of the velocity of each particle of finite mass; from or to zero if it is added or removed.
    fn changed_velocities(&self, world: &World, survivors: &[u32]) -> Vec<VelocityChange> {
        let old = &self.state.world;
        let mut changes = BTreeMap::new();
        for i in 0..old.particles.len() as u32 {
            let before = old.peculiar(i, old.now).1;
            changes.insert(i, (old.body(i).mass, before, DVec3::ZERO));
        }
        let mut found = Vec::new();
        for new in 0..world.particles.len() as u32 {
            let after = world.peculiar(new, world.now).1;
            let mass = world.body(new).mass;
            let before = survivors.get(new as usize).and_then(|i| changes.remove(i));
            let before = before.map_or(DVec3::ZERO, |(_, before, _)| before);
            found.push(VelocityChange { i: new, mass, before, after });
        }
        let removed =
            changes.into_iter().map(|(i, (mass, before, after))| VelocityChange { i, mass, before, after });
        found.extend(removed);
        found.retain(|change| change.mass.is_finite() && change.before != change.after);
        found
    }

    /// The timed actions of the changed system, each at the point where it was.
    fn moved_actions(
        &self,
        system: &System,
        time: f64,
    ) -> Result<Vec<Box<dyn crate::actions::timed::TimedAction>>, EngineError> {
        let mut saved = BTreeMap::new();
        self.save_actions(&mut |name, bits| {
            saved.insert(name.to_owned(), bits);
        });
        let mut moved = actions(system);
        for action in &mut moved {
            action.load(&mut |name| saved.get(name).copied().unwrap_or(0), time)?;
        }
        Ok(moved)
    }
}

/// Removes the classes that no particle has any more. The length of a tick and the choice of the search
/// follow from sizes and masses of all classes, so that those of removed particles would still set them.
fn drop_unused_classes(system: &mut System) {
    let mut used = vec![false; system.classes.len()];
    system.bodies.iter().for_each(|body| used[body.class as usize] = true);
    let mut left = 0;
    let renumbered: Vec<u32> = used
        .iter()
        .map(|&used| {
            left += u32::from(used);
            left.saturating_sub(1)
        })
        .collect();
    system.bodies.iter_mut().for_each(|body| body.class = renumbered[body.class as usize]);
    let mut used = used.into_iter();
    system.classes.retain(|_| used.next().unwrap_or(true));
}

/// The wall that particle i overlaps with most, in words.
fn nearest_wall(system: &System, world: &World, i: u32) -> String {
    let (position, _) = world.state(i, world.now);
    let gap = |wall: usize| world.wall_distance(i, wall as u32, position);
    let nearest = (0..world.boundary.walls.len()).min_by(|&a, &b| gap(a).total_cmp(&gap(b)));
    nearest.map_or_else(String::new, |wall| format!("wall \"{}\"", system.walls[wall].name))
}

/// The class of an added particle, whose values have been checked.
fn added_class(system: &mut System, new: &NewParticle) -> u32 {
    let name = &system.species[new.species as usize];
    let group = system.groups.iter().position(|group| group.name == *name).unwrap_or(0);
    let class = Class { radius: new.radius, mass: new.mass, group: group as u32 };
    let found = system.classes.iter().position(|known| *known == class);
    found.unwrap_or_else(|| {
        system.classes.push(class);
        system.classes.len() - 1
    }) as u32
}

impl WallSums {
    /// These sums, without the forces on particles that the walls of `world` support or carry until `time`.
    fn without_support(mut self, world: &World, time: f64) -> Self {
        self.end_support(time);
        for (wall, momentum) in world.carried_by_wall().into_iter().enumerate() {
            self.add(wall as u32, momentum, 0.0);
        }
        self
    }
}
