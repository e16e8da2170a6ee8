//! Settings that a caller gives by name; the others are chosen from the clouds.

use super::{ConfigError, FgrMode, Method, MethodConfig, Setting, setting};
use crate::Suggestions;

/// Settings that a caller gives.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// Numbers of the table of settings.
    pub numbers: Vec<(&'static Setting, f64)>,
    /// Mode of FGR.
    pub mode: Option<FgrMode>,
    /// Seed of FGR's draws.
    pub seed: Option<u64>,
}

/// Reason why what is given cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum GivenError {
    /// A setting that the method does not have.
    #[error("{key} is no setting of {}", method.name())]
    NoSetting {
        /// Name of the setting.
        key: &'static str,
        /// The method.
        method: Method,
    },
    /// A value out of bounds.
    #[error(transparent)]
    Bounds(#[from] ConfigError),
}

impl Given {
    /// Gives a setting by its name, or by its former one.
    ///
    /// # Errors
    ///
    /// The name, if no setting has it.
    pub fn set<'a>(&mut self, key: &'a str, value: f64) -> Result<(), &'a str> {
        self.numbers.push((setting(key).ok_or(key)?, value));
        Ok(())
    }

    /// Refuses settings that the method does not have, and values out of bounds.
    ///
    /// # Errors
    ///
    /// [`GivenError`] names the first.
    pub fn check(&self, method: Method) -> Result<(), GivenError> {
        let unknown = self.numbers.iter().find(|(setting, _)| setting.of(method).is_none());
        let own = [("mode", self.mode.is_some()), ("seed", self.seed.is_some())];
        let own =
            own.into_iter().find(|(_, given)| *given && method != Method::Fgr).map(|(key, _)| key);
        if let Some(key) = unknown.map(|(setting, _)| setting.key).or(own) {
            return Err(GivenError::NoSetting { key, method });
        }
        for (setting, value) in &self.numbers {
            setting.of(method).map(|of| setting.check_alone(&of, *value)).transpose()?;
        }
        Ok(())
    }

    /// Settings for two clouds: chosen from them, then as given.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the setting that cannot run.
    pub fn config(
        &self,
        method: Method,
        suggestions: &Suggestions<'_>,
    ) -> Result<MethodConfig, ConfigError> {
        let voxel = self.numbers.iter().find(|(setting, _)| setting.key == "voxel_m");
        let mode = self.mode.unwrap_or_default();
        self.apply_to(suggestions.method(method, mode, voxel.map(|(_, voxel_m)| *voxel_m)))
    }

    /// Lays the given settings over a configuration.
    ///
    /// # Errors
    ///
    /// As of [`Given::config`].
    pub fn apply_to(&self, mut config: MethodConfig) -> Result<MethodConfig, ConfigError> {
        if let Some(seed) = self.seed {
            config.set_seed(seed);
        }
        if self.gives("max_pair_distance_m") {
            config.clear("first_pair_distance_m"); // may not be below max_pair_distance_m
        }
        for (setting, value) in &self.numbers {
            config.set(setting.key, *value);
        }
        // The features' radius follows a given normal radius, unless it is given, too.
        let widens = self.gives("normal_radius_m") && !self.gives("feature_radius_m");
        if widens && config.method().is_global() {
            config.repair();
        }
        config.check()?;
        Ok(config)
    }

    fn gives(&self, key: &str) -> bool {
        self.numbers.iter().any(|(setting, _)| setting.key == key)
    }
}
