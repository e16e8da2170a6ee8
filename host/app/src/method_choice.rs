//! `--method`, `--mode` and `--refine`, and flags that take a name of a table.

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use echoloop_closed_loop::config::{FgrMode, Method, Override};

/// Help of `--mode`.
pub(super) const MODE_HELP: &str =
    "Of fgr: as published, or as Open3D 0.20 runs it from Python, the paper's baseline";

/// Flags of commands that scan and register.
#[derive(Clone, Debug, Args)]
pub(super) struct MethodChoice {
    /// Registration method; global ones (fgr, mac) get scans 5 m apart unless data.baseline_m says
    /// otherwise.
    #[arg(long, value_parser = method_parser())]
    method: Option<Method>,
    #[arg(long, help = MODE_HELP, value_parser = mode_parser())]
    mode: Option<FgrMode>,
    /// Whether point-to-plane ICP finishes what a global method finds [default: true with fgr and
    /// mac, but not with --mode open3d or the paper's strategy].
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true")]
    refine: Option<bool>,
}

impl MethodChoice {
    /// Changes of the configuration.
    pub(super) fn overrides(&self) -> Vec<Override> {
        let method = self.method.map(|method| Override::flag("registration.method", method.name()));
        let mode = self.mode.map(|mode| Override::flag("registration.mode", mode.name()));
        let refine = self.refine.map(|refine| Override::flag("registration.refine", refine));
        method.into_iter().chain(mode).chain(refine).collect()
    }
}

/// Name of a value on the command line, which is also its name in the file.
pub(super) fn toml_name(value: impl clap::ValueEnum) -> toml::Value {
    value.to_possible_value().map(|v| v.get_name().to_owned()).unwrap_or_default().into()
}

/// Names of the methods of a kind: `icp, gicp and auto`.
pub(super) fn methods_that(is_one: fn(Method) -> bool) -> String {
    let names: Vec<&str> =
        Method::ALL.into_iter().filter(|method| is_one(*method)).map(Method::name).collect();
    match names.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        _ => names.concat(),
    }
}

/// Reads `--method`.
pub(super) fn method_parser() -> impl TypedValueParser<Value = Method> {
    one_of(Method::ALL.map(|method| (method.name(), method.summary(), method)))
}

/// Reads `--mode`.
pub(super) fn mode_parser() -> impl TypedValueParser<Value = FgrMode> {
    one_of(FgrMode::ALL.map(|mode| (mode.name(), mode.summary(), mode)))
}

/// Parser of a table's names, each with a line of help.
pub(super) fn one_of<T: Copy + Send + Sync + 'static, const N: usize>(
    choices: [(&'static str, &'static str, T); N],
) -> impl TypedValueParser<Value = T> {
    let values = choices.map(|(name, summary, _)| PossibleValue::new(name).help(summary));
    PossibleValuesParser::new(values).try_map(move |given| {
        let found = choices.iter().find(|(name, ..)| *name == given);
        found.map(|(.., choice)| *choice).ok_or_else(|| format!("no choice is called {given}"))
    })
}
