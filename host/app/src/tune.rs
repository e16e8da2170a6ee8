//! `echoloop tune`.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use echoloop_dsp::ScanPattern;
use echoloop_parameters::{Bounds, Kind};

use super::axis_flags::AxisFlags;
use super::candidate::candidate_values;
use super::common::{Setup, on_threads};
use super::exit::{self, Failure, print};
use super::figures::print_table;
use super::interrupt::stop_on_interrupt;
use super::method_choice::{MethodChoice, toml_name};
use super::number::{flag, number_of, read};
use super::prepared::{Met, Prepared, percent, require_recall};
use super::progress::Progress;
use super::report::write_page;
use super::shown_pair::write_clouds;
use super::table_format::{TableFormat, csv};
use super::tuned_run::tuned_values;
use echoloop_closed_loop::config::preset::{
    LidarPreset, Objective, PowerRange, Preset, Protocol, Strategy,
};
use echoloop_closed_loop::config::{Override, RunConfig, default_runs_folder, key, load};
use echoloop_closed_loop::cost::CostKind;
use echoloop_closed_loop::evaluation::compare::Comparison;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::front::{Front, FrontSearch};
use echoloop_closed_loop::parameters::Parameters;
use echoloop_closed_loop::run_folder::files::FileError;
use echoloop_closed_loop::run_folder::journal::{Generation, Journal};
use echoloop_closed_loop::run_folder::provenance::About;
use echoloop_closed_loop::run_folder::run::{
    AxisRecord, Background, CONFIG, FRONT, HISTORY, REPORT, RESULT, RunFolder, RunResult,
    StageRecord,
};
use echoloop_closed_loop::search::{Stage, TuneError, TuneSearch, Tuned};
use echoloop_files::say;
use echoloop_report::finished_runs::judged;
use echoloop_sensors::pattern::{described, size};

/// Flags of `tune`.
#[derive(Clone, Debug, Args)]
pub(crate) struct TuneArgs {
    #[command(flatten)]
    setup: Setup,
    #[command(flatten)]
    method: MethodChoice,
    /// How to search.
    #[arg(long)]
    strategy: Option<Strategy>,
    /// What is made small.
    #[arg(long)]
    objective: Option<Objective>,
    /// Make this cost of a scan small instead, at an error as by --at-most-error.
    #[arg(long, value_name = "COST")]
    minimise: Option<CostKind>,
    /// With --minimise: so many times the start's error, 1 to 100 [default: 1.2x].
    #[arg(long, value_name = "TIMES", value_parser = times)]
    at_most_error: Option<f64>,
    /// What is tuned.
    #[arg(long)]
    protocol: Option<Protocol>,
    /// Which of the sensor's parameters are tuned.
    #[arg(long)]
    lidar: Option<LidarPreset>,
    #[command(flatten)]
    axes: AxisFlags,
    /// Ranges and defaults of the registration parameters.
    #[arg(long)]
    preset: Option<Preset>,
    /// Generations, 1 to 100000.
    #[arg(long, value_name = "N", value_parser = number_of::<u32>("tune.generations"))]
    generations: Option<u32>,
    /// Candidates a generation; 0: as many as there are parameters.
    #[arg(long, value_name = "N", value_parser = number_of::<u32>("tune.population"))]
    population: Option<u32>,
    /// Where the search may begin, too: at what a run tuned, or at the parameters of a JSON file as
    /// `evaluate --candidate` has them; - is standard input. It begins at the best on the training
    /// pairs. May be given again.
    #[arg(long, value_name = "RUN|FILE")]
    warm_start: Vec<PathBuf>,
    /// Then search for a front of error against a cost of a scan [default cost: energy].
    #[arg(long, value_name = "COST", num_args = 0..=1, default_missing_value = "energy")]
    pareto: Option<CostKind>,
    /// Points of the front at most, 2 to 1000.
    #[arg(long, value_name = "N", requires = "pareto",
          value_parser = number_of::<u32>("front.points"))]
    points: Option<u32>,
    /// Folder for run folders [default: runs].
    #[arg(long, value_name = "FOLDER")]
    runs: Option<PathBuf>,
    /// Go on with an interrupted run; with --generations, beyond what it was to have.
    #[arg(
        long,
        value_name = "RUN",
        conflicts_with_all = [
            "config", "run", "set", "scene", "seed", "method", "mode", "refine", "strategy",
            "objective", "minimise", "at_most_error", "protocol", "lidar", "preset", "tune", "fix",
            "population", "pareto", "points", "runs", "warm_start",
        ],
    )]
    resume: Option<PathBuf>,
    /// With --resume: drop the damaged end of a journal, after copying it.
    #[arg(long, requires = "resume")]
    repair: bool,
    /// Print a row for each held-out pair instead of text.
    #[arg(long, value_enum, conflicts_with = "json")]
    format: Option<TableFormat>,
    /// Exit with 4 when the tuned recall on held-out pairs is below this, percent.
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    require_recall: Option<f64>,
}

