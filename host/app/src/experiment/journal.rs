//! The record of a search: one JSON line a generation, enough to go on from.
//!
//! The first line says what the search was; each further line is a generation with every candidate,
//! its values, its errors and its fitness. The optimiser's state is a function of what it was told,
//! so a resumed search tells it again.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

use crate::experiment::objective::PairError;
use crate::experiment::params::{Values, written_values};

/// First line: what the search was.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Version of this format.
    pub journal: u32,
    /// Version of the program.
    pub program: String,
    /// Schema of the link, hexadecimal.
    pub link_schema: String,
    /// The axes searched, in the cube's order.
    pub axes: Vec<String>,
    /// Candidates a generation.
    pub population: usize,
    /// The whole configuration.
    pub config: Value,
}

/// Version of the journal's format.
pub const FORMAT: u32 = 1;

/// One candidate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CandidateRecord {
    /// Its point in the unit cube.
    pub point: Vec<f64>,
    /// The searched parameters in their units.
    #[serde(serialize_with = "written_values")]
    pub values: Values,
    /// Settings that a joint constraint changed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[serde(alias = "mended")] // its name in earlier journals
    pub repaired: Vec<String>,
    /// Hash of its settings, as the sensor named them.
    pub settings: u32,
    /// How each pair of the generation came out.
    pub errors: Vec<PairError>,
    /// What the optimiser was told.
    pub fitness: f64,
}

/// One generation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Generation {
    /// Its number, from 0.
    pub generation: u32,
    /// The training pairs it saw.
    pub pairs: Vec<usize>,
    /// Middle of the distribution that its candidates were drawn from, in the cube.
    pub mean: Vec<f64>,
    /// Standard deviations of that distribution, in the cube.
    pub deviations: Vec<f64>,
    /// Its step size.
    pub sigma: f64,
    /// Its candidates.
    pub candidates: Vec<CandidateRecord>,
}

/// Why a journal cannot be used.
#[derive(Debug, Error)]
pub enum JournalError {
    /// No access.
    #[error("{}: {source}", path.display())]
    Io {
        /// The journal.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A line is damaged.
    #[error(
        "{}: line {line} is {what}; the {whole} generations before it are whole (--repair keeps \
         them and goes on, and leaves a copy of the damaged file)",
        path.display()
    )]
    Damaged {
        /// The journal.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        what: String,
        /// Whole generations before it.
        whole: usize,
    },
    /// It belongs to another search.
    #[error("{}: {what}", path.display())]
    Other {
        /// The journal.
        path: PathBuf,
        /// How it differs.
        what: String,
    },
}

/// An open journal.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Begins a journal.
    ///
    /// # Errors
    ///
    /// [`JournalError::Io`]; an existing journal is never overwritten.
    pub fn create(path: &Path, header: &Header) -> Result<Self, JournalError> {
        let file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(path)
            .map_err(|e| io_error(path, e))?;
        let mut journal = Self { path: path.to_owned(), file };
        journal.write_line(header)?;
        Ok(journal)
    }

    /// Opens a journal to go on with it.
    ///
    /// # Errors
    ///
    /// [`JournalError`]; of a damaged line its number. With `repair`, the damaged rest is dropped
    /// after the whole file has been copied beside itself.
    pub fn resume(
        path: &Path,
        header: &Header,
        repair: bool,
    ) -> Result<(Self, Vec<Generation>), JournalError> {
        let bytes = std::fs::read(path).map_err(|e| io_error(path, e))?;
        let (found, generations, damage) = parse(path, &bytes)?;
        agree(path, &found, header)?;
        if let Some((error, whole_bytes)) = damage {
            if !repair {
                return Err(error);
            }
            keep_copy(path)?;
            let file = OpenOptions::new().write(true).open(path).map_err(|e| io_error(path, e))?;
            file.set_len(whole_bytes as u64).map_err(|e| io_error(path, e))?;
        }
        let file = OpenOptions::new().append(true).open(path).map_err(|e| io_error(path, e))?;
        Ok((Self { path: path.to_owned(), file }, generations))
    }

    /// Adds a generation: one line, written at once.
    ///
    /// # Errors
    ///
    /// [`JournalError::Io`].
    pub fn add(&mut self, generation: &Generation) -> Result<(), JournalError> {
        self.write_line(generation)
    }

    fn write_line(&mut self, value: &impl Serialize) -> Result<(), JournalError> {
        let mut line = serde_json::to_vec(value).map_err(|e| io_error(&self.path, e.into()))?;
        line.push(b'\n');
        self.file
            .write_all(&line)
            .and_then(|()| self.file.flush())
            .map_err(|e| io_error(&self.path, e))
    }
}

