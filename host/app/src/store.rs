//! `echoloop store`.

use std::path::PathBuf;

use clap::{Args, ValueHint};
use serde_json::json;

use super::common::{Setup, on_threads};
use super::exit::{self, Failure};
use super::method_choice::MethodChoice;
use super::prepared::prepare;
use super::progress::Progress;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::{Facts, stored};
use echoloop_closed_loop::run_folder::files::Output;

/// Flags of `store`.
#[derive(Clone, Debug, Args)]
pub(crate) struct StoreArgs {
    #[command(flatten)]
    setup: Setup,
    #[command(flatten)]
    method: MethodChoice,
    /// File to write.
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    output: PathBuf,
}

pub(super) fn run(args: &StoreArgs) -> Result<(), Failure> {
    let config = args.setup.source.load(args.method.overrides())?;
    let output = Output::at(&args.output)?; // now: tracing takes long
    on_threads(args.setup.common.threads, || store(args, config, &output))?
}

fn store(args: &StoreArgs, config: RunConfig, output: &Output) -> Result<(), Failure> {
    let progress = Progress::new(args.setup.common.quiet);
    let prepared = prepare(config, &args.setup.sensor, &progress)?;
    progress.end();
    let (config, dataset) = (&prepared.config, &prepared.dataset);
    let bytes = stored(config, dataset).map_err(Failure::usage)?;
    output.write(&bytes)?;
    let (facts, file) = (Facts::new(dataset), args.output.display());
    if args.setup.common.json {
        let document =
            json!({ "format": 1, "file": file.to_string(), "bytes": bytes.len(), "set": facts });
        return exit::print_json(&document);
    }
    let size = match bytes.len() as f64 / 1e3 {
        kilobytes if kilobytes < 100.0 => format!("{kilobytes:.1} kB"),
        kilobytes => format!("{:.1} MB", kilobytes / 1e3),
    };
    exit::print(&format!("wrote {size} to {file}\n"))
}
