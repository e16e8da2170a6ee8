//! The `[registration]` section: the method, and settings of registration's own table.

use std::fmt;

use echoloop_parameters::{Bounds, Kind as KeyKind, Parameter};
use echoloop_registration::{FgrMode, Method, SETTINGS, SettingKind};
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
        bounds: Bounds::OneOf(&METHODS),
        ..text("registration.method", "How scans are registered, from near or from anywhere.")
    },
    Parameter {
        bounds: Bounds::OneOf(&["outdoor", "paper"]),
        ..text(
            "registration.preset",
            "Ranges and defaults: `outdoor`, or `paper` (Sec. 3.3, made for indoor spacing).",
        )
    },
    Parameter {
        bounds: Bounds::OneOf(&["annealed", "open3d"]),
        ..text(
            "registration.mode",
            "Of FGR: `annealed`, or `open3d` (as Open3D 0.20 runs it, the paper's baseline).",
        )
    },
    Parameter {
        kind: KeyKind::Flag,
        bounds: Bounds::FLAG,
        ..text(
            "registration.refine",
            "Whether point-to-plane ICP finishes what a global method finds.",
        )
    },
];

const METHODS: [&str; Method::ALL.len()] = {
    let mut names = [""; Method::ALL.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = Method::ALL[i].name();
        i += 1;
    }
    names
};

const fn text(key: &'static str, help: &'static str) -> Parameter {
    Parameter { key, unit: "", kind: KeyKind::Text, bounds: Bounds::OneOf(&[]), help }
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
        if let Some(Key::Setting(index)) = Key::by_name(key) {
            self.given[index] = Some(value);
        }
        self
    }
}

/// A key of the section.
enum Key {
    Method,
    Preset,
    Mode,
    Refine,
    /// A setting, by its place in [`SETTINGS`].
    Setting(usize),
}

impl Key {
    /// The keys before those of the settings.
    const OWN: [&'static str; 4] = ["method", "preset", "mode", "refine"];

    const NAMES: [&'static str; Self::OWN.len() + SETTINGS.len()] = {
        let mut names = [""; Self::OWN.len() + SETTINGS.len()];
        let mut i = 0;
        while i < names.len() {
            let own = i < Self::OWN.len();
            names[i] = if own { Self::OWN[i] } else { SETTINGS[i - Self::OWN.len()].key };
            i += 1;
        }
        names
    };

    fn by_name(name: &str) -> Option<Self> {
        match name {
            "method" => Some(Self::Method),
            "preset" => Some(Self::Preset),
            "mode" => Some(Self::Mode),
            "refine" => Some(Self::Refine),
            _ => {
                let named = |setting: &echoloop_registration::Setting| {
                    setting.key == name || setting.former == Some(name)
                };
                SETTINGS.iter().position(named).map(Self::Setting)
            }
        }
    }
}

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::by_name(&name).ok_or_else(|| D::Error::unknown_field(&name, &Self::NAMES))
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
        while let Some(key) = map.next_key()? {
            match key {
                Key::Method => config.method = map.next_value()?,
                Key::Preset => config.preset = map.next_value()?,
                Key::Mode => config.mode = map.next_value()?,
                Key::Refine => config.refine = map.next_value()?,
                Key::Setting(index) => {
                    let (key, value) = (SETTINGS[index].key, map.next_value::<f64>()?);
                    if !value.is_finite() {
                        return Err(A::Error::custom(format_args!(
                            "{key} = {value} must be finite"
                        )));
                    }
                    if config.given[index].replace(value).is_some() {
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
        if self.refine {
            map.serialize_entry("refine", &self.refine)?;
        }
        for (setting, value) in SETTINGS.iter().zip(self.given) {
            if let Some(value) = value {
                let written = Written::new(value, setting.kind == SettingKind::Count);
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
