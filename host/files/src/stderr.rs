//! Messages on standard error.

use std::fmt::Display;
use std::io::Write;

use crate::printable;

/// Characters of a message at most; paths alone may take four thousand each.
const MOST_SAID: usize = 8192;

/// Says a line or a few. A standard error that takes nothing, full or closed, is no reason to end:
/// then nobody hears it.
pub fn say(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{}", bounded(&text.to_string()));
}

/// A message without control characters but its line ends, cut where nobody reads on.
pub fn bounded(text: &str) -> String {
    let text = printable(text);
    match text.char_indices().nth(MOST_SAID) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_moves_no_cursor_and_ends() {
        assert_eq!(bounded("a\n\x1b[2Jb"), "a\n\\u{1b}[2Jb");
        assert_eq!(bounded(&"x".repeat(1_000_000)).chars().count(), MOST_SAID + 1);
    }
}
