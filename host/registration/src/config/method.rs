//! The methods, and their settings by name.

use serde::{Deserialize, Serialize};

use super::{ConfigError, FgrConfig, GicpConfig, IcpConfig, MacConfig};

/// Names of settings in earlier versions, and today's. They are read for one version more.
const FORMER: [(&str, &str); 6] = [
    ("still_m", "translation_tolerance_m"),
    ("still_rad", "rotation_tolerance_rad"),
    ("still_fraction", "fitness_tolerance"),
    ("still_rmse_m", "rmse_tolerance_m"),
    ("least_information", "degeneracy_threshold"),
    ("max_stretch_m", "length_tolerance_m"),
];

/// Today's name of a setting, whether it was given by that or by a former one.
pub fn current_key(key: &str) -> &str {
    FORMER.iter().find(|(former, _)| *former == key).map_or(key, |(_, current)| current)
}

/// The name that a setting had in earlier versions, if another.
pub fn former_key(key: &str) -> Option<&'static str> {
    FORMER.iter().find(|(_, current)| *current == key).map(|(former, _)| *former)
}

/// A registration method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Point-to-plane ICP: local, starts at an initial guess.
    #[default]
    Icp,
    /// Generalised ICP: local, plane to plane.
    Gicp,
    /// Fast global registration on FPFH features: needs no initial guess.
    Fgr,
    /// Maximal cliques of compatible FPFH matches: needs no initial guess.
    Mac,
}

impl Method {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Icp, Self::Gicp, Self::Fgr, Self::Mac];

    /// What it is, in a line of help.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Icp => "Point-to-plane ICP: local, starts at an initial guess",
            Self::Gicp => "Generalised ICP: local, plane to plane",
            Self::Fgr => "Fast global registration on FPFH features: needs no initial guess",
            Self::Mac => "Maximal cliques of compatible FPFH matches: needs no initial guess",
        }
    }

    /// Name on the command line, in files and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Icp => "icp",
            Self::Gicp => "gicp",
            Self::Fgr => "fgr",
            Self::Mac => "mac",
        }
    }

    /// The names of its settings, in the order of their use.
    pub fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Icp => IcpConfig::KEYS,
            Self::Gicp => GicpConfig::KEYS,
            Self::Fgr => FgrConfig::KEYS,
            Self::Mac => MacConfig::KEYS,
        }
    }

    /// Whether it searches all motions, and so needs no initial guess.
    pub fn is_global(self) -> bool {
        matches!(self, Self::Fgr | Self::Mac)
    }
}

/// The settings of one method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MethodConfig {
    /// Of [`crate::Icp`].
    Icp(IcpConfig),
    /// Of [`crate::Gicp`].
    Gicp(GicpConfig),
    /// Of [`crate::Fgr`].
    Fgr(FgrConfig),
    /// Of [`crate::Mac`].
    Mac(MacConfig),
}

/// Where a setting that has a name is kept.
pub(super) enum Slot<'a> {
    /// A length, an angle or a share.
    Real(&'a mut f64),
    /// A length that may be left out.
    Optional(&'a mut Option<f64>),
    /// A number of things.
    Count(&'a mut usize),
}

impl Slot<'_> {
    fn get(&self) -> Option<f64> {
        match self {
            Self::Real(value) => Some(**value),
            Self::Optional(value) => **value,
            Self::Count(value) => Some(**value as f64),
        }
    }

    fn set(self, new: f64) {
        match self {
            Self::Real(value) => *value = new,
            Self::Optional(value) => *value = Some(new),
            // Below zero it becomes none: flags and axes have their own bounds before.
            Self::Count(value) => *value = new.max(0.0) as usize,
        }
    }
}

impl MethodConfig {
    /// Whose settings these are.
    pub fn method(&self) -> Method {
        match self {
            Self::Icp(_) => Method::Icp,
            Self::Gicp(_) => Method::Gicp,
            Self::Fgr(_) => Method::Fgr,
            Self::Mac(_) => Method::Mac,
        }
    }

    /// Whether each setting can run.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the first that cannot, and its bound.
    pub fn check(&self) -> Result<(), ConfigError> {
        match self {
            Self::Icp(config) => config.check(),
            Self::Gicp(config) => config.check(),
            Self::Fgr(config) => config.check(),
            Self::Mac(config) => config.check(),
        }
    }

    /// The names of the settings, in the order of their use.
    pub fn keys(&self) -> &'static [&'static str] {
        self.method().keys()
    }

    /// A setting by its name, or a former one; absent when the method has none of that name, or it is left out.
    pub fn get(&self, key: &str) -> Option<f64> {
        let mut copy = *self;
        copy.slot(current_key(key)).and_then(|slot| slot.get())
    }

    /// Sets a setting by its name, or a former one; false when the method has none.
    pub fn set(&mut self, key: &str, value: f64) -> bool {
        match self.slot(current_key(key)) {
            Some(slot) => slot.set(value),
            None => return false,
        }
        true
    }

    fn slot(&mut self, key: &str) -> Option<Slot<'_>> {
        match self {
            Self::Icp(config) => config.slot(key),
            Self::Gicp(config) => config.slot(key),
            Self::Fgr(config) => config.slot(key),
            Self::Mac(config) => config.slot(key),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> [MethodConfig; 4] {
        [
            MethodConfig::Icp(IcpConfig::outdoor()),
            MethodConfig::Gicp(GicpConfig::outdoor()),
            MethodConfig::Fgr(FgrConfig::outdoor()),
            MethodConfig::Mac(MacConfig::outdoor()),
        ]
    }

    #[test]
    fn every_key_is_kept_by_its_own_name_and_no_other() {
        for mut config in all() {
            assert_eq!(config.check(), Ok(()));
            for (i, key) in config.keys().iter().enumerate() {
                assert!(config.set(key, 10.0 + i as f64), "{key}");
            }
            for (i, key) in config.keys().iter().enumerate() {
                assert_eq!(
                    config.get(key),
                    Some(10.0 + i as f64),
                    "{key} of {:?}",
                    config.method()
                );
            }
            assert!(!config.set("no_such_setting", 1.0));
            assert_eq!(config.get("no_such_setting"), None);
        }
    }

    #[test]
    fn a_former_name_reads_and_sets_what_it_named() {
        for mut config in all() {
            for (i, (former, current)) in FORMER.iter().enumerate() {
                let has = config.keys().contains(current);
                assert_eq!(config.set(former, 10.0 + i as f64), has, "{former}");
                assert_eq!(config.get(current), has.then_some(10.0 + i as f64), "{current}");
                assert_eq!(config.get(former), config.get(current));
                assert_eq!(former_key(current), Some(*former));
                assert!(!config.keys().contains(former), "{former} is no longer listed");
            }
        }
    }

    #[test]
    fn a_count_below_zero_is_refused_by_name() {
        for mut config in all() {
            config.set("max_iterations", -3.0);
            if config.method() != Method::Mac {
                assert_eq!(config.check().map_err(|e| e.field), Err("max_iterations"));
            }
            assert_eq!(config.get("max_iterations"), Some(0.0));
        }
    }
}
