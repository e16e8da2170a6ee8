//! Numbers and text of a page.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use echoloop_closed_loop::parameters::choices;

/// Text of a value that is not finite.
pub(super) const NONE: &str = "–";

/// No-break space between a number and its unit.
const GAP: char = '\u{a0}';

/// Text for HTML, also inside quoted attributes.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// Text for HTML, with passages between backticks as code.
pub(super) fn with_code(text: &str) -> String {
    let pieces = text.split('`').map(escape).enumerate();
    let texts = pieces.map(|(k, piece)| match k % 2 {
        0 => piece,
        _ => format!("<code>{piece}</code>"),
    });
    texts.collect()
}

/// A name fit for a file: letters, digits and dashes.
pub(super) fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}

/// `value` with a fixed number of decimals and a true minus sign.
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(zero) if zero.chars().all(|c| c == '0' || c == '.') => zero.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => text,
    }
}

/// A number as by [`fixed`], with a sign also when positive.
pub(super) fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    let is_zero = text.chars().all(|c| c == '0' || c == '.');
    if value > 0.0 && value.is_finite() && !is_zero {
        return format!("+{text}");
    }
    text
}

/// Three significant digits without trailing zeros; a power of ten below 10⁻⁴ and from 10⁶ on.
pub fn significant(value: f64) -> String {
    if !value.is_finite() || value == 0.0 {
        return fixed(value, 0);
    }
    let exponent = libm::log10(value.abs()).floor() as i32;
    if !(-4..6).contains(&exponent) {
        return scientific(value);
    }
    trimmed(&fixed(value, (2 - exponent).max(0) as usize))
}

fn scientific(value: f64) -> String {
    let text = format!("{value:.1e}").replace('-', "−");
    match text.split_once('e') {
        Some((digits, exponent)) => format!("{}e{exponent}", trimmed(digits)),
        None => text,
    }
}

fn trimmed(text: &str) -> String {
    if !text.contains('.') {
        return text.to_owned();
    }
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A number with its unit after a no-break space, for degrees without; a missing number has no
/// unit.
pub(super) fn with_unit(number: &str, unit: &str) -> String {
    if unit.is_empty() || number == NONE {
        return number.to_owned();
    }
    if unit == "°" {
        return format!("{number}{unit}");
    }
    format!("{number}{GAP}{unit}")
}

/// Name of a value of a parameter that is a choice.
pub(super) fn choice(parameter: &str, value: f64) -> Option<&'static str> {
    choices(parameter).get(value as usize).filter(|_| value.is_finite()).copied()
}

/// Bytes as base64.
pub(super) fn base64(bytes: &[u8]) -> String {
    STANDARD.encode(bytes)
}

/// A count with commas between thousands, such as 516,048.
pub fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let comma = |k: usize| k > 0 && (digits.len() - k).is_multiple_of(3);
    digits
        .char_indices()
        .flat_map(|(k, digit)| [comma(k).then_some(','), Some(digit)].into_iter().flatten())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits_and_a_true_minus() {
        let cases = [
            (0.05, "0.05"),
            (0.043_21, "0.0432"),
            (12.0, "12"),
            (123_456.0, "123456"),
            (1.5e-7, "1.5e−7"),
            (-2.5, "−2.5"),
            (0.0, "0"),
            (f64::NAN, NONE),
            (f64::INFINITY, NONE),
        ];
        for (value, text) in cases {
            assert_eq!(significant(value), text);
        }
        assert_eq!(fixed(-0.01, 1), "0.0");
        assert_eq!(signed(1.25, 1), "+1.2");
        assert_eq!(signed(0.01, 1), "0.0");
    }

    #[test]
    fn a_command_in_a_text_is_code_and_escaped() {
        assert_eq!(with_code("run `a <b>`, & wait"), "run <code>a &lt;b&gt;</code>, &amp; wait");
    }

    #[test]
    fn a_missing_number_has_no_unit() {
        assert_eq!(with_unit(&fixed(f64::NAN, 1), "cm"), NONE);
        assert_eq!(with_unit("3.0", "cm"), "3.0\u{a0}cm");
        assert_eq!(with_unit("3.0", "°"), "3.0°");
    }

    #[test]
    fn counts_have_a_comma_before_every_three_digits() {
        let written = [0, 7, 999, 1000, 516_048, 1_234_567].map(grouped);
        assert_eq!(written, ["0", "7", "999", "1,000", "516,048", "1,234,567"]);
    }
}
