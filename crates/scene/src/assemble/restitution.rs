//! Laws of restitution.

use haff_mechanics::{Restitution, RestitutionError, RestitutionTable, Scatter};

use super::{
    Assembler,
    values::{not_negative, positive},
};
use crate::{
    config::{RestitutionConfig, RestitutionModelConfig},
    plugins::{law_names, make_law},
};

/// The law of restitution of two names, and what is added to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rule {
    pub restitution: Restitution,
    /// Half of the speed that contacts add [length/time].
    pub added: f64,
}

impl Rule {
    /// Sets what is given.
    pub fn set(&mut self, restitution: Option<Restitution>, added: Option<f64>) {
        self.restitution = restitution.unwrap_or(self.restitution);
        self.added = added.unwrap_or(self.added);
    }

    /// Both in one.
    pub fn law(self) -> Restitution {
        self.restitution.with_added_speed(self.added)
    }
}

/// The path of a key under another one.
fn under(path: &[String], keys: &[&str]) -> Vec<String> {
    path.iter().cloned().chain(keys.iter().map(|&key| key.to_owned())).collect()
}

/// The numbers that the models of restitution of haff have, and whether they are given.
fn numbers(config: &RestitutionModelConfig) -> [(&'static str, bool); 4] {
    [
        ("coefficient", config.coefficient.is_some()),
        ("restitution", config.restitution.is_some()),
        ("speed", config.speed.is_some()),
        ("exponent", config.exponent.is_some()),
    ]
}

/// A key of a table and its value.
type Key = (&'static str, Option<f64>);

impl Assembler<'_> {
    /// Why a law of contact that may add energy is not possible in this scene.
    fn why_no_gain(&self) -> Option<&'static str> {
        let rest_speed = self.config.contact.as_ref().and_then(|contact| contact.rest_speed);
        if self.has_joints() {
            Some("does not work with pendulums, springs, rods or sticking contacts")
        } else if rest_speed.is_some_and(|speed| speed > 0.0) {
            Some("does not work with contact.rest_speed: its contacts need not lose energy")
        } else {
            None
        }
    }

    /// Half of the speed that contacts add to the separation, if it is given and valid.
    pub(super) fn added_speed(&mut self, path: &[String], added: Option<f64>) -> Option<f64> {
        let added = added?;
        if !not_negative(&mut self.document, path, added) {
            return None;
        }
        if added > 0.0
            && let Some(why) = self.why_no_gain()
        {
            self.document.report(path, why);
            return None;
        }
        Some(added)
    }

    /// Coefficients that are drawn anew in each contact, if their distribution is valid.
    fn random_restitution(
        &mut self,
        path: &[String],
        config: &RestitutionModelConfig,
    ) -> Option<Restitution> {
        let sub = |key: &str| under(path, &[key]);
        let mut sound = true;
        let others = [("parameters", config.parameters.is_some()), ("speeds", config.speeds.is_some())];
        for (key, _) in numbers(config).into_iter().chain(others).filter(|(_, given)| *given) {
            self.document.report(&sub(key), "does not belong to this model");
            sound = false;
        }
        if self.has_joints() {
            let why = "does not work with pendulums, springs, rods or sticking contacts";
            self.document.report(&sub("model"), why);
            sound = false;
        }
        let mut two = |key: &str, list: &Option<Vec<f64>>, what: &str| {
            let numbers = list.as_ref()?;
            let pair = <[f64; 2]>::try_from(numbers.as_slice()).ok();
            if pair.is_none() {
                self.document.refuse(&sub(key), format!("must have two numbers: {what}"));
                sound = false;
            }
            pair
        };
        let uniform = two("uniform", &config.uniform, "the bounds of the coefficient");
        let normal = two("normal", &config.normal, "mean and standard deviation of the coefficient");
        let given =
            [config.uniform.is_some(), config.normal.is_some(), config.values.is_some()].map(usize::from);
        match given.iter().sum::<usize>() {
            0 => {
                let why = "missing: a random coefficient has uniform = [low, high], normal = [mean, standard \
                           deviation] or values = [e, …]";
                self.document.report_missing(&sub("uniform"), why);
                return None;
            }
            1 => {}
            _ => {
                self.document.report(&sub("model"), "has one distribution: give uniform, normal or values");
                return None;
            }
        }
        let scatter = match (uniform, normal, &config.values) {
            (Some(bounds), ..) => Scatter::Uniform(bounds),
            (_, Some(moments), _) => Scatter::Normal(moments),
            (.., Some(values)) => Scatter::Values(values.clone()),
            _ => return None,
        };
        match Restitution::random(scatter) {
            Ok(law) => sound.then_some(law),
            Err(RestitutionError { parameter, value, allowed }) => {
                self.document.refuse_part(&sub(parameter), value, allowed);
                None
            }
        }
    }

    /// Measured coefficients of restitution, if they are valid.
    fn restitution_table(&mut self, path: &[String], config: &RestitutionModelConfig) -> Option<Restitution> {
        let sub = |key: &str| under(path, &[key]);
        let mut sound = true;
        let names = [("model", config.model.is_some()), ("parameters", config.parameters.is_some())];
        for (key, _) in numbers(config).into_iter().chain(names).filter(|(_, given)| *given) {
            self.document.report(&sub(key), "does not belong to a table of speeds and values");
            sound = false;
        }
        for (key, list) in [("speeds", &config.speeds), ("values", &config.values)] {
            if list.is_none() {
                self.document.report_missing(&sub(key), "missing: a table has speeds and values");
                sound = false;
            }
        }
        let (Some(speeds), Some(values)) = (&config.speeds, &config.values) else { return None };
        match RestitutionTable::of(speeds, values) {
            Ok(table) if sound => Some(Restitution::Table(table)),
            Ok(_) => None,
            Err(error) => {
                self.document.refuse_part(&sub(error.parameter), error.value, error.allowed);
                None
            }
        }
    }

    /// A law of restitution, if there is one and it is valid.
    pub(super) fn restitution(
        &mut self,
        path: &[String],
        config: Option<&RestitutionConfig>,
    ) -> Option<Restitution> {
        let sub = |key: &str| under(path, &[key]);
        let model = match config? {
            RestitutionConfig::Constant(e) => {
                if (0.0..=1.0).contains(e) {
                    return Some(Restitution::Constant(*e));
                }
                self.document.refuse(path, "must be in [0, 1]");
                return None;
            }
            RestitutionConfig::Model(model) => model,
        };
        if model.model.as_deref() == Some("random") {
            return self.random_restitution(path, model);
        }
        for (key, given) in [("uniform", model.uniform.is_some()), ("normal", model.normal.is_some())] {
            if given {
                self.document.report(&sub(key), "is for model = \"random\"");
                return None;
            }
        }
        if model.speeds.is_some() || model.values.is_some() {
            return self.restitution_table(path, model);
        }
        let Some(name) = model.model.as_deref() else {
            let known: Vec<String> = law_names().into_iter().map(|name| format!("\"{name}\"")).collect();
            let why = format!("missing: {}; or give speeds and values", known.join(" or "));
            self.document.report_missing(&sub("model"), why);
            return None;
        };
        let (needed, extra): (&[Key], &[Key]) = match name {
            "viscoelastic" => (
                &[("coefficient", model.coefficient)],
                &[("restitution", model.restitution), ("speed", model.speed), ("exponent", model.exponent)],
            ),
            "cutoff" => (
                &[("restitution", model.restitution), ("speed", model.speed)],
                &[("coefficient", model.coefficient)],
            ),
            _ => return self.added_law(path, name, model),
        };
        let mut sound = true;
        for (key, value) in needed {
            if value.is_none() {
                self.document.report_missing(&sub(key), "missing: this model needs it");
                sound = false;
            }
        }
        for (key, value) in extra {
            if value.is_some() {
                self.document.report(&sub(key), "does not belong to this model");
                sound = false;
            }
        }
        if model.parameters.is_some() {
            self.document.report(&sub("parameters"), "does not belong to this model");
            sound = false;
        }
        if !sound {
            return None;
        }
        if name == "viscoelastic" {
            let coefficient = model.coefficient.unwrap_or(0.0);
            return not_negative(&mut self.document, &sub("coefficient"), coefficient)
                .then_some(Restitution::Viscoelastic { coefficient });
        }
        let restitution = model.restitution.unwrap_or(1.0);
        let speed = model.speed.unwrap_or(1.0);
        let exponent = model.exponent.unwrap_or(0.75);
        if !(0.0..=1.0).contains(&restitution) {
            self.document.refuse(&sub("restitution"), "must be in [0, 1]");
            sound = false;
        }
        sound &= positive(&mut self.document, &sub("speed"), speed);
        sound &= positive(&mut self.document, &sub("exponent"), exponent);
        sound.then_some(Restitution::Cutoff { restitution, speed, exponent })
    }

    /// The law of contact of another crate with this name, if there is one and its parameters are valid.
    fn added_law(
        &mut self,
        path: &[String],
        name: &str,
        model: &RestitutionModelConfig,
    ) -> Option<Restitution> {
        let sub = |keys: &[&str]| under(path, keys);
        let given = model.parameters.clone().unwrap_or_default();
        let Some(made) = make_law(name, &given) else {
            let known: Vec<String> = law_names().into_iter().map(|name| format!("\"{name}\"")).collect();
            self.document.refuse(&sub(&["model"]), format!("must be one of {}", known.join(", ")));
            return None;
        };
        let mut sound = true;
        for (key, _) in numbers(model).into_iter().filter(|(_, given)| *given) {
            self.document
                .report(&sub(&[key]), "does not belong to this model, whose parameters are in parameters");
            sound = false;
        }
        if let Some(why) = self.why_no_gain() {
            self.document.report(&sub(&["model"]), why);
            sound = false;
        }
        match made {
            Ok(law) => sound.then_some(Restitution::Law(law)),
            Err(faults) => {
                self.report_faults(&sub(&["parameters"]), faults);
                None
            }
        }
    }
}