fn io_error(path: &Path, source: io::Error) -> JournalError {
    JournalError::Io { path: path.to_owned(), source }
}

/// Copies a damaged journal to `.damaged`, or `.damaged-2` and so on: a second repair keeps the
/// copy of the first.
fn keep_copy(path: &Path) -> Result<(), JournalError> {
    let mut copy = path.as_os_str().to_owned();
    copy.push(".damaged");
    let mut free = PathBuf::from(&copy);
    for number in 2.. {
        if !free.exists() {
            break;
        }
        let mut next = copy.clone();
        next.push(format!("-{number}"));
        free = next.into();
    }
    std::fs::copy(path, free).map(|_| ()).map_err(|e| io_error(path, e))
}

type Damage = Option<(JournalError, usize)>;

/// Header, whole generations, and the first damage with the bytes before it.
fn parse(path: &Path, bytes: &[u8]) -> Result<(Header, Vec<Generation>, Damage), JournalError> {
    let damaged = |line: usize, what: String| JournalError::Damaged {
        path: path.to_owned(),
        line,
        what,
        whole: line.saturating_sub(2),
    };
    let mut lines = bytes.split_inclusive(|&b| b == b'\n').enumerate();
    let header =
        match lines.next().map(|(_, line)| (line.ends_with(b"\n"), serde_json::from_slice(line))) {
            Some((true, Ok(header))) => header,
            Some((true, Err(error))) => {
                return Err(headless(path, &format!("no journal header ({error})")));
            }
            Some((false, _)) => return Err(headless(path, "cut off")),
            None => return Err(headless(path, "missing: the file is empty")),
        };
    let mut generations: Vec<Generation> = Vec::new();
    let mut whole_bytes = bytes.iter().position(|&b| b == b'\n').map_or(0, |i| i + 1);
    for (index, line) in lines {
        let what = match serde_json::from_slice::<Generation>(line) {
            _ if !line.ends_with(b"\n") => format!("cut off after {} bytes", line.len()),
            Err(error) => format!("no generation ({error})"),
            Ok(found) if found.generation as usize != generations.len() => {
                format!("generation {} where {} was expected", found.generation, generations.len())
            }
            Ok(found) => {
                generations.push(found);
                whole_bytes += line.len();
                continue;
            }
        };
        return Ok((header, generations, Some((damaged(index + 1, what), whole_bytes))));
    }
    Ok((header, generations, None))
}

/// Without its first line a journal tells nothing, and there is nothing to repair.
fn headless(path: &Path, what: &str) -> JournalError {
    let what = format!(
        "line 1 is {what}; begin anew with `echoloop tune --config` and the run's config.toml"
    );
    JournalError::Other { path: path.to_owned(), what }
}

/// A search may only go on as it began.
fn agree(path: &Path, found: &Header, expected: &Header) -> Result<(), JournalError> {
    let differ = |what: String| Err(JournalError::Other { path: path.to_owned(), what });
    if found.journal != expected.journal {
        return differ(format!(
            "journal format {}, this program writes {}",
            found.journal, expected.journal
        ));
    }
    if found.link_schema != expected.link_schema || found.program != expected.program {
        return differ(format!(
            "written by {} (link schema {}), this is {} ({}): its numbers would not go on",
            found.program, found.link_schema, expected.program, expected.link_schema
        ));
    }
    let other = |axis: &&String| !expected.axes.contains(axis);
    let same_config = is_same(&found.config, &expected.config);
    if let Some(axis) = found.axes.iter().find(other).filter(|_| same_config) {
        return differ(format!(
            "it searched {axis}, which this version does not; begin anew with \
             `echoloop tune --config` and the run's config.toml"
        ));
    }
    if !same_config || found.axes != expected.axes || found.population != expected.population {
        return differ(
            "written with another configuration; resume with the run's own config.toml".into(),
        );
    }
    Ok(())
}

