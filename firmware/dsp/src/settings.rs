//! Θ_lidar: what may be set, and the one table of names, units, ranges and defaults.
//!
//! The optimiser's unit cube, the link's checks, the command line's help and the documentation all
//! come from [`PARAMETERS`]. Values travel as integers in a *wire unit* fine enough for every use
//! (`codes_per_unit` of them make one unit); only [`Parameter::to_unit`] and [`Parameter::to_code`]
//! convert.

use core::fmt;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::choice::{AmbientEstimator, DenoiseFilter, EchoChoice, TimingMethod};
use crate::limits::PRE_TRIGGER;
use crate::reason::Reason;

/// One whole set of sensor settings, in wire units. It is taken or refused whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// Peak laser power P, 0.01 W.
    pub power_cw: i32,
    /// Pulse width W (FWHM), ps.
    pub pulse_width_ps: i32,
    /// Analog gain G, 0.01 dB.
    pub gain_cdb: i32,
    /// Waveform resolution N_w, bins over the range window.
    pub bins: i32,
    /// Accumulated shots m.
    pub shots: i32,
    /// Saturation level S, ppm of ADC full scale.
    pub saturation_ppm: i32,
    /// Noise-floor threshold N, ppm of ADC full scale, on an echo's amplitude.
    pub noise_floor_ppm: i32,
    /// SNR threshold k, 0.001 σ of the filtered noise.
    pub snr_threshold_milli: i32,
    /// Upsampling ratio o of the interpolation around a candidate.
    pub upsampling: i32,
    /// Denoise filter, a choice.
    pub denoise: i32,
    /// Ambient estimator, a choice.
    pub ambient: i32,
    /// Timing method, a choice.
    pub timing: i32,
    /// Minimum echo separation ΔR, mm; `None` follows the pulse: 1.14·cW/2.
    pub min_separation_mm: Option<i32>,
    /// Echoes kept per waveform.
    pub echoes: i32,
    /// Which echoes are kept, a choice.
    pub echo_choice: i32,
}

/// Names one field of [`Settings`]. Variants are only ever appended: their order is on the wire.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, Schema,
)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs, reason = "each is the field of Settings of that name")]
pub enum ParameterId {
    Power,
    PulseWidth,
    Gain,
    WaveformResolution,
    Shots,
    Saturation,
    NoiseFloor,
    SnrThreshold,
    Upsampling,
    Denoise,
    Ambient,
    Timing,
    MinSeparation,
    Echoes,
    EchoChoice,
}

/// How a parameter's values lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Any value of the range.
    Real {
        /// Searched on a logarithmic scale.
        log: bool,
    },
    /// Whole numbers of the range.
    Integer,
    /// 1, 2, 4, … up to the maximum.
    PowerOfTwo,
    /// One of several methods; the value is the index of its name.
    Choice {
        /// Their names.
        names: &'static [&'static str],
    },
}

/// A row of [`PARAMETERS`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// The field it describes.
    pub id: ParameterId,
    /// Its name in configuration files and messages.
    pub name: &'static str,
    /// Its symbol in the paper.
    pub symbol: &'static str,
    /// Its unit; empty for plain numbers.
    pub unit: &'static str,
    /// How its values lie.
    pub kind: Kind,
    /// Wire units per unit.
    pub codes_per_unit: i32,
    /// The least value, in wire units.
    pub min: i32,
    /// The greatest value, in wire units.
    pub max: i32,
    /// The default, in wire units; `None` where it follows other settings.
    pub default: Option<i32>,
    /// Where it acts, in a few words.
    pub acts_in: &'static str,
}

const fn row(
    id: ParameterId,
    name: &'static str,
    symbol: &'static str,
    unit: &'static str,
    kind: Kind,
) -> Parameter {
    Parameter {
        id,
        name,
        symbol,
        unit,
        kind,
        codes_per_unit: 1,
        min: 0,
        max: 0,
        default: None,
        acts_in: "",
    }
}

impl Parameter {
    const fn codes(self, codes_per_unit: i32, min: i32, max: i32, default: i32) -> Self {
        Self { codes_per_unit, min, max, default: Some(default), ..self }
    }

    const fn follows(self) -> Self {
        Self { default: None, ..self }
    }

    const fn acts(self, acts_in: &'static str) -> Self {
        Self { acts_in, ..self }
    }

    /// A wire value in the parameter's unit.
    pub fn to_unit(&self, code: i32) -> f64 {
        f64::from(code) / f64::from(self.codes_per_unit)
    }

