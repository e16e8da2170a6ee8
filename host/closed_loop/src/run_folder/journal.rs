//! Journal of a search: one JSON line a generation, enough to resume from.
//!
//! The first line identifies the search; each further line is a generation with every candidate,
//! its values, its errors and its fitness. The optimiser's state is a function of the fitness
//! values it was told, so a resumed search tells it again.
//!
//! ```text
//! {"journal":4, …,"check":"995dc9bbdf1939fa"}      line 1
//! {"generation":0, …,"check":"…"}                  line 2
//! ```
//!
//! A line's last member is the checksum of the previous checksum and of the line up to it. It
//! reveals a line that is changed, lost, doubled, moved or of another run. A generation is on the
//! disk before the search goes on: [`Journal::add`] returns once the system has confirmed it.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use echoloop_files::one_line;
use echoloop_link::settings_hash;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

use crate::checksum::Checksum;
use crate::cost::ScanCost;
use crate::dataset::fingerprint::Content;
use crate::evaluation::objective::PairError;
use crate::parameters::{Parameters, Space, Values, written_values};
use crate::run_folder::files::{
    FileError, PART, begin_part, beside, file_error, open_own, replace, settle_part, sync_folder_of,
};

/// First line: identity of the search.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Version of this format.
    pub journal: u32,
    /// Version of the program.
    pub program: String,
    /// Checksum of the program's file, where it can be read.
    pub build: Option<String>,
    /// Schema of the link, hexadecimal.
    pub link_schema: String,
    /// Kind of the sensor, and name and version of its firmware.
    pub sensor: String,
    /// The whole configuration.
    pub config: Value,
    /// The axes searched, in the cube's order.
    pub axes: Vec<String>,
    /// Checksums of the scans, the scene and the sensor.
    pub content: Content,
}

/// Version of the journal's format. Lines of format 1 had no checksums, those of format 2 no stage,
/// the first of format 3 no sensor.
pub const FORMAT: u32 = 4;

/// Candidate of a generation.
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
    pub repaired: Vec<String>,
    /// Hash of its settings, as the sensor named them.
    pub settings: u32,
    /// Error of each pair of the generation.
    pub errors: Vec<PairError>,
    /// Fitness that the optimiser was told.
    pub fitness: f64,
    /// Cost of a scan, in a search for a front.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<ScanCost>,
}

impl CandidateRecord {
    /// Parameters of the candidate at a point, and its record before any scan.
    pub fn drawn(space: &Space, point: Vec<f64>) -> (Parameters, Self) {
        let (parameters, repaired) = space.parameters(&point);
        let record = Self {
            point,
            values: space.values(&parameters),
            repaired: repaired.into_iter().map(str::to_owned).collect(),
            settings: settings_hash(&parameters.settings),
            errors: Vec::new(),
            fitness: f64::NAN,
            cost: None,
        };
        (parameters, record)
    }
}

/// Generation of a search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Generation {
    /// Its number, from 0.
    pub generation: u32,
    /// Stage of the search: `registration`, `lidar`, `joint` or `front`.
    pub stage: String,
    /// Training pairs that its candidates were scanned on.
    pub pairs: Vec<usize>,
    /// Mean of the distribution that its candidates were drawn from, in the cube; empty for a
    /// front, whose search has no distribution.
    pub mean: Vec<f64>,
    /// Standard deviations of that distribution, in the cube; empty for a front.
    pub deviations: Vec<f64>,
    /// Step size; 0 for a front.
    pub sigma: f64,
    /// Its candidates.
    pub candidates: Vec<CandidateRecord>,
}

/// Unusable journal.
#[derive(Debug, Error)]
pub enum JournalError {
    /// File error.
    #[error(transparent)]
    File(#[from] FileError),
    /// Damaged line.
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
        /// Fault.
        what: String,
        /// Whole generations before it.
        whole: usize,
    },
    /// Journal of another search.
    #[error("{}: {what}", path.display())]
    Other {
        /// The journal.
        path: PathBuf,
        /// Difference.
        what: String,
    },
}