/// `1.2x`, or `1.2`.
fn times(text: &str) -> Result<f64, String> {
    let times =
        key("tune.at_most_error").copied().unwrap_or(flag(Kind::Number, Bounds::at_least(1.0)));
    let said = |problem| format!("{problem} times, as 1.2x");
    read(&times, text.strip_suffix('x').unwrap_or(text)).map_err(said)
}

impl TuneArgs {
    fn config(&self) -> Result<RunConfig, Failure> {
        if let Some(run) = &self.resume {
            let config = load(Some(&run.join(CONFIG)), &[]).map_err(Failure::usage)?;
            return self.extended(config);
        }
        let mut own = self.method.overrides();
        own.extend(self.axes.overrides()?);
        let mut flag = |path: &str, value: Option<toml::Value>| {
            own.extend(value.map(|v| Override::flag(path, v)))
        };
        flag("tune.strategy", self.strategy.map(toml_name));
        flag("tune.objective", self.objective.map(toml_name));
        flag("tune.minimise", self.minimise.map(toml_name));
        flag("tune.at_most_error", self.at_most_error.map(toml::Value::from));
        flag("tune.protocol", self.protocol.map(toml_name));
        flag("tune.lidar", self.lidar.map(toml_name));
        flag("registration.preset", self.preset.map(toml_name));
        flag("tune.generations", self.generations.map(|n| i64::from(n).into()));
        flag("tune.population", self.population.map(|n| i64::from(n).into()));
        let warm_starts = self.warm_starts()?;
        flag("tune.warm_starts", (!warm_starts.is_empty()).then(|| warm_starts.into()));
        flag("front.cost", self.pareto.map(toml_name));
        flag("front.points", self.points.map(|n| i64::from(n).into()));
        let config = self.setup.source.load(own)?;
        match self.at_most_error {
            Some(times) if config.tune.minimise.is_none() => Err(Failure::usage(format!(
                "--at-most-error {times}: expected with it what is to be made small, as \
                 --minimise energy"
            ))),
            _ => Ok(config),
        }
    }

    /// What `--warm-start` names, each as a table.
    fn warm_starts(&self) -> Result<Vec<toml::Value>, Failure> {
        if self.warm_start.iter().filter(|path| path.as_os_str() == "-").count() > 1 {
            return Err(Failure::usage("--warm-start -: standard input can be read once"));
        }
        let table = |path: &PathBuf| {
            let values = if path.is_dir() { tuned_values(path) } else { candidate_values(path) }?;
            toml::Value::try_from(values).map_err(Failure::run)
        };
        self.warm_start.iter().map(table).collect()
    }

    /// A run's configuration with more generations, where they are asked for.
    fn extended(&self, mut config: RunConfig) -> Result<RunConfig, Failure> {
        let Some(asked) = self.generations else { return Ok(config) };
        let had = config.tune.last_generations();
        if asked < had {
            return Err(Failure::usage(format!(
                "--generations {asked}: the run is to have {had} already; more can be asked for"
            )));
        }
        if asked > config.tune.generations {
            config.tune.extended_to = Some(asked);
        }
        config.check().map_err(Failure::usage)?;
        Ok(config)
    }
}

pub(super) fn run(args: &TuneArgs) -> Result<(), Failure> {
    let resumed = args.resume.as_deref().map(RunFolder::open).transpose()?;
    let config = args.config()?;
    let stop = stop_on_interrupt();
    on_threads(args.setup.common.threads, || tune(args, config, resumed, &stop))?
}

