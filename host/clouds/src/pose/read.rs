//! Reading a pose from a file.

use std::path::Path;

use echoloop_files::{FileError, MOST_TEXT, one_line, read_text};
use serde_json::Value;

use super::{Pose, from_rows};

/// The key of the motion in a JSON document.
const KEY: &str = "target_from_source";

/// The fourth row of the matrix, which KITTI leaves out.
const LAST_ROW: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// Reads a pose, row by row, in one of three forms:
///
/// - JSON that has `target_from_source`, four rows of four numbers, as `echoloop register --json`
///   writes it; other keys are ignored;
/// - sixteen numbers, a 4×4 matrix, separated by blanks, commas or line ends;
/// - twelve numbers, its upper three rows: a line of KITTI's `poses/NN.txt`.
///
/// A rotation within 1e-3 of orthonormal is made orthonormal ([`from_rows`]).
///
/// # Errors
///
/// [`FileError`] names the file, what was found, and what was expected.
pub fn read_pose(path: &Path) -> Result<Pose, FileError> {
    let text = read_text(path, MOST_TEXT).map_err(FileError::io(path))?;
    parse_pose(path, &text)
}

/// [`read_pose`] of text in memory; `path` is for messages.
pub fn parse_pose(path: &Path, text: &str) -> Result<Pose, FileError> {
    let is_json = text.trim_start().starts_with(['{', '[']);
    let rows = match is_json {
        true => document(text).map_err(FileError::content(path)),
        false => matrix(path, text),
    };
    from_rows(&rows?).map_err(FileError::content(path))
}

fn document(text: &str) -> Result<[f64; 16], String> {
    let no_json = |error| format!("expected a JSON document with {KEY}, found no JSON: {error}");
    let document: Value = serde_json::from_str(text).map_err(no_json)?;
    let motion = document.get(KEY).ok_or_else(|| format!("a JSON document without {KEY}"));
    let expected = |found| format!("found {found}, expected {KEY} with 4 rows of 4 numbers");
    motion.and_then(rows).map_err(expected)
}

/// Four rows of four numbers; the error says what was found instead.
fn rows(motion: &Value) -> Result<[f64; 16], String> {
    let rows = motion.as_array().ok_or_else(|| format!("{KEY} that is {}", kind(motion)))?;
    let mut all = Vec::new();
    for (row, i) in rows.iter().zip(1..) {
        let number = |v: &Value| v.as_f64().ok_or_else(|| format!("{} in row {i}", kind(v)));
        let Some(row) = row.as_array() else { return Err(format!("{} as row {i}", kind(row))) };
        if row.len() != 4 {
            return Err(format!("{} numbers in row {i}", row.len()));
        }
        all.extend(row.iter().map(number).collect::<Result<Vec<f64>, String>>()?);
    }
    all.try_into().map_err(|_| format!("{} × 4 numbers", rows.len()))
}

/// The type of a JSON value, in words.
fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

fn matrix(path: &Path, text: &str) -> Result<[f64; 16], FileError> {
    let mut numbers = numbers(path, text)?;
    let found = numbers.len();
    if found == 12 {
        numbers.extend(LAST_ROW);
    }
    let expected = |_| {
        format!(
            "found {found} numbers, expected a 4×4 matrix (16), a KITTI row (12) or a JSON \
             document with {KEY}"
        )
    };
    numbers.try_into().map_err(expected).map_err(FileError::content(path))
}

