//! A flag for each row of registration's table of settings.

use std::num::ParseFloatError;
use std::sync::LazyLock;

use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};

use super::exit::Failure;
use super::method_choice::{MODE_HELP, mode_parser};
use super::number::seed;
use echoloop_parameters::Kind;
use echoloop_registration::config::given::{Given, GivenError};
use echoloop_registration::{FgrMode, Method, SETTINGS, Setting};

const HEADING: &str = "Settings; those left out are chosen from the clouds";

/// Settings of a method that the user gives; the others are chosen from the clouds.
#[derive(Clone, Debug)]
pub(super) struct MethodFlags {
    /// Numbers.
    given: Vec<(&'static Setting, f64)>,
    own: OtherFlags,
}

/// Flags that are not in the table of settings.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = HEADING)]
struct OtherFlags {
    #[arg(long, value_name = "MODE", help = MODE_HELP, value_parser = mode_parser())]
    mode: Option<FgrMode>,
    /// Seed of FGR's draws [default: 0].
    #[arg(long, value_name = "N", value_parser = seed)]
    seed: Option<u64>,
}

/// A flag for each setting. Built once, as their names are leaked: clap needs them `'static`.
static FLAGS: LazyLock<Vec<Arg>> = LazyLock::new(|| SETTINGS.iter().map(flag).collect());

fn flag(setting: &'static Setting) -> Arg {
    let name = |key: &str| &*dashed(key).leak();
    let arg = Arg::new(setting.key)
        .long(name(setting.key))
        .value_name(value_name(setting))
        .value_parser(move |text: &str| number(setting, text))
        .help(help(setting))
        .help_heading(HEADING);
    setting.former.map(name).into_iter().fold(arg, Arg::alias)
}

fn dashed(key: &str) -> String {
    key.replace('_', "-")
}

/// Reads a number. Its bound is checked later, when the method is known.
fn number(setting: &Setting, text: &str) -> Result<f64, String> {
    match setting.kind {
        Kind::Whole => text
            .parse::<usize>()
            .map(|count| count as f64)
            .map_err(|_| format!("expected a whole number, {}", setting.bounds())),
        _ => text.parse().map_err(|error: ParseFloatError| error.to_string()),
    }
}

/// Settings that the command line gives.
fn given(matches: &ArgMatches) -> impl Iterator<Item = (&'static Setting, f64)> {
    SETTINGS.iter().filter_map(|setting| Some((setting, *matches.get_one(setting.key)?)))
}

fn value_name(setting: &Setting) -> &'static str {
    match (setting.kind, setting.unit) {
        (Kind::Whole, _) => "N",
        (_, "m") => "M",
        (_, "rad") => "RAD",
        _ => "SHARE",
    }
}

/// Names of the methods that have a setting.
fn methods(setting: &Setting) -> Vec<&'static str> {
    let having = Method::ALL.into_iter().filter(|&method| setting.of(method).is_some());
    having.map(Method::name).collect()
}

/// Help of a setting with its bounds; the methods that have it come first, unless all do.
fn help(setting: &Setting) -> String {
    let line = setting.help.strip_suffix('.').unwrap_or(setting.help);
    let line = format!("{line} [{}]", setting.bounds());
    let methods = methods(setting);
    if methods.len() == Method::ALL.len() {
        return line;
    }
    let (first, rest) = line.split_at(line.chars().next().map_or(0, char::len_utf8));
    format!("{}: {}{rest}", methods.join(", "), first.to_lowercase())
}

impl FromArgMatches for MethodFlags {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        Ok(Self { given: given(matches).collect(), own: OtherFlags::from_arg_matches(matches)? })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        self.given.extend(given(matches));
        self.own.update_from_arg_matches(matches)
    }
}

impl Args for MethodFlags {
    fn augment_args(command: Command) -> Command {
        OtherFlags::augment_args(command.args(FLAGS.iter().cloned()))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl MethodFlags {
    /// Settings as the library takes them.
    pub(super) fn given(&self) -> Given {
        Given { numbers: self.given.clone(), mode: self.own.mode, seed: self.own.seed }
    }
}

/// Refusal of a setting, by its flag.
pub(super) fn refused(error: &GivenError) -> Failure {
    Failure::usage(match error {
        GivenError::NoSetting { key, method } => {
            format!("--{} is no setting of {}", dashed(key), method.name())
        }
        GivenError::Bounds(error) => error.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use echoloop_parameters::Kind;
    use echoloop_registration::setting;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        flags: MethodFlags,
    }

    fn read(flag: &str, value: &str) -> Result<MethodFlags, String> {
        let line = Line::try_parse_from(["line", &format!("--{flag}"), value]);
        line.map(|line| line.flags).map_err(|error| error.to_string())
    }

    #[test]
    fn every_setting_has_a_flag_by_its_current_and_its_former_name() {
        for setting in SETTINGS {
            for name in [Some(setting.key), setting.former].into_iter().flatten() {
                let flags = read(&dashed(name), "7").unwrap();
                assert!(matches!(flags.given[..], [(given, 7.0)] if given.key == setting.key));
                for method in Method::ALL {
                    let checked =
                        flags.given().check(method).map_err(|error| refused(&error).message);
                    let is_refused = checked.is_err_and(|why| why.contains("is no setting of"));
                    assert_eq!(is_refused, setting.of(method).is_none());
                }
            }
            let fraction = read(&dashed(setting.key), "7.5");
            assert_eq!(fraction.is_err(), setting.kind == Kind::Whole, "{}", setting.key);
        }
    }

    #[test]
    fn the_help_has_every_setting_once_with_its_methods() {
        let help = <Line as clap::CommandFactory>::command().render_long_help().to_string();
        for setting in SETTINGS {
            let flag = format!("--{} <{}>", dashed(setting.key), value_name(setting));
            assert_eq!(help.matches(&flag).count(), 1, "{flag}");
            assert!(setting.former.is_none_or(|former| !help.contains(&dashed(former))));
        }
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        let of = |key: &str| methods(setting(key).unwrap()).join(", ");
        let distance = "largest distance between the points of a pair, m [a length above 0 m, at \
             most 1e6 m] --";
        let turn = "turn of a step, rad, below which the run ends if its length";
        for line in [
            &format!("{}: {distance}", of("max_pair_distance_m")),
            "fgr, mac: radius of the neighbourhood of a feature, m [a length above 0 m, at most \
             1e6 m; normal_radius_m or more (Sec. 3.3)]",
            ": 1 or more; fgr: 1 to 100000; mac: at most 100000]",
            &format!("{}: {turn}", of("rotation_tolerance_rad")),
        ] {
            assert!(help.contains(line), "{line}: {help}");
        }
    }
}
