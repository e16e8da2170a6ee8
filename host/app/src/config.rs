//! `echoloop config`.

use clap::Args;
use echoloop_files::one_line;

use super::common::{Common, ConfigSource};
use super::exit::{self, Failure, print};
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::config::key_reference::{explained, selected};
use echoloop_closed_loop::parameters::{Parameters, parameter_json, parameter_table};
use echoloop_closed_loop::prepared::space;

/// Flags of `config`.
#[derive(Clone, Debug, Args)]
pub(crate) struct ConfigArgs {
    #[command(flatten)]
    source: ConfigSource,
    #[command(flatten)]
    common: Common,
    /// List every tunable parameter with unit, range and default.
    #[arg(long, conflicts_with = "explain")]
    parameters: bool,
    /// Explain every key, those of a section, or one: what it is, unit, range and default.
    #[arg(long, value_name = "KEY|SECTION", num_args = 0..=1, default_missing_value = "")]
    explain: Option<String>,
}

pub(super) fn run(args: &ConfigArgs) -> Result<(), Failure> {
    let config = args.source.load(Vec::new())?;
    // Refuses what a run would refuse.
    let device = config.device();
    let start = Parameters::start(&config, &device)?;
    space(&config, start, device)?;
    let (method, preset) = (config.registration.method, config.registration.preset);
    let json = args.common.json;
    if let Some(asked) = &args.explain {
        return explain(&config, asked, json);
    }
    print(&match (args.parameters, json) {
        (true, true) => format!("{}\n", parameter_json(method, preset)),
        (true, false) => parameter_table(method, preset),
        (false, true) => exit::json(&config)?,
        (false, false) => toml::to_string(&config).map_err(Failure::run)?,
    })
}

fn explain(config: &RunConfig, asked: &str, json: bool) -> Result<(), Failure> {
    let rows = selected(explained(config)?, asked).map_err(|sections| {
        Failure::usage(format!(
            "--explain {}: no key and no section is called that; the sections are {sections}",
            one_line(asked.trim_matches(['[', ']']))
        ))
    })?;
    match json {
        true => exit::print_json(&rows),
        false => print(&rows.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")),
    }
}
