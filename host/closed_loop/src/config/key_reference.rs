//! Reference of the keys of a configuration: meaning, unit, bounds and default of each.

use std::collections::BTreeMap;
use std::fmt;

use echoloop_parameters::Parameter;
use echoloop_registration::{Method, SETTINGS};
use serde::Serialize;
use toml::Value;

use super::preset::Strategy;
use super::{LoadError, Override, RunConfig, ScannerConfig, load};
use crate::parameters::{Ranges, Row, ThetaReg, table, written};

/// Reference of a key.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explained {
    /// Section and key.
    pub key: &'static str,
    /// Unit; empty for plain numbers.
    pub unit: &'static str,
    /// Bounds, to follow "must be".
    pub must: String,
    /// Minimum of a number.
    pub min: Option<f64>,
    /// Maximum of a number; None where there is none.
    pub max: Option<f64>,
    /// Names that a choice chooses from.
    pub choices: &'static [&'static str],
    /// Default; `None` where the key is left out.
    pub default: Option<Value>,
    /// Value in the configuration at hand.
    pub value: Option<Value>,
    /// Defaults with other choices of method, strategy and pattern.
    pub other_defaults: Vec<OtherDefault>,
    /// Meaning.
    pub help: &'static str,
}

/// Default that goes with other choices.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OtherDefault {
    /// The choices, any of them: `registration.method = "fgr"`.
    pub with: Vec<String>,
    /// Default; `None` where the key is left out.
    pub default: Option<Value>,
}

/// Text of a value in a file.
pub fn said(value: Option<&Value>) -> String {
    value.map_or_else(|| "left out".to_owned(), Value::to_string)
}

/// Reads `5.0 with registration.method = "fgr", "mac"`.
impl fmt::Display for OtherDefault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut keys: Vec<(&str, Vec<&str>)> = Vec::new();
        for (key, name) in self.with.iter().filter_map(|choice| choice.split_once(" = ")) {
            match keys.iter_mut().find(|(known, _)| *known == key) {
                Some((_, names)) => names.push(name),
                None => keys.push((key, vec![name])),
            }
        }
        let each = keys.iter().map(|(key, names)| format!("{key} = {}", names.join(", ")));
        let with = each.collect::<Vec<_>>().join("; ");
        write!(f, "{} with {with}", said(self.default.as_ref()))
    }
}

/// The key in lines: its default, bound, help, other defaults, and its value where that differs.
impl fmt::Display for Explained {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = if self.default.is_some() { self.unit } else { "" };
        let head = format!("{} = {} {unit}", self.key, said(self.default.as_ref()));
        writeln!(f, "{}", head.trim_end())?;
        writeln!(f, "    {}\n    must be {}", self.help.replace('`', ""), self.must)?;
        self.other_defaults.iter().try_for_each(|other| writeln!(f, "    {other}"))?;
        match self.value == self.default {
            true => Ok(()),
            false => writeln!(f, "    now {}", said(self.value.as_ref())),
        }
    }
}

/// Rows of a key, a section, or a key's last name; all where nothing is asked for.
///
/// # Errors
///
/// The sections there are, when none has that name.
pub fn selected(rows: Vec<Explained>, asked: &str) -> Result<Vec<Explained>, String> {
    let asked = asked.trim_matches(['[', ']']);
    let is_key = |row: &Explained| row.key == asked;
    let in_section = |row: &Explained| {
        asked.is_empty() || row.key.strip_prefix(asked).is_some_and(|rest| rest.starts_with('.'))
    };
    let is_named = |row: &Explained| row.key.rsplit('.').next() == Some(asked);
    let kinds: [&dyn Fn(&Explained) -> bool; 3] = [&is_key, &in_section, &is_named];
    if let Some(is_asked) = kinds.into_iter().find(|is_asked| rows.iter().any(is_asked)) {
        return Ok(rows.iter().filter(|row| is_asked(row)).cloned().collect());
    }
    let mut sections: Vec<&str> =
        rows.iter().filter_map(|row| Some(row.key.rsplit_once('.')?.0)).collect();
    sections.dedup();
    Err(sections.join(", "))
}

/// Values by key, without those that are left out.
type ValuesByKey = BTreeMap<String, Value>;

