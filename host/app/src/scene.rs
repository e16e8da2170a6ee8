//! `echoloop scene`.

use std::path::{Path, PathBuf};

use clap::Args;
use echoloop_parameters::{Bounds, Kind};

use super::common::{Common, ConfigSource, on_threads};
use super::exit::{self, Failure, print};
use super::number::{flag, number_as};
use super::progress::Progress;
use super::report::is_standard_output;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::survey::Survey;
use echoloop_closed_loop::dataset::towns;
use echoloop_closed_loop::run_folder::files::Output;
use echoloop_report::{STILL_PX, SceneReport};

/// Flags of `scene`.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneArgs {
    /// Scene to show, as of --scene.
    #[arg(value_name = "KIND|FILE", conflicts_with = "scene")]
    what: Option<String>,
    #[command(flatten)]
    source: ConfigSource,
    #[command(flatten)]
    common: Common,
    /// Which of scene.towns, by its seed [default: the first].
    #[arg(long, value_name = "SEED", value_parser = super::number::seed)]
    town: Option<u64>,
    /// Write a page in three dimensions, to open in a browser; `-`: to standard output, instead of
    /// the facts.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write a still picture (PNG), from above and beside.
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,
    /// Pixels of the picture across; down it has five eighths of them.
    #[arg(long, value_name = "PIXELS", default_value_t = STILL_PX, requires = "picture",
          value_parser = number_as::<usize>(flag(Kind::Whole, Bounds::between(16.0, 8192.0))))]
    width: usize,
}

pub(super) fn run(args: &SceneArgs) -> Result<(), Failure> {
    let mut source = args.source.clone();
    source.scene = args.what.clone().or(source.scene);
    let config = source.load(Vec::new())?;
    config.device().pattern.aimed(&config.lidar.0).map_err(Failure::usage)?;
    let outputs = Outputs::of(args)?; // now: large scenes take long
    on_threads(args.common.threads, || show(args, &config, &outputs))?
}

/// Files to write, checked to be writable.
struct Outputs {
    page: Option<Output>,
    picture: Option<Output>,
}

impl Outputs {
    fn of(args: &SceneArgs) -> Result<Self, Failure> {
        let page = args.output.as_deref().filter(|path| !is_standard_output(path));
        let picture = args.picture.as_deref().map(picture_output).transpose()?;
        Ok(Self { page: page.map(Output::at).transpose()?, picture })
    }
}

fn picture_output(path: &Path) -> Result<Output, Failure> {
    let output = Output::at(path)?;
    let is_png = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("png"));
    match is_png || output.is_stream() {
        true => Ok(output),
        false => Err(Failure::usage(format_args!(
            "--picture {}: expected a name that ends in .png",
            path.display()
        ))),
    }
}

fn show(args: &SceneArgs, config: &RunConfig, outputs: &Outputs) -> Result<(), Failure> {
    let progress = Progress::new(args.common.quiet);
    let survey = surveyed(args, config, &progress)?;
    let report = SceneReport { config, survey: &survey };
    if let Some(output) = &outputs.picture {
        output.write(&report.picture(args.width).map_err(Failure::run)?)?;
    }
    if args.output.is_some() {
        progress.begin("picture", 1);
        let html = report.page();
        progress.end();
        let html = html.map_err(Failure::run)?;
        match &outputs.page {
            Some(output) => output.write(html.as_bytes())?,
            None => return print(&html),
        }
    }
    if !args.common.quiet {
        survey.missing.iter().for_each(|why| progress.say(&format!("remark: {why}")));
    }
    print_report(args, &report)
}

fn surveyed(args: &SceneArgs, config: &RunConfig, progress: &Progress) -> Result<Survey, Failure> {
    let towns = towns(config);
    let index = match args.town {
        None => 0,
        Some(town) => towns.iter().position(|&seed| seed == town).ok_or_else(|| {
            let towns = towns.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
            Failure::usage(format_args!("--town {town}: the configuration has the towns {towns}"))
        })?,
    };
    progress.begin("viewpoints", (config.data.train_pairs + config.data.test_pairs) as u64);
    let survey = Survey::of(config, index, &|found, _| progress.at(found as u64));
    progress.end();
    Ok(survey?)
}

fn print_report(args: &SceneArgs, report: &SceneReport<'_>) -> Result<(), Failure> {
    let (page, picture) = (args.output.as_deref(), args.picture.as_deref());
    if args.common.json {
        return exit::print_json(&report.json(page, picture));
    }
    let line = |(name, value): &(String, String)| format!("{name:<31}{value}\n");
    let facts: String = report.facts().iter().map(line).collect();
    let files = picture.iter().chain(&page);
    let wrote: String = files.map(|path| format!("wrote {}\n", path.display())).collect();
    print(&(facts + &wrote))
}