    /// The nearest wire value; saturates, and NaN becomes `i32::MIN`, which every range refuses.
    pub fn to_code(&self, value: f64) -> i32 {
        if value.is_nan() {
            return i32::MIN;
        }
        let scaled = value * f64::from(self.codes_per_unit);
        let nearest = if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 };
        nearest as i32 // `as` saturates
    }

    /// Whether the value is in range.
    ///
    /// # Errors
    ///
    /// What is wrong, with the bound.
    pub fn check(&self, value: i32) -> Result<(), Reason> {
        match self.kind {
            Kind::Choice { names } if value < 0 || value as usize >= names.len() => {
                Err(Reason::NotAChoice)
            }
            _ if value < self.min => Err(Reason::BelowMinimum { minimum: self.min }),
            _ if value > self.max => Err(Reason::AboveMaximum { maximum: self.max }),
            Kind::PowerOfTwo if !is_power_of_two(value) => Err(Reason::NotAChoice),
            _ => Ok(()),
        }
    }
}

fn is_power_of_two(value: i32) -> bool {
    u32::try_from(value).is_ok_and(u32::is_power_of_two)
}

/// The parameter table: every name, unit, range and default of Θ_lidar, once.
pub const PARAMETERS: [Parameter; 15] = {
    use Kind::{Choice, Integer, PowerOfTwo, Real};
    use ParameterId as Id;
    let real = Real { log: false };
    let log = Real { log: true };
    [
        row(Id::Power, "power", "P", "W", log).codes(100, 500, 10_000, 7_500).acts("front end"),
        row(Id::PulseWidth, "pulse_width", "W", "ns", real)
            .codes(1000, 2_000, 20_000, 5_000)
            .acts("front end, template"),
        row(Id::Gain, "gain", "G", "dB", real).codes(100, -1_000, 3_000, 0).acts("front end"),
        row(Id::WaveformResolution, "waveform_resolution", "N_w", "bins", Integer)
            .codes(1, 200, 2400, 800)
            .acts("ADC clock"),
        row(Id::Shots, "shots", "m", "", PowerOfTwo).codes(1, 1, 16, 1).acts("DSP accumulation"),
        row(Id::Saturation, "saturation", "S", "of full scale", real)
            .codes(1_000_000, 250_000, 1_000_000, 1_000_000)
            .acts("DSP clip"),
        row(Id::NoiseFloor, "noise_floor", "N", "of full scale", log)
            .codes(1_000_000, 100, 200_000, 4_000)
            .acts("DSP threshold"),
        row(Id::SnrThreshold, "snr_threshold", "k", "sigma", real)
            .codes(1000, 2_500, 8_000, 4_700)
            .acts("DSP threshold"),
        row(Id::Upsampling, "upsampling", "o", "", PowerOfTwo)
            .codes(1, 1, 8, 1)
            .acts("DSP interpolation"),
        row(Id::Denoise, "denoise", "", "", Choice { names: DenoiseFilter::NAMES })
            .codes(1, 0, 2, DenoiseFilter::Matched.code())
            .acts("DSP filter"),
        row(Id::Ambient, "ambient", "", "", Choice { names: AmbientEstimator::NAMES })
            .codes(1, 0, 2, AmbientEstimator::Median.code())
            .acts("DSP baseline"),
        row(Id::Timing, "timing", "", "", Choice { names: TimingMethod::NAMES })
            .codes(1, 0, 3, TimingMethod::WalkCorrected.code())
            .acts("DSP timing"),
        row(Id::MinSeparation, "min_separation", "ΔR", "m", real)
            .codes(1000, 300, 3_000, 855)
            .follows()
            .acts("DSP peaks"),
        row(Id::Echoes, "echoes", "E", "", Integer).codes(1, 1, 4, 1).acts("DSP peaks"),
        row(Id::EchoChoice, "echo_choice", "", "", Choice { names: EchoChoice::NAMES })
            .codes(1, 0, 2, EchoChoice::Strongest.code())
            .acts("DSP peaks"),
    ]
};

impl ParameterId {
    /// Its row of the table.
    pub fn parameter(self) -> &'static Parameter {
        const { assert!(PARAMETERS.len() == Self::EchoChoice as usize + 1) };
        PARAMETERS.get(self as usize).unwrap_or(&PARAMETERS[0]) // a row each: never out of bounds
    }

    /// The parameter of that name.
    pub fn by_name(name: &str) -> Option<Self> {
        PARAMETERS.iter().find(|p| p.name == name).map(|p| p.id)
    }
}

impl fmt::Display for ParameterId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.parameter().name)
    }
}

impl Default for Settings {
    fn default() -> Self {
        let mut settings = Self {
            power_cw: 0,
            pulse_width_ps: 0,
            gain_cdb: 0,
            bins: 0,
            shots: 0,
            saturation_ppm: 0,
            noise_floor_ppm: 0,
            snr_threshold_milli: 0,
            upsampling: 0,
            denoise: 0,
            ambient: 0,
            timing: 0,
            min_separation_mm: None,
            echoes: 0,
            echo_choice: 0,
        };
        for parameter in &PARAMETERS {
            settings.set(parameter.id, parameter.default);
        }
        settings
    }
}

