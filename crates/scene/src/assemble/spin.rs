//! Rough contacts, moments of inertia and angular velocities.

use std::collections::HashMap;

use glam::DVec3;
use haff_engine::{Dimension, Spin, bounds};
use haff_mechanics::{Roughness, rough};
use haff_placement::random::{Purpose, Stream};

use super::{
    Assembler,
    names::{MAX_GROUPS, Names, wall_indices},
    particles::{Rows, SpeciesPlan},
    values::{at, item, not_negative},
};
use crate::{config::document::Path, model::state::State};

/// Why a key of spins is refused where nothing turns.
const WITHOUT_SPIN: &str = "has no effect without spin: give contact.tangential_restitution above −1, or \
                            initial.rotational_temperature";

/// The laws of spin of a scene that has any.
pub(super) struct SpinPlan {
    inertia: Vec<f64>,
    pair: Vec<Roughness>,
    wall: Vec<Roughness>,
    rotational_temperature: Option<f64>,
    /// Angular velocity of each explicit particle.
    explicit: Vec<DVec3>,
}

/// The two keys of a rough contact.
type Keys = [Option<f64>; 2];

impl Assembler<'_> {
    /// The laws of spin; `None` if the scene has none.
    pub(super) fn spin_plan(&mut self, names: &Names, walls: &[String]) -> Option<SpinPlan> {
        let contact = self.config.contact.clone().unwrap_or_default();
        let groups = names.all.len().min(MAX_GROUPS);
        // The key that turns spin on.
        let mut cause: Option<Path> = None;
        let general_path = |key: &str| at(["contact", key]);
        let keys = [contact.tangential_restitution, contact.friction];
        let general = self.roughness(&general_path, keys, Roughness::SMOOTH, &mut cause);
        let mut pair = vec![general; groups * groups];
        let mut wall = vec![general; groups * walls.len()];
        let configs = self.config.wall.clone().unwrap_or_default();
        let indices_of_walls = wall_indices(&configs, walls);
        for (k, config) in configs.iter().enumerate() {
            let keys = [config.tangential_restitution, config.friction];
            let law = self.roughness(&|key| item("wall", k, key), keys, general, &mut cause);
            if let (Some(index), true) = (indices_of_walls[k], keys != [None; 2]) {
                wall.iter_mut().skip(index).step_by(walls.len()).for_each(|entry| *entry = law);
            }
        }
        let mut places: HashMap<&str, usize> = HashMap::new();
        for (position, name) in names.all.iter().chain(walls).enumerate() {
            places.entry(name).or_insert(position);
        }
        let place = |name: &String| places.get(name.as_str()).copied();
        for (k, config) in contact.pair.iter().flatten().enumerate() {
            let path = |key: &str| {
                let mut path = at(["contact", "pair"]);
                path.extend([k.to_string(), key.to_owned()]);
                path
            };
            let keys = [config.tangential_restitution, config.friction];
            if keys == [None; 2] {
                continue;
            }
            let pair_places = config.between.as_ref().and_then(|names| {
                let [a, b] = names.as_slice() else { return None };
                Some([place(a)?, place(b)?])
            });
            let Some([i, j]) = pair_places.map(|[i, j]| [i.min(j), i.max(j)]) else { continue };
            let is_wall = j >= names.all.len();
            if i >= groups || (!is_wall && j >= groups) {
                continue;
            }
            let entry = if is_wall { i * walls.len() + j - names.all.len() } else { i * groups + j };
            let inherited = if is_wall { wall[entry] } else { general };
            let law = self.roughness(&path, keys, inherited, &mut cause);
            if is_wall {
                wall[entry] = law;
            } else {
                (pair[entry], pair[j * groups + i]) = (law, law);
            }
        }
        let rotational_temperature =
            self.config.initial.as_ref().and_then(|initial| initial.rotational_temperature);
        if let Some(temperature) = rotational_temperature {
            let path = at(["initial", "rotational_temperature"]);
            not_negative(&mut self.document, &path, temperature);
            cause.get_or_insert(path);
        }
        let explicit = self.explicit_spins(&mut cause);
        let inertia = self.inertia(names, cause.is_some());
        let cause = cause?;
        if self.has_joints() {
            let why = "spin does not work with pendulums, springs, rods or sticking contacts";
            self.document.report(&cause, why);
        }
        Some(SpinPlan { inertia, pair, wall, rotational_temperature, explicit })
    }

    /// The tangential law with these keys, and with those of `inherited` where one is missing.
    fn roughness(
        &mut self,
        path: &dyn Fn(&str) -> Path,
        [beta, mu]: Keys,
        inherited: Roughness,
        cause: &mut Option<Path>,
    ) -> Roughness {
        let law = Roughness {
            tangential_restitution: beta.unwrap_or(inherited.tangential_restitution),
            friction: mu.unwrap_or(inherited.friction),
        };
        if let Err(error) = law.check() {
            self.document.refuse(&path(error.parameter), error.allowed);
            return inherited;
        }
        if mu.is_some() && law.tangential_restitution == -1.0 {
            let why = "has no effect on a smooth contact: give tangential_restitution, too, above −1";
            self.document.report(&path("friction"), why);
        }
        if law.tangential_restitution != -1.0 {
            let key = if beta.is_some() { "tangential_restitution" } else { "friction" };
            cause.get_or_insert_with(|| path(key));
        }
        law
    }

    /// Angular velocities of explicit particles.
    fn explicit_spins(&mut self, cause: &mut Option<Path>) -> Vec<DVec3> {
        let configs = self.config.particle.clone().unwrap_or_default();
        let mut spins = Vec::with_capacity(configs.len());
        for (k, config) in configs.iter().enumerate() {
            let path = item("particle", k, "angular_velocity");
            let Some(given) = &config.angular_velocity else {
                spins.push(DVec3::ZERO);
                continue;
            };
            let spin = match (self.dimension, given.as_slice()) {
                (Dimension::Two, &[z]) => DVec3::new(0.0, 0.0, z),
                (Dimension::Two, &[x, y, z]) if (x, y) == (0.0, 0.0) => DVec3::new(0.0, 0.0, z),
                (Dimension::Three, &[x, y, z]) => DVec3::new(x, y, z),
                (Dimension::Two, _) => {
                    self.document.refuse(&path, "must be one number, or three of which the first two are 0");
                    DVec3::ZERO
                }
                (Dimension::Three, _) => {
                    self.document.refuse(&path, "must have three numbers");
                    DVec3::ZERO
                }
            };
            if bounds::vector(spin).is_err() {
                self.document.refuse(&path, "must be finite numbers, at most 1e50 in size");
            }
            cause.get_or_insert(path);
            spins.push(spin);
        }
        spins
    }

    /// The number q of each group.
    fn inertia(&mut self, names: &Names, has_spin: bool) -> Vec<f64> {
        let (default, largest, allowed) = match self.dimension {
            Dimension::Two => (rough::DISK, 1.0, "must be in (0, 1]: a disk has 1/2, a ring 1"),
            Dimension::Three => {
                (rough::SPHERE, 2.0 / 3.0, "must be in (0, 2/3]: a sphere has 2/5, a spherical shell 2/3")
            }
        };
        let of_species = self.config.species.iter().flatten().map(|species| species.inertia);
        let of_species = of_species.enumerate().map(|(k, q)| (item("species", k, "inertia"), k, q));
        let of_particles = self.config.particle.iter().flatten().zip(&names.of_particle);
        let of_particles = of_particles.enumerate().map(|(k, (particle, group))| {
            (item("particle", k, "inertia"), *group as usize, particle.inertia)
        });
        let given: Vec<(Path, usize, Option<f64>)> = of_species.chain(of_particles).collect();
        let mut inertia: Vec<Option<f64>> = vec![None; names.all.len()];
        for (path, group, q) in given {
            let Some(q) = q else { continue };
            // A literal of 2/3 may be rounded up.
            if !(q > 0.0 && q <= largest * (1.0 + 1e-12)) {
                self.document.refuse(&path, allowed);
            } else if !has_spin {
                self.document.report(&path, WITHOUT_SPIN);
            } else if inertia[group].is_some_and(|other| other != q) {
                let why = format!("must be the same for all particles named \"{}\"", names.all[group]);
                self.document.refuse(&path, why);
            }
            inertia[group] = Some(q);
        }
        for (k, drive) in self.config.drive.clone().iter().flatten().enumerate() {
            if drive.rotational == Some(true) && !has_spin {
                self.document.report(&item("drive", k, "rotational"), WITHOUT_SPIN);
            }
        }
        inertia.into_iter().map(|q| q.unwrap_or(default)).collect()
    }

    /// The spins of all bodies, with their laws.
    pub(super) fn spin(
        &mut self,
        plan: SpinPlan,
        species: &[SpeciesPlan],
        rows: &Rows,
        state: Option<&State>,
    ) -> Spin {
        let SpinPlan { inertia, pair, wall, rotational_temperature, explicit } = plan;
        let mut spins = match state.and_then(|state| state.angular_velocity.as_ref()) {
            Some(spins) if rotational_temperature.is_none() => spins[..rows.species].to_vec(),
            _ => vec![DVec3::ZERO; rows.species],
        };
        if let Some(temperature) = rotational_temperature {
            self.draw_spins(species, rows, &inertia, temperature, &mut spins);
        }
        spins.extend(explicit);
        Spin { inertia, angular_velocity: spins, pair, wall }
    }

    /// Draws angular velocities from Maxwell distributions, scaled to the rotational temperature exactly.
    fn draw_spins(
        &self,
        species: &[SpeciesPlan],
        rows: &Rows,
        inertia: &[f64],
        temperature: f64,
        spins: &mut [DVec3],
    ) {
        let axes = if self.dimension == Dimension::Two { 1.0 } else { 3.0 };
        let (mut row, mut twice_energy, mut bodies) = (0, 0.0, 0.0);
        for (k, plan) in species.iter().enumerate() {
            for i in 0..plan.count {
                let (mass, radius) = (rows.mass(row), rows.radius(row));
                if mass.is_finite() {
                    let moment = inertia[k] * mass * radius * radius;
                    let mut random = Stream::new(self.seed, Purpose::Spin, &plan.name, i);
                    let spread = (temperature / moment).sqrt();
                    let ([x, y], [z, _]) = (random.normal_pair(), random.normal_pair());
                    let spin = match self.dimension {
                        Dimension::Two => DVec3::new(0.0, 0.0, spread * z),
                        Dimension::Three => DVec3::new(x, y, z) * spread,
                    };
                    twice_energy += moment * spin.length_squared();
                    bodies += 1.0;
                    spins[row] = spin;
                }
                row += 1;
            }
        }
        if twice_energy > 0.0 {
            let scale = (axes * bodies * temperature / twice_energy).sqrt();
            for spin in spins {
                *spin *= scale;
            }
        }
    }
}
