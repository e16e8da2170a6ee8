//! `[emitter]`: what the laser may emit.

use echoloop_dsp::Hardware;
use echoloop_parameters::{Bounds, section};
use serde::{Deserialize, Serialize};

section! {
    /// What the laser may emit.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct EmitterConfig in "emitter" {
        energy_limit_nj: f64, "nJ", Bounds::between(LEAST_NJ, GREATEST_NJ),
            "Greatest energy of a pulse, power times width, nJ: the sensor refuses settings above \
             it. It keeps a search from buying signal with power. A board on a serial line has a \
             limit of its own.";
    }
}

/// Of the longest pulse, with the least power, and with the greatest: 10 µW and 100 W in 20 ns. The
/// sensor counts whole pJ. A test holds both to the table of its parameters.
const LEAST_NJ: f64 = 0.001;
const GREATEST_NJ: f64 = 2000.0;

impl Default for EmitterConfig {
    fn default() -> Self {
        Self { energy_limit_nj: f64::from(Hardware::REFERENCE.energy_limit_pj) / 1e3 }
    }
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::{ParameterId, pulse_energy_pj};

    use super::*;

    #[test]
    fn the_limit_lies_between_the_longest_pulse_of_least_and_of_greatest_power() {
        let (power, width) = (ParameterId::Power.parameter(), ParameterId::PulseWidth.parameter());
        let energy_nj = |power_uw| f64::from(pulse_energy_pj(power_uw, width.max)) / 1e3;
        assert_eq!([LEAST_NJ, GREATEST_NJ], [energy_nj(power.min), energy_nj(power.max)]);
    }
}
