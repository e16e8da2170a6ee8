//! Runs the cells in sequence. Scans that cells share are traced once, shared starts evaluated
//! once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::HumanDuration;

use super::super::choice::SensorChoice;
use super::super::exit::Failure;
use super::super::interrupt::INTERRUPTED;
use super::super::prepared::{all_pairs, connect};
use super::super::progress::Progress;
use super::super::report::write_page;
use echoloop_campaign::Unfinished;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::config::preset::Protocol;
use echoloop_closed_loop::dataset::Dataset;
use echoloop_closed_loop::dataset::fingerprint::{Content, build};
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::parameters::Parameters;
use echoloop_closed_loop::prepared::{Preparation, Prepared};
use echoloop_closed_loop::run_folder::journal::Journal;
use echoloop_closed_loop::run_folder::provenance::About;
use echoloop_closed_loop::run_folder::run::{HISTORY, RunFolder};
use echoloop_closed_loop::search::{Observer, Origin, TuneSearch};
use echoloop_closed_loop::tuning::{Judged, result, write_run};
use echoloop_study::{Base, Cell, Folder, Record, Times, Took, TrainedIn, configuration};

/// Greatest number of returns in the cache; beyond it the oldest scans are dropped.
const MAX_RETURNS: usize = 120_000_000;

/// Runner of the cells of a folder.
pub(super) struct Runner<'a> {
    base: &'a Base,
    folder: &'a Folder,
    progress: &'a Progress,
    stop: &'a AtomicBool,
    /// Cache of traced pairs with their key, oldest first.
    cache: Vec<(String, Dataset)>,
    times: Times,
}

/// Record of a finished cell, and the number of registrations made by this process.
type Finished = (Record, usize);

impl<'a> Runner<'a> {
    /// Runner for a folder, with the durations recorded there.
    pub(super) fn new(
        base: &'a Base,
        folder: &'a Folder,
        progress: &'a Progress,
        stop: &'a AtomicBool,
    ) -> Result<Self, Failure> {
        let times = folder.times()?;
        Ok(Self { base, folder, progress, stop, cache: Vec::new(), times })
    }

    /// Runs the unfinished cells. A failure is reported and recorded; the other cells go on.
    pub(super) fn run(&mut self, cells: &[Cell]) -> Result<(), Failure> {
        let unfinished = Unfinished::of(cells, |cell| match self.folder.record(cell) {
            Ok(record) => Some(record.is_some()),
            Err(error) => {
                self.progress.say(&format!("failed: {cell}: {error}"));
                None
            }
        });
        let left = unfinished.cells.iter().map(|cell| (**cell, self.registrations(cell)));
        let left: Vec<(Cell, usize)> = left.collect();
        let begun = Instant::now();
        let done = unfinished.done;
        self.progress.say(&format!("{} cells, {done} of them done before", cells.len()));
        unfinished.run(|index, place| self.run_first(&left[index..], place))?;
        if !left.is_empty() {
            self.progress.say(&format!(
                "{} cells took {}; all that are in the folder {}",
                left.len(),
                HumanDuration(begun.elapsed()),
                HumanDuration(Duration::from_secs_f64(self.times.seconds()))
            ));
        }
        Ok(())
    }

    /// Runs the first of the cells left, and saves its record or the reason of its failure.
    fn run_first(&mut self, left: &[(Cell, usize)], place: &str) -> Result<(), Failure> {
        let [(cell, registrations), ..] = left else { return Ok(()) };
        if self.stop.load(Ordering::Relaxed) {
            return Err(self.interrupted(left.len()));
        }
        let rest = self.times.of(left);
        let rest = rest.map_or("time left not known yet".into(), |rest| {
            format!("about {} left", HumanDuration(rest))
        });
        self.progress.say(&format!("cell {place}: {cell}; {rest}"));
        match self.run_cell(cell, *registrations) {
            Ok((record, took)) => {
                self.folder.save(&record)?;
                self.times.add(took);
                Ok(self.folder.save_times(&self.times)?)
            }
            Err(failure) if failure.code == INTERRUPTED => Err(self.interrupted(left.len())),
            Err(failure) => {
                self.progress.say(&format!("failed: {cell}: {}", failure.message.trim_end()));
                Ok(self.folder.save_failure(cell, failure.message.trim_end())?)
            }
        }
    }