/// Open journal.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    /// Checksum of the last line.
    check: String,
    /// Bytes of whole lines.
    length: u64,
}

impl Journal {
    /// Creates a journal with its first line, or none.
    ///
    /// # Errors
    ///
    /// [`JournalError::File`]; an existing journal is never overwritten.
    pub fn create(path: &Path, header: &Header) -> Result<Self, JournalError> {
        if fs::symlink_metadata(path).is_ok() {
            return Err(file_error("begin", path)(io::ErrorKind::AlreadyExists.into()).into());
        }
        let part = beside(path, PART);
        let file = begin_part(&part)?;
        let check = String::new();
        let mut journal = Self { path: part.clone(), file, check, length: 0 };
        journal.write_line(header)?;
        settle_part(&journal.file, &part, path)?;
        Ok(Self { path: path.to_owned(), ..journal })
    }

    /// Checks before any work that a journal can be resumed: it is whole, or `repair` is allowed.
    ///
    /// # Errors
    ///
    /// [`JournalError`], as far as the journal alone tells.
    pub fn check(path: &Path, repair: bool) -> Result<(), JournalError> {
        match read(path)? {
            _ if repair => Ok(()),
            bytes => parse(path, &bytes)?.damage.map_or(Ok(()), Err),
        }
    }

    /// Reads a whole journal.
    ///
    /// # Errors
    ///
    /// [`JournalError`] with the number of a damaged line.
    pub fn read(path: &Path) -> Result<(Header, Vec<Generation>), JournalError> {
        let found = parse(path, &read(path)?)?;
        found.damage.map_or(Ok((found.header, found.generations)), Err)
    }

    /// Opens a journal to append to it.
    ///
    /// With `repair`, the damaged rest is dropped, and a damaged first line is rewritten when the
    /// checksum of a later line confirms it. The whole file is copied beside itself first.
    ///
    /// # Errors
    ///
    /// [`JournalError`] with the number of a damaged line.
    pub fn resume(
        path: &Path,
        header: &Header,
        repair: bool,
    ) -> Result<(Self, Vec<Generation>), JournalError> {
        let bytes = read(path)?;
        let found = match parse(path, &bytes) {
            Err(error) if repair => with_expected_header(path, &bytes, header).ok_or(error)?,
            found => found?,
        };
        check_header(path, &found.header, header)?;
        if let Some(error) = found.damage {
            if !repair {
                return Err(error);
            }
            keep_copy(path, &bytes)?;
            replace(path, &found.whole)?;
        }
        let mut file = open_own(path, OpenOptions::new().read(true).write(true))?;
        let length = file.seek(io::SeekFrom::End(0)).map_err(file_error("read", path))?;
        Ok((Self { path: path.to_owned(), file, check: found.check, length }, found.generations))
    }

    /// Appends a generation: one line, on the disk when this returns.
    ///
    /// # Errors
    ///
    /// [`JournalError`]; the lines before it stay whole.
    pub fn add(&mut self, generation: &Generation) -> Result<(), JournalError> {
        self.write_line(generation)
    }

    fn write_line(&mut self, value: &impl Serialize) -> Result<(), JournalError> {
        let (line, check) = sealed(&self.check, value)
            .map_err(|error| file_error("write", &self.path)(error.into()))?;
        if let Err(error) = self.file.write_all(&line).and_then(|()| self.file.sync_data()) {
            let _ = self.file.set_len(self.length); // a full disk leaves no half line
            return Err(file_error("write", &self.path)(error).into());
        }
        self.check = check;
        self.length += line.len() as u64;
        Ok(())
    }
}

/// Bytes before a line's checksum, and after it.
const SEAL: (&[u8], &[u8]) = (b",\"check\":\"", b"\"}\n");

/// Most bytes of a header: a configuration has at most [`echoloop_files::MOST_TEXT`], and takes up
/// to twenty times as many in JSON.
const MOST_HEADER: usize = 2 << 20;

/// Digits of a checksum.
const DIGITS: usize = 16;

