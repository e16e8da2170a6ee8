//! The `echoloop` command: one file a command, which reads flags, calls a library and prints.
//!
//! To add a command:
//!
//! 1. a file with a struct of flags (clap's `Args`) and `run(&Args) -> Result<(), Failure>`;
//! 2. a variant of `Command` here, whose comment is the command's help, and its arm in
//!    [`Cli::run`];
//! 3. a file of tests in `host/app/tests/command`, and a row in `docs/commands.md`.
//!
//! `run` loads the configuration (`ConfigSource::load`), checks its outputs (`Output::at`), works
//! on the threads of `--threads` (`on_threads`), and prints text or, with `--json`, one document.
//! Errors of libraries become exit codes in `exit`, by `?`.
//!
//! Files that are no command:
//!
//! | file | holds |
//! |---|---|
//! | `common` | flags of most commands: `--json`, `--threads`, `--config`, `--set`, … |
//! | `choice` | flags of the sensor |
//! | `method_choice` | `--method` |
//! | `method_flags` | a flag for each row of registration's table of settings |
//! | `axis_flags` | `--tune` and `--fix` |
//! | `number` | numbers with bounds |
//! | `order` | flags before the command's name |
//! | `cloud_output`, `response` | files that several flags describe |
//! | `hints` | what is odd about clouds that do not register |
//! | `prepared` | sensor and traced pairs, with progress |
//! | `progress`, `exit`, `interrupt` | progress bar, printing and exit codes, ^C |

mod axis_flags;
mod choice;
mod cloud_output;
mod common;
mod compare;
mod config;
mod difficulty;
mod echoes;
mod evaluate;
mod evaluate_files;
mod exit;
mod hints;
mod interrupt;
mod method_choice;
mod method_flags;
mod number;
mod order;
mod pairs;
mod prepared;
mod progress;
mod rate;
mod register;
mod register_all;
mod report;
mod reproduce;
mod response;
mod roads;
mod scan;
mod scan_along;
mod scene;
mod sensor;
mod serve;
mod store;
mod tune;

use std::ffi::OsString;

use clap::error::ContextValue;
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;
use echoloop_files::one_line;

use echoloop_closed_loop::config::preset::Preset;
use echoloop_closed_loop::parameters::parameter_table;
use echoloop_registration::Method;

pub use exit::{Failure, READER_GONE, report_failure};

/// A LiDAR that tunes itself: sensor and registration parameters, searched together through the
/// sensor's own link.
///
/// Without a command: `tune`. Flags may stand before a command's name or after it.
#[derive(Debug, Parser)]
#[command(
    name = "echoloop",
    version,
    args_conflicts_with_subcommands = true,
    after_help = EXIT_CODES,
)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    tune: tune::TuneArgs,
}

const EXIT_CODES: &str = "Exit codes: 0 done, 1 the run failed, 2 usage, configuration or a file, \
    3 the link or the sensor, 4 finished below --require-recall, 130 interrupted.";

#[derive(Debug, Subcommand)]
enum Command {
    /// Tune parameters in the closed loop, then judge them on held-out pairs.
    Tune(tune::TuneArgs),
    /// Judge one set of parameters; `--candidate -` reads it as JSON from standard input.
    Evaluate(evaluate::EvaluateArgs),
    /// Write a run's page again, from its folder alone; its charts as files.
    Report(report::ReportArgs),
    /// Compare runs: errors of their tuned parameters, and the settings in which they differ.
    Compare(compare::CompareArgs),
    /// Run the paper's Table 1, cell by cell, and print it beside the paper's numbers.
    ///
    /// Killed at any time, the same command goes on where it was. --quick shows the table's shape
    /// in some minutes; --table prints what is done and runs nothing.
    Reproduce(reproduce::ReproduceArgs),
    /// Scan a scene through the sensor and write the cloud.
    Scan(scan::ScanArgs),
    /// Show a scene: a page in three dimensions with its viewpoints and pairs, or a still picture.
    ///
    /// Without -o and --picture its facts are printed.
    Scene(scene::SceneArgs),
    /// Scan the configured pairs through the sensor and write them as files: clouds, true motions,
    /// poses.
    ///
    /// The scans are the ones that `evaluate` registers with the same configuration. Pairs that are
    /// hard for every method:
    /// `--set data.baseline_m=15 --set data.heading_range_deg=180 --set scanner.azimuth_deg=360`.
    Pairs(pairs::PairsArgs),
    /// Trace the configured pairs and keep them in a file, for `--stored FILE` of the others.
    Store(store::StoreArgs),
    /// Find the `data.difficulty` at which the settings that a run starts with register 90, 50 or
    /// 20 % of the pairs.
    ///
    /// Tries ever harder training pairs, interpolates between their difficulties, and prints the
    /// recall on held-out pairs of the difficulty found.
    Difficulty(difficulty::DifficultyArgs),
    /// Register two clouds: PLY, PCD, VTK, KITTI .bin or XYZ.
    Register(register::RegisterArgs),
    /// Find the echoes of waveforms that another instrument recorded.
    ///
    /// With --json, one line a waveform: {"waveform": i, "outgoing_peak_ns": …, "background": …,
    /// "false_alarms": …, "echoes": [{"time_ns": …, "amplitude": …, "width_ns": …, "snr": …,
    /// "flags": […]}]}, times from the row's first sample, amplitudes above ambient in the input's
    /// units.
    Echoes(echoes::EchoesArgs),
    /// Read a road network (OpenDRIVE): facts about it, its waypoints as a table.
    ///
    /// With --json its topology too: the entries of each driving lane and of each that it leads
    /// into. Of a town of ours `-o FILE.xodr` writes the roads, for CARLA and its editors.
    Roads(roads::RoadsArgs),
    /// Read a sensor's identity and settings, and set them.
    ///
    /// `--set lidar.power=50` and the like are laid over the sensor's own settings and sent to it,
    /// which checks them itself; of a configuration file, all of [lidar] is sent. With neither,
    /// nothing is changed.
    Sensor(sensor::SensorArgs),
    /// Estimate the scans a second that a processor, a line and the light allow, with this
    /// configuration's beams and settings.
    ///
    /// Instructions are those of `cargo xtask cost`, counted in an emulator and fitted. With
    /// --sensor qemu or serial the sensor is asked as well: it times its scans itself, and counts
    /// those that take longer than --hz allows.
    Rate(rate::RateArgs),
    /// Act as a sensor on a serial port, to rehearse `--sensor serial:` with.
    ///
    /// The sensor shows viewpoint n for scan n: those of the configuration's pairs, numbered as
    /// `--sensor serial:` asks for them. To rehearse without a board, run
    /// `socat -d -d pty,raw,echo=0 pty,raw,echo=0`, serve the one terminal it names, and give the
    /// other to `tune --sensor serial:`, with the same configuration.
    Serve(serve::ServeArgs),
    /// Print the effective configuration, every parameter with unit and range, or what a key is.
    ///
    /// A configuration that a run would refuse is refused.
    ///
    /// scanner.pattern says where beams point: grid, raster, vlp-16, vlp-32c, vls-128, hdl-64e,
    /// os1-64, os1-128, livox-mid-40, or a table of azimuth_deg, elevation_deg, time_s and channel:
    /// FILE.csv. What a pattern has no use for is left out.
    Config(config::ConfigArgs),
    /// Print shell completions.
    Completions {
        /// The shell.
        shell: Shell,
    },
}

