//! Cost of a scan: energy, the detector's instructions, bits on the link, time.
//!
//! - **Energy**, J: P · W · shots · beams. A sin² pulse of peak P and FWHM W carries exactly P · W
//!   (benches/record/physics.md).
//! - **Instructions** a waveform: a model fitted to the counts on the microcontroller in
//!   `firmware/image/cost.tsv`, which `cargo xtask cost` writes.
//! - **Bits**: frames of the scan, both ways ([`scan_bits`]).
//! - **Seconds**: beams · shots · 2 R_max/c with one converter, or the duration of the pattern
//!   where that is longer.

mod instructions;
mod kind;
mod processor;
mod rate;
mod record;

use echoloop_dsp::hardware::SPEED_OF_LIGHT_M_S;
use echoloop_dsp::{Echoes, Hardware, ScanPattern, Settings};
use echoloop_link::settings_hash;
use serde::{Deserialize, Serialize};

use echoloop_sensors::size::scan_bits;
pub use kind::CostKind;
pub use processor::Processor;
pub use rate::{LineRate, ProcessorRate, Rate, RateOf};
use record::near_mm;

/// Cost of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScanCost {
    /// Emitted light, J.
    pub energy_j: f64,
    /// Instructions of the detector a waveform, shots of a beam together, on a Cortex-M4.
    pub instructions: f64,
    /// Bits on the link, both ways.
    pub bits: f64,
    /// Time, s.
    pub seconds: f64,
}

/// Properties of the sensor that a cost depends on besides settings and echoes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scanner {
    /// Hardware of the sensor.
    pub hardware: Hardware,
    /// Scan pattern, which the settings may aim.
    pub pattern: ScanPattern,
    /// Duration of a scan by its motion, s; 0 where that is open. A steered sensor has its own.
    pub duration_s: f64,
}

impl Scanner {
    /// Scanner whose scans take `duration_s`, or the pattern's own duration where that is longer.
    pub fn new(hardware: Hardware, pattern: &ScanPattern, duration_s: f64) -> Self {
        Self { hardware, pattern: *pattern, duration_s }
    }

    /// Pattern with the aim of these settings; as it is with settings that a sensor refuses.
    fn aimed(&self, settings: &Settings) -> ScanPattern {
        self.pattern.aimed(settings).unwrap_or(self.pattern)
    }

    /// Cost of a scan that found these echoes.
    pub fn cost(&self, settings: &Settings, scan: &[Echoes]) -> ScanCost {
        ScanCost {
            energy_j: self.energy_j(settings),
            instructions: self.instructions(settings, scan),
            bits: scan_bits(scan, settings_hash(settings)) as f64,
            seconds: self.seconds(settings),
        }
    }

    /// Emitted light of a scan, J: 1 µW · 1 ps is 10⁻¹⁸ J.
    fn energy_j(&self, settings: &Settings) -> f64 {
        let pulse_j = f64::from(settings.power_uw) * f64::from(settings.pulse_width_ps) * 1e-18;
        pulse_j * self.shots(settings)
    }

    /// Number of shots of a scan.
    fn shots(&self, settings: &Settings) -> f64 {
        f64::from(settings.shots) * f64::from(self.aimed(settings).beams())
    }

    /// Duration of a scan, s. A shot ends when light could be back from the end of the window. The
    /// sensor has one converter and fires a beam once the one before is read (`Board::samples`),
    /// so shots follow one another; a head that turns slower sets the time.
    fn seconds(&self, settings: &Settings) -> f64 {
        let range_max_m = f64::from(self.hardware.range_max_mm) / 1e3;
        let shot_s = 2.0 * range_max_m / SPEED_OF_LIGHT_M_S as f64;
        let pattern = self.aimed(settings);
        let duration_s = match pattern {
            ScanPattern::Steered(_) => pattern.duration_s(),
            _ => pattern.duration_s().max(self.duration_s),
        };
        (self.shots(settings) * shot_s).max(duration_s)
    }

    /// Mean over the waveforms of a scan; NaN for settings that a sensor refuses.
    fn instructions(&self, settings: &Settings, scan: &[Echoes]) -> f64 {
        let waveforms = scan.len().max(1) as f64;
        let near_mm = near_mm(settings);
        let echoes = scan.iter().flatten();
        let near = echoes.clone().filter(|echo| echo.range >> 8 < near_mm).count();
        let found = [echoes.count(), near].map(|count| count as f64 / waveforms);
        let model = Processor::REFERENCE.model();
        model.and_then(|model| model.of(settings, &self.hardware, found)).unwrap_or(f64::NAN)
    }
}

