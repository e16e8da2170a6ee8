//! `[data]`: which pairs of scans to register, and when one succeeds.

use echoloop_registration::Method;
use serde::{Deserialize, Serialize};

use super::error::{RunConfigError, require};

/// Which pairs of scans to register.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DataConfig {
    /// Pairs to tune on.
    pub train_pairs: usize,
    /// Pairs to judge on, from other viewpoints of the same towns: 10 m from any to tune on, less
    /// where the place is under 100 m wide.
    pub test_pairs: usize,
    /// Distance of a pair's scans, m: the paper's 2 for local methods, 5 for global ones.
    pub baseline_m: f64,
    /// Pairs to tune on are up to so many times as far apart, evenly: what is chosen on them keeps
    /// away from where registrations begin to fail. 1 with `tune.strategy = "paper"`.
    pub train_baseline_factor: f64,
    /// The second scan's heading differs by at most this, degrees.
    pub heading_range_deg: f64,
    /// Roll and pitch of each scan, at most, degrees.
    pub tilt_range_deg: f64,
    /// A registration succeeds within this translation, m, …
    pub success_translation_m: f64,
    /// … and this rotation, degrees.
    pub success_rotation_deg: f64,
}

impl Default for DataConfig {
    fn default() -> Self {
        Self {
            train_pairs: 30,
            test_pairs: 40,
            baseline_m: 2.0,
            train_baseline_factor: 2.0,
            heading_range_deg: 10.0,
            tilt_range_deg: 2.0,
            success_translation_m: 0.5,
            success_rotation_deg: 2.5,
        }
    }
}

impl DataConfig {
    /// As in the paper: local methods get scans 2 m apart and succeed within 0.5 m and 2.5°, global
    /// ones 5 m, 1 m and 5°.
    pub fn for_method(method: Method) -> Self {
        let local = Self::default();
        match method.is_global() {
            true => Self {
                baseline_m: 5.0,
                success_translation_m: 1.0,
                success_rotation_deg: 5.0,
                ..local
            },
            false => local,
        }
    }

    pub(super) fn check(&self) -> Result<(), RunConfigError> {
        let some = |n: usize| (1..=10_000).contains(&n);
        require("data.train_pairs", self.train_pairs, some(self.train_pairs), "1 to 10000")?;
        require("data.test_pairs", self.test_pairs, some(self.test_pairs), "1 to 10000")?;
        require(
            "data.baseline_m",
            self.baseline_m,
            (0.0..=100.0).contains(&self.baseline_m),
            "0 to 100",
        )?;
        let factor = self.train_baseline_factor;
        require("data.train_baseline_factor", factor, (1.0..=10.0).contains(&factor), "1 to 10")?;
        let angle = |v: f64| (0.0..=180.0).contains(&v);
        require(
            "data.heading_range_deg",
            self.heading_range_deg,
            angle(self.heading_range_deg),
            "0 to 180",
        )?;
        require(
            "data.tilt_range_deg",
            self.tilt_range_deg,
            (0.0..=45.0).contains(&self.tilt_range_deg),
            "0 to 45",
        )?;
        let success = self.success_translation_m;
        require(
            "data.success_translation_m",
            success,
            success > 0.0 && success <= 100.0,
            "above 0, at most 100",
        )?;
        let success = self.success_rotation_deg;
        require(
            "data.success_rotation_deg",
            success,
            success > 0.0 && success <= 180.0,
            "above 0, at most 180",
        )
    }
}
