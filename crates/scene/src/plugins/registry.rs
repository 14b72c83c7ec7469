//! The plug-ins of a program.

use std::sync::{Arc, OnceLock};

use haff_engine::{Action, NamedAction, NamedProbe, Probe, named_action};
use haff_mechanics::{ContactLaw, NamedLaw, NamedSurface, Surface};
use thiserror::Error;

use super::parameters::{Fault, Given, Parameters};

/// Models of restitution that haff itself has.
const MODELS: [&str; 3] = ["viscoelastic", "cutoff", "random"];
/// Drives that haff itself has.
const DRIVES: [&str; 4] = ["rescale", "andersen", "white_noise", "drag"];

/// Makes a plug-in from the parameters of a scene.
type Make<T> = fn(&mut Parameters<'_>) -> T;
type MakeLaw = Make<Box<dyn ContactLaw>>;
type MakeAction = Make<Box<dyn Action>>;
type MakeProbe = Make<Box<dyn Probe>>;
type MakeSurface = Make<Box<dyn Surface>>;

/// The plug-ins of a program: what its scenes may name besides what haff itself has.
///
/// ```
/// use haff_scene::{ContactLaw, NormalContact, Parameters, Plugins};
///
/// /// Each contact loses the same speed.
/// #[derive(Debug)]
/// struct Friction { speed: f64 }
///
/// impl ContactLaw for Friction {
///     fn separation_speed(&self, contact: &NormalContact) -> f64 {
///         contact.approach_speed - self.speed
///     }
/// }
///
/// // In scenes: restitution = { model = "friction", parameters = { speed = 0.1 } }
/// let plugins = Plugins::new().law("friction", |parameters: &mut Parameters| {
///     Box::new(Friction { speed: parameters.not_negative("speed") })
/// });
/// plugins.install().unwrap();
/// ```
#[derive(Debug, Clone, Default)]
pub struct Plugins {
    laws: Vec<(&'static str, MakeLaw)>,
    drives: Vec<(&'static str, MakeAction)>,
    probes: Vec<(&'static str, MakeProbe)>,
    surfaces: Vec<(&'static str, MakeSurface)>,
}

/// Why plug-ins cannot be installed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PluginError {
    /// Two of a kind have the same name, or one has the name of what haff itself has.
    #[error("two {kind} are named \"{name}\"")]
    Twice {
        /// The kind, in words.
        kind: &'static str,
        /// The name.
        name: &'static str,
    },
    /// The name is empty, or has other characters than letters, digits and underscores.
    #[error("the name \"{0}\" of a plug-in must have letters, digits and _ only")]
    Name(&'static str),
    /// Plug-ins have been installed already.
    #[error("plug-ins can be installed once, before the first scene is read")]
    Late,
}

static INSTALLED: OnceLock<Plugins> = OnceLock::new();

impl Plugins {
    /// No plug-ins.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a law of contact, which scenes name as the `model` of a restitution. `make` makes it from the
    /// `parameters` beside the model; what is wrong with them is collected by [`Parameters`], so that the law
    /// it returns is not used then.
    #[must_use]
    pub fn law(mut self, name: &'static str, make: MakeLaw) -> Self {
        self.laws.push((name, make));
        self
    }

    /// Adds a drive, which scenes name as the `kind` of a `[[drive]]`, with its `parameters` beside it.
    #[must_use]
    pub fn drive(mut self, name: &'static str, make: MakeAction) -> Self {
        self.drives.push((name, make));
        self
    }

    /// Adds a probe, which scenes name as the `kind` of a `[[measure.probes]]`, with its `parameters` beside
    /// it. Its columns are in the observables of files.
    #[must_use]
    pub fn probe(mut self, name: &'static str, make: MakeProbe) -> Self {
        self.probes.push((name, make));
        self
    }

    /// Adds a surface, which scenes name as the `surface` of a `[[wall]]`, with its `parameters` beside it.
    #[must_use]
    pub fn surface(mut self, name: &'static str, make: MakeSurface) -> Self {
        self.surfaces.push((name, make));
        self
    }

    /// Makes these the plug-ins of the process.
    ///
    /// # Errors
    /// A name that is taken or not allowed; a second call.
    pub fn install(self) -> Result<(), PluginError> {
        check_names("laws of contact", &MODELS, &self.laws)?;
        check_names("drives", &DRIVES, &self.drives)?;
        check_names("probes", &[], &self.probes)?;
        check_names("surfaces", &[], &self.surfaces)?;
        INSTALLED.set(self).map_err(|_| PluginError::Late)
    }
}

fn check_names<M>(
    kind: &'static str,
    taken: &[&str],
    added: &[(&'static str, M)],
) -> Result<(), PluginError> {
    for (k, &(name, _)) in added.iter().enumerate() {
        let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if name.is_empty() || !name.chars().all(is_allowed) {
            return Err(PluginError::Name(name));
        }
        if taken.contains(&name) || added[..k].iter().any(|&(other, _)| other == name) {
            return Err(PluginError::Twice { kind, name });
        }
    }
    Ok(())
}

/// The plug-ins of one kind.
fn added<M>(of: fn(&Plugins) -> &Vec<(&'static str, M)>) -> &'static [(&'static str, M)] {
    INSTALLED.get().map_or(&[], |plugins| of(plugins))
}

fn names<M>(added: &[(&'static str, M)]) -> impl Iterator<Item = &'static str> {
    added.iter().map(|&(name, _)| name)
}

/// The names of all models of restitution.
pub(crate) fn law_names() -> Vec<&'static str> {
    MODELS.into_iter().chain(names(added(|plugins| &plugins.laws))).collect()
}

/// The names of the drives of plug-ins.
pub(crate) fn drive_names() -> Vec<&'static str> {
    names(added(|plugins| &plugins.drives)).collect()
}

/// The names of all drives.
pub(crate) fn all_drive_names() -> Vec<&'static str> {
    DRIVES.into_iter().chain(drive_names()).collect()
}

/// The names of all probes.
pub(crate) fn probe_names() -> Vec<&'static str> {
    names(added(|plugins| &plugins.probes)).collect()
}

/// The names of all surfaces.
pub(crate) fn surface_names() -> Vec<&'static str> {
    names(added(|plugins| &plugins.surfaces)).collect()
}

/// What is made of the parameters of a scene, or what is wrong with them; `None` if no plug-in has the name.
type Made<T> = Option<Result<T, Vec<Fault>>>;

/// Finds a plug-in, and makes what it is for.
fn make<T>(added: &'static [(&'static str, Make<T>)], name: &str, given: &Given) -> Made<(&'static str, T)> {
    let &(name, make) = added.iter().find(|(other, _)| *other == name)?;
    let mut parameters = Parameters::new(given);
    let made = make(&mut parameters);
    Some(parameters.end().map(|()| (name, made)))
}

/// The law of contact of a plug-in.
pub(crate) fn make_law(name: &str, given: &Given) -> Made<&'static NamedLaw> {
    let made = make(added(|plugins| &plugins.laws), name, given)?;
    Some(made.map(|(name, law)| NamedLaw::of(name, &format!("{given:?}"), law)))
}

/// The drive of a plug-in.
pub(crate) fn make_action(name: &str, given: &Given) -> Made<&'static NamedAction> {
    let made = make(added(|plugins| &plugins.drives), name, given)?;
    Some(made.map(|(name, action)| named_action(name, &format!("{given:?}"), action)))
}

/// The surface of a plug-in.
pub(crate) fn make_surface(name: &str, given: &Given) -> Made<&'static NamedSurface> {
    let made = make(added(|plugins| &plugins.surfaces), name, given)?;
    Some(made.map(|(name, surface)| NamedSurface::of(name, &format!("{given:?}"), surface)))
}

/// The probe of a plug-in.
pub(crate) fn make_probe(name: &str, given: &Given) -> Made<Arc<NamedProbe>> {
    let added = added(|plugins| &plugins.probes);
    let &(_, again) = added.iter().find(|(other, _)| *other == name)?;
    let made = make(added, name, given)?;
    let parameters = given.clone();
    Some(made.map(|(name, _)| {
        let start = move || again(&mut Parameters::new(&parameters));
        Arc::new(NamedProbe::new(name, format!("{given:?}"), Box::new(start)))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_are_taken_or_not_allowed_are_refused() {
        let make: MakeLaw = |_| unreachable!("no scene names it");
        let action: MakeAction = |_| unreachable!("no scene names it");
        let probe: MakeProbe = |_| unreachable!("no scene names it");
        let twice = |kind, name| PluginError::Twice { kind, name };
        for (names, expected) in [
            (&["cutoff"][..], twice("laws of contact", "cutoff")),
            (&["delta", "gamma", "delta"], twice("laws of contact", "delta")),
            (&[""], PluginError::Name("")),
            (&["delta model"], PluginError::Name("delta model")),
        ] {
            let plugins = names.iter().fold(Plugins::new(), |plugins, name| plugins.law(name, make));
            assert_eq!(plugins.install(), Err(expected), "{names:?}");
        }
        let plugins = Plugins::new().drive("andersen", action);
        assert_eq!(plugins.install(), Err(twice("drives", "andersen")));
        let plugins = Plugins::new().law("shaker", make).drive("shaker", action);
        let plugins = plugins.probe("flux", probe).probe("flux", probe);
        assert_eq!(plugins.install(), Err(twice("probes", "flux")));
    }

    #[test]
    fn the_drives_of_haff_are_those_of_its_schema() {
        let schema = schemars::schema_for!(crate::config::DriveKindConfig);
        let choices = schema.get("anyOf").and_then(serde_json::Value::as_array).expect("choices");
        let names: Vec<_> = choices.iter().filter_map(|choice| choice["const"].as_str()).collect();
        assert_eq!(names, DRIVES);
    }
}