/// Line with its checksum, and the checksum alone.
fn sealed(before: &str, value: &impl Serialize) -> serde_json::Result<(Vec<u8>, String)> {
    Ok(sealed_line(before, serde_json::to_vec(value)?))
}

fn sealed_line(before: &str, mut line: Vec<u8>) -> (Vec<u8>, String) {
    line.pop(); // the brace that closes it
    let check = Checksum::of(&[before.as_bytes(), &line]).to_string();
    for piece in [SEAL.0, check.as_bytes(), SEAL.1] {
        line.extend(piece);
    }
    (line, check)
}

/// Journal of any lines with valid checksums, to test its reader with.
pub fn sealed_lines<'a>(lines: impl Iterator<Item = &'a [u8]>) -> Vec<u8> {
    let (mut journal, mut before) = (Vec::new(), String::new());
    for line in lines {
        let (line, check) = sealed_line(&before, line.to_vec());
        journal.extend(line);
        before = check;
    }
    journal
}

/// Number of whole generations in the bytes of a journal.
///
/// # Errors
///
/// [`JournalError`] when its first line is no header.
pub fn whole_generations(bytes: &[u8]) -> Result<usize, JournalError> {
    parse(Path::new("any"), bytes).map(|found| found.generations.len())
}

/// JSON of a whole line, and its checksum. The error says what is wrong with the line.
fn unsealed(before: &str, line: &[u8]) -> Result<(Vec<u8>, String), String> {
    if !line.ends_with(b"\n") {
        return Err(format!("cut off after {} bytes", line.len()));
    }
    let parts = line.strip_suffix(SEAL.1).and_then(|line| line.split_last_chunk::<DIGITS>());
    let parts = parts.and_then(|(rest, check)| Some((rest.strip_suffix(SEAL.0)?, check)));
    let (body, check) = parts.ok_or("without a checksum at its end")?;
    let computed = Checksum::of(&[before.as_bytes(), body]).to_string();
    if computed.as_bytes() != check {
        return Err("damaged, or not the one that followed the line before it: \
                    its checksum differs"
            .into());
    }
    Ok(([body, b"}"].concat(), computed))
}

/// Creates the first free file `PATH.ending`, `PATH.ending-2` and so on.
fn free_file(path: &Path, ending: &str) -> io::Result<(PathBuf, File)> {
    let mut number = 1;
    loop {
        let ending = if number == 1 { ending.to_owned() } else { format!("{ending}-{number}") };
        let free = beside(path, &ending);
        match OpenOptions::new().write(true).create_new(true).open(&free) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
            opened => return opened.map(|file| (free, file)),
        }
    }
}

/// Writes a copy under a free name beside a path.
fn copy_beside(bytes: &[u8], path: &Path, ending: &str) -> io::Result<PathBuf> {
    let (free, mut copy) = free_file(path, ending)?;
    copy.write_all(bytes)?;
    copy.sync_all()?;
    Ok(free)
}

/// Copies a damaged journal. A second repair keeps the copy of the first.
fn keep_copy(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    copy_beside(bytes, path, ".damaged").map_err(file_error("copy", path))?;
    sync_folder_of(path)
}

/// Content of a journal.
#[derive(Default)]
struct Found {
    header: Header,
    generations: Vec<Generation>,
    /// Checksum of the last whole line.
    check: String,
    /// Bytes of the whole lines.
    whole: Vec<u8>,
    /// Error of the first line that is not whole.
    damage: Option<JournalError>,
}

/// Bytes of a journal.
fn read(path: &Path) -> Result<Vec<u8>, FileError> {
    let mut bytes = Vec::new();
    let mut file = open_own(path, OpenOptions::new().read(true))?;
    file.read_to_end(&mut bytes).map_err(file_error("read", path))?;
    Ok(bytes)
}