/// Reference of every key, in the order of the file, with the defaults of the configuration's
/// method, preset, strategy and pattern.
///
/// # Errors
///
/// [`LoadError`] when the configuration's own choices do not go together.
pub fn explained(config: &RunConfig) -> Result<Vec<Explained>, LoadError> {
    let choices = [
        ("registration.method", config.registration.method.name().to_owned()),
        ("registration.preset", config.registration.preset.name().to_owned()),
        ("tune.strategy", config.tune.strategy.name().to_owned()),
        ("scanner.pattern", config.scanner.pattern.clone()),
    ];
    let default = values(&with(&choices)?);
    let others = others(&choices)?;
    let now = values(config);
    let explain = |row: Row| {
        let Parameter { key, unit, bounds, help, .. } = row.parameter;
        let usual = default.get(key).cloned();
        Explained {
            other_defaults: other_defaults(key, usual.as_ref(), &others),
            value: now.get(key).cloned(),
            default: usual,
            key,
            unit,
            must: row.expected(),
            min: row.range().map(|[min, _]| min),
            max: row.range().map(|[_, max]| max).filter(|max| max.is_finite()),
            choices: bounds.names(),
            help,
        }
    };
    Ok(table(config).into_iter().map(explain).collect())
}

/// The default configuration with some choices made.
fn with(choices: &[(&str, String)]) -> Result<RunConfig, LoadError> {
    let made: Vec<Override> =
        choices.iter().map(|(key, name)| Override::flag(key, name.as_str())).collect();
    load(None, &made)
}

/// The defaults with each other choice of a method, a strategy and a pattern, by its key and name.
fn others(choices: &[(&str, String); 4]) -> Result<Vec<(String, ValuesByKey)>, LoadError> {
    let names: [(usize, Vec<&str>); 3] = [
        (0, Method::NAMES.to_vec()),
        (2, Strategy::NAMES.to_vec()),
        (3, ScannerConfig::patterns().collect()),
    ];
    let mut found = Vec::new();
    for (at, names) in names {
        for name in names.into_iter().filter(|name| *name != choices[at].1) {
            let mut other = choices.clone();
            other[at].1 = name.to_owned();
            found.push((format!("{} = {name:?}", other[at].0), values(&with(&other)?)));
        }
    }
    Ok(found)
}

/// The other defaults of a key, each once; of a choice itself none.
fn other_defaults(
    key: &str,
    usual: Option<&Value>,
    others: &[(String, ValuesByKey)],
) -> Vec<OtherDefault> {
    let mut found: Vec<OtherDefault> = Vec::new();
    for (choice, values) in others {
        let default = values.get(key);
        // A pattern without a key refuses it; the key's help says of which it is.
        let is_without = default.is_none() && key.starts_with("scanner.");
        if default == usual || is_without || choice.starts_with(&format!("{key} =")) {
            continue;
        }
        match found.iter_mut().find(|other| other.default.as_ref() == default) {
            Some(other) => other.with.push(choice.clone()),
            None => {
                found.push(OtherDefault { with: vec![choice.clone()], default: default.cloned() });
            }
        }
    }
    // One that every other pattern has is named once.
    let is_of_pattern = |choice: &&String| choice.starts_with("scanner.pattern =");
    let patterns = others.iter().map(|(choice, _)| choice).filter(is_of_pattern).count();
    for other in &mut found {
        if other.with.iter().filter(is_of_pattern).count() == patterns {
            other.with.retain(|choice| !is_of_pattern(&choice));
            other.with.push("scanner.pattern = any other".into());
        }
    }
    found
}

/// Every value of a configuration, with the settings of its method, given or not.
fn values(config: &RunConfig) -> ValuesByKey {
    let mut values = ValuesByKey::new();
    if let Ok(table) = toml::Table::try_from(config) {
        flatten("", &table, &mut values);
    }
    let own = [
        ("registration.mode", config.registration.mode.name().into()),
        ("registration.refine", config.registration.refine.into()),
    ];
    values.extend(own.map(|(key, value): (&str, Value)| (key.to_owned(), value)));
    let axes = Ranges::from(config).of_registration(config.registration.method);
    let Ok(theta) = ThetaReg::start(&config.registration, &axes) else { return values };
    let of_method = SETTINGS.iter().filter_map(|setting| {
        let value = written(setting.path, theta.get(setting.path)?);
        Some((setting.path.to_owned(), Value::try_from(value).ok()?))
    });
    values.extend(of_method);
    values
}

