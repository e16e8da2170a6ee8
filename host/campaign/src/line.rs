//! Records of a line of JSON for each finished run.

use std::fs::{self, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;

use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};

use super::plan::Cell;

/// A finished run: a line of a record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Line<T> {
    /// Its cell.
    pub cell: Cell,
    /// Day and commit.
    pub made: String,
    /// Members of its own.
    #[serde(flatten)]
    pub result: T,
}

/// Written by hand: derived `flatten` cannot read floats where another crate of the build enables
/// serde_json's `arbitrary_precision`.
impl<'de, T: DeserializeOwned> Deserialize<'de> for Line<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut members = Map::deserialize(deserializer)?;
        let asked = members.remove("asked"); // name of the cell in lines of earlier versions
        let mut own = |name| members.remove(name).ok_or_else(|| D::Error::missing_field(name));
        let cell = asked.map_or_else(|| own("cell"), Ok)?;
        Ok(Self {
            cell: serde_json::from_value(cell).map_err(D::Error::custom)?,
            made: serde_json::from_value(own("made")?).map_err(D::Error::custom)?,
            result: serde_json::from_value(Value::Object(members)).map_err(D::Error::custom)?,
        })
    }
}

/// All lines of a record; none where there is no record yet. The end of a line whose writing was
/// cut off is left out.
///
/// # Errors
///
/// Names the file, and the line that cannot be read.
pub fn lines<T: DeserializeOwned>(path: &Path) -> io::Result<Vec<T>> {
    let all = bytes(path)?;
    let read = |(i, line): (usize, &[u8])| {
        let wrong = |error| format!("{}: line {}: {error}", path.display(), i + 1);
        serde_json::from_slice(line).map_err(|error| io::Error::other(wrong(error)))
    };
    let lines = whole(&all).split_inclusive(|&byte| byte == b'\n');
    lines.enumerate().map(read).collect()
}

/// Adds a line, in place of the end of one whose writing was cut off.
///
/// # Errors
///
/// Names the file, which cannot be read or written.
pub fn append<T: Serialize>(path: &Path, line: &T) -> io::Result<()> {
    let all = bytes(path)?;
    let kept = whole(&all);
    let between = if kept.last().is_none_or(|&byte| byte == b'\n') { "" } else { "\n" };
    let new = format!("{between}{}\n", serde_json::to_string(line)?);
    let write = || {
        let mut file = OpenOptions::new().create(true).append(true).open(path)?;
        if kept.len() < all.len() {
            file.set_len(kept.len() as u64)?;
        }
        file.write_all(new.as_bytes())?;
        file.sync_data()
    };
    write().map_err(|error| named("write", path, &error))
}

fn bytes(path: &Path) -> io::Result<Vec<u8>> {
    match fs::read(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Vec::new()),
        bytes => bytes.map_err(|error| named("read", path, &error)),
    }
}

/// All but the end of a line whose writing was cut off: it ends no line and is no JSON.
fn whole(all: &[u8]) -> &[u8] {
    let (kept, last) = match all.iter().rposition(|&byte| byte == b'\n') {
        Some(end) => all.split_at(end + 1),
        None => (&[][..], all),
    };
    if serde_json::from_slice::<Value>(last).is_ok() { all } else { kept }
}

fn named(what: &str, path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("cannot {what} {}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn lines_that_were_added_are_read_back_and_a_broken_one_is_named() {
        let path = std::env::temp_dir().join(format!("record-{}", std::process::id()));
        assert_eq!(lines::<Vec<u32>>(&path).unwrap(), Vec::<Vec<u32>>::new());
        append(&path, &[1, 2]).unwrap();
        append(&path, &[3]).unwrap();
        assert_eq!(lines::<Vec<u32>>(&path).unwrap(), [vec![1, 2], vec![3]]);
        fs::write(&path, "[1]\n{}\n").unwrap();
        assert!(format!("{:#}", lines::<Vec<u32>>(&path).unwrap_err()).contains("line 2"));
        fs::remove_file(&path).unwrap();
    }

    #[test]
    fn a_line_whose_writing_was_cut_off_is_left_out_and_replaced_by_the_next() {
        let path = std::env::temp_dir().join(format!("cut-off-{}", std::process::id()));
        for (text, whole) in [("[1]\n[2, ", vec![1]), ("[1]\n[2]", vec![1, 2]), ("[1", vec![])] {
            fs::write(&path, text).unwrap();
            let expected: Vec<[u32; 1]> = whole.iter().map(|&number| [number]).collect();
            assert_eq!(lines::<[u32; 1]>(&path).unwrap(), expected, "{text}");
            append(&path, &[3]).unwrap();
            assert_eq!(lines::<[u32; 1]>(&path).unwrap(), [&expected[..], &[[3]]].concat());
        }
        fs::remove_file(&path).unwrap();
    }

    #[test]
    fn a_line_has_numbers_as_numbers_and_reads_back() {
        let cell = Cell::default().with("seed", "3").with("scene", "structured");
        let result = BTreeMap::from([("pairs".to_owned(), 12)]);
        let line = Line { cell, made: "today".into(), result };
        let text = serde_json::to_string(&line).unwrap();
        let expected = r#"{"cell":{"scene":"structured","seed":3},"made":"today","pairs":12}"#;
        assert_eq!(text, expected);
        let older = text.replace("cell", "asked");
        assert_eq!(serde_json::from_str::<Line<_>>(&older).unwrap(), line);
        assert_eq!(serde_json::from_str::<Line<_>>(&text).unwrap(), line);
    }
}
