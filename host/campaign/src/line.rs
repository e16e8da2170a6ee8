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

/// All lines of a record; none where there is no record yet.
///
/// # Errors
///
/// Names the file, and the line that cannot be read.
pub fn lines<T: DeserializeOwned>(path: &Path) -> io::Result<Vec<T>> {
    let text = match fs::read_to_string(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        text => text.map_err(|error| named("read", path, &error))?,
    };
    let read = |(i, line): (usize, &str)| {
        let wrong = |error| format!("{}: line {}: {error}", path.display(), i + 1);
        serde_json::from_str(line).map_err(|error| io::Error::other(wrong(error)))
    };
    text.lines().enumerate().map(read).collect()
}

/// Adds a line.
///
/// # Errors
///
/// Names the file, which cannot be written.
pub fn append<T: Serialize>(path: &Path, line: &T) -> io::Result<()> {
    let text = serde_json::to_string(line)? + "\n";
    let file = OpenOptions::new().create(true).append(true).open(path);
    let write =
        |mut file: fs::File| file.write_all(text.as_bytes()).and_then(|()| file.sync_data());
    file.and_then(write).map_err(|error| named("write", path, &error))
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
