//! CSV without a header, one waveform a line.

use echoloop_files::one_line_of;

use super::read::no_number;
use super::rows::Rows;

/// The text of a file.
pub(super) fn text(bytes: &[u8]) -> Result<&str, String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    str::from_utf8(bytes).map_err(|error| {
        let found = format!("bytes that are no text at offset {}", error.valid_up_to());
        format!("expected CSV (numbers between commas) or a NumPy .npy array, found {found}")
    })
}

/// Rows of a text. A line may be empty, end in commas, quote its numbers or end in CR LF; empty
/// lines at the end are no rows. An empty cell before a number is a missing sample.
pub(super) fn parse(text: &str) -> Result<Rows, String> {
    let (mut numbers, mut ends) = (Vec::new(), Vec::new());
    for (line, row) in text.trim_end().lines().zip(1..) {
        parse_row(line, row, &mut numbers)?;
        let end = u32::try_from(numbers.len());
        ends.push(end.map_err(|_| "more than four billion numbers")?);
    }
    let missing = numbers.iter().filter(|number| number.is_nan()).count();
    let rows = Rows::of_text(numbers, ends);
    Ok(match missing {
        0 => rows,
        1 => rows.with_remark("1 empty cell is a missing sample".to_owned()),
        _ => rows.with_remark(format!("{missing} empty cells are missing samples")),
    })
}

fn parse_row(line: &str, row: usize, numbers: &mut Vec<f64>) -> Result<(), String> {
    let line = line.trim_end_matches(|c: char| c == ',' || c.is_whitespace());
    let cells = line.split(',').filter(|_| !line.is_empty());
    for (cell, column) in cells.zip(1..) {
        numbers.push(parse_cell(cell, row, column)?);
    }
    Ok(())
}

/// Number of a cell; NaN of an empty one.
fn parse_cell(cell: &str, row: usize, column: usize) -> Result<f64, String> {
    let cell = cell.trim().trim_matches('"');
    match cell.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ if cell.is_empty() => Ok(f64::NAN),
        _ => Err(no_number(row, column, &quoted(cell), hint(cell, row))),
    }
}

/// A cell in quotes, cut to the length of a message.
fn quoted(cell: &str) -> String {
    match one_line_of(cell, 24) {
        nothing if nothing.is_empty() => "nothing".into(),
        some => format!("'{some}'"),
    }
}

/// A likely reason why a cell is no number; may be empty.
fn hint(cell: &str, row: usize) -> &'static str {
    let numbers = |separator: char| {
        cell.contains(separator) && cell.split(separator).all(|c| c.trim().parse::<f64>().is_ok())
    };
    let means_missing = ["na", "n/a", "nan", "null", "none"];
    match () {
        () if means_missing.contains(&cell.to_lowercase().as_str()) => {
            " (a missing sample's cell is empty)"
        }
        () if [';', '\t', ' '].into_iter().any(numbers) => " (numbers are separated by commas)",
        () if row == 1
            && cell.starts_with(|c: char| c.is_alphabetic())
            && cell.parse::<f64>().is_err() =>
        {
            " (the first line is a waveform: there is no header)"
        }
        () => "",
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_any_length_and_may_end_in_commas() {
        let rows = parse("1,2,3\r\n\n 4.5 ,-1e2,,,\n\"7\"\n\n").unwrap();
        assert_eq!(rows, Rows::of_text(vec![1., 2., 3., 4.5, -100., 7.], vec![3, 3, 5, 6]));
    }

    #[test]
    fn an_empty_cell_before_a_number_is_a_missing_sample() {
        let rows = parse("1,,3\n,5\n").unwrap();
        assert!(rows.row(0)[1].is_nan() && rows.row(1)[0].is_nan() && rows.row(1)[1] == 5.0);
        assert_eq!(rows.remarks(), ["2 empty cells are missing samples"]);
    }

    #[test]
    fn a_cell_that_is_no_number_is_named_by_row_and_column() {
        let table = [
            ("1,2\n3,nan\n", 2, 2, "'nan'", " (a missing sample's cell is empty)"),
            ("NA,2\n", 1, 1, "'NA'", " (a missing sample's cell is empty)"),
            ("1,inf", 1, 2, "'inf'", ""),
            ("V1,V2\n1,2", 1, 1, "'V1'", " (the first line is a waveform: there is no header)"),
            ("1;2;3", 1, 1, "'1;2;3'", " (numbers are separated by commas)"),
            ("1,2\n3 4", 2, 1, "'3 4'", " (numbers are separated by commas)"),
        ];
        for (text, row, column, found, hint) in table {
            assert_eq!(parse(text), Err(no_number(row, column, found, hint)), "{text}");
        }
        assert!(text(&[b'1', 0xff]).unwrap_err().contains("no text at offset 1"));
    }

    #[test]
    fn a_file_without_lines_has_no_rows() {
        assert!(parse("").unwrap().is_empty());
        assert!(parse("\n\n").unwrap().is_empty());
        assert!(parse(text(b"\xef\xbb\xbf").unwrap()).unwrap().is_empty());
    }
}
