//! Escaping of external text for a line of a terminal or a log.
//!
//! Titles, names, keys, values and paths may come from files of others. Without escaping, control characters
//! in them can move the cursor, change colors or start a line that imitates a message of haff; and characters
//! that reverse the direction of writing can disguise a text.

use std::borrow::Cow;
use std::fmt::Display;

/// Longest piece of a message [characters]: longer ones are cut.
pub const LONGEST: usize = 1000;

/// Longest value in a message [characters]: its beginning shows what it is.
pub const LONGEST_VALUE: usize = 120;

/// Whether a character is shown as an escape: control characters (C0, DEL, C1), the separators of lines and
/// paragraphs, and those that change the direction of writing.
fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The text on one line: hidden characters as `\n`, `\t`, `\u{1b}`, ….
pub fn escaped(text: &str) -> Cow<'_, str> {
    escape(text, is_hidden)
}

/// As [`escaped`], but line ends are kept: for text of several lines composed by haff.
pub fn escaped_lines(text: &str) -> Cow<'_, str> {
    escape(text, |c| c != '\n' && is_hidden(c))
}

/// The displayed value, escaped as by [`escaped`] and cut after [`LONGEST`] characters.
pub fn shown(piece: impl Display) -> String {
    let text = piece.to_string();
    cut(&escaped(cut(&text, LONGEST).as_ref()), LONGEST).into_owned()
}

/// The text, or its beginning and `…` if it has more than `longest` characters.
pub fn cut(text: &str, longest: usize) -> Cow<'_, str> {
    // The length in bytes is an upper bound.
    if text.len() <= longest || text.char_indices().nth(longest).is_none() {
        return Cow::Borrowed(text);
    }
    let end = text.char_indices().nth(longest.saturating_sub(1)).map_or(text.len(), |(end, _)| end);
    Cow::Owned(format!("{}…", &text[..end]))
}

/// Longest word that is compared with others, and the largest number of them.
const COMPARED: usize = 64;
const CANDIDATES: usize = 1000;

/// The candidate most similar to `word`, as a correction of a misspelling.
pub(crate) fn nearest<'t>(word: &str, candidates: impl Iterator<Item = &'t str>) -> Option<&'t str> {
    if word.len() > COMPARED {
        return None;
    }
    candidates
        .filter(|candidate| candidate.len() <= COMPARED)
        .take(CANDIDATES)
        .map(|candidate| (strsim::jaro_winkler(candidate, word), candidate))
        .max_by(|(a, _), (b, _)| a.total_cmp(b))
        .and_then(|(score, candidate)| (score > 0.75).then_some(candidate))
}

/// Largest number of names listed in a message.
const LISTED: usize = 12;

/// The first few of some names, each once, and `…` if there are more.
pub(crate) fn some_of<'t>(names: impl Iterator<Item = &'t str>) -> String {
    let mut listed: Vec<&str> = Vec::new();
    for name in names.take(CANDIDATES) {
        if listed.contains(&name) {
            continue;
        }
        if listed.len() == LISTED {
            listed.push("…");
            break;
        }
        listed.push(name);
    }
    let cut: Vec<_> = listed.into_iter().map(|name| cut(name, COMPARED)).collect();
    cut.join(", ")
}

fn escape(text: &str, hidden: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&hidden) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if hidden(c) { out.extend(c.escape_default()) } else { out.push(c) }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped_and_other_text_is_unchanged() {
        let hidden = (0..=0x1f).chain(0x7f..=0x9f).chain(0x2028..=0x202e).chain(0x2066..=0x2069);
        for c in hidden.filter_map(char::from_u32) {
            let text = format!("a{c}b");
            let escaped = escaped(&text);
            assert!(escaped.starts_with("a\\") && escaped.ends_with('b'), "{c:?}: {escaped:?}");
            assert!(!escaped.contains(c), "{c:?}: {escaped:?}");
        }
        assert_eq!(escaped("\u{1b}[31m\r\nerror: x"), r"\u{1b}[31m\r\nerror: x");
        assert_eq!(escaped_lines("a\nb\u{202e}"), "a\nb\\u{202e}");
        let plain = "Überlapp ≥ 10⁻¹² σ, 𝜑 = 0.1 — “x”";
        assert!(matches!(escaped(plain), Cow::Borrowed(text) if text == plain));
    }

    #[test]
    fn long_texts_are_cut_between_characters() {
        assert_eq!(cut("éé", 2), "éé");
        assert_eq!(cut("ééé", 2), "é…");
        assert_eq!(cut("", 0), "");
        assert_eq!(shown("\u{1b}".repeat(5000)).chars().count(), LONGEST);
    }
}