/// Whether two documents say the same, be a number written `20` or `20.0`: earlier journals have
/// the latter for counts.
fn is_same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) if a.is_f64() != b.is_f64() => {
            a.as_f64() == b.as_f64()
        }
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_same(a, b))
        }
        (Value::Object(a), Value::Object(b)) => {
            let also = |(key, a): (&String, &Value)| b.get(key).is_some_and(|b| is_same(a, b));
            a.len() == b.len() && a.iter().all(also)
        }
        _ => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        Header {
            journal: FORMAT,
            program: "echoloop 0".into(),
            link_schema: "0x1".into(),
            axes: vec!["lidar.power".into()],
            population: 2,
            config: serde_json::json!({"seed": 1}),
        }
    }

    fn generation(number: u32) -> Generation {
        let candidate = CandidateRecord {
            point: vec![0.1 + 0.2],
            values: Values::from([("lidar.power".into(), 1.0 / 3.0)]),
            repaired: vec![],
            settings: 7,
            errors: vec![],
            fitness: 1e-300,
        };
        Generation {
            generation: number,
            pairs: vec![1, 2],
            mean: vec![0.5],
            deviations: vec![0.2],
            sigma: 0.2,
            candidates: vec![candidate.clone(), candidate],
        }
    }

    fn written(folder: &Path) -> PathBuf {
        let path = folder.join("history.jsonl");
        let mut journal = Journal::create(&path, &header()).unwrap();
        (0..3).for_each(|i| journal.add(&generation(i)).unwrap());
        path
    }

    #[test]
    fn what_was_written_reads_back_bit_for_bit_and_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let (mut journal, generations) = Journal::resume(&path, &header(), false).unwrap();
        assert_eq!(generations, [generation(0), generation(1), generation(2)]);
        journal.add(&generation(3)).unwrap();
        assert_eq!(Journal::resume(&path, &header(), false).unwrap().1.len(), 4);
    }

    #[test]
    fn what_was_repaired_reads_back_by_today_s_name_and_by_the_former_one() {
        let candidate = CandidateRecord {
            repaired: vec!["pulse_width".into()],
            ..generation(0).candidates.remove(0)
        };
        let line = serde_json::to_string(&candidate).unwrap();
        assert!(line.contains(r#""repaired":["pulse_width"]"#), "{line}");
        for line in [line.clone(), line.replace("repaired", "mended")] {
            assert_eq!(serde_json::from_str::<CandidateRecord>(&line).unwrap(), candidate);
        }
    }

    #[test]
    fn a_journal_is_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        assert!(matches!(Journal::create(&path, &header()), Err(JournalError::Io { .. })));
    }

    #[test]
    fn a_cut_line_is_named_and_nothing_is_touched_without_repair() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let whole = std::fs::read(&path).unwrap();
        let cut = &whole[..whole.len() - 20];
        std::fs::write(&path, cut).unwrap();
        let error = Journal::resume(&path, &header(), false).unwrap_err().to_string();
        assert!(
            error.contains("line 4 is cut off") && error.contains("the 2 generations before it"),
            "{error}"
        );
        assert_eq!(std::fs::read(&path).unwrap(), cut);
        let (_, generations) = Journal::resume(&path, &header(), true).unwrap();
        assert_eq!(generations.len(), 2);
        assert_eq!(std::fs::read(folder.path().join("history.jsonl.damaged")).unwrap(), cut);
        assert!(Journal::resume(&path, &header(), false).is_ok());
    }

    #[test]
    fn a_journal_with_counts_written_as_20_0_goes_on_and_one_with_another_count_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let text = std::fs::read_to_string(&path).unwrap();
        let with = |config: Value| Header { config, ..header() };
        let of = |count: &str| {
            let earlier = format!(r#""config":{{"seed":1,"registration":{{"n":[{count}]}}}}"#);
            std::fs::write(&path, text.replace(r#""config":{"seed":1}"#, &earlier)).unwrap();
            let now = with(serde_json::json!({"registration": {"n": [20]}, "seed": 1}));
            Journal::resume(&path, &now, false).is_ok()
        };
        assert!(of("20.0") && of("20"));
        assert!(!of("21.0") && !of("20.5") && !of("20.0,1") && !of(r#""20""#));
    }

    #[test]
    fn a_journal_of_another_search_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let other = Header { config: serde_json::json!({"seed": 2}), ..header() };
        let error = Journal::resume(&path, &other, true).unwrap_err().to_string();
        assert!(error.contains("another configuration"), "{error}");
        let renamed = Header { axes: vec!["lidar.energy".into()], ..header() };
        let error = Journal::resume(&path, &renamed, true).unwrap_err().to_string();
        assert!(error.contains("it searched lidar.power"), "{error}");
        std::fs::write(&path, b"").unwrap();
        assert!(
            Journal::resume(&path, &header(), false).unwrap_err().to_string().contains("empty")
        );
    }
}