fn parse(path: &Path, bytes: &[u8]) -> Result<Found, JournalError> {
    let mut lines = bytes.split_inclusive(|&byte| byte == b'\n');
    let first = lines.next().ok_or_else(|| headless(path, "missing: the file is empty"))?;
    let (header, check) = read_header(path, first)?;
    let mut found = Found { header, check, whole: first.to_vec(), ..Found::default() };
    found.damage = lines.find_map(|line| found.take(line).err()).map(|what| {
        let whole = found.generations.len();
        JournalError::Damaged { path: path.to_owned(), line: whole + 2, what, whole }
    });
    Ok(found)
}

/// Content of a journal whose first line is damaged. `None` unless a later line's checksum shows
/// that it followed the expected first line.
fn with_expected_header(path: &Path, bytes: &[u8], expected: &Header) -> Option<Found> {
    let (whole, check) = sealed("", expected).ok()?;
    let mut lines = bytes.split_inclusive(|&byte| byte == b'\n');
    let mut found = Found { header: expected.clone(), check, whole, ..Found::default() };
    lines.find(|line| found.take(line).is_ok())?;
    lines.find(|line| found.take(line).is_err());
    let what = "damaged".to_owned();
    found.damage = Some(JournalError::Damaged { path: path.to_owned(), line: 1, what, whole: 0 });
    Some(found)
}

/// Header and its checksum.
fn read_header(path: &Path, line: &[u8]) -> Result<(Header, String), JournalError> {
    if line.len() > MOST_HEADER {
        return Err(headless(path, &format!("longer than {} MB", MOST_HEADER >> 20)));
    }
    let format = serde_json::from_slice::<Value>(line).ok();
    let format = format.as_ref().and_then(|header| header.get("journal")?.as_u64());
    if let Some(other) = format.filter(|format| *format != u64::from(FORMAT)) {
        let what = format!(
            "of journal format {other}, and this program goes on with format {FORMAT} alone, which \
             has checksums"
        );
        return Err(headless(path, &what));
    }
    let (json, check) = unsealed("", line).map_err(|what| headless(path, &what))?;
    let header = serde_json::from_slice(&json).map_err(|error| {
        headless(path, &format!("no journal header ({})", one_line(&error.to_string())))
    })?;
    Ok((header, check))
}

impl Found {
    /// Takes the next line. The error says what is wrong with it.
    fn take(&mut self, line: &[u8]) -> Result<(), String> {
        let (json, check) = unsealed(&self.check, line)?;
        let generation: Generation = serde_json::from_slice(&json)
            .map_err(|error| format!("no generation ({})", one_line(&error.to_string())))?;
        let (number, expected) = (generation.generation, self.generations.len());
        if number as usize != expected {
            return Err(format!("generation {number} where {expected} was expected"));
        }
        self.generations.push(generation);
        self.check = check;
        self.whole.extend(line);
        Ok(())
    }
}

/// Error of a damaged first line. Only a caller that knows the expected header can repair it.
fn headless(path: &Path, what: &str) -> JournalError {
    let what = format!(
        "line 1 is {what}; if it was this search's, --repair writes it anew and goes on, else \
         {BEGIN_ANEW}"
    );
    JournalError::Other { path: path.to_owned(), what }
}

const BEGIN_ANEW: &str = "begin anew with `echoloop tune --config` and the run's config.toml";

/// Refuses a journal whose header differs from the expected one.
fn check_header(path: &Path, found: &Header, expected: &Header) -> Result<(), JournalError> {
    let json = |header: &Header| {
        // `extended_to` moves the end of a run and changes no generation before it.
        let mut header = header.clone();
        if let Some(tune) = header.config.get_mut("tune").and_then(Value::as_object_mut) {
            tune.remove("extended_to");
        }
        serde_json::to_value(header).map_err(|error| file_error("compare", path)(error.into()))
    };
    let Some((field, was, is)) = difference("", &json(found)?, &json(expected)?) else {
        return Ok(());
    };
    let advice = match field.split('.').next() {
        Some("config" | "axes" | "population") => {
            "written with another configuration; resume with the run's own config.toml".to_owned()
        }
        Some("sensor") => {
            format!("resume with that sensor (--sensor, --front-end), or {BEGIN_ANEW}")
        }
        Some("content") => {
            format!("what is scanned has changed since: put it back, or {BEGIN_ANEW}")
        }
        _ => format!("written by another build, whose numbers would not go on; {BEGIN_ANEW}"),
    };
    let [field, was, is] = [field, was, is].map(|text| one_line(&text));
    let what = format!("line 1: {field} is {was} there and {is} now: {advice}");
    Err(JournalError::Other { path: path.to_owned(), what })
}

