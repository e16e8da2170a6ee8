//! `[tune.axes]`: parameters that a search moves other than usual, and their ranges.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use echoloop_files::one_line;
use serde::de::{Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::parameters::tunable;

/// The user's choice of an axis.
///
/// Its text is `fixed`, `free`, or `LO..HI` with `,log` or `,linear` after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisChoice {
    /// Not searched: the start stays.
    Fixed,
    /// Searched within the usual range.
    Free,
    /// Searched within these bounds.
    Within {
        /// Least value, in the parameter's unit.
        min: f64,
        /// Greatest value.
        max: f64,
        /// True when even in the logarithm, false when even; None follows the usual axis.
        log: Option<bool>,
    },
}

impl FromStr for AxisChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            let found = one_line(text);
            format!("expected fixed, free, or bounds as 1..100 or 1..100,log, found `{found}`")
        };
        match text {
            "fixed" => return Ok(Self::Fixed),
            "free" => return Ok(Self::Free),
            _ => {}
        }
        let (range, spacing) = match text.split_once(',') {
            Some((range, spacing)) => (range, Some(spacing.trim())),
            None => (text, None),
        };
        let log = match spacing {
            None => None,
            Some("log") => Some(true),
            Some("linear") => Some(false),
            Some(_) => return Err(wrong()),
        };
        let (min, max) = range.split_once("..").ok_or_else(wrong)?;
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
        let (min, max) = number(min).zip(number(max)).ok_or_else(wrong)?;
        match min < max {
            true => Ok(Self::Within { min, max, log }),
            false => Err(format!("expected bounds that rise, found {min} to {max}")),
        }
    }
}

impl fmt::Display for AxisChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed => f.write_str("fixed"),
            Self::Free => f.write_str("free"),
            Self::Within { min, max, log } => {
                write!(f, "{min}..{max}")?;
                f.write_str(log.map_or("", |log| if log { ",log" } else { ",linear" }))
            }
        }
    }
}

/// The choices of a configuration: of parameters of the sensor and of registration, by full name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnAxes(BTreeMap<String, AxisChoice>);

impl OwnAxes {
    /// True when all axes are as usual.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Choice for a parameter, by its full name.
    pub fn of(&self, name: &str) -> Option<AxisChoice> {
        self.0.get(name).copied()
    }

    /// Removes the choices for parameters whose full name begins like this.
    pub fn forget(&mut self, beginning: &str) {
        self.0.retain(|name, _| !name.starts_with(beginning));
    }

    /// All choices, by full name.
    pub fn iter(&self) -> impl Iterator<Item = (&str, AxisChoice)> {
        self.0.iter().map(|(name, choice)| (name.as_str(), *choice))
    }
}

/// The sections that parameters lie in.
const SECTIONS: [&str; 2] = ["lidar", "registration"];

impl Serialize for OwnAxes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut sections: BTreeMap<&str, BTreeMap<&str, String>> = BTreeMap::new();
        for (name, choice) in &self.0 {
            if let Some((section, key)) = name.split_once('.') {
                sections.entry(section).or_default().insert(key, choice.to_string());
            }
        }
        let mut map = serializer.serialize_map(Some(sections.len()))?;
        for (section, keys) in &sections {
            map.serialize_entry(section, keys)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for OwnAxes {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Sections)
    }
}

struct Sections;

impl<'de> Visitor<'de> for Sections {
    type Value = OwnAxes;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the sections lidar and registration with a choice for each parameter")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<OwnAxes, A::Error> {
        let mut axes = OwnAxes::default();
        while let Some(section) = map.next_key::<String>()? {
            let Some(section) = SECTIONS.into_iter().find(|known| *known == section) else {
                return Err(A::Error::unknown_field(&section, &SECTIONS));
            };
            for (key, choice) in map.next_value::<BTreeMap<String, Text>>()? {
                let Some(parameter) = tunable(&format!("{section}.{key}")) else {
                    let key = one_line(&key);
                    return Err(A::Error::custom(format_args!(
                        "there is no parameter `{section}.{key}` to tune; \
                         `echoloop config --parameters` lists them"
                    )));
                };
                let name = parameter.key;
                let choice = choice.0.parse().map_err(|problem| {
                    A::Error::custom(format_args!("tune.axes.{name}: {problem}"))
                })?;
                axes.0.insert(name.to_owned(), choice);
            }
        }
        Ok(axes)
    }
}

/// Text, and of `--set tune.axes.lidar.shots=…` nothing else.
#[derive(Deserialize)]
struct Text(String);

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<OwnAxes, String> {
        toml::from_str(text).map_err(|error| error.message().to_owned())
    }

    #[test]
    fn choices_are_read_by_section_and_written_as_they_were() {
        let text = "[lidar]\npower = \"1..100,log\"\nshots = \"free\"\n\n\
                    [registration]\nvoxel_m = \"fixed\"\n";
        let axes = read(text).unwrap();
        let within = AxisChoice::Within { min: 1.0, max: 100.0, log: Some(true) };
        assert_eq!(axes.of("lidar.power"), Some(within));
        assert_eq!(axes.of("lidar.shots"), Some(AxisChoice::Free));
        assert_eq!(axes.of("registration.voxel_m"), Some(AxisChoice::Fixed));
        assert_eq!(axes.of("lidar.gain"), None);
        assert_eq!(toml::to_string(&axes).unwrap(), text);
        let former = read("[registration]\nmax_stretch_m = \"0.1..0.5\"\n").unwrap();
        assert!(former.of("registration.length_tolerance_m").is_some(), "{former:?}");
    }

    #[test]
    fn what_is_no_choice_is_refused_by_name() {
        for (text, part) in [
            ("[lidar]\npowr = \"free\"", "no parameter `lidar.powr`"),
            ("[lidr]\npower = \"free\"", "unknown field `lidr`"),
            ("[lidar]\npower = \"100..1\"", "lidar.power: expected bounds that rise, found 100"),
            ("[lidar]\npower = \"1..1\"", "bounds that rise"),
            ("[lidar]\npower = \"1..nan\"", "found `1..nan`"),
            ("[lidar]\npower = \"1..2,cubic\"", "found `1..2,cubic`"),
            ("[lidar]\npower = \"5\"", "found `5`"),
            ("[lidar]\npower = 5", "invalid type"),
            ("[registration]\nvoxel = \"free\"", "no parameter `registration.voxel`"),
        ] {
            let said = read(text).unwrap_err();
            assert!(said.contains(part), "{text}: {said}");
        }
    }
}
