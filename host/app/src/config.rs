//! `echoloop config`.

use clap::Args;
use echoloop_files::shown;

use super::common::{Common, ConfigSource};
use super::exit::{self, Failure, print};
use super::parameter_table::{parameter_json, parameter_table};
use super::prepared::space;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::config::key_reference::{Explained, explained, said};
use echoloop_closed_loop::parameters::Parameters;

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
    // What a run would refuse is no configuration to begin one with.
    let hardware = config.hardware();
    let start = Parameters::start(&config, &hardware).map_err(Failure::usage)?;
    space(&config, start, hardware)?;
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
    let rows = chosen(explained(config).map_err(Failure::usage)?, asked)?;
    match json {
        true => print(&exit::json(&rows)?),
        false => print(&rows.iter().map(told).collect::<Vec<_>>().join("\n")),
    }
}

/// The rows of a section, of a key, or of a key's last name; all, if nothing is asked for.
fn chosen(rows: Vec<Explained>, asked: &str) -> Result<Vec<Explained>, Failure> {
    let asked = asked.trim_matches(['[', ']']);
    let sections = || {
        let mut sections: Vec<&str> =
            rows.iter().filter_map(|row| Some(row.key.rsplit_once('.')?.0)).collect();
        sections.dedup();
        sections.join(", ")
    };
    let in_section = |row: &Explained| {
        asked.is_empty() || row.key.strip_prefix(asked).is_some_and(|rest| rest.starts_with('.'))
    };
    let is_key = |row: &Explained| row.key == asked;
    let is_named = |row: &Explained| row.key.rsplit('.').next() == Some(asked);
    let kinds: [&dyn Fn(&Explained) -> bool; 3] = [&is_key, &in_section, &is_named];
    match kinds.into_iter().find(|is_asked| rows.iter().any(is_asked)) {
        Some(is_asked) => Ok(rows.iter().filter(|row| is_asked(row)).cloned().collect()),
        None => Err(Failure::usage(format!(
            "--explain {}: no key and no section is called that; the sections are {}",
            shown(asked),
            sections()
        ))),
    }
}

/// A key in lines: its default, what it must be, what it is, and where it is otherwise.
fn told(row: &Explained) -> String {
    let default = said(row.default.as_ref());
    let unit = if row.default.is_some() { row.unit } else { "" };
    let mut text_of = format!("{} = {default} {unit}", row.key).trim_end().to_owned() + "\n";
    let mut line = |text: &str| text_of += &format!("    {text}\n");
    line(&row.help.replace('`', ""));
    line(&format!("must be {}", row.must));
    row.other_defaults.iter().for_each(|other| line(&other.to_string()));
    if row.value != row.default {
        line(&format!("now {}", said(row.value.as_ref())));
    }
    text_of
}
