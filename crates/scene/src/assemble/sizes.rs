//! Laws of the radii of a species: their parameters, ranges and draws.

use haff_placement::random::Stream;

use super::{
    Assembler,
    values::{item, positive},
};
use crate::config::{RadiusConfig, RadiusDistribution, SizeTableConfig, SizesConfig};

/// Radii of a species.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum RadiusLaw {
    Fixed(f64),
    Uniform(f64, f64),
    Normal {
        mean: f64,
        sd: f64,
        min: f64,
        max: f64,
    },
    /// The logarithm is normal with this mean and standard deviation.
    LogNormal {
        log_mean: f64,
        log_sd: f64,
        min: f64,
        max: f64,
    },
    /// The distribution of Schulz: a gamma distribution of this shape and scale.
    Schulz {
        shape: f64,
        scale: f64,
        min: f64,
        max: f64,
    },
    /// Density ∝ R^(power − 1) between two radii.
    Power {
        min: f64,
        max: f64,
        power: f64,
    },
    /// These radii in turn.
    List(Vec<f64>),
    /// These radii at random: each with the sum of its weight and all before it, and their whole sum.
    Table {
        radii: Vec<f64>,
        sums: Vec<f64>,
    },
}

/// Standard deviations from the mean beyond which no law draws.
const FARTHEST: f64 = 8.5;
/// Largest ratio of the standard deviation to the mean: with wider laws the range of radii is beyond what a
/// run can have.
const WIDEST: f64 = 2.0;

impl RadiusLaw {
    pub(super) fn is_fixed(&self) -> bool {
        matches!(self, Self::Fixed(_))
    }

    /// Smallest and largest radius.
    pub(super) fn range(&self) -> [f64; 2] {
        match self {
            Self::Fixed(radius) => [*radius, *radius],
            Self::Uniform(a, b) => [*a, *b],
            Self::Normal { min, max, .. }
            | Self::LogNormal { min, max, .. }
            | Self::Schulz { min, max, .. }
            | Self::Power { min, max, .. } => [*min, *max],
            Self::List(radii) | Self::Table { radii, .. } => {
                radii.iter().fold([f64::INFINITY, 0.0], |[least, largest], &r| [least.min(r), largest.max(r)])
            }
        }
    }

    /// The radius of particle `k` of the species.
    pub(super) fn draw(&self, k: usize, random: &mut Stream) -> f64 {
        match *self {
            Self::Fixed(radius) => radius,
            Self::Uniform(a, b) => random.between(a, b),
            Self::Normal { mean, sd, min, max } => {
                (mean + sd * random.truncated_normal((min - mean) / sd, (max - mean) / sd)).clamp(min, max)
            }
            Self::LogNormal { log_mean, log_sd, min, max } => {
                let bound = |radius: f64| (libm::log(radius) - log_mean) / log_sd;
                let z = random.truncated_normal(bound(min), bound(max));
                libm::exp(log_mean + log_sd * z).clamp(min, max)
            }
            Self::Schulz { shape, scale, min, max } => loop {
                let radius = scale * random.gamma(shape);
                if (min..=max).contains(&radius) {
                    break radius;
                }
            },
            Self::Power { min, max, power } => {
                let (u, width) = (random.unit(), libm::log(max / min));
                // The inverse of the distribution function, without powers that overflow.
                let log = if power == 0.0 {
                    width * u
                } else if power > 0.0 {
                    width + libm::log1p((1.0 - u) * libm::expm1(-power * width)) / power
                } else {
                    libm::log1p(u * libm::expm1(power * width)) / power
                };
                (min * libm::exp(log)).clamp(min, max)
            }
            Self::List(ref radii) => radii[k % radii.len()],
            Self::Table { ref radii, ref sums } => {
                let whole = sums.last().copied().unwrap_or(0.0);
                let drawn = random.unit() * whole;
                // The first whose sum is above what is drawn: never one of weight zero.
                let index = sums.partition_point(|sum| *sum <= drawn);
                radii[index.min(radii.len() - 1)]
            }
        }
    }
}