    fn interrupted(&self, left: usize) -> Failure {
        let what = format!("interrupted, {left} cells left; the same command goes on");
        Failure::new(INTERRUPTED, what)
    }

    /// Approximate number of registrations of a cell; 0 for one that will fail when it is run.
    fn registrations(&self, cell: &Cell) -> usize {
        let preparation = self.preparation(cell);
        preparation.map_or(0, |p| p.registrations() + p.config.data.test_pairs)
    }

    fn preparation(&self, cell: &Cell) -> Result<Preparation, Failure> {
        let config = cell.config(self.base).map_err(Failure::usage)?;
        let preparation = connect(config, &SensorChoice::in_process(), &Progress::new(true))?;
        Ok(if cell.is_searched() { preparation.for_a_search()? } else { preparation })
    }

    /// Runs a cell. Returns its record, and its duration without the tracing of scans.
    fn run_cell(&mut self, cell: &Cell, registrations: usize) -> Result<(Record, Took), Failure> {
        let preparation = self.preparation(cell)?;
        let dataset = self.scans(cell, &preparation.config)?;
        let prepared = preparation.with(dataset);
        let watch = Instant::now();
        self.progress.begin(&cell.file_name(), registrations as u64);
        let (record, registrations) = match cell.protocol {
            Protocol::Default => self.evaluate_start(cell, &prepared)?,
            _ => self.run_search(cell, &prepared)?,
        };
        let seconds = watch.elapsed().as_secs_f64();
        Ok((record, Took { cell: *cell, seconds, registrations }))
    }

    /// Evaluates the start on the held-out pairs.
    fn evaluate_start(&self, cell: &Cell, prepared: &Prepared) -> Result<Finished, Failure> {
        let search = prepared.search(self.stop);
        let summary = search.judge(&search.start, &Steps(self.progress))?;
        let made = summary.pairs;
        let origin = Origin::Start.to_string();
        Ok((record(cell, prepared, &search.start, origin, [0; 2], summary), made))
    }

    /// Resumes the search from its journal, evaluates the chosen parameters, and writes the run's
    /// files as `tune` does.
    fn run_search(&self, cell: &Cell, prepared: &Prepared) -> Result<Finished, Failure> {
        let run = RunFolder::at(&self.folder.run_of(cell), &prepared.config)?;
        let search = prepared.search(self.stop);
        let (path, header) = (run.file(HISTORY), search.header());
        // With repair: a line that was cut off is dropped.
        let (mut journal, done) = match path.exists() {
            true => Journal::resume(&path, &header, true)?,
            false => (Journal::create(&path, &header)?, Vec::new()),
        };
        About::read(run.path())?.record(&run)?;
        let before: usize = done.iter().map(|g| g.candidates.len() * g.pairs.len()).sum();
        let steps = Steps(self.progress);
        let tuned = search.run(&mut journal, done, &steps)?;
        let start = self.start_of(cell, &search)?;
        let after = search.judge(&tuned.parameters, &steps)?;
        let judged = Judged { plain: None, before: start, after: after.clone() };
        write_run(&run, prepared, &tuned.parameters, &result(&search, &tuned, judged))?;
        write_page(&run)?;
        let made = (tuned.registrations + after.pairs).saturating_sub(before);
        let searched = [tuned.generations.len(), tuned.registrations];
        let origin = tuned.origin.clone();
        Ok((record(cell, prepared, &tuned.parameters, origin, searched, after), made))
    }

    /// Summary of the start on the held-out pairs, from the untuned cell's record if its parameters
    /// and number of pairs are the same.
    fn start_of(&self, cell: &Cell, search: &TuneSearch<'_>) -> Result<Summary, Failure> {
        let values = search.start.values(search.config);
        let is_same = |record: &Record| {
            let pairs = search.bench.dataset.test.len();
            record.parameters == values && record.summary.pairs == pairs
        };
        match self.folder.record(&cell.untuned()).ok().flatten().filter(is_same) {
            Some(record) => Ok(record.summary),
            None => Ok(search.judge(&search.start, &Steps(self.progress))?),
        }
    }

