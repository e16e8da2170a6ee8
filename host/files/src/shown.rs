//! What a message may repeat of a file, which anybody may have written.

/// Characters of a file that a message repeats at most.
pub const MOST_SHOWN: usize = 200;

/// One line of at most [`MOST_SHOWN`] characters and `…`: blanks and line ends become a blank,
/// what moves a cursor or hides is written as `\u{1b}`.
///
/// ```
/// assert_eq!(echoloop_files::shown("two\n lines, \x1b[31mred"), "two lines, \\u{1b}[31mred");
/// ```
#[must_use]
pub fn shown(text: &str) -> String {
    shown_most(text, MOST_SHOWN)
}

/// As [`shown`], of at most so many characters.
#[must_use]
pub fn shown_most(text: &str, most: usize) -> String {
    let words = text.split_whitespace();
    let mut line = String::new();
    for word in words {
        if !line.is_empty() {
            line.push(' ');
        }
        line.extend(word.chars().take(most + 1));
        // Escapes come later, so that none is cut in half.
        if line.chars().nth(most).is_some() {
            line = line.chars().take(most).chain(['…']).collect();
            break;
        }
    }
    printable(&line)
}

/// The text with its line ends, but without other control characters: `\u{1b}` is written out.
#[must_use]
pub fn printable(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' | '"' | '\'' | '\\' => out.push(c),
            _ => out.extend(c.escape_debug()),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_shown_is_short_and_moves_no_cursor() {
        assert_eq!(shown("a \t b\r\nc"), "a b c");
        assert_eq!(shown("\x1b]0;owned\x07"), "\\u{1b}]0;owned\\u{7}");
        let long = shown(&"ä ".repeat(1_000_000));
        assert_eq!(long.chars().count(), MOST_SHOWN + 1);
        assert!(long.ends_with('…'));
        assert_eq!(shown(&"x".repeat(200)), "x".repeat(200));
        assert!(shown(&"\x1b".repeat(1_000)).len() <= 201 * 6);
    }

    #[test]
    fn a_printable_text_keeps_its_lines_and_quotes() {
        assert_eq!(printable("it's \"ä\"\n\tx\u{202e}\u{9b}"), "it's \"ä\"\n\\tx\\u{202e}\\u{9b}");
    }
}
