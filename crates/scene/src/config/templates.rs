//! The shipped scenes, as templates of scenes of one's own.

/// A shipped scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Template {
    /// Heading of the scenes of its kind.
    pub group: &'static str,
    /// Its name, that of its file without the ending.
    pub name: &'static str,
    /// The scene, in TOML.
    pub text: &'static str,
    /// Paths and texts of the files that it names, relative to the file of the scene.
    pub files: &'static [(&'static str, &'static str)],
}

impl Template {
    /// What the scene is, in a few words: its `title`.
    pub fn title(&self) -> &'static str {
        let title = self.text.lines().find_map(|line| line.strip_prefix("title = \"")?.strip_suffix('"'));
        title.unwrap_or(self.name)
    }
}

/// The scenes of a group, of which the files are in a folder of configs.
macro_rules! scenes {
    ($group:literal, $folder:literal, $($name:literal $(+ $file:literal)?),* $(,)?) => {
        &[$(Template {
            group: $group,
            name: $name,
            text: include_str!(concat!("../../../../configs/", $folder, $name, ".toml")),
            files: &[$(($file, include_str!(concat!("../../../../configs/", $file))))?],
        }),*]
    };
}

/// The templates by group.
const GROUPS: [&[Template]; 9] = [
    scenes!(
        "Gases and fluids",
        "",
        "cooling",
        "fluid",
        "disks",
        "mixture",
        "polydisperse",
        "gravity_box",
        "membrane",
    ),
    scenes!(
        "Driven gases",
        "",
        "thermostat",
        "heated_gas",
        "suspension",
        "added_speed",
        "thermal_walls",
        "hot_wall",
    ),
    scenes!("Rough particles", "", "rough_cooling", "bouncing_superball", "rolling", "couette_cell"),
    scenes!("Flows and boxes that deform", "", "sheared_gas", "dense_shear", "elongation", "compression"),
    scenes!("Packings", "", "grow", "jam", "crucible"),
    scenes!(
        "Vibrated grains",
        "",
        "vibrated_gas",
        "vibrated_bed",
        "vibrated_layer",
        "brazil_nut",
        "leidenfrost",
        "maxwell_demon",
    ),
    scenes!(
        "Containers and flows of grains",
        "",
        "heap",
        "hopper",
        "refilled_hopper",
        "silo",
        "sieve",
        "bumpy_floor",
        "drum",
        "mill" + "meshes/mill.obj",
    ),
    scenes!("Demonstrations", "", "breakshot", "galton_board", "piston"),
    scenes!(
        "Textbook: particle impact",
        "textbook/",
        "bouncing_ball",
        "direct_impact",
        "oblique_wall",
        "oblique_pair",
        "forging",
        "hammer_and_nail",
        "pendulums",
        "pendulums_unequal",
        "newtons_cradle",
        "spring_impact",
        "stick_to_rod",
        "elastic_rod_end",
    ),
];

/// All shipped scenes, group by group. The first one is that of `haff init` without a name.
pub fn templates() -> impl Iterator<Item = &'static Template> {
    GROUPS.into_iter().flatten()
}

/// The shipped scene with this name.
pub fn template(name: &str) -> Option<&'static Template> {
    templates().find(|template| template.name == name)
}