impl Assembler<'_> {
    pub(super) fn radius_law(&mut self, k: usize, config: Option<&RadiusConfig>) -> RadiusLaw {
        let path = |key: &str| item("species", k, key);
        let fallback = RadiusLaw::Fixed(1.0);
        let distribution = match config {
            None => {
                let why = "missing: a number, { uniform = [a, b] }, { normal = [mean, sd] } or another law";
                self.document.report_missing(&path("radius"), why);
                return fallback;
            }
            Some(RadiusConfig::Fixed(radius)) => {
                positive(&mut self.document, &path("radius"), *radius);
                return RadiusLaw::Fixed(*radius);
            }
            Some(RadiusConfig::Distribution(distribution)) => distribution.clone(),
        };
        let RadiusDistribution { uniform, normal, lognormal, schulz, power, list, table, min, max } =
            distribution;
        let laws = [
            ("uniform", uniform, 2),
            ("normal", normal, 2),
            ("lognormal", lognormal, 2),
            ("schulz", schulz, 2),
            ("power", power, 3),
            ("list", list, 0),
            ("table", table.as_ref().map(|_| Vec::new()), 0),
        ];
        let mut given = laws.into_iter().filter_map(|(name, values, count)| Some((name, values?, count)));
        let Some((name, values, count)) = given.next() else {
            let why = "must have uniform = [a, b], normal = [mean, sd], lognormal = [mean, sd], \
                       schulz = [mean, sd], power = [min, max, exponent], list = […] or table = \"sizes.csv\"";
            self.document.report_missing(&path("radius"), why);
            return fallback;
        };
        if let Some((other, ..)) = given.next() {
            let why = format!("contradiction: give {name} or {other}, not both");
            self.document.report(&path("radius"), why);
            return fallback;
        }
        drop(given);
        let at = path(&format!("radius.{name}"));
        if let Some(table) = table {
            for (key, value) in [("radius.min", min), ("radius.max", max)] {
                if value.is_some() {
                    let why = "belongs to normal, lognormal and schulz distributions only";
                    self.document.report(&path(key), why);
                }
            }
            return self.table_law(k, table).unwrap_or(fallback);
        }
        if count > 0 && values.len() != count || values.is_empty() {
            let why = if count == 3 { "must have three numbers" } else { "must have two numbers" };
            self.document.report(&at, if count == 0 { "must have at least one number" } else { why });
            return fallback;
        }
        // The exponent of a power law can have any sign.
        let lengths = if count == 3 { &values[..2] } else { &values[..] };
        if !lengths.iter().all(|&length| positive(&mut self.document, &at, length)) {
            return fallback;
        }
        let has_limits = matches!(name, "normal" | "lognormal" | "schulz");
        for (key, value) in [("radius.min", min), ("radius.max", max)] {
            if value.is_some() && !has_limits {
                let why = "belongs to normal, lognormal and schulz distributions only";
                self.document.report(&path(key), why);
            }
        }
        let law = match (name, &values[..]) {
            ("uniform", &[a, b]) => RadiusLaw::Uniform(a, b),
            ("power", &[min, max, exponent]) => {
                if !(-100.0..=100.0).contains(&exponent) {
                    self.document.refuse(&at, "must have an exponent from −100 to 100");
                    return fallback;
                }
                RadiusLaw::Power { min, max, power: exponent + 1.0 }
            }
            ("list", radii) => return RadiusLaw::List(radii.to_vec()),
            (_, &[mean, sd]) => return self.limited_law(k, name, [mean, sd], [min, max]).unwrap_or(fallback),
            _ => return fallback,
        };
        if law.range()[0] > law.range()[1] {
            self.document.refuse(&at, "must have the smaller radius first");
            return fallback;
        }
        law
    }

    /// The law of a table of sizes. The resolved scene has the table itself, so that it does not need the
    /// file.
    fn table_law(&mut self, k: usize, table: SizeTableConfig) -> Option<RadiusLaw> {
        let at = item("species", k, "radius.table");
        let sizes = match table {
            SizeTableConfig::Values(sizes) => sizes,
            SizeTableConfig::File(file) => {
                let text = self.states.table(std::path::Path::new(&file));
                match text.and_then(|text| read_sizes(&text)) {
                    Ok(sizes) => sizes,
                    Err(why) => {
                        self.document.report(&at, format!("cannot be used: {why}"));
                        return None;
                    }
                }
            }
        };
        let radii = sizes.radii.clone().unwrap_or_default();
        let weights = sizes.weights.clone().unwrap_or_else(|| vec![1.0; radii.len()]);
        if radii.is_empty() || radii.len() != weights.len() {
            let why = format!(
                "must have at least one radius, and as many weights: it has {} and {}",
                radii.len(),
                weights.len()
            );
            self.document.refuse(&at, why);
            return None;
        }
        if let Some(radius) = radii.iter().find(|radius| !(**radius > 0.0 && radius.is_finite())) {
            self.document.refuse(&at, format!("must have positive radii, not {radius}"));
            return None;
        }
        let mut sum = 0.0;
        let sums: Vec<f64> = weights
            .iter()
            .map(|weight| {
                sum += weight;
                sum
            })
            .collect();
        let sound = weights.iter().all(|weight| *weight >= 0.0) && sum > 0.0 && sum.is_finite();
        if !sound {
            self.document.refuse(&at, "must have weights of zero or more, and one above zero");
            return None;
        }
        if let Some(Some(species)) = self.config.species.as_mut().map(|species| species.get_mut(k))
            && let Some(RadiusConfig::Distribution(distribution)) = &mut species.radius
        {
            distribution.table = Some(SizeTableConfig::Values(sizes));
        }
        Some(RadiusLaw::Table { radii, sums })
    }

    /// A law with a mean, a standard deviation and limits.
    fn limited_law(
        &mut self,
        k: usize,
        name: &str,
        [mean, sd]: [f64; 2],
        [min, max]: [Option<f64>; 2],
    ) -> Option<RadiusLaw> {
        let path = |key: &str| item("species", k, key);
        let ratio = sd / mean;
        if name != "normal" && ratio > WIDEST {
            let why = format!("must have a standard deviation of at most {WIDEST} means");
            self.document.refuse(&path(&format!("radius.{name}")), why);
            return None;
        }
        let variance = libm::log1p(ratio * ratio);
        let (log_mean, log_sd) = (libm::log(mean) - 0.5 * variance, variance.sqrt());
        let largest = match name {
            "lognormal" => libm::exp(log_mean + FARTHEST * log_sd),
            // The tail is exponential.
            "schulz" => mean + FARTHEST * FARTHEST * sd.max(sd * ratio),
            _ => mean + FARTHEST * sd,
        };
        let min = min.unwrap_or(0.1 * mean);
        let max = max.unwrap_or(largest);
        let mut sound = true;
        for (key, value) in [("radius.min", min), ("radius.max", max)] {
            sound &= positive(&mut self.document, &path(key), value);
        }
        let far = |low: f64, high: f64| low > 8.0 || high < -8.0;
        let is_far = match name {
            "lognormal" => {
                let bound = |radius: f64| (libm::log(radius) - log_mean) / log_sd;
                far(bound(min), bound(max))
            }
            // Draws outside of the limits are repeated: a good part of them must be inside.
            "schulz" => min > mean + sd || max < (mean - sd).max(0.5 * mean),
            _ => far((min - mean) / sd, (max - mean) / sd),
        };
        if sound && min > max {
            self.document.refuse(&path("radius"), format!("must have min ≤ max, not {min} > {max}"));
            return None;
        }
        if sound && is_far {
            let text = match name {
                "schulz" => "the range from min to max must contain radii next to the mean",
                _ => "the range from min to max lies more than 8 standard deviations from the mean",
            };
            self.document.report(&path("radius"), text);
            return None;
        }
        sound.then_some(match name {
            "lognormal" => RadiusLaw::LogNormal { log_mean, log_sd, min, max },
            "schulz" => {
                RadiusLaw::Schulz { shape: 1.0 / (ratio * ratio), scale: mean * ratio * ratio, min, max }
            }
            _ => RadiusLaw::Normal { mean, sd, min, max },
        })
    }
}

