//! `--set KEY=V1,V2,…` of a sweep: a key and the values it takes.

use std::{collections::HashSet, fmt};

use haff_scene::config::WallTimeConfig;
use toml::Value;

use crate::terminal::{output::shown, words::set};

/// Largest number of values of one key: more are taken for a mistake.
const MAX_VALUES: usize = 1_000_000;

/// A key of the scene with all its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Dotted path.
    pub key: String,
    /// At least one, all different.
    pub values: Vec<Value>,
}

impl Axis {
    /// Reads `KEY=V1,V2,…`. Values are TOML, separated by commas outside of brackets and quotes; a bare word
    /// is text; `lin(a, b, n)` and `log(a, b, n)` are n values from a to b, equally spaced or in equal
    /// ratios.
    pub fn parse(text: &str) -> Result<Self, String> {
        let error = |message: &str| format!("{}: {}", set(shown(text)), shown(message));
        let Some((key, list)) = text.split_once('=') else {
            return Err(error("must read KEY=V1,V2,…, for example contact.restitution=0.8,0.9"));
        };
        let key = key.trim();
        if key.is_empty() {
            return Err(error("the key is missing, such as contact.restitution"));
        }
        let mut values: Vec<Value> = Vec::new();
        for part in split(list) {
            let part = part.trim();
            if part.is_empty() {
                return Err(error("a value is missing; they are separated by single commas"));
            }
            let more = match range(part) {
                Some(range) => range,
                None => value(part).map(|value| vec![value]),
            };
            values.extend(more.map_err(|message| error(&message))?);
            if values.len() > MAX_VALUES {
                return Err(error(&format!("more than {MAX_VALUES} values")));
            }
        }
        let mut texts: Vec<String> = values.iter().map(|value| canonical(key, value)).collect();
        texts.sort_unstable();
        if let Some([twice, ..]) = texts.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(error(&format!("{twice} is given twice")));
        }
        Ok(Self { key: key.to_owned(), values })
    }

    /// Whether all values of another axis are among the values.
    pub fn has_all_of(&self, other: &Self) -> bool {
        let own: HashSet<String> = self.values.iter().map(|value| canonical(&self.key, value)).collect();
        other.values.iter().all(|value| own.contains(&canonical(&self.key, value)))
    }

    /// Key and values as text that is the same for equal values.
    pub fn canonical(&self) -> String {
        let values: Vec<String> = self.values.iter().map(|value| canonical(&self.key, value)).collect();
        format!("{}={}", self.key, values.join(","))
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let values: Vec<String> = self.values.iter().map(Value::to_string).collect();
        write!(f, "{}={}", self.key, values.join(","))
    }
}

