//! The plug-ins of a program.

use std::sync::OnceLock;

use haff_mechanics::{ContactLaw, NamedLaw};
use thiserror::Error;

use super::parameters::{Fault, Given, Parameters};

/// Models of restitution that haff itself has.
const MODELS: [&str; 2] = ["viscoelastic", "cutoff"];

/// Makes a law of contact from the parameters of a scene.
type MakeLaw = fn(&mut Parameters<'_>) -> Box<dyn ContactLaw>;

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
}

/// Why plug-ins cannot be installed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PluginError {
    /// Two have the same name, or one has the name of what haff itself has.
    #[error("two laws of contact are named \"{0}\"")]
    Twice(&'static str),
    /// The name is empty, or has other characters than letters, digits and underscores.
    #[error("the name \"{0}\" of a law of contact must have letters, digits and _ only")]
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

    /// Makes these the plug-ins of the process.
    ///
    /// # Errors
    /// A name that is taken or not allowed; a second call.
    pub fn install(self) -> Result<(), PluginError> {
        for (k, &(name, _)) in self.laws.iter().enumerate() {
            let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '_';
            if name.is_empty() || !name.chars().all(is_allowed) {
                return Err(PluginError::Name(name));
            }
            if MODELS.contains(&name) || self.laws[..k].iter().any(|&(other, _)| other == name) {
                return Err(PluginError::Twice(name));
            }
        }
        INSTALLED.set(self).map_err(|_| PluginError::Late)
    }
}

/// The names of all models of restitution.
pub(crate) fn law_names() -> Vec<&'static str> {
    let plugins = INSTALLED.get().into_iter().flat_map(|plugins| &plugins.laws);
    MODELS.into_iter().chain(plugins.map(|&(name, _)| name)).collect()
}

/// The law of contact of a plug-in with these parameters, or what is wrong with them; `None` if no plug-in
/// has the name.
pub(crate) fn make_law(name: &str, given: &Given) -> Option<Result<&'static NamedLaw, Vec<Fault>>> {
    let (_, make) = INSTALLED.get()?.laws.iter().find(|(other, _)| *other == name)?;
    let mut parameters = Parameters::new(given);
    let law = make(&mut parameters);
    Some(parameters.end().map(|()| NamedLaw::of(name, &format!("{given:?}"), law)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_are_taken_or_not_allowed_are_refused() {
        let make: MakeLaw = |_| unreachable!("no scene names it");
        for (names, expected) in [
            (&["cutoff"][..], PluginError::Twice("cutoff")),
            (&["delta", "gamma", "delta"], PluginError::Twice("delta")),
            (&[""], PluginError::Name("")),
            (&["delta model"], PluginError::Name("delta model")),
        ] {
            let plugins = names.iter().fold(Plugins::new(), |plugins, name| plugins.law(name, make));
            assert_eq!(plugins.install(), Err(expected), "{names:?}");
        }
    }
}
