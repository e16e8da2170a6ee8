//! `[emitter]`: limits of the laser.

use echoloop_dsp::Hardware;
use echoloop_parameters::{Bounds, section};
use serde::{Deserialize, Serialize};

section! {
    /// Limits of the laser.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, expecting = "a table, [emitter]")]
    pub struct EmitterConfig in "emitter" {
        energy_limit_nj: f64, "nJ", Bounds::between(MIN_NJ, MAX_NJ),
            "Greatest energy of a pulse, power times width, nJ: the sensor refuses settings above \
             it. A board on a serial line has a limit of its own.";
    }
}

/// Energy of the longest pulse, 20 ns, at the lowest power, 10 µW, and at the highest, 100 W. The
/// sensor counts whole pJ. A test compares both with the table of its parameters.
const MIN_NJ: f64 = 0.001;
const MAX_NJ: f64 = 2000.0;

impl Default for EmitterConfig {
    fn default() -> Self {
        Self { energy_limit_nj: f64::from(Hardware::REFERENCE.energy_limit_pj) / 1e3 }
    }
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::{ParameterId, pulse_energy_pj};

    use super::*;
    use crate::config::RunConfig;

    #[test]
    fn the_limit_lies_between_the_longest_pulse_of_least_and_of_greatest_power() {
        let (power, width) = (ParameterId::Power.parameter(), ParameterId::PulseWidth.parameter());
        let energy_nj = |power_uw| f64::from(pulse_energy_pj(power_uw, width.max)) / 1e3;
        assert_eq!([MIN_NJ, MAX_NJ], [energy_nj(power.min), energy_nj(power.max)]);
        let check = |energy_limit_nj| {
            RunConfig { emitter: EmitterConfig { energy_limit_nj }, ..RunConfig::default() }.check()
        };
        assert_eq!([MIN_NJ, MAX_NJ].map(check), [Ok(()), Ok(())]);
        for limit_nj in [0.0, -1.0, 0.0009, 2000.1, f64::NAN, f64::INFINITY] {
            let expected = format!("emitter.energy_limit_nj = {limit_nj} must be 0.001 to 2000");
            assert_eq!(check(limit_nj).unwrap_err().to_string(), expected);
        }
    }
}