fn numbers(path: &Path, text: &str) -> Result<Vec<f64>, FileError> {
    let words = text.lines().enumerate().flat_map(|(line, text)| {
        text.split(|c: char| c.is_whitespace() || c == ',')
            .filter(|word| !word.is_empty())
            .map(move |word| (line, word))
    });
    words
        .map(|(line, word)| {
            let problem = || format!("expected a number, found {:?}", one_line(word));
            word.parse().map_err(|_| FileError::Line {
                path: path.into(),
                line: line + 1,
                problem: problem(),
            })
        })
        .collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use nalgebra::Vector3;

    use super::super::to_rows;
    use super::*;

    fn read(name: &str, text: &str) -> Result<Pose, FileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        read_pose(&path)
    }

    #[test]
    fn a_matrix_a_kitti_row_and_a_document_say_the_same_motion() {
        let pose = Pose::new(Vector3::new(1.5, -2.0, 0.25), Vector3::new(0.1, -0.2, 0.3));
        let numbers = to_rows(&pose);
        let written = numbers.map(|v| v.to_string());
        let rows: Vec<&[f64]> = numbers.chunks(4).collect();
        let whole = serde_json::json!({"target_from_source": rows});
        let among_others =
            serde_json::json!({"format": 1, "stop": "Still", "target_from_source": rows, "x": [1]});
        let lines: Vec<String> = written.chunks(4).map(|row| row.join("\t")).collect();
        let texts = [
            written.join(" "),
            written.join(",\n"),
            lines.join("\r\n") + "\n",
            written[..12].join(" ") + "\n",
            lines[..3].join("\n"),
            whole.to_string(),
            format!("\n {among_others:#}\n"),
        ];
        for text in texts {
            let found = read("pose", &text).unwrap();
            let miss = (found.to_homogeneous() - pose.to_homogeneous()).amax();
            assert!(miss < 1e-14, "{miss} of {text}");
        }
    }

    #[test]
    fn a_file_without_a_motion_is_refused_with_found_and_expected() {
        let of = |motion: &str| format!("{{\"format\": 1, \"target_from_source\": {motion}}}");
        let expected = ", expected target_from_source with 4 rows of 4 numbers";
        let both = |found: &str| format!("{found}{expected}");
        let shapes = "expected a 4×4 matrix (16), a KITTI row (12) or a JSON document";
        let table = [
            ("1 0 0 0\n0 1 0 0\n".into(), format!("found 8 numbers, {shapes}")),
            ("0 0 0 0 0 0 1 ".repeat(2), format!("found 14 numbers, {shapes}")),
            ("1 0 0 0 0 1 0 0 0 0 1 0\n".repeat(2), format!("found 24 numbers, {shapes}")),
            (String::new(), format!("found 0 numbers, {shapes}")),
            ("1 0 0 0\n0 one 0 0\n".into(), ":2: expected a number, found \"one\"".into()),
            ("2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1".into(), "not orthonormal".into()),
            ("2 0 0 0 0 2 0 0 0 0 2 0".into(), "not orthonormal".into()),
            ("-1 0 0 0 0 1 0 0 0 0 1 0".into(), "mirrors".into()),
            ("{\"pairs\": 7}".into(), both("found a JSON document without target_from_source")),
            ("[1, 0, 0, 0]".into(), both("found a JSON document without target_from_source")),
            (of("null"), both("found target_from_source that is null")),
            (of("[[1, 0, 0, 0]]"), both("found 1 × 4 numbers")),
            (of("[1, 0, 0, 0]"), both("found a number as row 1")),
            (of("[[1, 0, 0, 0], [0, 1, 0]]"), both("found 3 numbers in row 2")),
            (of("[[1, 0, null, 0]]"), both("found null in row 1")),
            (of("[[1, 0"), "found no JSON: expected `,` or `]`".into()),
            (
                of("[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]"),
                "the rotation is not orthonormal".into(),
            ),
            (
                of("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,1,1]]"),
                "the last row of the matrix is not 0 0 0 1".into(),
            ),
        ];
        for (text, expected) in table {
            let message = read("start.txt", &text).unwrap_err().to_string();
            assert!(message.contains("start.txt") && message.contains(&expected), "{message}");
        }
    }

    #[test]
    fn a_file_that_is_not_there_is_named() {
        let message = read_pose(Path::new("absent.txt")).unwrap_err().to_string();
        assert!(message.contains("absent.txt"), "{message}");
    }
}
