//! The `[registration]` section: the method, and settings of registration's own table.

use std::fmt;

use echoloop_parameters::{Bounds, Kind, Parameter};
use echoloop_registration::{FgrMode, Method, SETTINGS, setting};
use serde::de::{Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::config::preset::Preset;
use crate::written::Written;

/// Θ_reg to start from. A setting that is left out has the preset's default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegistrationConfig {
    /// The method.
    pub method: Method,
    /// Ranges and defaults: `outdoor`, or `paper` (Sec. 3.3, made for indoor spacing).
    pub preset: Preset,
    /// Mode of FGR: `annealed`, or `open3d` (as Open3D 0.20 runs it, the paper's baseline).
    pub mode: FgrMode,
    /// True when point-to-plane ICP refines the result of a global method.
    pub refine: bool,
    /// The settings that are given, in the order of [`SETTINGS`].
    pub(crate) given: [Option<f64>; SETTINGS.len()],
}

/// The keys that are no settings of registration's table.
pub(super) const OWN_KEYS: &[Parameter] = &[
    Parameter {
        bounds: Method::BOUNDS,
        ..text("registration.method", "How scans are registered, from near or from anywhere.")
    },
    Parameter {
        bounds: Preset::BOUNDS,
        ..text(
            "registration.preset",
            "Ranges and defaults: `outdoor`, or `paper` (Sec. 3.3, made for indoor spacing).",
        )
    },
    Parameter {
        bounds: FgrMode::BOUNDS,
        ..text(
            "registration.mode",
            "Of FGR: `annealed`, or `open3d` (as Open3D 0.20 runs it, the paper's baseline).",
        )
    },
    Parameter {
        kind: Kind::Flag,
        bounds: Bounds::FLAG,
        ..text(
            "registration.refine",
            "Whether point-to-plane ICP finishes what a global method finds: by default where it \
             leaves that to another (`fgr`, `mac`), but not with `open3d` or the paper's \
             strategy.",
        )
    },
];

const fn text(key: &'static str, help: &'static str) -> Parameter {
    Parameter { key, unit: "", kind: Kind::Text, bounds: Bounds::OneOf(&[]), help }
}

impl RegistrationConfig {
    /// Name in reports: the method, its mode, and the refinement.
    pub fn name(&self) -> String {
        let mode = if self.mode == FgrMode::Open3d { " as Open3D runs it" } else { "" };
        let refine = if self.refine { ", then icp" } else { "" };
        format!("{}{mode}{refine}", self.method.name())
    }

    /// The values that are given, by key.
    pub fn chosen(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let given = SETTINGS.iter().zip(self.given);
        given.filter_map(|(setting, value)| value.map(|value| (setting.key, value)))
    }

    /// Gives a value to a setting, by its name or its former one; without a setting of that name,
    /// as it was.
    #[must_use]
    pub fn with(mut self, key: &str, value: f64) -> Self {
        if let Some(given) = Key::by_name(key).and_then(|Key(at)| at.checked_sub(OWN.len())) {
            self.given[given] = Some(value);
        }
        self
    }
}

/// The keys before those of the settings.
const OWN: [&str; 4] = ["method", "preset", "mode", "refine"];

/// The keys of the section: [`OWN`], then those of [`SETTINGS`].
const NAMES: [&str; OWN.len() + SETTINGS.len()] = {
    let mut names = [""; OWN.len() + SETTINGS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = if i < OWN.len() { OWN[i] } else { SETTINGS[i - OWN.len()].key };
        i += 1;
    }
    names
};

/// A key by its place in [`NAMES`].
struct Key(usize);

impl Key {
    fn by_name(name: &str) -> Option<Self> {
        let name = setting(name).map_or(name, |setting| setting.key);
        NAMES.iter().position(|known| *known == name).map(Self)
    }
}

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::by_name(&name).ok_or_else(|| D::Error::unknown_field(&name, &NAMES))
    }
}

impl<'de> Deserialize<'de> for RegistrationConfig {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Section)
    }
}

struct Section;

impl<'de> Visitor<'de> for Section {
    type Value = RegistrationConfig;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table of registration parameters")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<RegistrationConfig, A::Error> {
        let mut config = RegistrationConfig::default();
        while let Some(Key(at)) = map.next_key()? {
            match NAMES[at] {
                "method" => config.method = map.next_value()?,
                "preset" => config.preset = map.next_value()?,
                "mode" => config.mode = map.next_value()?,
                "refine" => config.refine = map.next_value()?,
                key => {
                    let value = map.next_value::<f64>()?;
                    if !value.is_finite() {
                        return Err(A::Error::custom(format_args!(
                            "{key} = {value} must be finite"
                        )));
                    }
                    if config.given[at - OWN.len()].replace(value).is_some() {
                        return Err(A::Error::duplicate_field(key));
                    }
                }
            }
        }
        Ok(config)
    }
}

impl Serialize for RegistrationConfig {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("method", &self.method)?;
        map.serialize_entry("preset", &self.preset)?;
        if self.mode != FgrMode::default() {
            map.serialize_entry("mode", &self.mode)?;
        }
        // What is left out follows method and strategy.
        if self.refine || self.method.is_rough() {
            map.serialize_entry("refine", &self.refine)?;
        }
        for (setting, value) in SETTINGS.iter().zip(self.given) {
            if let Some(value) = value {
                let written = Written::new(value, setting.kind == Kind::Whole);
                map.serialize_entry(setting.key, &written)?;
            }
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<RegistrationConfig, String> {
        toml::from_str(text).map_err(|error| error.to_string())
    }

    #[test]
    fn every_setting_is_a_key_by_today_s_name_and_its_former_one() {
        for setting in SETTINGS {
            for name in [Some(setting.key), setting.former].into_iter().flatten() {
                let config = read(&format!("{name} = 7")).unwrap();
                assert_eq!(config.chosen().collect::<Vec<_>>(), [(setting.key, 7.0)]);
                let again = toml::to_string(&config).unwrap();
                assert!(again.contains(setting.key), "{again}");
                assert_eq!(read(&again).unwrap(), config);
            }
        }
    }

    #[test]
    fn counts_are_written_whole_and_lengths_are_not() {
        let config = read("voxel_m = 1\nnormal_neighbours = 20.0").unwrap();
        let again = toml::to_string(&config).unwrap();
        assert!(again.ends_with("voxel_m = 1.0\nnormal_neighbours = 20\n"), "{again}");
    }

    #[test]
    fn a_setting_given_by_both_its_names_is_refused() {
        let error = read("max_stretch_m = 0.2\nlength_tolerance_m = 0.3").unwrap_err();
        assert!(error.contains("duplicate field `length_tolerance_m`"), "{error}");
    }

    #[test]
    fn an_unknown_key_is_shown_with_those_there_are() {
        let error = read("method = \"icp\"\nvoxel = 1").unwrap_err();
        assert!(error.contains("line 2") && error.contains("unknown field `voxel`"), "{error}");
        assert!(error.contains("`voxel_m`") && error.contains("`refine`"), "{error}");
    }
}
