//! Estimates the memory and stack needed to parse a TOML text, before it is parsed.
//!
//! The parser takes about a hundred bytes for every byte of a text, and 600 for every byte of a key with many
//! dots; and it is recursive in the levels of nesting. A pass over the tokens gives an upper bound.

use toml_parser::Source;
use toml_parser::lexer::TokenKind;

/// Longest scene file [bytes]: a million `[[particle]]` with positions and velocities to the last digit have
/// 182 MB. Larger systems start from a state file.
pub const LONGEST_FILE: u64 = 256 << 20;

/// Deepest nesting of tables and arrays. Keys of a scene nest four deep, and the parser reports an error at
/// 80 levels of one kind.
const DEEPEST: u32 = 80;

/// Bytes that the parser needs for each token; for each table, since even a short one takes a whole node of a
/// tree; and for each key and each value of an array. Measured, and rounded up: it is 1.1 to 1.5 times what
/// reading takes in the end.
const TOKEN: u64 = 52;
const TABLE: u64 = 1250;
const VALUE: u64 = 150;

/// Numbers of tokens and levels in a text.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Weight {
    bytes: u64,
    tokens: u64,
    tables: u64,
    values: u64,
    depth: u32,
}

impl Weight {
    /// Of a whole document.
    pub(crate) fn of_document(text: &str) -> Self {
        Self::of(text, true)
    }

    /// Of a single value.
    pub(crate) fn of_value(text: &str) -> Self {
        Self::of(text, false)
    }

    fn of(text: &str, document: bool) -> Self {
        let mut weight = Self { bytes: text.len() as u64, ..Self::default() };
        if weight.bytes > LONGEST_FILE {
            return weight;
        }
        // Levels that each open bracket has added, and whether it is that of a table.
        let mut open: Vec<(u32, bool)> = Vec::new();
        let mut depth = 0;
        // Levels of the header above, and of the key being read.
        let (mut header, mut dots) = (0, 0);
        let (mut in_header, mut in_key) = (false, document);
        for token in Source::new(text).lex() {
            weight.tokens += 1;
            match token.kind() {
                TokenKind::Newline if open.is_empty() => {
                    (in_header, in_key, dots) = (false, document, 0);
                }
                // The second one of an array of tables.
                TokenKind::LeftSquareBracket if in_header => {}
                TokenKind::LeftSquareBracket if open.is_empty() && in_key => {
                    (in_header, header) = (true, 1);
                    weight.tables += 1;
                }
                TokenKind::Dot if in_header => {
                    header += 1;
                    weight.tables += 1;
                }
                TokenKind::Dot if in_key => {
                    dots += 1;
                    weight.tables += 1;
                }
                TokenKind::Equals => {
                    in_key = false;
                    weight.values += 1;
                }
                TokenKind::Comma => {
                    weight.values += 1;
                    (in_key, dots) = (open.last().is_some_and(|(_, table)| *table), 0);
                }
                kind @ (TokenKind::LeftCurlyBracket | TokenKind::LeftSquareBracket) => {
                    let table = kind == TokenKind::LeftCurlyBracket;
                    weight.tables += u64::from(table);
                    weight.values += 1;
                    depth += 1 + dots;
                    open.push((1 + dots, table));
                    (in_key, dots) = (table, 0);
                }
                TokenKind::RightCurlyBracket | TokenKind::RightSquareBracket if !in_header => {
                    if let Some((levels, _)) = open.pop() {
                        depth -= levels;
                    }
                    (in_key, dots) = (false, 0);
                }
                _ => {}
            }
            weight.depth = weight.depth.max(header + depth + dots);
            if weight.depth > DEEPEST {
                break;
            }
        }
        weight
    }

    /// Upper bound of the memory for parsing and keeping it [bytes].
    fn memory(self) -> u64 {
        // Including the text itself.
        2 * self.bytes + TOKEN * self.tokens + TABLE * self.tables + VALUE * self.values
    }

    /// An error if it exceeds `memory` bytes or a fixed limit.
    pub(crate) fn check(self, memory: u64) -> Result<(), String> {
        let size = |bytes: u64| format!("{:.1} GiB", bytes as f64 / (1_u64 << 30) as f64);
        if self.bytes > LONGEST_FILE {
            return Err(too_long());
        }
        if self.depth > DEEPEST {
            return Err(format!("tables and arrays may nest {DEEPEST} deep; those of scenes nest four deep"));
        }
        if self.memory() > memory {
            return Err(format!(
                "reading it may take {} of memory, {} are free; start large systems from a state file \
                 (initial.positions = {{ file = … }})",
                size(self.memory()),
                size(memory)
            ));
        }
        Ok(())
    }
}

/// Why a text of more than [`LONGEST_FILE`] bytes is refused.
pub(crate) fn too_long() -> String {
    format!(
        "a scene file may have {} MiB; start larger systems from a state file (initial.positions = {{ file = … }})",
        LONGEST_FILE >> 20
    )
}
