//! Members of a sweep: every combination of the values, each for every seed.

use std::path::PathBuf;

use toml::{Table, Value};
use xxhash_rust::xxh3::xxh3_64;

use super::values::{Axis, canonical};
use crate::{
    arguments::Sweep,
    terminal::{
        failure::{Failure, Status, scene_failure},
        output::shown,
        words::{say, set},
    },
};

/// Largest number of members in one folder.
const MAX_MEMBERS: usize = 1_000_000;

/// Definition of a sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The scene file as given.
    pub scene: PathBuf,
    /// Its text.
    pub text: String,
    /// The keys in the order given, the first one varying slowest.
    pub axes: Vec<Axis>,
    /// Runs of each combination with seeds derived; `None`: one, with the scene's own seed.
    pub seeds: Option<u32>,
    /// Seed of the scene file.
    base_seed: Option<u64>,
}

/// One run of a sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// Number in the sweep, from 0.
    pub index: usize,
    /// Key and value.
    pub parameters: Vec<(String, Value)>,
    /// Which of the runs with the same parameters, from 0, if seeds are derived.
    pub replica: Option<u32>,
    /// Seed; `None` if the scene has none that is a whole number.
    pub seed: Option<u64>,
    /// Name of its file in the sweep's folder.
    pub file: String,
}

impl Plan {
    /// The plan given by the options.
    pub fn new(options: &Sweep) -> Result<Self, Failure> {
        let invalid = |message: String| Failure::new(Status::Invalid, message);
        let axes: Vec<Axis> =
            options.set.iter().map(|text| Axis::parse(text).map_err(invalid)).collect::<Result<_, _>>()?;
        for (k, axis) in axes.iter().enumerate() {
            if axes[..k].iter().any(|other| other.key == axis.key) {
                let key = shown(&axis.key);
                return Err(invalid(format!(
                    "{}: given twice; separate its values by commas: {key}=V1,V2",
                    set(&key)
                )));
            }
        }
        if axes.is_empty() && options.seeds.is_none() {
            let message = say(
                "nothing to vary: give --set KEY=V1,V2,… (several times for several keys) or --seeds N",
                "nothing to vary: give values, {KEY: [V1, V2, …]}, or seeds=N",
            );
            return Err(invalid(message.to_owned()));
        }
        if options.seeds.is_some() && axes.iter().any(|axis| axis.key == "seed" && axis.values.len() > 1) {
            let message = say(
                "--seeds derives seeds from one; give either --seeds N or --set seed=S1,S2",
                "seeds=N derives seeds from one: give either it or {\"seed\": [S1, S2]}",
            );
            return Err(invalid(message.to_owned()));
        }
        let text = haff_scene::read(&options.scene).map_err(|errors| scene_failure(&errors))?;
        // Errors of syntax are reported when the scene is assembled.
        let seed = text.parse::<Table>().ok().map_or(Some(0), |table| match table.get("seed") {
            None => Some(0),
            Some(value) => whole(value),
        });
        let plan = Self { scene: options.scene.clone(), text, axes, seeds: options.seeds, base_seed: seed };
        match plan.count() {
            Some(1..=MAX_MEMBERS) => Ok(plan),
            _ => Err(invalid(format!(
                "more than {MAX_MEMBERS} runs: split the study into several sweeps, each in a separate folder"
            ))),
        }
    }

    fn count(&self) -> Option<usize> {
        let mut count = self.seeds.unwrap_or(1) as usize;
        for axis in &self.axes {
            count = count.checked_mul(axis.values.len())?;
        }
        Some(count)
    }

    /// Number of members.
    pub fn len(&self) -> usize {
        self.count().unwrap_or(usize::MAX)
    }

    /// The member of a number below [`Plan::len`].
    pub fn member(&self, index: usize) -> Member {
        let replicas = self.seeds.unwrap_or(1) as usize;
        let replica = self.seeds.map(|_| (index % replicas) as u32);
        let mut rest = index / replicas;
        let mut parameters: Vec<(String, Value)> = Vec::new();
        for axis in self.axes.iter().rev() {
            parameters.push((axis.key.clone(), axis.values[rest % axis.values.len()].clone()));
            rest /= axis.values.len();
        }
        parameters.reverse();
        let own = parameters.iter().find(|(key, _)| key == "seed");
        let base = own.map_or(self.base_seed, |(_, value)| whole(value));
        let seed = match (base, replica) {
            (Some(base), Some(replica)) => Some(derived_seed(base, replica, &parameters)),
            (base, _) => base,
        };
        Member { index, parameters, replica, seed, file: self.file(index) }
    }

    /// The file name of a number.
    pub fn file(&self, number: usize) -> String {
        let digits = (self.len() - 1).to_string().len().max(4);
        format!("run-{number:0digits$}.h5")
    }

    /// The plan of other values and seeds, of the same scene.
    pub fn with(&self, axes: Vec<Axis>, seeds: Option<u32>) -> Self {
        Self { axes, seeds, ..self.clone() }
    }

    /// All members in order.
    pub fn members(&self) -> impl Iterator<Item = Member> + '_ {
        (0..self.len()).map(|index| self.member(index))
    }

    /// A short label of a member: its values of the keys that vary, each key by its shortest unique suffix.
    pub fn label(&self, member: &Member) -> String {
        let varying: Vec<&str> =
            self.axes.iter().filter(|axis| axis.values.len() > 1).map(|axis| axis.key.as_str()).collect();
        let mut words: Vec<String> = member
            .parameters
            .iter()
            .filter(|(key, _)| varying.contains(&key.as_str()))
            .map(|(key, value)| shown(format_args!("{}={value}", tail(key, &varying))))
            .collect();
        words.extend(member.replica.map(|replica| format!("seed {replica}")));
        if words.is_empty() { format!("run {}", member.index) } else { words.join("  ") }
    }

    /// Numbers of members that show each value of each key at least once, with the others at their first
    /// values.
    pub fn corners(&self) -> Vec<usize> {
        let mut corners = vec![0];
        let mut stride = self.seeds.unwrap_or(1) as usize;
        for axis in self.axes.iter().rev() {
            corners.extend((1..axis.values.len()).map(|k| k * stride));
            stride *= axis.values.len();
        }
        corners
    }
}