/// Help of --json of `echoes`: all other commands print one document.
const JSON_LINES: &str =
    "Print a JSON document a waveform, each a line, to standard output instead of text";

/// The command line, with the parameter table in its help.
pub fn command() -> clap::Command {
    let help = format!(
        "Parameters, set with --set KEY=VALUE or in a file ([lidar], [registration]); those of \
         another method: \
         `echoloop config --parameters --set registration.method=fgr`.\n\n{}",
        parameter_table(Method::Icp, Preset::Outdoor)
    );
    let with_parameters = |c: clap::Command| c.after_long_help(help.clone());
    let command = Cli::command().mut_subcommand("tune", with_parameters);
    let command = command
        .mut_subcommand("evaluate", with_parameters)
        .mut_subcommand("pairs", with_parameters);
    let command = command.mut_subcommand("scan", with_parameters);
    let command =
        command.mut_subcommand("echoes", |c| c.mut_arg("json", |json| json.help(JSON_LINES)));
    // A negative number reaches its flag's parser, whose refusal names the bound.
    command.allow_negative_numbers(true).mut_subcommands(|c| c.allow_negative_numbers(true))
}

/// Reads a command line, beginning with the program's name.
///
/// # Errors
///
/// [`clap::Error`] when it is invalid or asks for help.
pub fn matches_of<A: Into<OsString>>(
    line: impl IntoIterator<Item = A>,
) -> Result<ArgMatches, clap::Error> {
    let command = command();
    let line = order::command_first(&command, line.into_iter().map(Into::into).collect());
    command.try_get_matches_from(line)
}

/// Shortens the parts of the command line that a message of clap repeats.
fn shortened(mut error: clap::Error) -> clap::Error {
    let repeated: Vec<_> = error
        .context()
        .filter_map(|(kind, value)| match value {
            ContextValue::String(text) => Some((kind, ContextValue::String(one_line(text)))),
            _ => None,
        })
        .collect();
    for (kind, value) in repeated {
        error.insert(kind, value);
    }
    error
}

impl Cli {
    /// Reads the command line. An invalid one, or a request for help, prints a message and ends the
    /// process.
    pub fn from_command_line() -> Self {
        let matches = matches_of(std::env::args_os());
        let cli = matches.and_then(|matches| Self::from_arg_matches(&matches));
        cli.unwrap_or_else(|error| shortened(error).exit())
    }

    /// Runs the command.
    ///
    /// # Errors
    ///
    /// [`Failure`] with the exit code.
    pub fn run(self) -> Result<(), Failure> {
        match self.command.unwrap_or(Command::Tune(self.tune)) {
            Command::Tune(args) => tune::run(&args),
            Command::Evaluate(args) => evaluate::run(&args),
            Command::Report(args) => report::run(&args),
            Command::Compare(args) => compare::run(&args),
            Command::Reproduce(args) => reproduce::run(&args),
            Command::Scan(args) => scan::run(&args),
            Command::Scene(args) => scene::run(&args),
            Command::Pairs(args) => pairs::run(&args),
            Command::Store(args) => store::run(&args),
            Command::Difficulty(args) => difficulty::run(&args),
            Command::Register(args) => register::run(&args),
            Command::Echoes(args) => echoes::run(&args),
            Command::Roads(args) => roads::run(&args),
            Command::Sensor(args) => sensor::run(&args),
            Command::Rate(args) => rate::run(&args),
            Command::Serve(args) => serve::run(&args),
            Command::Config(args) => config::run(&args),
            Command::Completions { shell } => {
                let mut script = Vec::new();
                clap_complete::generate(shell, &mut Self::command(), "echoloop", &mut script);
                exit::print(&String::from_utf8_lossy(&script))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        command().debug_assert();
    }
}
