//! Numbers with their words, as a person writes them.

use haff_engine::significant;

/// A number of things: `1 particle`, `2 particles`.
pub fn counted(count: u64, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// A wall time: `1.94 ms`, `11.1 s`, `2 h 5 min`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        _ if seconds < 1e-3 => format!("{} µs", significant(seconds * 1e6, 3)),
        _ if seconds < 1.0 => format!("{} ms", significant(seconds * 1e3, 3)),
        0..100 => format!("{} s", significant(seconds, 3)),
        100..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_words() {
        assert_eq!([counted(1, "wall"), counted(0, "wall")], ["1 wall", "0 walls"]);
        let times = [2.5e-5, 0.001_942, 11.1, 99.96, 7500.0].map(duration);
        assert_eq!(times, ["25 µs", "1.94 ms", "11.1 s", "1 min 40 s", "2 h 5 min"]);
    }
}
