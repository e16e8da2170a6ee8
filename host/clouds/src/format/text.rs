//! Reading KITTI's binary scans, and points as text.

use echoloop_files::attribute::INTENSITY;
use echoloop_files::{Coordinates, one_line_of};

use crate::recorded::{Keep, Recorded};

/// Reads a KITTI scan: x, y, z, intensity as little-endian `f32`, 16 bytes per point.
pub(crate) fn parse_kitti(bytes: &[u8], keep: Keep) -> Result<Recorded, String> {
    let (records, rest) = bytes.as_chunks::<16>();
    if !rest.is_empty() {
        return Err(format!(
            "expected a size that is a multiple of 16 bytes (KITTI), found {}",
            bytes.len()
        ));
    }
    let number = |record: &[u8; 16], at: usize| f32::from_le_bytes(record.as_chunks().0[at]);
    let points = records.iter().map(|r| [number(r, 0), number(r, 1), number(r, 2)]);
    let mut recorded = Recorded::of(Coordinates::Single(points.collect()), None);
    if keep == Keep::All {
        let intensities = records.iter().map(|record| f64::from(number(record, 3)));
        recorded.columns.push(INTENSITY.column(intensities));
    }
    Ok(recorded)
}

/// Reads a text file: one point per line, numbers separated by blanks, commas or semicolons.
///
/// Empty lines and lines that begin with `#` or `//` are skipped. x, y, z are the first three
/// numbers, unless the first line names the columns.
pub(crate) fn parse_text(bytes: &[u8]) -> Result<Coordinates, String> {
    let text =
        std::str::from_utf8(bytes).map_err(|error| format!("expected text in UTF-8: {error}"))?;
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !(line.is_empty() || line.starts_with('#') || line.starts_with("//")))
        .peekable();
    let mut axes = [0, 1, 2];
    if let Some(&(number, line)) = lines.peek()
        && words(line).next().is_some_and(|word| word.parse::<f32>().is_err())
    {
        axes = columns(line)
            .ok_or(format!("line {number}: expected numbers or the column names x, y, z"))?;
        lines.next();
    }
    let mut points = Vec::with_capacity(most_points(bytes));
    for (number, line) in lines {
        let point = point(line, axes)
            .ok_or_else(|| format!("line {number}: expected x y z, found {:?}", start(line)))?;
        points.push(point);
    }
    points.shrink_to_fit();
    Ok(Coordinates::Wide(points))
}

/// Most points in this text: a point takes three digits and three blanks or line ends.
pub(super) fn most_points(text: &[u8]) -> usize {
    text.len() / 6 + 1
}

fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| c.is_whitespace() || c == ',' || c == ';').filter(|word| !word.is_empty())
}

/// The first characters of a line, enough to recognise it.
fn start(line: &str) -> String {
    one_line_of(line, 60)
}

fn columns(line: &str) -> Option<[usize; 3]> {
    let place =
        |axis| words(line).position(|word| word.trim_matches('"').eq_ignore_ascii_case(axis));
    Some([place("x")?, place("y")?, place("z")?])
}

fn point(line: &str, axes: [usize; 3]) -> Option<[f64; 3]> {
    let value = |axis: usize| words(line).nth(axes[axis])?.parse().ok();
    Some([value(0)?, value(1)?, value(2)?])
}
