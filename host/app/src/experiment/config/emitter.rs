//! `[emitter]`: what the laser may emit.

use echoloop_dsp::Hardware;
use serde::{Deserialize, Serialize};

use super::error::{RunConfigError, require};

/// What the laser may emit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EmitterConfig {
    /// Greatest energy of a pulse, power times width, nJ: the sensor refuses settings above it. It
    /// keeps a search from buying signal with power. A board on a serial line has a limit of its
    /// own.
    pub energy_limit_nj: f64,
}

impl Default for EmitterConfig {
    fn default() -> Self {
        Self { energy_limit_nj: f64::from(Hardware::REFERENCE.energy_limit_pj) / 1e3 }
    }
}

impl EmitterConfig {
    pub(super) fn check(&self) -> Result<(), RunConfigError> {
        // 100 nJ is the least power, 5 W, in the longest pulse, 20 ns; 2000 nJ the greatest, 100 W.
        let limit_nj = self.energy_limit_nj;
        require(
            "emitter.energy_limit_nj",
            limit_nj,
            (100.0..=2000.0).contains(&limit_nj),
            "100 to 2000",
        )
    }
}