fn tune(
    args: &TuneArgs,
    config: RunConfig,
    resumed: Option<RunFolder>,
    stop: &AtomicBool,
) -> Result<(), Failure> {
    // Asked once: a journal that goes away while the scenes are traced is missed later.
    let begun = resumed.as_ref().map(|folder| folder.file(HISTORY)).filter(|path| path.exists());
    if let Some(journal) = &begun {
        Journal::check(journal, args.repair)?;
    }
    let about = resumed.as_ref().map(|folder| About::read(folder.path())).transpose()?;
    let progress = Progress::new(args.setup.common.quiet);
    let runs = args.runs.clone().unwrap_or_else(default_runs_folder);
    if resumed.is_none() {
        RunFolder::check(&runs)?;
    }
    // What cannot run leaves no folder, and `latest` where it was.
    let met = Met::new(config, &args.setup.sensor, &progress)?.for_a_search()?;
    let prepared = met.traced_for_a_search(&progress)?;
    let folder = resumed.map_or_else(|| new_folder(&runs, &prepared.config), Ok)?;
    let search = prepared.search(stop);
    let (mut journal, done) = match &begun {
        Some(path) => Journal::resume(path, &search.header(), args.repair)?,
        None => (Journal::create(&folder.file(HISTORY), &search.header())?, Vec::new()),
    };
    if begun.is_some() && args.generations.is_some() {
        extend(&folder, &prepared.config)?;
    }
    about.unwrap_or_default().record(&folder)?;
    if search.space.axes().is_empty() && search.config.tune.protocol != Protocol::Default {
        say(format_args!("nothing is searched: every parameter is fixed"));
    }
    progress.begin("tuning", search.registrations() as u64);
    let outcome = search_and_judge(&search, &mut journal, done, &progress).and_then(|judged| {
        let front = front(&prepared, &search, &judged, &folder, (args.repair, &progress))?;
        Ok((judged, front))
    });
    progress.end();
    if let Err(TuneError::Interrupted { .. } | TuneError::Sensor(_)) = &outcome {
        say(format_args!(
            "go on with: echoloop tune --resume {}{}",
            folder.path().display(),
            args.setup.sensor.again()
        ));
    }
    let ((tuned, judged), front) = outcome?;
    let result = RunResult { front, ..result(&prepared, &tuned, judged) };
    let result = RunResult { background: Some(background(&search, &tuned)), ..result };
    write_run(&folder, &prepared, &tuned, &result)?;
    finish(args, &folder, &prepared, &result)
}

/// Writes what came out of a run into its folder.
pub(super) fn write_run(
    folder: &RunFolder,
    prepared: &Prepared,
    tuned: &Tuned,
    result: &RunResult,
) -> Result<(), Failure> {
    folder.write_tuned(&tuned.parameters.as_start_of(&prepared.config))?;
    folder.write_result(result)?;
    write_clouds(folder, prepared, &tuned.parameters, result)?;
    write_page(folder)
}

/// Notes in the folder that its run goes on beyond its end. A front begins at the tuned parameters,
/// which will be others: its search begins anew.
fn extend(folder: &RunFolder, config: &RunConfig) -> Result<(), Failure> {
    let was = load(Some(&folder.file(CONFIG)), &[]).map_err(Failure::usage)?;
    if was.tune.extended_to != config.tune.extended_to {
        folder.put_aside(FRONT)?;
        folder.write_config(config)?;
    }
    Ok(())
}

/// A new folder with the configuration in it.
fn new_folder(runs: &Path, config: &RunConfig) -> Result<RunFolder, FileError> {
    let folder = RunFolder::create(runs, &run_name(config))?;
    folder.write_config(config)?;
    folder.become_latest()?;
    Ok(folder)
}

/// The plain method, the start and the choice on the held-out pairs.
pub(super) struct Judged {
    pub(super) plain: Option<Summary>,
    pub(super) before: Summary,
    pub(super) after: Summary,
}

/// The search, then the judgement.
fn search_and_judge(
    search: &TuneSearch<'_>,
    journal: &mut Journal,
    done: Vec<Generation>,
    progress: &Progress,
) -> Result<(Tuned, Judged), TuneError> {
    let tuned = search.run(journal, done, progress)?;
    if let Some(stop) = tuned.nothing_found {
        return Err(TuneError::NothingFound { registrations: tuned.registrations, stop });
    }
    let start = search.start;
    let plain = start.registration.plain().map(|registration| Parameters { registration, ..start });
    // A search that kept its start has nothing more to be judged.
    let is_start = tuned.parameters == start;
    let judgements = 1 + usize::from(plain.is_some()) + usize::from(!is_start);
    progress.begin("judging", (judgements * search.bench.dataset.test.len()) as u64);
    let plain = plain.map(|plain| search.judge(&plain, progress)).transpose()?;
    let before = search.judge(&start, progress)?;
    let after = match is_start {
        true => before.clone(),
        false => search.judge(&tuned.parameters, progress)?,
    };
    let judged = Judged { plain, before, after };
    match search.stop.load(Ordering::Relaxed) {
        true => Err(TuneError::Interrupted { generations: tuned.generations.len() }),
        false => Ok((tuned, judged)),
    }
}