fn flatten(prefix: &str, table: &toml::Table, values: &mut ValuesByKey) {
    for (key, value) in table {
        match value {
            Value::Table(table) => flatten(&format!("{prefix}{key}."), table, values),
            value => drop(values.insert(format!("{prefix}{key}"), value.clone())),
        }
    }
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::PARAMETERS;
    use echoloop_parameters::{Bounds, Kind, Range};

    use super::*;
    use crate::config::key;
    use crate::parameters::Parameters;

    /// Other keys that must be set for the bounds of a key to apply.
    fn beside(key: &str, when: Option<&str>) -> Vec<&'static str> {
        match (key, when) {
            ("tune.extended_to", _) => vec!["tune.generations=1"],
            ("scanner.beams", _) => vec!["scanner.pattern=livox-mid-40"],
            (key, _) if key.starts_with("scanner.") => vec!["scanner.pattern=grid"],
            (_, Some("in fog")) => vec!["weather.kind=fog"],
            (_, Some("in rain")) => vec!["weather.kind=rain"],
            (_, Some("in snow")) => vec!["weather.kind=wet-snow"],
            _ => Vec::new(),
        }
    }

    fn loaded(sets: &[String]) -> Result<RunConfig, String> {
        let overrides: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
        load(None, &overrides).map_err(|error| error.to_string())
    }

    fn default_rows() -> Vec<Explained> {
        explained(&load(None, &[]).unwrap()).unwrap()
    }

    #[test]
    fn every_key_of_the_default_configuration_is_explained_once() {
        let rows = default_rows();
        let named = |name: &str| rows.iter().filter(|row| row.key == name).count();
        let mut values = ValuesByKey::new();
        flatten("", &toml::Table::try_from(RunConfig::default()).unwrap(), &mut values);
        for key in values.keys() {
            assert_eq!(named(key), 1, "{key}");
        }
        for row in &rows {
            assert_eq!(named(row.key), 1, "{}", row.key);
            assert!(row.help.ends_with('.') && row.help.len() > 8, "{}: {}", row.key, row.help);
            assert!(!row.must.is_empty(), "{}", row.key);
            // Each is a key: an unknown one is another error.
            let said = loaded(&[format!("{}=!", row.key)]);
            assert!(!format!("{said:?}").contains("unknown field"), "{}: {said:?}", row.key);
        }
    }

    #[test]
    fn a_printed_default_is_the_configuration_s() {
        let usual = load(None, &[]).unwrap();
        for row in default_rows() {
            assert_eq!(row.value, row.default, "{}", row.key);
            let Some(default) = row.default else { continue };
            let given = loaded(&[format!("{}={default}", row.key)]).unwrap();
            let start = |config: &RunConfig| Parameters::start(config, &config.device()).unwrap();
            assert_eq!(start(&given), start(&usual), "{}", row.key);
            let without =
                |config: RunConfig| RunConfig { registration: usual.registration, ..config };
            assert_eq!(without(given), usual, "{}", row.key);
        }
        let of = |name: &str| default_rows().into_iter().find(|row| row.key == name).unwrap();
        assert_eq!(of("data.baseline_m").default, Some(Value::Float(2.0)));
        let global = OtherDefault {
            with: ["fgr", "mac", "auto"]
                .map(|name| format!("registration.method = {name:?}"))
                .into(),
            default: Some(Value::Float(5.0)),
        };
        assert_eq!(of("data.baseline_m").other_defaults, [global]);
        assert_eq!(of("tune.pairs_per_generation").other_defaults[0].default, Some(0.into()));
        assert_eq!(of("front.cost").default, None);
    }

    #[test]
    fn printed_bounds_are_those_that_are_checked() {
        let mut stepped = 0;
        for row in default_rows() {
            let own = key(row.key);
            let whole = row.default.as_ref().is_some_and(Value::is_integer)
                || own.is_some_and(|key| key.kind == Kind::Whole);
            let count = match own.map(|key| key.kind) {
                Some(Kind::Numbers(count)) => count,
                _ => 1,
            };
            let text = |number: f64| match count {
                1 if whole => format!("{number}"),
                1 => format!("{number:?}"),
                _ => format!("[{}]", vec![format!("{number:?}"); count].join(", ")),
            };
            let tried = |number: f64, when| {
                let mut sets: Vec<String> =
                    beside(row.key, when).into_iter().map(str::to_owned).collect();
                sets.push(format!("{}={}", row.key, text(number)));
                let config = loaded(&sets)?;
                let start = Parameters::start(&config, &config.device());
                start.map(drop).map_err(|error| error.to_string())
            };
            let ranges = match own {
                Some(key) if !matches!(key.bounds, Bounds::Count(..)) => key.bounds.ranges(),
                Some(_) => Vec::new(),
                None => {
                    let range = row.min.zip(row.max);
                    let range = range.map(|(min, max)| (None, Range::new(min, max)));
                    range.into_iter().collect()
                }
            };
            // A parameter of the sensor is read in its wire unit: half of one is no step.
            let code = PARAMETERS.iter().find(|p| row.key == format!("lidar.{}", p.name));
            let step = code.map_or(1.0, |p| 1.0 / f64::from(p.codes_per_unit));
            for (when, range) in ranges {
                let (below, above) = match whole || code.is_some() {
                    true => (range.min - step, range.max + step),
                    false => (range.min.next_down(), range.max.next_up()),
                };
                let below = if range.excludes_min { range.min } else { below };
                let outside = [below, above, f64::NAN].into_iter().filter(|n| n.is_finite());
                for number in outside.chain((!whole).then_some(f64::NAN)) {
                    if own.is_some_and(|key| key.bounds.allows(number)) && when.is_none() {
                        continue; // 0, which means something
                    }
                    let said = tried(number, when).unwrap_err();
                    let name = row.key.rsplit('.').next().unwrap();
                    assert!(said.contains(name), "{} {number}: {said}", row.key);
                    stepped += 1;
                }
                let inside = [range.min, range.max];
                for number in inside.into_iter().filter(|n| n.is_finite() && !range.excludes_min) {
                    let is_ours = |said: &String| said.contains(&format!("{} = ", row.key));
                    let said = tried(number, when);
                    assert!(!said.as_ref().is_err_and(is_ours), "{} {number}: {said:?}", row.key);
                }
            }
        }
        assert!(stepped > 150, "{stepped}");
    }

    #[test]
    fn every_printed_choice_is_read_and_there_is_no_other() {
        let mut seen = 0;
        for row in default_rows().into_iter().filter(|row| !row.choices.is_empty()) {
            let is_read = |name: &str| loaded(&[format!("{}={name}", row.key)]);
            for name in row.choices {
                let said = is_read(name);
                assert!(!said.as_ref().is_err_and(|s| s.contains("unknown variant")), "{said:?}");
                seen += 1;
            }
            let said = is_read("conjured").unwrap_err();
            let names = said.matches('`').count() / 2;
            assert!(row.choices.iter().all(|name| said.contains(name)), "{}: {said}", row.key);
            if said.contains("unknown variant") {
                assert_eq!(names, row.choices.len() + 1, "{}: {said}", row.key);
            }
        }
        assert!(seen > 40, "{seen}");
    }

    #[test]
    fn the_defaults_are_those_of_the_method_at_hand_and_the_value_is_what_is_set() {
        let config = loaded(&["registration.method=mac".into(), "data.baseline_m=3".into()]);
        let rows = explained(&config.unwrap()).unwrap();
        let of = |name: &str| rows.iter().find(|row| row.key == name).unwrap();
        let baseline = of("data.baseline_m");
        assert_eq!(baseline.default, Some(Value::Float(5.0)));
        assert_eq!(baseline.value, Some(Value::Float(3.0)));
        assert_eq!(of("registration.least_clique").default, Some(Value::Integer(3)));
        assert_eq!(of("registration.kernel_width").default, None);
        assert!(of("registration.voxel_m").must.starts_with("0.05 to 1 in a run; "));
    }
}
