//! Damaged journals of an interrupted search: resuming is refused, or ends exactly as the
//! undamaged search.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;
use std::sync::atomic::AtomicBool;

use echoloop_closed_loop::config::{RunConfig, load};
use echoloop_closed_loop::dataset::Dataset;
use echoloop_closed_loop::evaluation::objective::Bench;
use echoloop_closed_loop::parameters::{Parameters, Space};
use echoloop_closed_loop::run_folder::journal::{Generation, Journal};
use echoloop_closed_loop::search::{Silent, TuneSearch, Tuned};
use echoloop_sensors::sensor::{Model, Sensors};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::campaign::{Campaign, Verdict};
use crate::damage::accident;

/// Generations of the whole search, and of the interrupted one.
const GENERATIONS: [usize; 2] = [5, 3];

static NEVER: AtomicBool = AtomicBool::new(false);

/// A search that takes milliseconds.
struct Subject {
    config: RunConfig,
    dataset: Dataset,
    sensors: Sensors,
}

/// Result of the whole search.
struct Whole {
    journal: Vec<u8>,
    tuned: Tuned,
}

/// Data shared by all cases.
struct Stage {
    subject: Subject,
    whole: Whole,
    /// Lines of the interrupted search's journal, header first.
    half: Vec<Vec<u8>>,
    /// Journals to take foreign lines from: with other errors below the same header, and of another
    /// seed.
    foreign: [Vec<Vec<u8>>; 2],
}

static STAGE: LazyLock<Stage> = LazyLock::new(|| {
    let subject = Subject::new(1);
    let whole = subject.whole();
    let lines = lines(&whole.journal);
    let half = lines[..=GENERATIONS[1]].to_vec();
    let foreign = [subject.noisy(&whole.tuned.generations), Subject::new(2).whole().journal];
    Stage { foreign: foreign.map(|journal| self::lines(&journal)), subject, whole, half }
});

fn lines(journal: &[u8]) -> Vec<Vec<u8>> {
    journal.split_inclusive(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect()
}

impl Subject {
    fn new(seed: u64) -> Self {
        let small = [
            "scene.towns=[1]",
            "scanner.pattern=grid",
            "scanner.columns=16",
            "scanner.rows=6",
            "data.train_pairs=2",
            "data.test_pairs=1",
            "tune.generations=5",
            "tune.population=3",
            "tune.pairs_per_generation=1",
            "tune.shortlist=1",
        ];
        let overrides = small.into_iter().map(str::to_owned).chain([format!("seed={seed}")]);
        let overrides: Vec<_> = overrides.map(|text| text.parse().expect("an override")).collect();
        let config = load(None, &overrides).expect("a configuration");
        assert_eq!(config.tune.generations as usize, GENERATIONS[0]);
        let dataset = Dataset::build(&config, &|_, _| ()).expect("a town");
        let sensors = Sensors::in_process(Model::from(&config));
        Self { config, dataset, sensors }
    }

    fn search(&self) -> TuneSearch<'_> {
        let (tune, preset) = (&self.config.tune, self.config.registration.preset);
        let start = Parameters::start(&self.config, &self.config.device()).expect("a start");
        let space = Space::new(tune.protocol, tune.lidar, preset, start, self.config.device());
        let bench = Bench { dataset: &self.dataset, sensors: &self.sensors };
        TuneSearch {
            config: &self.config,
            bench,
            space,
            start,
            warm_starts: Vec::new(),
            stop: &NEVER,
            elsewhere: None,
        }
    }

    /// Runs the whole search.
    fn whole(&self) -> Whole {
        let (folder, search) = (tempfile::tempdir().expect("a folder"), self.search());
        let path = folder.path().join("history.jsonl");
        let mut journal = Journal::create(&path, &search.header()).expect("a journal");
        let tuned = search.run(&mut journal, Vec::new(), &Silent).expect("a search");
        Whole { journal: fs::read(path).expect("a journal"), tuned }
    }

    /// A whole journal with other errors below the same header.
    fn noisy(&self, generations: &[Generation]) -> Vec<u8> {
        let noise = |generation: &Generation| {
            let mut noisy = generation.clone();
            noisy.candidates.iter_mut().for_each(|candidate| candidate.fitness *= 1.01);
            noisy
        };
        self.sealed(&generations.iter().map(noise).collect::<Vec<_>>())
    }

    /// A journal of some generations, with right checksums.
    fn sealed(&self, generations: &[Generation]) -> Vec<u8> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("history.jsonl");
        let mut journal = Journal::create(&path, &self.search().header()).expect("a journal");
        generations.iter().for_each(|generation| journal.add(generation).expect("a line"));
        fs::read(path).expect("a journal")
    }

    /// Resumes from a journal's file.
    fn resumed(&self, path: &Path, repair: bool) -> Result<Tuned, String> {
        let search = self.search();
        let (mut journal, done) = Journal::resume(path, &search.header(), repair)
            .map_err(|error| format!("reading: {error}"))?;
        search.run(&mut journal, done, &Silent).map_err(|error| format!("replaying: {error}"))
    }
}

