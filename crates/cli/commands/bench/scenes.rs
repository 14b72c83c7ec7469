//! The standard scenes of `haff bench`, as the text of scene files. `benches/scenes.rs` times them too.

/// A standard scene.
pub struct Standard {
    pub name: &'static str,
    pub description: &'static str,
    /// Default packing fraction.
    pub phi: f64,
    /// Largest packing fraction that its packing reaches with any number of particles that fills its lattice.
    pub largest_phi: f64,
    text: fn(n: u64, phi: f64) -> String,
}

/// Volume of the closest packing of spheres, π/√18.
const CLOSEST: f64 = 0.7404;
/// Area of the closest packing of disks, π/√12.
const CLOSEST_2D: f64 = 0.9068;
/// The box is this many scale heights kT/mg tall.
const SCALE_HEIGHTS: f64 = 5.0;

/// One species of unit diameter, mass and temperature on the densest lattice, with more keys of `[domain]`.
fn single(domain: &str, n: u64, phi: f64) -> String {
    format!(
        "[domain]\npacking_fraction = {phi:?}\n{domain}\n\
         [[species]]\nname = \"sphere\"\ncount = {n}\nradius = 0.5\nmass = 1.0\n\n\
         [initial]\npositions = \"lattice\"\ntemperature = 1.0\n"
    )
}

fn fluid(n: u64, phi: f64) -> String {
    single("", n, phi)
}

fn cooling(n: u64, phi: f64) -> String {
    single("", n, phi) + "\n[contact]\nrestitution = 0.9\n"
}

fn disks(n: u64, phi: f64) -> String {
    "dimension = 2\n\n".to_owned() + &single("", n, phi)
}

fn gravity(n: u64, phi: f64) -> String {
    let edge = (n as f64 * std::f64::consts::FRAC_PI_6 / phi).cbrt();
    let domain = format!(
        "boundary = [\"periodic\", \"periodic\", \"wall\"]\ngravity = [0.0, 0.0, -{:.6e}]\n",
        SCALE_HEIGHTS / edge
    );
    single(&domain, n, phi)
}

/// Half of the volume is that of grains ten times as large.
fn mixture(n: u64, phi: f64) -> String {
    let large = ((n as f64 / 1001.0).round() as u64).max(1);
    let species = |name: &str, count: u64, radius: f64, mass: f64| {
        format!("[[species]]\nname = \"{name}\"\ncount = {count}\nradius = {radius:?}\nmass = {mass:?}\n\n")
    };
    format!(
        "[domain]\npacking_fraction = {phi:?}\n\n{}{}[initial]\npositions = \"random\"\ntemperature = 1.0\n",
        species("small", n - large, 0.5, 1.0),
        species("large", large, 5.0, 1000.0)
    )
}

/// All standard scenes; the first is the default.
pub const STANDARD: [Standard; 5] = [
    Standard {
        name: "fluid",
        description: "elastic spheres in a periodic cube, melted from fcc",
        phi: 0.1,
        largest_phi: CLOSEST,
        text: fluid,
    },
    Standard {
        name: "cooling",
        description: "granular gas that cools freely, restitution 0.9",
        phi: 0.1,
        largest_phi: CLOSEST,
        text: cooling,
    },
    Standard {
        name: "mixture",
        description: "elastic mixture, size ratio 10, half of the volume each",
        phi: 0.2,
        largest_phi: 0.5,
        text: mixture,
    },
    Standard {
        name: "gravity",
        description: "elastic grains under gravity over a floor, five scale heights tall, with a lid",
        phi: 0.05,
        largest_phi: CLOSEST,
        text: gravity,
    },
    Standard {
        name: "disks",
        description: "elastic disks in a periodic square, melted from the triangular lattice",
        phi: 0.3,
        largest_phi: CLOSEST_2D,
        text: disks,
    },
];

/// The list as text.
pub fn list() -> String {
    let line = |scene: &Standard| format!("{:8}  {} (φ = {})", scene.name, scene.description, scene.phi);
    STANDARD.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// The standard scene of this name.
pub fn find(name: &str) -> Option<&'static Standard> {
    STANDARD.iter().find(|scene| scene.name == name)
}

impl Standard {
    /// An error if the packing cannot be this dense.
    pub fn check(&self, phi: f64) -> Result<(), String> {
        if phi <= self.largest_phi {
            return Ok(());
        }
        Err(format!("--phi {phi}: must be at most {} for the scene {}", self.largest_phi, self.name))
    }

    /// The scene file of a cell that ends after `collisions`.
    pub fn scene(&self, n: u64, phi: f64, seed: u64, collisions: u64) -> String {
        let Self { name, description, .. } = self;
        format!(
            "schema = 1\ntitle = \"{name}: {description}; N = {n}, φ = {phi}\"\nseed = {seed}\n{}\n\
             [run]\ncollisions = {collisions}\n",
            (self.text)(n, phi)
        )
    }
}