impl Settings {
    /// The value of one field, in wire units; `None` where it follows other settings.
    pub fn get(&self, id: ParameterId) -> Option<i32> {
        use ParameterId as Id;
        Some(match id {
            Id::Power => self.power_cw,
            Id::PulseWidth => self.pulse_width_ps,
            Id::Gain => self.gain_cdb,
            Id::WaveformResolution => self.bins,
            Id::Shots => self.shots,
            Id::Saturation => self.saturation_ppm,
            Id::NoiseFloor => self.noise_floor_ppm,
            Id::SnrThreshold => self.snr_threshold_milli,
            Id::Upsampling => self.upsampling,
            Id::Denoise => self.denoise,
            Id::Ambient => self.ambient,
            Id::Timing => self.timing,
            Id::MinSeparation => return self.min_separation_mm,
            Id::Echoes => self.echoes,
            Id::EchoChoice => self.echo_choice,
        })
    }

    /// Sets one field, in wire units. `None` returns a field to following others; where it cannot
    /// follow, nothing happens.
    pub fn set(&mut self, id: ParameterId, value: Option<i32>) {
        use ParameterId as Id;
        if id == Id::MinSeparation {
            self.min_separation_mm = value;
            return;
        }
        let Some(value) = value else { return };
        match id {
            Id::Power => self.power_cw = value,
            Id::PulseWidth => self.pulse_width_ps = value,
            Id::Gain => self.gain_cdb = value,
            Id::WaveformResolution => self.bins = value,
            Id::Shots => self.shots = value,
            Id::Saturation => self.saturation_ppm = value,
            Id::NoiseFloor => self.noise_floor_ppm = value,
            Id::SnrThreshold => self.snr_threshold_milli = value,
            Id::Upsampling => self.upsampling = value,
            Id::Denoise => self.denoise = value,
            Id::Ambient => self.ambient = value,
            Id::Timing => self.timing = value,
            Id::MinSeparation => {}
            Id::Echoes => self.echoes = value,
            Id::EchoChoice => self.echo_choice = value,
        }
    }

    /// ΔR in mm; 1.14·cW/2, rounded down, when it follows the pulse.
    pub fn separation_mm(&self) -> i32 {
        // 1.14 × c/2 = 170.88 µm per ps
        let following = i64::from(self.pulse_width_ps).saturating_mul(17_088) / 100_000;
        self.min_separation_mm.unwrap_or(i32::try_from(following).unwrap_or(i32::MAX))
    }

    /// Samples before the trigger that the ambient estimator reads.
    pub fn pre_trigger_samples(&self) -> u32 {
        if self.ambient == AmbientEstimator::PreTrigger.code() { PRE_TRIGGER as u32 } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stand_in_the_order_of_their_ids() {
        for (i, parameter) in PARAMETERS.iter().enumerate() {
            assert_eq!(parameter.id as usize, i, "{}", parameter.name);
            assert_eq!(ParameterId::by_name(parameter.name), Some(parameter.id));
        }
    }

    #[test]
    fn every_field_reads_back_what_was_set() {
        let mut settings = Settings::default();
        for (i, parameter) in PARAMETERS.iter().enumerate() {
            settings.set(parameter.id, Some(1000 + i as i32));
        }
        for (i, parameter) in PARAMETERS.iter().enumerate() {
            assert_eq!(settings.get(parameter.id), Some(1000 + i as i32), "{}", parameter.name);
        }
    }

    #[test]
    fn both_ends_of_every_range_are_accepted_by_its_row_and_the_next_value_is_not() {
        for parameter in &PARAMETERS {
            for end in [parameter.min, parameter.max] {
                assert_eq!(parameter.check(end), Ok(()), "{} {end}", parameter.name);
            }
            assert!(parameter.check(parameter.min - 1).is_err(), "{}", parameter.name);
            assert!(parameter.check(parameter.max + 1).is_err(), "{}", parameter.name);
        }
    }

    #[test]
    fn units_and_codes_convert_there_and_back() {
        for parameter in &PARAMETERS {
            for code in [parameter.min, parameter.max, i32::midpoint(parameter.min, parameter.max)]
            {
                assert_eq!(parameter.to_code(parameter.to_unit(code)), code, "{}", parameter.name);
            }
            assert!(parameter.check(parameter.to_code(f64::NAN)).is_err(), "{}", parameter.name);
            assert!(
                parameter.check(parameter.to_code(f64::INFINITY)).is_err(),
                "{}",
                parameter.name
            );
        }
    }
}