    /// Pairs of a cell. A cell trained elsewhere takes all but the held-out ones from there.
    fn scans(&mut self, cell: &Cell, config: &RunConfig) -> Result<Dataset, Failure> {
        let dataset = self.traced(config)?;
        match cell.trained_in(config) {
            Some(other) => {
                let Dataset { train, check, .. } = self.traced(&other)?;
                Ok(Dataset { train, check, ..dataset })
            }
            None => Ok(dataset),
        }
    }

    /// Pairs of a configuration, traced unless they are in the cache.
    fn traced(&mut self, config: &RunConfig) -> Result<Dataset, Failure> {
        let key = scan_key(config);
        if let Some((_, dataset)) = self.cache.iter().find(|(other, _)| *other == key) {
            return Ok(dataset.clone());
        }
        let dataset = all_pairs(config, self.progress)?;
        self.cache.push((key, dataset.clone()));
        while self.cache.len() > 1 && returns(&self.cache) > MAX_RETURNS {
            self.cache.remove(0);
        }
        Ok(dataset)
    }
}

/// Cache key of traced pairs: the configuration without sensor, registration and search.
fn scan_key(config: &RunConfig) -> String {
    let usual = RunConfig::default();
    let mut of_scans = RunConfig {
        seed: config.seed,
        scene: config.scene.clone(),
        scanner: config.scanner.clone(),
        data: config.data,
        receiver: config.receiver.clone(),
        motion: config.motion,
        ..usual
    };
    of_scans.data.success_translation_m = usual.data.success_translation_m;
    of_scans.data.success_rotation_deg = usual.data.success_rotation_deg;
    toml::to_string(&of_scans).unwrap_or_default()
}

fn returns(cache: &[(String, Dataset)]) -> usize {
    cache.iter().flat_map(|(_, dataset)| dataset.views()).map(|view| view.returns.len()).sum()
}

/// Record of parameters with their origin, and the generations and registrations of their search.
fn record(
    cell: &Cell,
    prepared: &Prepared,
    parameters: &Parameters,
    origin: String,
    [generations, registrations]: [usize; 2],
    summary: Summary,
) -> Record {
    let config = &prepared.config;
    Record {
        format: Record::FORMAT,
        cell: *cell,
        seed: config.seed,
        version: env!("CARGO_PKG_VERSION").into(),
        build: build(),
        configuration: configuration(config),
        trained_in: cell.trained_in(config).as_ref().map(TrainedIn::from),
        content: Content::of(config, &prepared.dataset),
        origin,
        generations,
        registrations,
        parameters: parameters.values(config),
        data: config.data,
        summary,
    }
}

/// Progress that counts registrations and reports no generations, as there are thousands.
struct Steps<'a>(&'a Progress);

impl Observer for Steps<'_> {
    fn evaluated(&self) {
        self.0.evaluated();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_closed_loop::config::preset::{Preset, Strategy};
    use echoloop_study::{Ablation, Scene, TableMethod};

    #[test]
    fn cells_share_scans_unless_place_distance_or_scanner_differ() {
        let base = Base::paper(Vec::new());
        let method = |name| TableMethod::named(name).unwrap();
        let scene = |name| Scene::named(name).unwrap();
        let cell = Cell::start(Preset::Outdoor, method("fgr"), scene("structured"))
            .searched(Strategy::Paper, Protocol::Joint);
        let key = |cell: Cell| scan_key(&cell.config(&base).unwrap());
        let same = [
            Cell { ranges: Preset::Paper, ..cell },
            Cell { protocol: Protocol::Lidar, ..cell },
            Cell { method: method("mac"), ..cell },
            Cell { method: method("fgr-open3d"), ..cell },
            Cell { ablation: Ablation::named("rain"), ..cell },
            Cell { ablation: Ablation::named("tenth-energy"), ..cell },
        ];
        assert!(same.iter().all(|other| key(*other) == key(cell)));
        let others = [
            Cell { scene: scene("unstructured"), ..cell },
            Cell { method: method("icp"), ..cell },
            Cell { ablation: Ablation::named("motion"), ..cell },
            Cell { ablation: Ablation::named("quarter-density"), ..cell },
        ];
        assert!(others.iter().all(|other| key(*other) != key(cell)));
    }
}