/// The front, where one is asked for, with a journal of its own.
fn front(
    prepared: &Prepared,
    search: &TuneSearch<'_>,
    (tuned, judged): &(Tuned, Judged),
    folder: &RunFolder,
    (repair, progress): (bool, &Progress),
) -> Result<Option<Front>, TuneError> {
    let Some(cost) = prepared.config.front.cost else { return Ok(None) };
    let is_bounded = prepared.config.tune.axes.of("lidar.power").is_some();
    let space = match cost {
        CostKind::Energy if !is_bounded => search.space.clone().with_power(PowerRange::Whole),
        _ => search.space.clone(),
    };
    let judged = [&judged.before, &judged.after];
    let of_front = FrontSearch { search, space, tuned: tuned.parameters, judged, cost };
    let (path, header) = (folder.file(FRONT), of_front.header());
    let (mut journal, done) = match path.exists() {
        true => Journal::resume(&path, &header, repair)?,
        false => (Journal::create(&path, &header)?, Vec::new()),
    };
    let each = of_front.registrations() / prepared.config.front.generations.max(1) as usize;
    progress.begin("front", of_front.registrations().saturating_sub(each * done.len()) as u64);
    let front = of_front.run(&mut journal, done, progress)?;
    Ok(Some(front))
}

/// Characters of a mesh's name in that of its run: a folder's may have 255 bytes.
const MOST_OF_SCENE: usize = 40;

fn run_name(config: &RunConfig) -> String {
    let source = Path::new(&config.scene.source);
    let scene = source
        .file_stem()
        .map_or_else(|| config.scene.source.clone(), |s| s.to_string_lossy().into_owned());
    let scene: String = scene.chars().filter(|c| !c.is_control()).take(MOST_OF_SCENE).collect();
    let method = config.registration.method.name();
    format!("{scene}-{method}-{}", config.tune.protocol.name())
}

/// What came out of a run, but for its front and what its page tells besides.
pub(super) fn result(prepared: &Prepared, tuned: &Tuned, judged: Judged) -> RunResult {
    RunResult {
        format: 1,
        protocol: prepared.config.tune.protocol.name().into(),
        method: prepared.config.registration.name(),
        scene: prepared.config.scene.source.clone(),
        seed: prepared.config.seed,
        generations: tuned.generations.len(),
        registrations: tuned.registrations,
        origin: tuned.origin.clone(),
        default: prepared.start.values(&prepared.config),
        tuned: tuned.parameters.values(&prepared.config),
        finalists: tuned.finalists.clone(),
        check: tuned.check,
        comparison: Comparison::new(
            &judged.before.errors,
            &judged.after.errors,
            prepared.config.tune.error_cap,
        ),
        plain_summary: judged.plain,
        default_summary: judged.before,
        tuned_summary: judged.after,
        front: None,
        background: None,
    }
}

/// What the page tells of the search besides its result.
pub(super) fn background(search: &TuneSearch<'_>, tuned: &Tuned) -> Background {
    let (dataset, axes) = (search.bench.dataset, search.space.axes());
    let pattern = dataset.beams.pattern();
    let stages = search.stages();
    let last = stages.last().map(|stage| stage.axes.clone()).unwrap_or_default();
    let was_made = |stage: &&Stage| tuned.generations.iter().any(|g| g.stage == stage.name);
    Background {
        triangles: dataset.triangles,
        beams: match pattern {
            ScanPattern::Grid(_) => size(pattern),
            _ => described(pattern),
        },
        places: dataset.test.iter().map(|pair| pair.place.clone()).collect(),
        stages: stages.iter().filter(was_made).map(StageRecord::from).collect(),
        axes: axes.iter().map(AxisRecord::from).collect(),
        correlated: last.iter().map(|&axis| axes[axis].name.to_owned()).collect(),
        correlations: tuned.correlations.clone(),
        covariance_learned: tuned.covariance_learned,
    }
}

/// Says what came out, and where it is.
fn finish(
    args: &TuneArgs,
    folder: &RunFolder,
    prepared: &Prepared,
    result: &RunResult,
) -> Result<(), Failure> {
    if let Some(TableFormat::Csv) = args.format {
        let sets: Vec<_> = judged(result).collect();
        let sets = sets.iter().map(|(_, name, summary)| (name.as_str(), *summary));
        print(&csv(sets)?)?;
    } else if args.setup.common.json {
        print(&exit::json(result)?)?;
    } else {
        print_table(&prepared.config, result, &prepared.search(&AtomicBool::new(false)).space);
        println!(
            "\nreport  {}\nresult  {}",
            folder.file(REPORT).display(),
            folder.file(RESULT).display()
        );
    }
    require_recall(args.require_recall, &result.tuned_summary)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_has_a_name_that_a_folder_can_have() {
        let name = |source: &str| {
            let mut config = RunConfig::default();
            config.scene.source = source.to_owned();
            run_name(&config)
        };
        assert_eq!(name("structured"), "structured-icp-joint");
        assert_eq!(name("a/yard.obj"), "yard-icp-joint");
        assert_eq!(name("a\u{1b}b.ply"), "ab-icp-joint");
        assert!(name(&format!("{}.ply", "\u{1f332}".repeat(60))).len() < 240);
    }
}
