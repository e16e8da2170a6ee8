//! A flag for each row of registration's table of settings.

use std::sync::LazyLock;

use clap::{Arg, ArgMatches, Args, Command, FromArgMatches, value_parser};

use super::exit::Failure;
use super::method_choice::{MODE_HELP, mode_parser};
use super::number::seed;
use echoloop_registration::{
    FgrMode, Method, MethodConfig, SETTINGS, Setting, SettingKind, Suggestions,
};

const HEADING: &str = "Settings; those left out are chosen from the clouds";

/// Settings of a method that the user gives; the others are chosen from the clouds.
#[derive(Clone, Debug)]
pub(super) struct MethodFlags {
    /// Numbers.
    given: Vec<(&'static Setting, f64)>,
    own: OwnFlags,
}

/// Flags that are no numbers of the table.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = HEADING)]
struct OwnFlags {
    #[arg(long, value_name = "MODE", help = MODE_HELP, value_parser = mode_parser())]
    mode: Option<FgrMode>,
    /// Of fgr: seed of its draws [default: 0].
    #[arg(long, value_name = "N", value_parser = seed)]
    seed: Option<u64>,
}

/// Flag of a setting. The parser keeps names as long as the program runs.
struct Flag {
    setting: &'static Setting,
    name: String,
    former: Option<String>,
}

static FLAGS: LazyLock<Vec<Flag>> = LazyLock::new(|| {
    let flag = |setting: &'static Setting| Flag {
        setting,
        name: dashed(setting.key),
        former: setting.former.map(dashed),
    };
    SETTINGS.iter().map(flag).collect()
});

fn dashed(key: &str) -> String {
    key.replace('_', "-")
}

impl Flag {
    fn arg(&'static self) -> Arg {
        let arg = Arg::new(self.setting.key)
            .long(self.name.as_str())
            .value_name(value_name(self.setting))
            .help(help(self.setting))
            .help_heading(HEADING);
        let arg = match self.setting.kind {
            SettingKind::Count => arg.value_parser(move |text: &str| whole(self.setting, text)),
            SettingKind::Real | SettingKind::Optional => arg.value_parser(value_parser!(f64)),
        };
        self.former.iter().fold(arg, |arg, former| arg.alias(former.as_str()))
    }

    fn value(&self, matches: &ArgMatches) -> Option<(&'static Setting, f64)> {
        let key = self.setting.key;
        let value = match self.setting.kind {
            SettingKind::Count => matches.get_one(key).map(|&count: &usize| count as f64),
            SettingKind::Real | SettingKind::Optional => matches.get_one(key).copied(),
        };
        value.map(|value| (self.setting, value))
    }
}

/// Reads a count. Its bound is checked later, when the method is known.
fn whole(setting: &Setting, text: &str) -> Result<usize, String> {
    text.parse().map_err(|_| format!("expected a whole number, {}", setting.bounds()))
}

fn value_name(setting: &Setting) -> &'static str {
    match (setting.kind, setting.unit) {
        (SettingKind::Count, _) => "N",
        (_, "m") => "M",
        (_, "rad") => "RAD",
        _ => "SHARE",
    }
}

/// Help of the table with the setting's bounds, after the methods that have it unless all do.
fn help(setting: &Setting) -> String {
    let line = setting.help.strip_suffix('.').unwrap_or(setting.help);
    let line = format!("{line} [{}]", setting.bounds());
    let methods = Method::ALL.into_iter().filter(|&method| setting.of(method).is_some());
    let methods: Vec<&str> = methods.map(Method::name).collect();
    if methods.len() == Method::ALL.len() {
        return line;
    }
    let (first, rest) = line.split_at(line.chars().next().map_or(0, char::len_utf8));
    format!("{}: {}{rest}", methods.join(", "), first.to_lowercase())
}

impl FromArgMatches for MethodFlags {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = FLAGS.iter().filter_map(|flag| flag.value(matches)).collect();
        Ok(Self { given, own: OwnFlags::from_arg_matches(matches)? })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        self.given.extend(FLAGS.iter().filter_map(|flag| flag.value(matches)));
        self.own.update_from_arg_matches(matches)
    }
}