/// Radii and weights from the lines of a CSV file. A first line without numbers is a heading; empty lines and
/// those that begin with # are left out.
fn read_sizes(text: &str) -> Result<SizesConfig, String> {
    let (mut radii, mut weights) = (Vec::new(), Vec::new());
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let separators = |c: char| c == ',' || c == ';' || c == '\t';
        let fields: Vec<&str> =
            line.split(separators).map(str::trim).filter(|field| !field.is_empty()).collect();
        let values: Result<Vec<f64>, _> = fields.iter().map(|field| field.parse::<f64>()).collect();
        match values.as_deref() {
            Ok(&[radius]) => radii.push(radius),
            Ok(&[radius, weight]) => {
                radii.push(radius);
                weights.push(weight);
            }
            Err(_)
                if radii.is_empty()
                    && weights.is_empty()
                    && !fields.iter().any(|f| f.parse::<f64>().is_ok()) => {}
            _ => {
                let line = crate::source::text::cut(line, 40);
                return Err(format!(
                    "line {} must be a radius, or a radius and a weight: {line}",
                    number + 1
                ));
            }
        }
    }
    if !weights.is_empty() && weights.len() != radii.len() {
        return Err("all lines must have a weight, or none".to_owned());
    }
    Ok(SizesConfig { radii: Some(radii), weights: (!weights.is_empty()).then_some(weights) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use haff_placement::random::Purpose;

    /// Mean and standard deviation of many draws.
    fn moments(law: &RadiusLaw) -> [f64; 2] {
        let draws: Vec<f64> =
            (0..COUNT).map(|k| law.draw(k, &mut Stream::new(1, Purpose::Radius, "grain", k))).collect();
        let [least, largest] = law.range();
        assert!(draws.iter().all(|r| (least..=largest).contains(r)), "{law:?}");
        let mean = draws.iter().sum::<f64>() / COUNT as f64;
        let variance = draws.iter().map(|r| (r - mean) * (r - mean)).sum::<f64>() / (COUNT - 1) as f64;
        [mean, variance.sqrt()]
    }

    const COUNT: usize = 100_000;

    /// z-scores of the mean against the stated one; the deviation to a part that five standard errors of
    /// these laws do not exceed.
    #[test]
    fn draws_have_the_stated_mean_and_deviation() {
        let wide = [1e-9, 1e9];
        let lognormal = |mean: f64, sd: f64| {
            let variance = libm::log1p(sd * sd / (mean * mean));
            RadiusLaw::LogNormal {
                log_mean: libm::log(mean) - 0.5 * variance,
                log_sd: variance.sqrt(),
                min: wide[0],
                max: wide[1],
            }
        };
        let schulz = |mean: f64, sd: f64| {
            let ratio = sd * sd / (mean * mean);
            RadiusLaw::Schulz { shape: 1.0 / ratio, scale: mean * ratio, min: wide[0], max: wide[1] }
        };
        for (law, mean, sd) in [
            (lognormal(2.0, 0.5), 2.0, 0.5),
            (lognormal(0.1, 0.01), 0.1, 0.01),
            (schulz(2.0, 0.5), 2.0, 0.5),
            (schulz(1.0, 1.5), 1.0, 1.5),
            // ∫ R^(−2.5) from 1 to 4: moments of a power law.
            (RadiusLaw::Power { min: 1.0, max: 4.0, power: -1.5 }, 1.714_285_714, 0.699_854),
            (RadiusLaw::Power { min: 1.0, max: 3.0, power: 0.0 }, 1.820_478_453, 0.571_677),
            (RadiusLaw::Power { min: 1.0, max: 2.0, power: 3.0 }, 1.607_142_857, 0.272_460),
        ] {
            let [found, deviation] = moments(&law);
            let z = (found - mean) / (sd / (COUNT as f64).sqrt());
            assert!(z.abs() < 4.0, "{law:?}: mean {found}, z = {z}");
            assert!((deviation / sd - 1.0).abs() < 0.03, "{law:?}: deviation {deviation}, not {sd}");
        }
        // Weights 1, 0 and 3 of the radii 1, 5 and 2.
        let table = RadiusLaw::Table { radii: vec![1.0, 5.0, 2.0], sums: vec![1.0, 1.0, 4.0] };
        let draws = (0..COUNT).map(|k| table.draw(k, &mut Stream::new(1, Purpose::Radius, "grain", k)));
        let small = draws.filter(|&radius| radius == 1.0).count() as f64;
        let z = (small - 0.25 * COUNT as f64) / (COUNT as f64 * 0.1875).sqrt();
        assert!(z.abs() < 4.0, "z = {z}");
        let list = RadiusLaw::List(vec![0.5, 2.0, 1.0]);
        assert_eq!(list.range(), [0.5, 2.0]);
        let mut random = Stream::new(1, Purpose::Radius, "grain", 0);
        assert_eq!([0, 1, 2, 3].map(|k| list.draw(k, &mut random)), [0.5, 2.0, 1.0, 0.5]);
    }

    #[test]
    fn sizes_are_read_from_lines_with_and_without_weights() {
        let sizes = |radii: &[f64], weights: Option<&[f64]>| {
            Ok(SizesConfig { radii: Some(radii.to_vec()), weights: weights.map(<[f64]>::to_vec) })
        };
        assert_eq!(read_sizes("0.5\n\n 0.25 \n"), sizes(&[0.5, 0.25], None));
        let text = "# sieve\nradius,weight\n1.0, 3\n2e-1;1\n";
        assert_eq!(read_sizes(text), sizes(&[1.0, 0.2], Some(&[3.0, 1.0])));
        for (text, message) in [
            ("0.5\nhalf\n", "line 2 must be a radius"),
            ("0.5\n1\n0.2 x\n", "line 3"),
            ("1,2,3\n", "line 1"),
            ("1,2\n3\n", "all lines must have a weight"),
        ] {
            let error = read_sizes(text).unwrap_err();
            assert!(error.contains(message), "{text:?}: {error}");
        }
    }
}
