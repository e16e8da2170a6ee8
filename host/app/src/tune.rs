//! `echoloop tune`.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::Args;
use echoloop_parameters::{Bounds, Kind};

use super::axis_flags::AxisFlags;
use super::common::{Setup, TableFormat, on_threads};
use super::exit::{self, Failure, print};
use super::interrupt::stop_on_interrupt;
use super::method_choice::{MethodChoice, toml_name};
use super::number::{flag, number_of, read};
use super::prepared::{connect, percent, require_recall, traced};
use super::progress::Progress;
use super::report::write_page;
use echoloop_closed_loop::config::preset::{LidarPreset, Objective, Preset, Protocol, Strategy};
use echoloop_closed_loop::config::{Budget, Override, RunConfig, default_runs_folder, key, load};
use echoloop_closed_loop::cost::CostKind;
use echoloop_closed_loop::parameters::read_candidate;
use echoloop_closed_loop::prepared::{Preparation, Prepared};
use echoloop_closed_loop::run_folder::files::FileError;
use echoloop_closed_loop::run_folder::journal::Journal;
use echoloop_closed_loop::run_folder::provenance::About;
use echoloop_closed_loop::run_folder::run::{
    CONFIG, FRONT, HISTORY, REPORT, RESULT, RunFolder, RunResult,
};
use echoloop_closed_loop::run_folder::tuned_run::tuned_values;
use echoloop_closed_loop::search::TuneError;
use echoloop_closed_loop::tuning::{run_name, tuned, write_run};
use echoloop_files::{one_line, say};
use echoloop_report::finished_runs::{judged, result_text};
use echoloop_report::pair_errors_csv;

/// Flags of `tune`.
#[derive(Clone, Debug, Args)]
pub(crate) struct TuneArgs {
    #[command(flatten)]
    setup: Setup,
    #[command(flatten)]
    method: MethodChoice,
    /// Search strategy.
    #[arg(long)]
    strategy: Option<Strategy>,
    /// Objective of the search.
    #[arg(long)]
    objective: Option<Objective>,
    /// Minimise this cost of a scan instead, within the error of --at-most-error.
    #[arg(long, value_name = "COST")]
    minimise: Option<CostKind>,
    /// With --minimise: greatest error, as a multiple of the start's, 1 to 100 [default: 1.2x].
    #[arg(long, value_name = "TIMES", value_parser = times)]
    at_most_error: Option<f64>,
    /// Parameters that are tuned.
    #[arg(long)]
    protocol: Option<Protocol>,
    /// Parameters of the sensor that are tuned.
    #[arg(long)]
    lidar: Option<LidarPreset>,
    /// Budget of light, converter, link and time: none, unitree-l2, mid-360, or limits of [budget],
    /// as shots_per_s=122880; several with commas. A search keeps within it.
    #[arg(long, value_name = "NAME|KEY=VALUE", value_delimiter = ',')]
    budget: Vec<String>,
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
    /// Further start of the search: the parameters that a run tuned, or those of a JSON file as
    /// `evaluate --candidate` has them; - is standard input. The search begins at the best on the
    /// training pairs. May be repeated.
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
            "objective", "minimise", "at_most_error", "protocol", "lidar", "budget", "preset",
            "tune", "fix", "population", "pareto", "points", "runs", "warm_start",
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
    let with_unit = |problem| format!("{problem} times, as 1.2x");
    read(&times, text.strip_suffix('x').unwrap_or(text)).map_err(with_unit)
}