/// The interrupted search's journal after an accident to its bytes or lines.
fn damaged(rng: &mut ChaCha8Rng, stage: &Stage) -> Vec<u8> {
    let mut lines = stage.half.clone();
    let [one, other] = [0, 1].map(|_| rng.random_range(0..lines.len()));
    let foreign = &stage.foreign[rng.random_range(0..2)];
    match rng.random_range(0..12) {
        0 => lines.swap(one, other),
        1 => lines.insert(one, lines[other].clone()),
        2 => drop(lines.remove(one)),
        3 => lines.truncate(one),
        4 => lines[one] = foreign[one].clone(),
        5 => lines.splice(one.., foreign[one..].iter().cloned()).for_each(drop),
        6 => lines[one] = digit(rng, &lines[one]),
        7 => lines.push(rubbish(rng)),
        8 => lines.push(stage.half[0].clone()),
        _ => return accident(rng, &lines.concat(), &foreign.concat()),
    }
    lines.concat()
}

/// A line with one digit changed; it stays JSON.
fn digit(rng: &mut ChaCha8Rng, line: &[u8]) -> Vec<u8> {
    let mut line = line.to_vec();
    let digits: Vec<usize> = (0..line.len()).filter(|&i| line[i].is_ascii_digit()).collect();
    let at = digits[rng.random_range(0..digits.len())];
    line[at] = b'0' + (line[at] - b'0' + rng.random_range(1..10)) % 10;
    line
}

fn rubbish(rng: &mut ChaCha8Rng) -> Vec<u8> {
    let kinds: [&[u8]; 6] = [b"\n", b"\0", b"{}\n", b"null\n", b" ", b"{\"generation\":3"];
    kinds[rng.random_range(0..kinds.len())].to_vec()
}

#[test]
fn a_damaged_journal_is_refused_or_leads_to_the_result_of_an_undamaged_one() {
    let stage = &*STAGE;
    Campaign { kind: "journal", cases: 200 }.run(|rng| {
        let bytes = damaged(rng, stage);
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        judge(stage, &folder.path().join("history.jsonl"), &bytes, rng.random())
    });
}

fn judge(stage: &Stage, path: &Path, bytes: &[u8], repair: bool) -> Verdict {
    fs::write(path, bytes).map_err(|error| error.to_string())?;
    let resumed = stage.subject.resumed(path, repair);
    let after = fs::read(path).map_err(|error| error.to_string())?;
    let lines = lines(bytes);
    // A damaged header is recognised by the line that follows it; one of another search is foreign.
    let is_ours = lines.first() == Some(&stage.half[0])
        || lines.contains(&stage.half[1]) && lines[0] != stage.foreign[1][0];
    let copy = fs::read(path.with_extension("jsonl.damaged")).ok();
    match resumed {
        Err(why) if after != bytes && copy.as_deref() != Some(bytes) => {
            Err(format!("refused, yet the damaged file is nowhere: {why}"))
        }
        // Lines of another run below the same header have right checksums; the search refuses them.
        Err(why) if repair && is_ours && why.starts_with("reading") => {
            Err(format!("not repaired: {why}"))
        }
        Err(_) => Ok("refused"),
        Ok(tuned) if after != stage.whole.journal || tuned != stage.whole.tuned => {
            Err(format!("SILENT: it went on to another end, with repair {repair}"))
        }
        Ok(_) if stage.whole.journal.starts_with(bytes) => Ok("whole lines, the same end"),
        Ok(_) if repair => Ok("repaired to the same end"),
        Ok(_) => Err("went on from a damaged journal without repair".into()),
    }
}

/// Changes a generation to one that the search would not have written.
fn forge(rng: &mut ChaCha8Rng, generation: &mut Generation) {
    let candidate = rng.random_range(0..generation.candidates.len());
    let one = &mut generation.candidates[candidate];
    match rng.random_range(0..16) {
        0 => generation.pairs[0] ^= 1,
        1 => generation.pairs.push(0),
        2 => generation.mean.clear(),
        3 => generation.mean[0] += 1e-9,
        4 => generation.deviations.truncate(1),
        5 => generation.sigma = 1e308,
        6 => generation.candidates.clear(),
        7 => generation.candidates.reverse(),
        8 => drop(generation.candidates.pop()),
        9 => one.point[0] = 0.123,
        10 => one.point.clear(),
        11 => one.values.clear(),
        12 => one.repaired.push("gain".into()),
        13 => one.settings ^= 1 << rng.random_range(0..32),
        14 => one.errors.clear(),
        _ => one.fitness = -1e300,
    }
}

#[test]
fn a_forged_generation_with_a_right_checksum_is_refused() {
    let stage = &*STAGE;
    Campaign { kind: "journal", cases: 200 }.run(|rng| {
        let mut generations = stage.whole.tuned.generations.clone();
        let at = rng.random_range(0..generations.len());
        forge(rng, &mut generations[at]);
        let bytes = stage.subject.sealed(&generations);
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let path = folder.path().join("history.jsonl");
        fs::write(&path, &bytes).map_err(|error| error.to_string())?;
        match stage.subject.resumed(&path, rng.random()) {
            Err(why) if why.contains(&format!("line {} of the journal", at + 2)) => Ok("refused"),
            Err(why) => Err(format!("line {} was forged: {why}", at + 2)),
            Ok(_) => Err(format!("line {} was forged, and it went on", at + 2)),
        }
    });
}
