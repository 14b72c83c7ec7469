//! Walls and contact rules.

use std::collections::{BTreeMap, HashMap, HashSet};

use haff_engine::{Boundary, Contacts, Shape, ThermalWall, Wall, WallLaw, WallMotion};
use haff_mechanics::Restitution;

use super::Assembler;
use super::domain::DomainPlan;
use super::names::{MAX_GROUPS, Names, among, wall_indices};
use super::shape::Turns;
use super::values::{at, item, not_negative, positive};
use crate::config::{ContactConfig, RestitutionConfig, WallConfig};
use crate::plugins::Fault;

use super::restitution::Rule;

/// Walls are 16-bit numbers in the engine; a plane is tested by every particle near it.
const MAX_WALLS: usize = 10_000;

impl Assembler<'_> {
    /// The walls of `[[wall]]`.
    pub(super) fn extra_walls(&mut self, domain: &DomainPlan) -> Vec<Wall> {
        let configs = self.config.wall.clone().unwrap_or_default();
        if configs.len() > MAX_WALLS {
            self.document.report(&at(["wall"]), format!("at most {MAX_WALLS} walls are possible"));
            return Vec::new();
        }
        let mut walls = Vec::with_capacity(configs.len());
        for (k, config) in configs.iter().enumerate() {
            if let Some(name) = domain.wall_names().iter().find(|name| config.names_boundary(name)) {
                if configs[..k].iter().any(|other| other.names_boundary(name)) {
                    let why = "is described twice: give all properties of a wall in one entry";
                    self.document.report(&item("wall", k, "name"), why);
                }
                if config.offset.is_some() {
                    let why = "is for shapes: a wall of domain.boundary has a displacement";
                    self.document.report(&item("wall", k, "offset"), why);
                }
                if config.passes.is_some() {
                    let why = "nothing passes through a wall of domain.boundary, which closes the box: give a plane";
                    self.document.report(&item("wall", k, "passes"), why);
                }
                if config.reference_time.is_some() {
                    let why = "is for planes: a wall of domain.boundary moves along itself";
                    self.document.report(&item("wall", k, "reference_time"), why);
                }
                self.refuse_piston(k, config);
                self.displacement(k, config);
                continue;
            }
            if config.name.is_none() {
                self.document.report_missing(&item("wall", k, "name"), "missing: a wall needs a name");
            }
            let is_plane = config.plane.as_ref().is_some_and(|plane| plane.extent.is_none());
            let shapes = config.shapes().iter().filter(|(_, given)| *given).count();
            if config.has_shape() && (shapes > 1 || !is_plane) {
                walls.extend(self.shaped_wall(k, config, domain));
                continue;
            }
            if config.parameters.is_some() {
                self.document.report(&item("wall", k, "parameters"), "are those of a surface: name it");
            }
            if config.offset.is_some() {
                self.document.report(&item("wall", k, "offset"), "is for other shapes: displace plane.point");
            }
            if config.motion.as_ref().is_some_and(|motion| motion.direction.is_some()) {
                let why = "is for other shapes: a plane oscillates along its normal";
                self.document.report(&item("wall", k, "motion.direction"), why);
            }
            if config.plane.as_ref().is_some_and(|plane| plane.along.is_some()) {
                let why = "is the direction of the first edge of plane.extent: give it";
                self.document.report(&item("wall", k, "plane.along"), why);
            }
            let plane = config.plane.clone().unwrap_or_default();
            let errors = self.document.count();
            let mut vector = |key: &str, value: &Option<Vec<f64>>, required: bool| {
                let path = item("wall", k, key);
                if let Some(value) = value {
                    return self.vector(&path, value);
                }
                if required {
                    let why = "missing: a wall needs plane = { point = […], normal = […] }, another shape, or the name of a wall of domain.boundary";
                    self.document.report_missing(&path, why);
                }
                glam::DVec3::ZERO
            };
            let point = vector("plane.point", &plane.point, true);
            let given = vector("plane.normal", &plane.normal, true);
            let velocity = vector("velocity", &config.velocity, false);
            if config.displacement.is_some() {
                let why = "is for walls of domain.boundary: displace plane.point";
                self.document.report(&item("wall", k, "displacement"), why);
            }
            let mut motion = WallMotion::from(velocity);
            if let (Some(reference_time), WallMotion::Constant(motion)) =
                (self.reference_time(k, config), &mut motion)
            {
                motion.reference_time = reference_time;
            }
            // Scaled by the largest component first, so that tiny and huge normals do not under- or overflow.
            let normal = given / given.abs().max_element();
            let normal = normal / normal.length();
            if plane.normal.is_some() && self.document.count() == errors {
                self.check_normal(&item("wall", k, "plane.normal"), normal, domain);
            }
            let mut wall =
                Wall { name: config.name.clone().unwrap_or_default(), point, normal, motion, shape: None };
            if self.document.count() == errors {
                wall.shape = self.partition(k, config, &wall).map(Shape::Partition);
                if let Some(rotation) = self.rotation(k, config, Turns::AlongNormal(point, normal)) {
                    wall.motion = WallMotion::Rotating(rotation);
                }
                self.piston(k, config, &mut wall, domain);
            }
            walls.push(wall);
        }
        walls
    }

    /// A plane must have a direction, and be its own image along every periodic axis: a particle that leaves
    /// through one face returns through the opposite one, and must find the plane unchanged. No component is
    /// negligible, since the number of images is not limited.
    fn check_normal(&mut self, path: &[String], normal: glam::DVec3, domain: &DomainPlan) {
        if !normal.is_finite() {
            self.document.refuse(path, "must not be zero");
            return;
        }
        let repeats = |axis: &usize| normal[*axis] != 0.0 && domain.boundary[*axis] == Boundary::Periodic;
        if let Some(axis) = (0..self.dimension.count()).find(repeats) {
            let name = ["x", "y", "z"][axis];
            let message = format!(
                "must be exactly 0 along {name}, which is periodic: the plane would not repeat with the box; make {name} \
                 \"wall\" or \"open\" in domain.boundary"
            );
            self.document.refuse(path, message);
        }
    }

    /// Rules for all pairs of groups and all groups with all walls.
    pub(super) fn contacts(&mut self, names: &Names, walls: &[String]) -> Contacts {
        let contact = self.config.contact.get_or_insert_with(ContactConfig::default);
        contact.restitution.get_or_insert(RestitutionConfig::Constant(1.0));
        contact.tc.get_or_insert(0.0);
        let contact = contact.clone();
        let tc = contact.tc.unwrap_or(0.0);
        not_negative(&mut self.document, &at(["contact", "tc"]), tc);

        let general = self.restitution(&at(["contact", "restitution"]), contact.restitution.as_ref());
        let general = general.unwrap_or(Restitution::Constant(1.0));
        let wall_rule =
            self.restitution(&at(["contact", "wall_restitution"]), contact.wall_restitution.as_ref());
        let wall_rule = wall_rule.unwrap_or(general);
        let added = self.added_speed(&at(["contact", "added_speed"]), contact.added_speed).unwrap_or(0.0);
        let groups = names.all.len().min(MAX_GROUPS);
        let mut pair = vec![Rule { restitution: general, added }; groups * groups];
        let mut wall = vec![Rule { restitution: wall_rule, added }; groups * walls.len()];
        let configs = self.config.wall.clone().unwrap_or_default();
        let indices_of_walls = wall_indices(&configs, walls);
        for (k, config) in configs.iter().enumerate() {
            let restitution = self.restitution(&item("wall", k, "restitution"), config.restitution.as_ref());
            let added = self.added_speed(&item("wall", k, "added_speed"), config.added_speed);
            if let Some(index) = indices_of_walls[k] {
                for rule in wall.iter_mut().skip(index).step_by(walls.len()) {
                    rule.set(restitution, added);
                }
            }
        }
        for (k, config) in configs.iter().enumerate().filter(|(_, config)| config.sticks == Some(true)) {
            if config.restitution.is_some() {
                self.document
                    .report(&item("wall", k, "sticks"), "contradicts restitution: give one of the two");
            }
            if let Some(index) = indices_of_walls[k] {
                self.sticking_to_walls.extend((0..groups).map(|group| [group as u32, index as u32]));
            }
        }
        let mut seen: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        // Rules of pairs for groups and walls take precedence over those of the walls.
        let mut ruled: HashSet<[u32; 2]> = HashSet::new();
        let mut sticking_to_walls: Vec<[u32; 2]> = Vec::new();
        let mut places: HashMap<&str, usize> = HashMap::new();
        for (position, name) in names.all.iter().chain(walls).enumerate() {
            places.entry(name).or_insert(position);
        }
        for (k, config) in contact.pair.iter().flatten().enumerate() {
            let path = |key: &str| {
                let mut path = at(["contact", "pair"]);
                path.push(k.to_string());
                path.push(key.to_owned());
                path
            };
            let restitution = self.restitution(&path("restitution"), config.restitution.as_ref());
            let added = self.added_speed(&path("added_speed"), config.added_speed);
            let sticks = config.sticks == Some(true);
            let has_other = config.tangential_restitution.is_some()
                || config.friction.is_some()
                || config.added_speed.is_some();
            if config.restitution.is_none() && !sticks && !has_other {
                let why = "missing: the pair needs a restitution, a tangential_restitution, an added_speed, or \
                           sticks = true";
                self.document.report_missing(&path("restitution"), why);
            }
            if config.restitution.is_some() && sticks {
                self.document.report(&path("sticks"), "contradicts restitution: give one of the two");
            }
            let Some(between) = &config.between else {
                self.document.report_missing(&path("between"), "missing: give two names");
                continue;
            };
            let [a, b] = between.as_slice() else {
                self.document.refuse(&path("between"), "must have two names");
                continue;
            };
            let mut find = |name: &String| -> Option<usize> {
                let position = places.get(name.as_str());
                if position.is_none() {
                    let known = || names.all.iter().chain(walls).map(String::as_str);
                    let message = format!("nothing is named {}", among(name, known));
                    self.document.report(&path("between"), message);
                }
                position.copied()
            };
            let i = find(a);
            let (Some(i), Some(j)) = (i, if a == b { i } else { find(b) }) else { continue };
            let (i, j) = (i.min(j), i.max(j));
            if i >= names.all.len() {
                self.document
                    .report(&path("between"), "two walls never touch: one name must be of particles");
                continue;
            }
            if let Some(first) = seen.insert((i, j), k) {
                let message = format!("contact.pair.{first} already rules these two");
                self.document.report(&path("between"), message);
            }
            if j >= names.all.len() {
                let entry = [i as u32, (j - names.all.len()) as u32];
                // A second rule for the same two is an error, which has been reported.
                if ruled.insert(entry) && sticks {
                    sticking_to_walls.push(entry);
                }
            } else if sticks {
                self.sticking.push([i as u32, j as u32]);
            }
            if i >= groups || (j < names.all.len() && j >= groups) {
                continue;
            }
            if j < names.all.len() {
                pair[i * groups + j].set(restitution, added);
                pair[j * groups + i] = pair[i * groups + j];
            } else {
                wall[i * walls.len() + j - names.all.len()].set(restitution, added);
            }
        }
        self.sticking_to_walls.retain(|entry| !ruled.contains(entry));
        self.sticking_to_walls.extend(sticking_to_walls);
        let pair = pair.into_iter().map(Rule::law).collect();
        let mut wall: Vec<WallLaw> = wall.into_iter().map(|rule| rule.law().into()).collect();
        for (k, config) in configs.iter().enumerate() {
            if let (Some([temperature, accommodation]), Some(index)) =
                (self.thermal(k, config), indices_of_walls[k])
            {
                for law in wall.iter_mut().skip(index).step_by(walls.len()) {
                    let restitution = law.restitution();
                    *law = WallLaw::Thermal(ThermalWall { temperature, accommodation, restitution });
                }
            }
        }
        for (k, config) in configs.iter().enumerate().filter(|(_, config)| config.passes.is_some()) {
            let passing = self.passing(k, config, &names.all);
            let Some(index) = indices_of_walls[k] else { continue };
            for group in (0..groups).filter(|&group| passing[group]) {
                wall[group * walls.len() + index] = WallLaw::Passes;
            }
        }
        Contacts { pair, wall, tc, rest_speed: self.rest_speed() }
    }

    /// Temperature and accommodation of the wall of an entry, if it is thermal.
    fn thermal(&mut self, k: usize, config: &WallConfig) -> Option<[f64; 2]> {
        let path = |key: &str| item("wall", k, key);
        let accommodation = config.accommodation.unwrap_or(1.0);
        if !(0.0..=1.0).contains(&accommodation) {
            self.document.refuse(&path("accommodation"), "must be a probability, from 0 to 1");
        }
        let Some(temperature) = config.temperature else {
            if config.accommodation.is_some() {
                let why = "only a thermal wall has it: give temperature, too";
                self.document.report(&path("accommodation"), why);
            }
            return None;
        };
        positive(&mut self.document, &path("temperature"), temperature);
        if config.sticks == Some(true) {
            let why = format!("contradicts wall.{k}.temperature: give one of the two");
            self.document.report(&path("sticks"), why);
        }
        for (key, given) in
            [("restitution", config.restitution.is_some()), ("added_speed", config.added_speed.is_some())]
        {
            if given && accommodation >= 1.0 {
                let why = format!(
                    "has no effect: all reflections of wall.{k} are thermal; give wall.{k}.accommodation below 1"
                );
                self.document.report(&path(key), why);
            }
        }
        if self.has_joints() && config.sticks != Some(true) {
            let why = "a thermal wall does not work with pendulums, springs, rods or sticking contacts";
            self.document.report(&path("temperature"), why);
        }
        if self.config.contact.as_ref().and_then(|contact| contact.rest_speed).is_some_and(|v| v > 0.0) {
            let why = "a thermal wall does not work with contact.rest_speed: nothing comes to rest on it";
            self.document.report(&path("temperature"), why);
        }
        if let Some(config) = self.config.wall.as_mut().and_then(|walls| walls.get_mut(k)) {
            config.accommodation = Some(accommodation);
        }
        Some([temperature, accommodation])
    }

    /// `contact.rest_speed`, for scenes in which something could rest on something.
    fn rest_speed(&mut self) -> f64 {
        let path = at(["contact", "rest_speed"]);
        let speed = *self.config.contact.get_or_insert_default().rest_speed.get_or_insert(0.0);
        if !not_negative(&mut self.document, &path, speed) || speed == 0.0 {
            return 0.0;
        }
        let gravity = self.config.domain.as_ref().and_then(|domain| domain.gravity.as_ref());
        if gravity.is_none_or(|gravity| gravity.iter().all(|g| *g == 0.0)) {
            let why =
                "needs gravity: without it nothing holds a grain; set domain.gravity, or contact.tc instead";
            self.document.report(&path, why);
        }
        speed
    }

    /// Reports what is wrong with the parameters of a plug-in.
    pub(super) fn report_faults(&mut self, parameters: &[String], faults: Vec<Fault>) {
        for Fault { key, why } in faults {
            let at: Vec<String> = parameters.iter().cloned().chain([key]).collect();
            self.document.report_why(&at, why);
        }
    }
}