impl ScanCost {
    /// Unknown cost: NaN throughout.
    pub const UNKNOWN: Self =
        Self { energy_j: f64::NAN, instructions: f64::NAN, bits: f64::NAN, seconds: f64::NAN };

    /// Mean cost; `None` of an empty slice.
    pub fn mean(costs: &[Self]) -> Option<Self> {
        let mean =
            |value: fn(&Self) -> f64| costs.iter().map(value).sum::<f64>() / costs.len() as f64;
        (!costs.is_empty()).then(|| Self {
            energy_j: mean(|cost| cost.energy_j),
            instructions: mean(|cost| cost.instructions),
            bits: mean(|cost| cost.bits),
            seconds: mean(|cost| cost.seconds),
        })
    }
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::{Echo, Steered};

    use super::*;

    fn scanner() -> Scanner {
        Scanner::new(Hardware::REFERENCE, &ScanPattern::default(), 0.0)
    }

    #[test]
    fn a_steered_scan_takes_its_own_time_however_long_the_sensor_s_motion_is_said_to_last() {
        let seconds = |pattern: &ScanPattern| {
            Scanner::new(Hardware::REFERENCE, pattern, 0.5).seconds(&Settings::default())
        };
        assert_eq!(seconds(&ScanPattern::Steered(Steered::REFERENCE)), 0.1);
        assert_eq!(seconds(&ScanPattern::default()), 0.5);
    }

    /// Scan in which every other beam has `echoes` echoes at a range.
    fn scan(echoes: usize, range_m: u32) -> Vec<Echoes> {
        let echo = Echo { range: range_m * 256_000, ..Default::default() };
        let beam = |i| (0..if i % 2 == 0 { echoes } else { 0 }).map(|_| echo).collect();
        (0..scanner().pattern.beams()).map(beam).collect()
    }

    #[test]
    fn energy_is_the_sum_of_all_pulses_and_time_that_of_light_out_and_back() {
        let cost = |settings: Settings| scanner().cost(&settings, &scan(1, 10));
        let usual = cost(Settings::default());
        // 192 × 64 pulses of 375 nJ
        assert!((usual.energy_j / (12_288.0 * 375e-9) - 1.0).abs() < 1e-12, "{}", usual.energy_j);
        assert!((usual.seconds / (12_288.0 * 240.0 / 299_792_458.0) - 1.0).abs() < 1e-12);
        let four = cost(Settings { shots: 4, ..Settings::default() });
        assert_eq!(four.energy_j, 4.0 * usual.energy_j);
        assert!((four.seconds / usual.seconds - 4.0).abs() < 1e-12);
        let weak = cost(Settings { power_uw: 10, pulse_width_ps: 2_500, ..Settings::default() });
        assert!((weak.energy_j / usual.energy_j - 1.0 / 15e6).abs() < 1e-15);
        let turning = Scanner { duration_s: 0.1, ..scanner() };
        assert_eq!(turning.cost(&Settings::default(), &[]).seconds, 0.1);
    }

    #[test]
    fn bits_grow_with_echoes_and_instructions_with_samples_shots_and_near_echoes() {
        let cost =
            |settings: Settings, echoes, range_m| scanner().cost(&settings, &scan(echoes, range_m));
        let usual = cost(Settings::default(), 1, 10);
        let none = cost(Settings::default(), 0, 10);
        let four = Settings { echoes: 4, ..Settings::default() };
        assert!(none.bits < usual.bits && usual.bits < cost(four, 4, 10).bits);
        assert!(none.instructions < usual.instructions);
        let full = cost(Settings { shots: 1, ..Settings::default() }, 2, 10).instructions;
        assert!(full > usual.instructions);
        let many = Settings { bins: 2_400, ..Settings::default() };
        assert!(cost(many, 1, 10).instructions > 3.0 * usual.instructions);
        let shots = Settings { shots: 16, ..Settings::default() };
        assert!(cost(shots, 1, 10).instructions > 2.0 * usual.instructions);
        let near = Settings { gain_slope_mdb_m: 1_000, ..Settings::default() };
        let (close, far) = (cost(near, 1, 10).instructions, cost(near, 1, 50).instructions);
        assert!(usual.instructions < far && far + 5_000.0 < close, "{far} {close}");
    }

    #[test]
    fn the_mean_of_costs_is_taken_field_by_field() {
        let cost = |x: f64| ScanCost { energy_j: x, instructions: 2.0 * x, bits: 3.0, seconds: x };
        assert_eq!(ScanCost::mean(&[cost(1.0), cost(3.0)]), Some(cost(2.0)));
        assert_eq!(ScanCost::mean(&[]), None);
    }
}