/// The value of a key, or of the whole scene if `key` is empty, as text that is the same for equal values:
/// numbers written as 1, 1.0 or 1e0, durations as `"2h"`, `"7200s"` or 7200.
pub fn canonical(key: &str, value: &Value) -> String {
    let inner = |name: &str| if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
    match value {
        // Every whole number below 2^53 is a float.
        Value::Float(number) if number.fract() == 0.0 && number.abs() < 9e15 => (*number as i64).to_string(),
        Value::Array(items) => {
            let items: Vec<String> =
                items.iter().enumerate().map(|(k, item)| canonical(&inner(&k.to_string()), item)).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Table(table) => {
            let mut items: Vec<String> = table
                .iter()
                .map(|(name, value)| format!("{name} = {}", canonical(&inner(name), value)))
                .collect();
            items.sort_unstable();
            format!("{{ {} }}", items.join(", "))
        }
        Value::String(text) if key == "run.wall_time" => {
            match WallTimeConfig::Text(text.clone()).duration() {
                Some(time) => canonical(key, &Value::Float(time.as_secs_f64())),
                None => value.to_string(),
            }
        }
        other => other.to_string(),
    }
}

/// Whether two scenes are equal, however their values are written; comments and layout do not matter.
pub fn same_scene(one: &str, other: &str) -> bool {
    let said = |text: &str| {
        haff_scene::check_weight(text).ok()?;
        text.parse::<toml::Table>().ok().map(|table| canonical("", &table.into()))
    };
    one == other || said(one).is_some_and(|one| Some(one) == said(other))
}

/// One value, as `haff run --set` reads it.
fn value(text: &str) -> Result<Value, String> {
    match text.parse() {
        Ok(value) => Ok(value),
        Err(error) if text.starts_with(['[', '{', '"', '\'']) => {
            let error: toml::de::Error = error;
            Err(format!("{text} is not a TOML value: {}", error.message().replace('\n', "; ")))
        }
        // Shells remove quotes: a bare word is text.
        Err(_) => Ok(Value::String(text.to_owned())),
    }
}

/// The parts between commas outside of brackets and strings.
fn split(list: &str) -> Vec<&str> {
    let (mut parts, mut start, mut depth) = (Vec::new(), 0, 0_i32);
    let mut quote: Option<char> = None;
    let mut escaped = false;
    for (index, letter) in list.char_indices() {
        match (quote, letter) {
            _ if escaped => escaped = false,
            (Some('"'), '\\') => escaped = true,
            (Some(open), _) if open == letter => quote = None,
            (None, '"' | '\'') => quote = Some(letter),
            (None, '[' | '{' | '(') => depth += 1,
            (None, ']' | '}' | ')') => depth -= 1,
            (None, ',') if depth <= 0 => {
                parts.push(&list[start..index]);
                start = index + 1;
            }
            (Some(_) | None, _) => {}
        }
    }
    parts.push(&list[start..]);
    parts
}

/// The values of `lin(a, b, n)` or `log(a, b, n)`; `None` if the text is something else.
fn range(text: &str) -> Option<Result<Vec<Value>, String>> {
    let (name, rest) = text.split_once('(')?;
    let logarithmic = match name.trim() {
        "lin" => false,
        "log" => true,
        _ => return None,
    };
    let numbers = rest.strip_suffix(')')?;
    let form = || format!("{text}: must read {}(from, to, number of values)", name.trim());
    let fields: Vec<&str> = numbers.split(',').map(str::trim).collect();
    let [from, to, count] = fields[..] else { return Some(Err(form())) };
    let (Ok(a), Ok(b), Ok(count)) = (from.parse::<f64>(), to.parse::<f64>(), count.parse::<usize>()) else {
        return Some(Err(form()));
    };
    if !(2..=MAX_VALUES).contains(&count) || !a.is_finite() || !b.is_finite() {
        return Some(Err(format!("{text}: needs finite ends and 2 to {MAX_VALUES} values")));
    }
    if logarithmic && (a <= 0.0 || b <= 0.0) {
        return Some(Err(format!("{text}: both ends must be positive")));
    }
    let at = |k: usize| {
        // The ends exactly.
        if k == 0 {
            return a;
        }
        if k == count - 1 {
            return b;
        }
        let part = k as f64 / (count - 1) as f64;
        let exact = if logarithmic { a * (b / a).powf(part) } else { a + (b - a) * part };
        // To 15 digits, so that 0.65 does not become 0.6499999999999999.
        format!("{exact:.14e}").parse().unwrap_or(exact)
    };
    let whole = from.parse::<i64>().is_ok() && to.parse::<i64>().is_ok();
    let values = (0..count).map(|k| match at(k) {
        // Between whole ends values are whole numbers; log rounds to them.
        x if whole && (logarithmic || x.fract() == 0.0) => Value::Integer(x.round() as i64),
        x => Value::Float(x),
    });
    Some(Ok(values.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(text: &str) -> Vec<String> {
        Axis::parse(text).expect(text).values.iter().map(Value::to_string).collect()
    }

    #[test]
    fn commas_separate_only_outside_of_brackets_and_quotes() {
        assert_eq!(texts("contact.restitution=0.8,0.9, 1"), ["0.8", "0.9", "1"]);
        assert_eq!(texts("domain.size=[1,2,3],[2, 3, 4]"), ["[1, 2, 3]", "[2, 3, 4]"]);
        assert_eq!(texts("contact.restitution={ model = \"cutoff\", a = 1 },0.9").len(), 2);
        assert_eq!(texts(r#"title="a,b",'c,"d',"e\",f""#).len(), 3);
        assert_eq!(texts("engine.neighbors=cells,lists"), ["\"cells\"", "\"lists\""]);
    }

    #[test]
    fn ranges_contain_their_ends_exactly() {
        assert_eq!(texts("a=lin(0.5,0.95,4)"), ["0.5", "0.65", "0.8", "0.95"]);
        assert_eq!(texts("a=lin(1000,5000,5)"), ["1000", "2000", "3000", "4000", "5000"]);
        assert_eq!(texts("a=log(1,1000,4),7"), ["1", "10", "100", "1000", "7"]);
        assert_eq!(texts("a=log(0.01,1.0,3)"), ["0.01", "0.1", "1.0"]);
    }

    #[test]
    fn durations_are_compared_by_value() {
        let canonical = |text: &str| Axis::parse(text).expect(text).canonical();
        let expected = canonical("run.wall_time=7200,0.5");
        for same in ["\"2h\",0.5", "7200s,500ms", "120 min,5e-1", "1h 60m,\"500 ms\"", "7200.0,500000us"] {
            assert_eq!(canonical(&format!("run.wall_time={same}")), expected);
        }
        assert_eq!(canonical("run={wall_time=\"2h\",until=1.0}"), canonical("run={until=1,wall_time=7200}"));
        assert_ne!(canonical("run.wall_time=2h"), canonical("run.wall_time=2m"));
        assert_ne!(canonical("title=2h"), canonical("title=7200"), "a title is text");
        assert_ne!(canonical("run.wall_time=soon"), canonical("run.wall_time=late"), "no durations");
    }

    #[test]
    fn invalid_values_are_refused() {
        for (text, why) in [
            ("contact.restitution", "must read KEY=V1,V2"),
            ("=1,2", "the key is missing"),
            ("a=", "a value is missing"),
            ("a=1,,2", "a value is missing"),
            ("a=1,2,", "a value is missing"),
            ("a=1,1.0", "1 is given twice"),
            ("run.wall_time=2h,7200s", "7200 is given twice"),
            ("a=[1,2", "not a TOML value"),
            ("a=lin(1,2)", "must read lin(from, to, number of values)"),
            ("a=log(0,2,3)", "both ends must be positive"),
            ("a=lin(0,2,1)", "2 to 1000000 values"),
        ] {
            let error = Axis::parse(text).expect_err(text);
            assert!(error.starts_with(&format!("--set {text}: ")) && error.contains(why), "{error}");
        }
    }
}
