//! Provenance of a run: time, program and command. Results leave it out, so that equal runs have
//! equal results.

use std::time::{SystemTime, UNIX_EPOCH};

use echoloop_files::{MOST_TEXT, one_line, read_text};
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;

use crate::dataset::fingerprint::build;
use crate::run_folder::files::{FileError, file_error};
use crate::run_folder::run::{ABOUT, RunFolder};

/// Version of the file's format.
const FORMAT: u32 = 1;

/// Commands that made a run: the one that began it, then those that resumed it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct About {
    /// Version of this format.
    pub format: u32,
    /// Commands, oldest first.
    pub sessions: Vec<Session>,
}

/// One command that worked on a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Session {
    /// Version of the program.
    pub version: String,
    /// Checksum of the program's file, where it can be read.
    pub build: Option<String>,
    /// Start time, UTC: 2026-11-22T17:05:00Z.
    pub begun: String,
    /// The command as a shell takes it.
    pub command: String,
}

impl Session {
    /// Command of this process.
    pub fn now() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let own = std::env::args_os().skip(1);
        let words = own.map(|word| quoted(&word.to_string_lossy()));
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            build: build(),
            begun: utc(since.as_secs()),
            command: [String::from("echoloop")]
                .into_iter()
                .chain(words)
                .collect::<Vec<_>>()
                .join(" "),
        }
    }
}

impl About {
    /// Reads the provenance of a run's folder; empty where there is none, as in one of an earlier
    /// version.
    ///
    /// # Errors
    ///
    /// [`FileError`] when the file cannot be read, or has another format.
    pub fn read(folder: &std::path::Path) -> Result<Self, FileError> {
        let path = folder.join(ABOUT);
        let fail = |what: String| {
            file_error("read", &path)(std::io::Error::other(format!(
                "{what}; without the file the run goes on, and says less of itself"
            )))
        };
        let text = match read_text(&path, MOST_TEXT) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Ok(Self { format: FORMAT, sessions: Vec::new() });
            }
            Err(error) => return Err(fail(error.to_string())),
        };
        let about: Self =
            serde_json::from_str(&text).map_err(|e| fail(one_line(&e.to_string())))?;
        match about.format {
            FORMAT => Ok(about),
            other => Err(fail(format!("it is of format {other}, not {FORMAT}"))),
        }
    }

    /// Adds this process to the provenance of a run's folder.
    pub fn record(mut self, folder: &RunFolder) -> Result<(), FileError> {
        self.format = FORMAT;
        self.sessions.push(Session::now());
        folder.write_json(ABOUT, &self)
    }
}

/// A word in shell syntax, quoted where needed.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_=+.,/:@%".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// Time of a number of seconds after 1970, UTC. A clock beyond the year 9999 counts as none.
fn utc(since_s: u64) -> String {
    let since_s = i64::try_from(since_s).unwrap_or_default();
    let time = OffsetDateTime::from_unix_timestamp(since_s).unwrap_or(OffsetDateTime::UNIX_EPOCH);
    let (hour, minute, second) = time.to_hms();
    format!("{}T{hour:02}:{minute:02}:{second:02}Z", time.date())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_since_1970_are_a_date_and_a_time() {
        for (seconds, expected) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_827_696, "2000-02-29T12:34:56Z"),
            (1_795_367_099, "2026-11-22T17:04:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(utc(seconds), expected);
        }
    }

    #[test]
    fn a_command_is_quoted_as_a_shell_takes_it() {
        assert_eq!(quoted("lidar.power=50"), "lidar.power=50");
        assert_eq!(quoted("my mesh.ply"), "'my mesh.ply'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(quoted(""), "''");
    }

    #[test]
    fn each_process_is_added_and_an_unreadable_file_is_kept() {
        let runs = tempfile::tempdir().unwrap();
        let folder = RunFolder::create(runs.path(), "a").unwrap();
        for sessions in 0..3 {
            let about = About::read(folder.path()).unwrap();
            assert_eq!(about.sessions.len(), sessions);
            about.record(&folder).unwrap();
        }
        for damaged in ["{", r#"{"format": 7, "sessions": []}"#] {
            std::fs::write(folder.file(ABOUT), damaged).unwrap();
            let error = About::read(folder.path()).unwrap_err().to_string();
            assert!(error.contains(ABOUT) && error.contains("the run goes on"), "{error}");
        }
    }
}
