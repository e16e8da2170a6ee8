//! Messages on standard error.

use std::fmt::Display;
use std::io::Write;

use crate::printable;

/// Most characters of a message: room for two paths of the longest kind.
const MOST_PRINTED: usize = 8192;

/// Writes a line or a few to standard error. Errors are ignored: a full or closed standard error is
/// no reason to end the program.
pub fn say(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{}", bounded(&text.to_string()));
}

/// Message without control characters except line ends, cut after 8192 characters.
pub fn bounded(text: &str) -> String {
    let text = printable(text);
    match text.char_indices().nth(MOST_PRINTED) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_moves_no_cursor_and_is_cut() {
        assert_eq!(bounded("a\n\x1b[2Jb"), "a\n\\u{1b}[2Jb");
        assert_eq!(bounded(&"x".repeat(1_000_000)).chars().count(), MOST_PRINTED + 1);
    }
}