impl Args for MethodFlags {
    fn augment_args(command: Command) -> Command {
        OwnFlags::augment_args(command.args(FLAGS.iter().map(Flag::arg)))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl MethodFlags {
    fn gives(&self, key: &str) -> bool {
        self.given.iter().any(|(setting, _)| setting.key == key)
    }

    /// Refuses settings that the method does not have, and values out of bounds.
    pub(super) fn check(&self, method: Method) -> Result<(), Failure> {
        let strange = self.given.iter().find(|(setting, _)| setting.of(method).is_none());
        let own = [("mode", self.own.mode.is_some()), ("seed", self.own.seed.is_some())];
        let own =
            own.into_iter().find(|(_, given)| *given && method != Method::Fgr).map(|(key, _)| key);
        if let Some(key) = strange.map(|(setting, _)| setting.key).or(own) {
            let flag = dashed(key);
            return Err(Failure::usage(format!("--{flag} is no setting of {}", method.name())));
        }
        for (setting, value) in &self.given {
            let checked = setting.of(method).map(|of| setting.check_alone(&of, *value));
            checked.transpose().map_err(Failure::usage)?;
        }
        Ok(())
    }

    /// Settings for two clouds: chosen from them, then as given.
    pub(super) fn config(
        &self,
        method: Method,
        suggestions: &Suggestions<'_>,
    ) -> Result<MethodConfig, Failure> {
        let voxel = self.given.iter().find(|(setting, _)| setting.key == "voxel_m");
        let mode = self.own.mode.unwrap_or_default();
        let config = suggestions.method(method, mode, voxel.map(|(_, voxel_m)| *voxel_m));
        self.laid_over(config)
    }

    /// Settings as given, the others as they are there.
    pub(super) fn laid_over(&self, mut config: MethodConfig) -> Result<MethodConfig, Failure> {
        if let (MethodConfig::Fgr(fgr), Some(seed)) = (&mut config, self.own.seed) {
            fgr.seed = seed;
        }
        self.keep_distance(&mut config);
        for (setting, value) in &self.given {
            config.set(setting.key, *value);
        }
        self.widen_features(&mut config);
        config.check().map_err(Failure::usage)?;
        Ok(config)
    }

    /// Widens the features' radius to a given normal radius, unless it is given, too.
    fn widen_features(&self, config: &mut MethodConfig) {
        if self.gives("normal_radius_m")
            && !self.gives("feature_radius_m")
            && config.method().is_global()
        {
            config.repair();
        }
    }

    /// Drops the coarse start where a pair distance is given: none may be above it.
    fn keep_distance(&self, config: &mut MethodConfig) {
        if self.gives("max_pair_distance_m") {
            match config {
                MethodConfig::Icp(config) => config.first_pair_distance_m = None,
                MethodConfig::Gicp(config) => config.first_pair_distance_m = None,
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

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
    fn every_setting_has_a_flag_by_today_s_name_and_its_former_one() {
        for setting in SETTINGS {
            for name in [Some(setting.key), setting.former].into_iter().flatten() {
                let flags = read(&dashed(name), "7").unwrap();
                assert!(matches!(flags.given[..], [(given, 7.0)] if given.key == setting.key));
                for method in Method::ALL {
                    let said = flags.check(method).map_err(|failure| failure.message);
                    let is_strange = said.is_err_and(|said| said.contains("is no setting of"));
                    assert_eq!(is_strange, setting.of(method).is_none());
                }
            }
            let fraction = read(&dashed(setting.key), "7.5");
            assert_eq!(fraction.is_err(), setting.kind == SettingKind::Count, "{}", setting.key);
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
        for line in [
            "icp, gicp, fgr, mac: largest distance between the points of a pair, m [a length above \
             0 m, at most 1e6 m] --",
            "fgr, mac: radius of the neighbourhood of a feature, m [a length above 0 m, at most \
             1e6 m; normal_radius_m or more (Sec. 3.3)]",
            "iterations [icp, gicp: 1 or more; fgr: 1 to 100000; mac: at most 100000]",
            "icp, gicp: turn of a step, rad, below which the run ends if its length",
        ] {
            assert!(help.contains(line), "{line}: {help}");
        }
    }
}
