//! Text of a file made safe for a message: short, and without control characters.

/// Most characters of a file that a message repeats.
pub const MAX_LINE: usize = 200;

/// The text as one line of at most [`MAX_LINE`] characters, then `…` if it is longer. Runs of white
/// space become one blank; control characters are written as `\u{1b}`.
///
/// ```
/// assert_eq!(echoloop_files::one_line("two\n lines, \x1b[31mred"), "two lines, \\u{1b}[31mred");
/// ```
#[must_use]
pub fn one_line(text: &str) -> String {
    one_line_of(text, MAX_LINE)
}

/// [`one_line`] with at most `most` characters.
#[must_use]
pub fn one_line_of(text: &str, most: usize) -> String {
    let words = text.split_whitespace();
    let mut line = String::new();
    for word in words {
        if !line.is_empty() {
            line.push(' ');
        }
        line.extend(word.chars().take(most + 1));
        // Control characters are written out only after the cut, so no `\u{1b}` is cut in half.
        if line.chars().nth(most).is_some() {
            line = line.chars().take(most).chain(['…']).collect();
            break;
        }
    }
    printable(&line)
}

/// The text with its line ends. Other control characters are written out, as `\u{1b}`.
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
    fn one_line_is_short_and_moves_no_cursor() {
        assert_eq!(one_line("a \t b\r\nc"), "a b c");
        assert_eq!(one_line("\x1b]0;owned\x07"), "\\u{1b}]0;owned\\u{7}");
        let long = one_line(&"ä ".repeat(1_000_000));
        assert_eq!(long.chars().count(), MAX_LINE + 1);
        assert!(long.ends_with('…'));
        assert_eq!(one_line(&"x".repeat(200)), "x".repeat(200));
        assert!(one_line(&"\x1b".repeat(1_000)).len() <= 201 * 6);
    }

    #[test]
    fn a_printable_text_keeps_its_lines_and_quotes() {
        assert_eq!(printable("it's \"ä\"\n\tx\u{202e}\u{9b}"), "it's \"ä\"\n\\tx\\u{202e}\\u{9b}");
    }
}
