//! Drives: which particles they act on, and with what.

use haff_engine::{Drive, DriveKind, KickTimes, NamedAction};

use super::{
    Assembler,
    drag::DragPlan,
    names::{Names, among},
    values::{item, not_negative, positive},
};
use crate::{
    config::{DriveConfig, DriveKindConfig},
    plugins::{all_drive_names, make_action},
};

/// The names of all drives.
fn quoted_names() -> String {
    let names = all_drive_names().into_iter().map(|name| format!("\"{name}\""));
    names.collect::<Vec<_>>().join(", ")
}

/// The keys of the values of drives that are numbers, and what is given.
fn values(config: &DriveConfig) -> [(&'static str, Option<f64>); 5] {
    [
        ("temperature", config.temperature),
        ("strength", config.strength),
        ("rate", config.rate),
        ("interval", config.interval),
        ("time", config.time),
    ]
}

impl Assembler<'_> {
    /// The drives of `[[drive]]`, and the drag among them.
    pub(super) fn drives(&mut self, names: &Names) -> (Vec<Drive>, Option<DragPlan>) {
        let configs = self.config.drive.clone().unwrap_or_default();
        let mut drives = Vec::with_capacity(configs.len());
        let mut drag = None;
        for (k, config) in configs.into_iter().enumerate() {
            let path = |key: &str| item("drive", k, key);
            if self.has_joints() {
                let why = "a drive does not work with pendulums, springs, rods or sticking contacts";
                self.document.report(&path(""), why);
            }
            if self.config.contact.as_ref().and_then(|contact| contact.rest_speed).is_some_and(|v| v > 0.0) {
                let why = "a drive does not work with contact.rest_speed: grains at rest would not be driven";
                self.document.report(&path(""), why);
            }
            let Some(kind) = config.kind.clone() else {
                let why = format!("missing: a drive needs a kind: {}", quoted_names());
                self.document.report_missing(&path("kind"), why);
                continue;
            };
            self.refuse_other_values(k, &kind, &config);
            if kind == DriveKindConfig::Drag {
                drag = self.drag(k, &config, drag.as_ref()).or(drag);
                continue;
            }
            let Some(kind) = self.drive_kind(k, &kind, &config) else { continue };
            let rotational = config.rotational == Some(true);
            if rotational && matches!(kind, DriveKind::Named(_)) {
                let why = "is for the drives of haff: one of another crate sets velocities alone";
                self.document.report(&path("rotational"), why);
            }
            let species = self.driven_species(k, config.species, names);
            drives.push(Drive { kind, species, rotational });
        }
        (drives, drag)
    }

    /// Refuses values that a drive of this kind does not have.
    fn refuse_other_values(&mut self, k: usize, kind: &DriveKindConfig, config: &DriveConfig) {
        let used: &[&str] = match kind {
            DriveKindConfig::Named(_) => &["parameters"],
            DriveKindConfig::Rescale => &["temperature", "interval"],
            DriveKindConfig::Andersen => &["temperature", "rate"],
            DriveKindConfig::WhiteNoise => &["strength", "rate", "interval"],
            DriveKindConfig::Drag => &["time"],
        };
        let given = values(config).into_iter().filter(|(_, value)| value.is_some()).map(|(key, _)| key);
        let parameters = config.parameters.is_some().then_some("parameters");
        for key in given.chain(parameters).filter(|key| !used.contains(key)) {
            let why = format!("a drive of kind \"{}\" has no {key}, but {}", kind.name(), used.join(", "));
            self.document.report(&item("drive", k, key), why);
        }
    }

    /// What a drive does, with the values of its kind.
    fn drive_kind(&mut self, k: usize, kind: &DriveKindConfig, config: &DriveConfig) -> Option<DriveKind> {
        if let DriveKindConfig::Named(name) = kind {
            return self.named_drive(k, name, config).map(DriveKind::Named);
        }
        let values = values(config);
        let mut number = |key: &str| {
            let path = item("drive", k, key);
            let Some(value) = values.iter().find(|(name, _)| *name == key).and_then(|(_, value)| *value)
            else {
                let why = format!("missing: a drive of kind \"{}\" needs it", kind.name());
                self.document.report_missing(&path, why);
                return 1.0;
            };
            let check = if matches!(key, "rate" | "interval") { positive } else { not_negative };
            check(&mut self.document, &path, value);
            value
        };
        Some(match kind {
            DriveKindConfig::Named(_) | DriveKindConfig::Drag => return None,
            DriveKindConfig::Andersen => {
                DriveKind::Andersen { temperature: number("temperature"), rate: number("rate") }
            }
            DriveKindConfig::Rescale => {
                DriveKind::Rescale { temperature: number("temperature"), interval: number("interval") }
            }
            DriveKindConfig::WhiteNoise => {
                let strength = number("strength");
                let kicks = match (config.rate, config.interval) {
                    (_, None) => KickTimes::Poisson { rate: number("rate") },
                    (None, Some(_)) => KickTimes::Regular { interval: number("interval") },
                    (Some(_), Some(_)) => {
                        let why = "either rate (kicks at Poisson times) or interval (kicks of all at once), not both";
                        self.document.report(&item("drive", k, "interval"), why);
                        KickTimes::Regular { interval: 1.0 }
                    }
                };
                DriveKind::WhiteNoise { strength, kicks }
            }
        })
    }

    /// The drive of a plug-in.
    fn named_drive(&mut self, k: usize, name: &str, config: &DriveConfig) -> Option<&'static NamedAction> {
        let given = config.parameters.clone().unwrap_or_default();
        let Some(made) = make_action(name, &given) else {
            self.document.refuse(&item("drive", k, "kind"), format!("must be one of {}", quoted_names()));
            return None;
        };
        match made {
            Ok(named) => {
                let first = named.get().time(1);
                if first.is_nan() || first <= 0.0 {
                    let why = format!("its first action is at {first}: times must be above 0");
                    self.document.report(&item("drive", k, "kind"), why);
                    return None;
                }
                Some(named)
            }
            Err(faults) => {
                self.report_faults(&item("drive", k, "parameters"), faults);
                None
            }
        }
    }

    /// The species that a drive acts on, all if none are named.
    fn driven_species(&mut self, k: usize, given: Option<Vec<String>>, names: &Names) -> Vec<u32> {
        let path = item("drive", k, "species");
        let Some(given) = given else {
            if let Some(config) = self.config.drive.as_mut().and_then(|drives| drives.get_mut(k)) {
                config.species = Some(names.all.clone());
            }
            return (0..names.all.len() as u32).collect();
        };
        if given.is_empty() {
            self.document.refuse(&path, "must name at least one species");
        }
        let mut species = Vec::with_capacity(given.len());
        for name in &given {
            if let Some(index) = names.all.iter().position(|known| known == name) {
                species.push(index as u32);
            } else {
                let known = || names.all.iter().map(String::as_str);
                self.document.report(&path, format!("no species is named {}", among(name, known)));
            }
        }
        species.sort_unstable();
        species.dedup();
        species
    }
}
