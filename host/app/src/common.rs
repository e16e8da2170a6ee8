//! Flags that commands share, and the threads they run on.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::choice::SensorChoice;
use super::exit::Failure;
use super::number::{self, THREADS, number_as};
use echoloop_closed_loop::config::{Override, RegistrationConfig, RunConfig, changed, load};
use echoloop_closed_loop::dataset::stored_config;
use echoloop_closed_loop::run_folder::tuned_run::tuned_config;
use echoloop_files::say;

/// Flags of every command.
#[derive(Clone, Debug, Args)]
pub(super) struct Common {
    /// Print one JSON document to standard output instead of text.
    #[arg(long)]
    pub(super) json: bool,
    /// No progress, no remarks.
    #[arg(short, long)]
    pub(super) quiet: bool,
    /// Threads; 0: as many as there are processors. Results do not depend on it.
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = number_as::<usize>(THREADS))]
    pub(super) threads: usize,
}

/// Flags that make the configuration. Later ones win: file or run, --set, flags.
#[derive(Clone, Debug, Args)]
pub(super) struct ConfigSource {
    /// Configuration file (TOML).
    #[arg(short, long, value_name = "FILE")]
    pub(super) config: Option<PathBuf>,
    /// Begin with what a run tuned: its configuration with the tuned parameters.
    #[arg(long, value_name = "RUN", conflicts_with = "config")]
    pub(super) run: Option<PathBuf>,
    /// Pairs that `echoloop store` kept: commands that register pairs read them instead of tracing.
    /// Without --config or --run their configuration is begun with.
    #[arg(long, value_name = "FILE")]
    pub(super) stored: Option<PathBuf>,
    /// Set one value, as lidar.power=50; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = parse_override)]
    pub(super) set: Vec<Override>,
    /// structured, semi-structured, unstructured, one of nine towns as old-town or town01, roads
    /// (FILE.xodr), or a mesh: PLY, OBJ, glTF or STL, metres, z up.
    #[arg(long, value_name = "KIND|FILE")]
    pub(super) scene: Option<String>,
    /// Decides every random choice.
    #[arg(long, value_name = "N", value_parser = number::seed)]
    pub(super) seed: Option<u64>,
}

fn parse_override(text: &str) -> Result<Override, String> {
    text.parse()
}

impl ConfigSource {
    /// File or run, then `--set`, then the flags given (and only those), with a command's own flags
    /// last.
    pub(super) fn load(&self, own: Vec<Override>) -> Result<RunConfig, Failure> {
        let mut overrides = self.set.clone();
        let stored = self.stored.as_deref();
        overrides.extend(
            stored.map(|path| Override::flag("scene.stored", path.to_string_lossy().into_owned())),
        );
        overrides.extend(self.scene.clone().map(|scene| Override::flag("scene.source", scene)));
        if let Some(seed) = self.seed {
            let seed = i64::try_from(seed).unwrap_or(i64::MAX); // the parser takes no more
            overrides.push(Override::flag("seed", seed));
        }
        overrides.extend(own);
        Ok(match (&self.run, &self.config, stored) {
            (Some(run), ..) => changed(&start_of(run, &overrides)?, &overrides),
            (None, None, Some(path)) => {
                changed(&stored_config(path).map_err(Failure::usage)?, &overrides)
            }
            (None, config, _) => load(config.as_deref(), &overrides),
        }?)
    }
}

/// Configuration that a run tuned; with another method, that method's defaults.
fn start_of(run: &Path, overrides: &[Override]) -> Result<RunConfig, Failure> {
    let mut config = tuned_config(run)?;
    let asked = overrides.iter().rev().find_map(|change| change.text_of("registration.method"));
    let was = config.registration.method.name();
    if let Some(method) = asked.filter(|method| *method != was) {
        let preset = config.registration.preset;
        config.registration = RegistrationConfig::default();
        config.registration.preset = preset;
        config.tune.axes.forget("registration.");
        say(format_args!("{}: of {was}, so {method} starts at its own settings", run.display()));
    }
    Ok(config)
}

/// Formats of a table, for programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum TableFormat {
    /// Comma-separated values with a header.
    Csv,
}

/// Flags of every command that uses a sensor.
#[derive(Clone, Debug, Args)]
pub(super) struct Setup {
    #[command(flatten)]
    pub(super) source: ConfigSource,
    #[command(flatten)]
    pub(super) common: Common,
    #[command(flatten)]
    pub(super) sensor: SensorChoice,
}

/// Runs `work` on the asked number of threads.
pub(super) fn on_threads<T: Send>(
    threads: usize,
    work: impl FnOnce() -> T + Send,
) -> Result<T, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    Ok(pool.map_err(|e| Failure::usage(format!("--threads {threads}: {e}")))?.install(work))
}
