//! `[emitter]`: what the laser may emit.

use echoloop_dsp::{Hardware, ParameterId, pulse_energy_pj};
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
        let limit_nj = self.energy_limit_nj;
        let (least_nj, greatest_nj) = energy_bounds_nj();
        require(
            "emitter.energy_limit_nj",
            limit_nj,
            (least_nj..=greatest_nj).contains(&limit_nj),
            format!("{least_nj} to {greatest_nj}"),
        )
    }
}

/// Of the longest pulse, with the least power, and with the greatest: 10 µW and 100 W in 20 ns. The
/// sensor counts whole pJ.
fn energy_bounds_nj() -> (f64, f64) {
    let (power, width) = (ParameterId::Power.parameter(), ParameterId::PulseWidth.parameter());
    let energy_nj = |power_uw| f64::from(pulse_energy_pj(power_uw, width.max)) / 1e3;
    (energy_nj(power.min), energy_nj(power.max))
}