impl Member {
    /// The arguments of `haff run --set`.
    pub fn overrides(&self) -> Vec<String> {
        let mut overrides: Vec<String> =
            self.parameters.iter().map(|(key, value)| format!("{key}={value}")).collect();
        if let (Some(_), Some(seed)) = (self.replica, self.seed) {
            overrides.push(format!("seed={seed}"));
        }
        overrides
    }
}

/// The seed of a run: a hash of the scene's seed, of which run with these parameters it is, and of the
/// parameters, in the order of their keys. So it depends neither on the order of keys and values, nor on the
/// other members.
fn derived_seed(base: u64, replica: u32, parameters: &[(String, Value)]) -> u64 {
    let mut lines: Vec<String> = parameters
        .iter()
        .filter(|(key, _)| key != "seed")
        .map(|(key, value)| format!("{key}={}\n", canonical(key, value)))
        .collect();
    lines.sort_unstable();
    // Seeds are TOML integers, so below 2^63.
    xxh3_64(format!("{base}\n{replica}\n{}", lines.concat()).as_bytes()) >> 1
}

/// The shortest suffix of a dotted key that no other key has.
fn tail<'a>(key: &'a str, keys: &[&str]) -> &'a str {
    let ends = |other: &str, end: &str| {
        other.strip_suffix(end).is_some_and(|rest| rest.is_empty() || rest.ends_with('.'))
    };
    key.rmatch_indices('.')
        .map(|(dot, _)| &key[dot + 1..])
        .find(|end| !keys.iter().any(|other| *other != key && ends(other, end)))
        .unwrap_or(key)
}

fn whole(value: &Value) -> Option<u64> {
    value.as_integer().and_then(|seed| u64::try_from(seed).ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(sets: &[&str], seeds: Option<u32>) -> Plan {
        let axes = sets.iter().map(|text| Axis::parse(text).expect(text)).collect();
        Plan { scene: PathBuf::new(), text: String::new(), axes, seeds, base_seed: Some(7) }
    }

    #[test]
    fn members_are_all_combinations_seeds_fastest() {
        let plan = plan(&["a=1,2", "b=3,4,5"], Some(2));
        let members: Vec<_> = plan.members().collect();
        assert_eq!(members.len(), 12);
        assert_eq!(plan.label(&members[0]), "a=1  b=3  seed 0");
        assert_eq!(plan.label(&members[1]), "a=1  b=3  seed 1");
        assert_eq!(plan.label(&members[2]), "a=1  b=4  seed 0");
        assert_eq!(plan.label(&members[11]), "a=2  b=5  seed 1");
        assert_eq!((members[11].index, members[11].file.as_str()), (11, "run-0011.h5"));
        assert_eq!(plan.corners(), [0, 2, 4, 6]);
    }

    #[test]
    fn labels_name_varying_keys_by_their_shortest_unique_suffix() {
        let plan = plan(&["run.until=9", "contact.restitution=1,2", "x.y.count=1,2", "z.y.count=3,4"], None);
        assert_eq!(plan.label(&plan.member(0)), "restitution=1  x.y.count=1  z.y.count=3");
        let single = super::tests::plan(&["run.until=9"], None);
        assert_eq!(single.label(&single.member(0)), "run 0");
    }

    #[test]
    fn seeds_depend_on_parameters_alone_and_are_pinned() {
        let seed = |sets: &[&str], seeds, label: &str| {
            let plan = plan(sets, Some(seeds));
            let parameters = |member: &Member| {
                let given: Vec<_> =
                    member.parameters.iter().map(|(key, value)| format!("{key}={value}  ")).collect();
                format!("{}seed {}", given.concat(), member.replica.unwrap())
            };
            let member = plan.members().find(|member| parameters(member) == label).expect(label);
            member.seed.expect("a seed")
        };
        let expected = seed(&["a=1,2", "b=3,4"], 2, "a=2  b=3  seed 1");
        // XXH3 of "7\n1\na=2\nb=3\n", by another implementation; files of sweeps made before depend on it.
        assert_eq!(expected, 3_850_004_166_513_477_094);
        assert_eq!(seed(&["b=4,3", "a=2,9.5,1"], 5, "b=3  a=2  seed 1"), expected);
        assert_eq!(seed(&["a=2.0", "b=3e0"], 2, "a=2.0  b=3.0  seed 1"), expected);
        assert_ne!(seed(&["a=2", "b=3"], 2, "a=2  b=3  seed 0"), expected);
        assert_ne!(seed(&["a=3", "b=3"], 2, "a=3  b=3  seed 1"), expected);
    }

    #[test]
    fn without_seeds_the_scene_keeps_its_own() {
        let plan = plan(&["a=1,2"], None);
        assert!(plan.members().all(|member| member.seed == Some(7) && member.replica.is_none()));
        assert_eq!(plan.member(1).overrides(), ["a=2"]);
        let explicit = super::tests::plan(&["seed=5,6"], None);
        assert_eq!(explicit.member(1).seed, Some(6));
    }
}
