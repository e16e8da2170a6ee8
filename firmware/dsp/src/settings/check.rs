//! Checks of settings: each value against the table, then against other settings and the hardware.

use crate::settings::hardware::{Hardware, sample_period_fs};
use crate::settings::reason::Reason;
use crate::settings::refusal::Refusal;
use crate::settings::{PARAMETERS, ParameterId, Settings};

/// W ≥ 2.5 samples, so the sample period is at most 1000 fs / 2.5 for each picosecond of W.
const PERIOD_FS_PER_WIDTH_PS: u32 = 400;

/// Energy of a pulse, pJ, rounded up: 1 µW × 1 ps = 10⁻⁶ pJ. In range it is at most 2 × 10⁶.
pub const fn pulse_energy_pj(power_uw: i32, width_ps: i32) -> u32 {
    let energy = (power_uw as u32 as u64).saturating_mul(width_ps as u32 as u64);
    match energy.div_ceil(1_000_000) {
        energy_pj if energy_pj <= u32::MAX as u64 => energy_pj as u32,
        _ => u32::MAX,
    }
}

impl Hardware {
    /// Highest power, µW, that a pulse of this width may have.
    pub fn strongest_power_uw(&self, width_ps: i32) -> i32 {
        let limit = u64::from(self.energy_limit_pj).saturating_mul(1_000_000);
        let power_uw = limit.checked_div(width_ps.max(0) as u64);
        power_uw.and_then(|power_uw| power_uw.try_into().ok()).unwrap_or(i32::MAX)
    }

    /// Shortest pulse that this many bins sample often enough, ps.
    pub const fn shortest_pulse_ps(&self, bins: i32) -> i32 {
        sample_period_fs(bins as u32, self).div_ceil(PERIOD_FS_PER_WIDTH_PS) as i32
    }

    /// Middle of the window, mm: the gain must be full from there on.
    pub const fn middle_mm(&self) -> u32 {
        self.range_min_mm.midpoint(self.range_max_mm)
    }
}

impl ParameterId {
    /// Checks that a value of this field is in range.
    ///
    /// # Errors
    ///
    /// [`Refusal`] with the bound.
    pub fn check(self, value: i32) -> Result<(), Refusal> {
        let refused = |reason| Refusal { field: self, value, reason };
        self.parameter().check(value).map_err(refused)
    }
}

impl Settings {
    /// Checks S > N, every field against the table, then pulse energy, sampling and the
    /// gain's ramp.
    ///
    /// # Errors
    ///
    /// The first [`Refusal`], in that order.
    pub fn check(&self, hardware: &Hardware) -> Result<(), Refusal> {
        self.check_saturation()?; // first: its message says more than that of either field's range
        for parameter in &PARAMETERS {
            if let Some(value) = self.get(parameter.id) {
                parameter.id.check(value)?;
            }
        }
        self.check_energy(hardware)?;
        self.check_sampling(hardware)?;
        self.check_ramp(hardware)
    }

    fn check_ramp(&self, hardware: &Hardware) -> Result<(), Refusal> {
        let middle_mm = hardware.middle_mm();
        if self.gain_slope_mdb_m == 0 || self.gain_range_mm as u32 <= middle_mm {
            return Ok(());
        }
        let reason = Reason::BeyondMiddle { middle_mm };
        Err(Refusal { field: ParameterId::GainRange, value: self.gain_range_mm, reason })
    }

    fn check_energy(&self, hardware: &Hardware) -> Result<(), Refusal> {
        let energy_pj = pulse_energy_pj(self.power_uw, self.pulse_width_ps);
        if energy_pj <= hardware.energy_limit_pj {
            return Ok(());
        }
        let reason = Reason::EnergyAboveLimit { energy_pj, limit_pj: hardware.energy_limit_pj };
        Err(Refusal { field: ParameterId::Power, value: self.power_uw, reason })
    }

    fn check_saturation(&self) -> Result<(), Refusal> {
        if self.saturation_ppm > self.noise_floor_ppm {
            return Ok(());
        }
        let reason = Reason::SaturationNotAboveFloor { floor_ppm: self.noise_floor_ppm };
        Err(Refusal { field: ParameterId::Saturation, value: self.saturation_ppm, reason })
    }

    fn check_sampling(&self, hardware: &Hardware) -> Result<(), Refusal> {
        let period_fs = sample_period_fs(self.bins as u32, hardware);
        // Multiplied, not divided as in `shortest_pulse_ps`: not every processor divides.
        let longest_fs = (self.pulse_width_ps as u32).saturating_mul(PERIOD_FS_PER_WIDTH_PS);
        if longest_fs >= period_fs {
            return Ok(());
        }
        let reason = Reason::Undersampled { sample_period_fs: period_fs };
        Err(Refusal { field: ParameterId::PulseWidth, value: self.pulse_width_ps, reason })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn the_defaults_are_accepted() {
        Settings::default().check(&Hardware::REFERENCE).unwrap();
    }

    #[test]
    fn the_strongest_and_the_shortest_pulse_are_the_last_that_are_accepted() {
        for (bins, pulse_width_ps) in [(256, 5_000), (800, 20_000), (1_200, 3_333)] {
            let hardware = Hardware { energy_limit_pj: 123_457, ..Hardware::REFERENCE };
            let power_uw = hardware.strongest_power_uw(pulse_width_ps);
            let with = |power_uw| Settings { power_uw, pulse_width_ps, ..Settings::default() };
            assert_eq!(with(power_uw).check_energy(&hardware), Ok(()));
            assert!(with(power_uw + 1).check_energy(&hardware).is_err());
            assert_eq!(hardware.strongest_power_uw(0), i32::MAX);
            let pulse_width_ps = hardware.shortest_pulse_ps(bins);
            let with = |pulse_width_ps| Settings { bins, pulse_width_ps, ..Settings::default() };
            assert_eq!(with(pulse_width_ps).check_sampling(&hardware), Ok(()));
            assert!(with(pulse_width_ps - 1).check_sampling(&hardware).is_err());
        }
    }

    #[test]
    fn a_refusal_names_the_field_the_value_and_the_bound() {
        type Change = fn(&mut Settings);
        let refusal = |change: Change| {
            let mut settings = Settings::default();
            change(&mut settings);
            settings.check(&Hardware::REFERENCE).unwrap_err().to_string()
        };
        let cases: [(Change, &str); 8] = [
            (|s| s.pulse_width_ps = 25_000, "pulse_width 25 ns is above its maximum 20 ns"),
            (|s| s.gain_cdb = -1_001, "gain -10.01 dB is below its minimum -10 dB"),
            (
                |s| s.power_uw = 100_000_000,
                "power 100 W times pulse_width is 500.0 nJ, \
                 above the pulse energy limit of 400.0 nJ",
            ),
            (
                |s| (s.saturation_ppm, s.noise_floor_ppm) = (150_000, 200_000),
                "saturation 0.15 of full scale is not above noise_floor 0.2 of full scale",
            ),
            (
                |s| s.bins = 200,
                "pulse_width 5 ns spans fewer than 2.5 samples of 3.969 ns \
                 (raise it or waveform_resolution)",
            ),
            (|s| s.upsampling = 3, "upsampling 3 is none of 1, 2, 4, 8"),
            (|s| s.shots = 3, "shots 3 is none of 1, 2, 4, 8, 16"),
            (|s| s.denoise = 9, "denoise 9 is none of 'none', 'gaussian', 'matched'"),
        ];
        for (change, message) in cases {
            assert_eq!(refusal(change), message);
        }
    }
}