impl TuneArgs {
    fn config(&self) -> Result<RunConfig, Failure> {
        if let Some(run) = &self.resume {
            let config = load(Some(&run.join(CONFIG)), &[])?;
            return self.extended(config);
        }
        let mut overrides = self.method.overrides();
        overrides.extend(self.axes.overrides()?);
        overrides.extend(budget_overrides(&self.budget)?);
        let mut flag = |path: &str, value: Option<toml::Value>| {
            overrides.extend(value.map(|v| Override::flag(path, v)))
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
        let config = self.setup.source.load(overrides)?;
        match self.at_most_error {
            Some(times) if config.tune.minimise.is_none() => Err(Failure::usage(format!(
                "--at-most-error {times}: expected with it what is to be made small, as \
                 --minimise energy"
            ))),
            _ => Ok(config),
        }
    }

    /// The candidates of `--warm-start`, each as a table.
    fn warm_starts(&self) -> Result<Vec<toml::Value>, Failure> {
        if self.warm_start.iter().filter(|path| path.as_os_str() == "-").count() > 1 {
            return Err(Failure::usage("--warm-start -: standard input can be read once"));
        }
        let table = |path: &PathBuf| {
            let values = if path.is_dir() { tuned_values(path)? } else { read_candidate(path)? };
            toml::Value::try_from(values).map_err(Failure::run)
        };
        self.warm_start.iter().map(table).collect()
    }

    /// The run's configuration, extended to `--generations` if that is given.
    fn extended(&self, mut config: RunConfig) -> Result<RunConfig, Failure> {
        let Some(new) = self.generations else { return Ok(config) };
        let old = config.tune.last_generations();
        if new < old {
            return Err(Failure::usage(format!(
                "--generations {new}: the run is to have {old} already; more can be asked for"
            )));
        }
        if new > config.tune.generations {
            config.tune.extended_to = Some(new);
        }
        config.check().map_err(Failure::usage)?;
        Ok(config)
    }
}

/// Keys that `--budget` sets.
fn budget_overrides(given: &[String]) -> Result<Vec<Override>, Failure> {
    let mut overrides = Vec::new();
    for text in given {
        if let Some(budget) = Budget::named(text) {
            let keys = toml::Table::try_from(budget).map_err(Failure::run)?;
            let flag = |(key, value): (String, toml::Value)| {
                Override::flag(&format!("budget.{key}"), value)
            };
            overrides.extend(keys.into_iter().map(flag));
            continue;
        }
        let wrong = |_| {
            let keys = Budget::KEYS.iter().filter_map(|key| key.key.strip_prefix("budget."));
            let keys = keys.collect::<Vec<_>>().join(", ");
            let names = Budget::NAMED.map(|(name, _)| name).join(", ");
            Failure::usage(format!(
                "--budget {}: expected {names}, or KEY=VALUE with one of {keys}",
                one_line(text)
            ))
        };
        let change = format!("budget.{text}").parse::<Override>();
        let is_key = text.split_once('=').is_some_and(|(key, _)| {
            Budget::KEYS.iter().any(|row| row.key.strip_prefix("budget.") == Some(key))
        });
        overrides.push(change.ok().filter(|_| is_key).ok_or(()).map_err(wrong)?);
    }
    Ok(overrides)
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
    // Looked up once: a journal that is removed while the scenes are traced is an error later.
    let history = resumed.as_ref().map(|folder| folder.file(HISTORY)).filter(|path| path.exists());
    if let Some(journal) = &history {
        Journal::check(journal, args.repair)?;
    }
    let about = resumed.as_ref().map(|folder| About::read(folder.path())).transpose()?;
    let progress = Progress::new(args.setup.common.quiet);
    let runs = args.runs.clone().unwrap_or_else(default_runs_folder);
    if resumed.is_none() {
        RunFolder::check(&runs)?;
    }
    // A run that cannot begin creates no folder and does not move `latest`.
    let preparation = connect(config, &args.setup.sensor, &progress)?.for_a_search()?;
    let prepared = traced(preparation, Preparation::traced_for_a_search, &progress)?;
    let folder = resumed.map_or_else(|| new_folder(&runs, &prepared.config), Ok)?;
    let search = prepared.search(stop);
    let (mut journal, done) = match &history {
        Some(path) => Journal::resume(path, &search.header(), args.repair)?,
        None => (Journal::create(&folder.file(HISTORY), &search.header())?, Vec::new()),
    };
    if history.is_some() && args.generations.is_some() {
        extend(&folder, &prepared.config)?;
    }
    about.unwrap_or_default().record(&folder)?;
    if search.space.axes().is_empty() && search.config.tune.protocol != Protocol::Default {
        say(format_args!("nothing is searched: every parameter is fixed"));
    }
    progress.begin("tuning", search.registrations() as u64);
    let outcome = tuned(&search, (&mut journal, done), &folder, args.repair, &progress);
    progress.end();
    if let Err(TuneError::Interrupted { .. } | TuneError::Sensor(_)) = &outcome {
        say(format_args!(
            "go on with: echoloop tune --resume {}{}",
            folder.path().display(),
            args.setup.sensor.again()
        ));
    }
    let (parameters, result) = outcome?;
    write_run(&folder, &prepared, &parameters, &result)?;
    write_page(&folder)?;
    finish(args, &folder, &prepared, &result)
}

/// Records the extension in the run folder. The front is searched anew, as its start, the tuned
/// parameters, will change.
fn extend(folder: &RunFolder, config: &RunConfig) -> Result<(), Failure> {
    let was = load(Some(&folder.file(CONFIG)), &[])?;
    if was.tune.extended_to != config.tune.extended_to {
        folder.put_aside(FRONT)?;
        folder.write_toml(CONFIG, config)?;
    }
    Ok(())
}

/// A new folder with the configuration in it.
fn new_folder(runs: &Path, config: &RunConfig) -> Result<RunFolder, FileError> {
    let folder = RunFolder::create(runs, &run_name(config))?;
    folder.write_toml(CONFIG, config)?;
    folder.become_latest()?;
    Ok(folder)
}

/// Prints the result and the paths of its files.
fn finish(
    args: &TuneArgs,
    folder: &RunFolder,
    prepared: &Prepared,
    result: &RunResult,
) -> Result<(), Failure> {
    if let Some(TableFormat::Csv) = args.format {
        let sets: Vec<_> = judged(result).collect();
        let sets = sets.iter().map(|(_, name, summary)| (name.as_str(), *summary));
        print(&pair_errors_csv(sets).map_err(Failure::run)?)?;
    } else if args.setup.common.json {
        exit::print_json(result)?;
    } else {
        print(&result_text(&prepared.config, result, &prepared.space))?;
        print(&format!(
            "\nreport  {}\nresult  {}\n",
            folder.file(REPORT).display(),
            folder.file(RESULT).display()
        ))?;
    }
    require_recall(args.require_recall, &result.tuned_summary)
}