/// First field that differs between two documents, and both values.
fn difference(field: &str, a: &Value, b: &Value) -> Option<(String, String, String)> {
    let name = |key: &str| match field {
        "" => key.to_owned(),
        _ => format!("{field}.{key}"),
    };
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            let null = Value::Null;
            let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
            keys.map(|key| (key, a.get(key).unwrap_or(&null), b.get(key).unwrap_or(&null)))
                .find_map(|(key, a, b)| difference(&name(key), a, b))
        }
        _ if a == b => None,
        _ => Some((field.to_owned(), a.to_string(), b.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        Header {
            journal: FORMAT,
            program: "echoloop 0".into(),
            build: Some("b0".into()),
            link_schema: "0x1".into(),
            sensor: "in-process, a 0".into(),
            axes: vec!["lidar.power".into()],
            config: serde_json::json!({"seed": 1}),
            content: Content::default(),
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
            cost: None,
        };
        Generation {
            generation: number,
            stage: "joint".into(),
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
    fn a_journal_reads_back_bit_for_bit_and_can_be_appended_to() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let (mut journal, generations) = Journal::resume(&path, &header(), false).unwrap();
        assert_eq!(generations, [generation(0), generation(1), generation(2)]);
        journal.add(&generation(3)).unwrap();
        assert_eq!(Journal::resume(&path, &header(), false).unwrap().1.len(), 4);
    }

    #[test]
    fn a_journal_is_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        assert!(matches!(Journal::create(&path, &header()), Err(JournalError::File(_))));
    }

    #[test]
    fn a_cut_line_is_named_and_nothing_is_touched_without_repair() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let whole = fs::read(&path).unwrap();
        let cut = &whole[..whole.len() - 20];
        fs::write(&path, cut).unwrap();
        let error = Journal::resume(&path, &header(), false).unwrap_err().to_string();
        assert!(
            error.contains("line 4 is cut off") && error.contains("the 2 generations before it"),
            "{error}"
        );
        assert_eq!(fs::read(&path).unwrap(), cut);
        let (_, generations) = Journal::resume(&path, &header(), true).unwrap();
        assert_eq!(generations.len(), 2);
        assert_eq!(fs::read(folder.path().join("history.jsonl.damaged")).unwrap(), cut);
        assert!(Journal::resume(&path, &header(), false).is_ok());
    }

    #[test]
    fn a_journal_of_another_search_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let refused = |other: Header, parts: [&str; 2]| {
            let error = Journal::resume(&path, &other, true).unwrap_err().to_string();
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        };
        refused(
            Header { config: serde_json::json!({"seed": 2}), ..header() },
            ["line 1: config.seed is 1 there and 2 now", "another configuration"],
        );
        refused(
            Header { axes: vec!["lidar.energy".into()], ..header() },
            [r#"line 1: axes is ["lidar.power"] there"#, "another configuration"],
        );
        let content = Content { scans: "5".into(), ..Content::default() };
        refused(Header { content, ..header() }, ["line 1: content.scans", "put it back"]);
        refused(
            Header { sensor: "serial, a 0".into(), ..header() },
            ["line 1: sensor is \"in-process, a 0\" there and \"serial, a 0\" now", "--sensor"],
        );
        refused(
            Header { build: None, ..header() },
            [r#"line 1: build is "b0" there and null now"#, "another build"],
        );
        let long = serde_json::json!({"seed": 1, "scene": "x".repeat(5_000)});
        let error = Journal::resume(&path, &Header { config: long, ..header() }, true);
        let error = error.unwrap_err().to_string();
        assert!(error.contains("config.scene is null there") && error.len() < 1_000, "{error}");
        fs::write(&path, b"").unwrap();
        assert!(
            Journal::resume(&path, &header(), false).unwrap_err().to_string().contains("empty")
        );
    }

    /// The journal's lines.
    fn lines(path: &Path) -> Vec<String> {
        let text = fs::read_to_string(path).unwrap();
        text.split_inclusive('\n').map(str::to_owned).collect()
    }

    #[test]
    fn after_any_flipped_bit_only_the_lines_before_it_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let whole = fs::read(&path).unwrap();
        for bit in 0..8 * whole.len() {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let line = whole[..bit / 8].iter().filter(|&&byte| byte == b'\n').count();
            match parse(&path, &bytes) {
                Err(_) => assert_eq!(line, 0, "bit {bit}"),
                Ok(found) => {
                    assert!(found.damage.is_some() && line > 0, "bit {bit}");
                    assert_eq!(found.generations.len(), line - 1, "bit {bit}");
                }
            }
        }
    }

    #[test]
    fn lines_that_are_lost_doubled_swapped_or_of_another_run_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let [head, a, b, c] = <[String; 4]>::try_from(lines(&path)).unwrap();
        // Another run of the same search, on a sensor with noise of its own.
        let other_path = folder.path().join("other.jsonl");
        let mut other = Journal::create(&other_path, &header()).unwrap();
        let mut noisy = generation(0);
        noisy.candidates[0].fitness = 2e-300;
        other.add(&noisy).unwrap();
        other.add(&generation(1)).unwrap();
        let foreign = lines(&other_path)[2].clone();
        for (damaged, line) in [
            ([&head, &b, &c, ""], 2),
            ([&head, &a, &c, ""], 3),
            ([&head, &a, &a, &b], 3),
            ([&head, &b, &a, &c], 2),
            ([&head, &a, &foreign, &c], 3),
            ([&head, &a, "\n", &b], 3),
        ] {
            fs::write(&path, damaged.concat()).unwrap();
            let error = Journal::resume(&path, &header(), false).unwrap_err().to_string();
            assert!(error.contains(&format!("line {line} is ")), "{line}: {error}");
        }
    }

    #[test]
    fn a_damaged_first_line_is_rewritten_where_the_next_checksum_confirms_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let whole = fs::read(&path).unwrap();
        for damage in [&b"*"[..], b"\n", b"\n\n"] {
            let mut bytes = whole.clone();
            bytes.splice(30..30 + damage.len(), damage.iter().copied());
            fs::write(&path, &bytes).unwrap();
            assert!(Journal::resume(&path, &header(), false).is_err());
            let other = Header { program: "another".into(), ..header() };
            assert!(Journal::resume(&path, &other, true).is_err());
            assert_eq!(fs::read(&path).unwrap(), bytes);
            assert_eq!(Journal::resume(&path, &header(), true).unwrap().1.len(), 3);
            assert_eq!(fs::read(&path).unwrap(), whole);
        }
    }

    #[test]
    fn a_journal_without_checksums_says_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.jsonl");
        fs::write(&path, "{\"journal\":1,\"program\":\"echoloop 0\"}\n").unwrap();
        let error = Journal::resume(&path, &header(), true).unwrap_err().to_string();
        for part in ["line 1 is of journal format 1", "begin anew with `echoloop tune --config`"] {
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn a_first_line_longer_than_any_configuration_is_refused_unparsed() {
        let long = [&b"{\"journal\":"[..], &b"[".repeat(MOST_HEADER)].concat();
        let error = whole_generations(&long).unwrap_err().to_string();
        assert!(error.contains("line 1 is longer than 2 MB"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn a_journal_that_is_a_link_is_not_resumed() {
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (written(folder.path()), folder.path().join("link"));
        std::os::unix::fs::symlink(path, &link).unwrap();
        let error = Journal::resume(&link, &header(), true).unwrap_err().to_string();
        assert!(error.contains("a link is in the way"), "{error}");
    }
}
