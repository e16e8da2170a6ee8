//! Θ_lidar, the settings of the sensor, and their one table of names, units, ranges and defaults.
//!
//! The optimiser's unit cube, the link's checks, the command line's help and the documentation all
//! come from [`PARAMETERS`]. Values travel as integers in a *wire unit* fine enough for every use
//! (`codes_per_unit` of them make one unit); only [`Parameter::to_unit`] and [`Parameter::to_code`]
//! convert.

use core::fmt;

use crate::limits::PRE_TRIGGER;
use crate::settings::choice::{AmbientEstimator, DenoiseFilter, Dither, EchoChoice, TimingMethod};
use crate::settings::reason::Reason;
use crate::stages::accumulate::LANES;

/// Kind of values that a parameter takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Any value in range.
    Real {
        /// True when the search is on a logarithmic scale.
        log: bool,
    },
    /// Whole numbers in range.
    Integer,
    /// 1, 2, 4, … up to the maximum.
    PowerOfTwo,
    /// One of several methods; the value is the index of its name.
    Choice {
        /// Names of the methods.
        names: &'static [&'static str],
    },
}

/// A row of [`PARAMETERS`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Field of [`Settings`] that the row describes.
    pub id: ParameterId,
    /// Name in configuration files and messages.
    pub name: &'static str,
    /// Symbol in the paper.
    pub symbol: &'static str,
    /// Unit; empty for plain numbers.
    pub unit: &'static str,
    /// Kind of values.
    pub kind: Kind,
    /// Wire units per unit.
    pub codes_per_unit: i32,
    /// Lowest value, in wire units.
    pub min: i32,
    /// Highest value, in wire units.
    pub max: i32,
    /// Default, in wire units; `None` where it follows other settings.
    pub default: Option<i32>,
    /// Parts of the sensor that it acts in, in a few words.
    pub acts_in: &'static str,
}

impl Parameter {
    /// Converts a wire value to the parameter's unit.
    pub fn to_unit(&self, code: i32) -> f64 {
        f64::from(code) / f64::from(self.codes_per_unit)
    }

    /// Converts a value to the nearest wire value; saturates. NaN becomes `i32::MIN`, which every
    /// range refuses.
    pub fn to_code(&self, value: f64) -> i32 {
        if value.is_nan() {
            return i32::MIN;
        }
        let scaled = value * f64::from(self.codes_per_unit);
        let nearest = if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 };
        nearest as i32 // `as` saturates
    }

    /// Checks that a wire value is in range.
    ///
    /// # Errors
    ///
    /// [`Reason`] with the bound.
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

/// Declares each parameter once: its field, its identifier and its row of [`PARAMETERS`].
///
/// A field of `i32` is always set; a field of `Option<i32>` may follow other settings. Rows are
/// only ever appended: the wire has the same order.
macro_rules! parameters {
    ($(
        $(#[$doc:meta])*
        $field:ident: $value:ty, $id:ident { help: $help:literal, $($row:tt)* }
    )*) => {
        /// Whole set of sensor settings, in wire units. It is taken or refused whole.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(
            feature = "wire",
            derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema)
        )]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct Settings {
            $($(#[$doc])* pub $field: $value,)*
        }

        /// Identifier of a field of [`Settings`]. Variants are only ever appended: the wire carries
        /// their numbers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[cfg_attr(
            feature = "wire",
            derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema)
        )]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum ParameterId {
            $($(#[$doc])* $id,)*
        }

        /// Table of the parameters: every name, unit, range and default of Θ_lidar, once.
        pub const PARAMETERS: [Parameter; [$(ParameterId::$id),*].len()] =
            [$(Parameter { id: ParameterId::$id, $($row)* }),*];

        impl ParameterId {
            /// The parameter in a sentence. It is not a field of [`Parameter`]: images hold those
            /// rows, and need no help.
            pub const fn help(self) -> &'static str {
                match self {
                    $(Self::$id => $help,)*
                }
            }
        }

        impl Settings {
            /// Value of a field, in wire units; `None` where it follows other settings.
            pub fn get(&self, id: ParameterId) -> Option<i32> {
                match id {
                    $(ParameterId::$id => self.$field.value(),)*
                }
            }

            /// Sets a field, in wire units. `None` lets the field follow other settings; a field
            /// that cannot follow keeps its value.
            pub fn set(&mut self, id: ParameterId, value: Option<i32>) {
                match id {
                    $(ParameterId::$id => self.$field.set(value),)*
                }
            }
        }

        impl Default for Settings {
            fn default() -> Self {
                let mut settings = Self { $($field: Default::default()),* };
                for parameter in &PARAMETERS {
                    settings.set(parameter.id, parameter.default);
                }
                settings
            }
        }
    };
}

/// Field of [`Settings`].
trait Field {
    fn value(&self) -> Option<i32>;
    fn set(&mut self, value: Option<i32>);
}

/// Field that is always set.
impl Field for i32 {
    fn value(&self) -> Option<i32> {
        Some(*self)
    }

    fn set(&mut self, value: Option<i32>) {
        *self = value.unwrap_or(*self);
    }
}

/// Field that follows other settings while it is `None`.
impl Field for Option<i32> {
    fn value(&self) -> Option<i32> {
        *self
    }

    fn set(&mut self, value: Option<i32>) {
        *self = value;
    }
}

const REAL: Kind = Kind::Real { log: false };
const LOG: Kind = Kind::Real { log: true };

/// Row of a choice, to be completed by its name and the stage it acts in.
const fn choice(names: &'static [&'static str], default: i32) -> Parameter {
    Parameter {
        id: ParameterId::Power, // replaced by the row's own
        name: "",
        symbol: "",
        unit: "",
        kind: Kind::Choice { names },
        codes_per_unit: 1,
        min: 0,
        max: (names.len() as i32).saturating_sub(1),
        default: Some(default),
        acts_in: "",
    }
}

parameters! {
    /// Peak laser power P, µW. At its minimum nothing is detected, whatever else is set.
    power_uw: i32, Power {
        help: "Peak power of the laser. At its minimum nothing is detected.",
        name: "power", symbol: "P", unit: "W", kind: LOG,
        codes_per_unit: 1_000_000, min: 10, max: 100_000_000, default: Some(75_000_000),
        acts_in: "front end",
    }
    /// Pulse width W (FWHM), ps.
    pulse_width_ps: i32, PulseWidth {
        help: "Width of the pulse, at half its height.",
        name: "pulse_width", symbol: "W", unit: "ns", kind: REAL,
        codes_per_unit: 1000, min: 2_000, max: 20_000, default: Some(5_000),
        acts_in: "front end, template",
    }
    /// Analog gain G, 0.01 dB.
    gain_cdb: i32, Gain {
        help: "Gain of the amplifier before the converter.",
        name: "gain", symbol: "G", unit: "dB", kind: REAL,
        codes_per_unit: 100, min: -1_000, max: 3_000, default: Some(0), acts_in: "front end",
    }
    /// Waveform resolution N_w, bins over the range window.
    bins: i32, WaveformResolution {
        help: "Number of samples of a waveform over the range window.",
        name: "waveform_resolution", symbol: "N_w", unit: "bins", kind: Kind::Integer,
        codes_per_unit: 1, min: 200, max: 2400, default: Some(800), acts_in: "ADC clock",
    }
    /// Accumulated shots m.
    shots: i32, Shots {
        help: "Number of shots of a beam that are added up.",
        name: "shots", symbol: "m", unit: "", kind: Kind::PowerOfTwo,
        codes_per_unit: 1, min: 1, max: 16, default: Some(1), acts_in: "DSP accumulation",
    }
    /// Saturation level S, ppm of ADC full scale.
    saturation_ppm: i32, Saturation {
        help: "Level from which the detector counts a sample as saturated.",
        name: "saturation", symbol: "S", unit: "of full scale", kind: REAL,
        codes_per_unit: 1_000_000, min: 250_000, max: 1_000_000, default: Some(1_000_000),
        acts_in: "DSP clip",
    }
    /// Noise-floor threshold N, ppm of ADC full scale, on an echo's amplitude.
    noise_floor_ppm: i32, NoiseFloor {
        help: "Lowest amplitude of an echo.",
        name: "noise_floor", symbol: "N", unit: "of full scale", kind: LOG,
        codes_per_unit: 1_000_000, min: 100, max: 200_000, default: Some(4_000),
        acts_in: "DSP threshold",
    }
    /// SNR threshold k, 0.001 σ of the filtered noise.
    snr_threshold_milli: i32, SnrThreshold {
        help: "Lowest amplitude of an echo over σ of the filtered noise.",
        name: "snr_threshold", symbol: "k", unit: "sigma", kind: REAL,
        codes_per_unit: 1000, min: 2_500, max: 8_000, default: Some(4_700),
        acts_in: "DSP threshold",
    }
    /// Upsampling ratio o of the interpolation around a candidate.
    upsampling: i32, Upsampling {
        help: "Points per sample of the interpolation around a candidate.",
        name: "upsampling", symbol: "o", unit: "", kind: Kind::PowerOfTwo,
        codes_per_unit: 1, min: 1, max: 8, default: Some(1), acts_in: "DSP interpolation",
    }
    /// Denoise filter: the code of a [`DenoiseFilter`].
    denoise: i32, Denoise {
        help: "Filter before the detector.",
        name: "denoise", acts_in: "DSP filter",
        ..choice(DenoiseFilter::NAMES, DenoiseFilter::Matched.code())
    }
    /// Ambient estimator: the code of an [`AmbientEstimator`].
    ambient: i32, Ambient {
        help: "Estimator of the ambient level.",
        name: "ambient", acts_in: "DSP baseline",
        ..choice(AmbientEstimator::NAMES, AmbientEstimator::Median.code())
    }
    /// Timing method: the code of a [`TimingMethod`].
    timing: i32, Timing {
        help: "Method that takes the time of an echo.",
        name: "timing", acts_in: "DSP timing",
        ..choice(TimingMethod::NAMES, TimingMethod::WalkCorrected.code())
    }
    /// Minimum echo separation ΔR, mm; `None` follows the pulse: 1.14·cW/2.
    min_separation_mm: Option<i32>, MinSeparation {
        help: "Smallest distance of two echoes. Left out: it follows the pulse, 1.14·cW/2.",
        name: "min_separation", symbol: "ΔR", unit: "m", kind: REAL,
        codes_per_unit: 1000, min: 300, max: 3_000, default: None, acts_in: "DSP peaks",
    }
    /// Echoes kept per waveform.
    echoes: i32, Echoes {
        help: "Most echoes of a waveform that are kept.",
        name: "echoes", symbol: "E", unit: "", kind: Kind::Integer,
        codes_per_unit: 1, min: 1, max: 4, default: Some(1), acts_in: "DSP peaks",
    }
    /// Rule for the echoes that are kept: the code of an [`EchoChoice`].
    echo_choice: i32, EchoChoice {
        help: "Rule for which echoes are kept.",
        name: "echo_choice", acts_in: "DSP peaks",
        ..choice(EchoChoice::NAMES, EchoChoice::Strongest.code())
    }
    /// Black level, ppm of ADC full scale: the converter's reading at no current.
    black_level_ppm: i32, BlackLevel {
        help: "The converter's reading at no current.",
        name: "black_level", symbol: "", unit: "of full scale", kind: REAL,
        codes_per_unit: 1_000_000, min: 0, max: 40_000, default: Some(0), acts_in: "front end",
    }
    /// Dither of the shots against the sampling clock: the code of a [`Dither`].
    dither: i32, Dither {
        help: "Dither: shots of a beam begin at different moments of the sampling clock.",
        name: "dither", acts_in: "ADC clock, DSP timing",
        ..choice(Dither::NAMES, Dither::Off.code())
    }
    /// Slope of the gain over range up to where it is full, 0.001 dB/m; 0: it is full everywhere.
    gain_slope_mdb_m: i32, GainSlope {
        help: "Slope of the gain over range up to where it is full; 0: it is full everywhere.",
        name: "gain_slope", symbol: "", unit: "dB/m", kind: REAL,
        codes_per_unit: 1000, min: 0, max: 1_000, default: Some(0), acts_in: "front end, DSP",
    }
    /// Range from which the gain is full, mm.
    gain_range_mm: i32, GainRange {
        help: "Range from which the gain is full.",
        name: "gain_range", symbol: "", unit: "m", kind: REAL,
        codes_per_unit: 1000, min: 5_000, max: 40_000, default: Some(40_000),
        acts_in: "front end, DSP",
    }
    /// Range from which the receiver sees the whole beam, mm; at nine tenths of it, nothing.
    overlap_mm: i32, Overlap {
        help: "Range from which the receiver sees the whole beam; at nine tenths of it, nothing.",
        name: "overlap", symbol: "ξ", unit: "m", kind: LOG,
        codes_per_unit: 1000, min: 500, max: 20_000, default: Some(1_000),
        acts_in: "front end, reflectivity",
    }
    /// Full azimuth range of the beams, 0.01°; `None`: as the scan pattern has it, as are all
    /// fields of the aim.
    azimuth_span_cdeg: Option<i32>, AzimuthSpan {
        help: "Full azimuth range of the beams of a steered sensor.",
        name: "azimuth_span", symbol: "", unit: "°", kind: REAL,
        codes_per_unit: 100, min: 100, max: 36_000, default: None, acts_in: "aim",
    }
    /// Full elevation range of the beams, 0.01°.
    elevation_span_cdeg: Option<i32>, ElevationSpan {
        help: "Full elevation range of the beams of a steered sensor.",
        name: "elevation_span", symbol: "", unit: "°", kind: REAL,
        codes_per_unit: 100, min: 100, max: 18_000, default: None, acts_in: "aim",
    }
    /// Elevation of the middle of the beams, 0.01°.
    tilt_cdeg: Option<i32>, Tilt {
        help: "Elevation of the middle of the beams of a steered sensor.",
        name: "tilt", symbol: "", unit: "°", kind: REAL,
        codes_per_unit: 100, min: -9_000, max: 9_000, default: None, acts_in: "aim",
    }
    /// Number of beams along azimuth.
    columns: Option<i32>, Columns {
        help: "Number of beams of a steered sensor along azimuth.",
        name: "columns", symbol: "", unit: "beams", kind: Kind::Integer,
        codes_per_unit: 1, min: 1, max: 4_096, default: None, acts_in: "aim",
    }
    /// Number of beams along elevation.
    rows: Option<i32>, Rows {
        help: "Number of beams of a steered sensor along elevation.",
        name: "rows", symbol: "", unit: "beams", kind: Kind::Integer,
        codes_per_unit: 1, min: 1, max: 1_024, default: None, acts_in: "aim",
    }
    /// Foveation of the columns, 0.001: see [`Aim`](crate::Aim).
    azimuth_fovea_milli: Option<i32>, AzimuthFovea {
        help: "Foveation of the columns: above 0 they are denser ahead, below 0 at the sides.",
        name: "azimuth_fovea", symbol: "", unit: "", kind: REAL,
        codes_per_unit: 1000, min: -400, max: 900, default: None, acts_in: "aim",
    }
    /// Foveation of the rows, 0.001.
    elevation_fovea_milli: Option<i32>, ElevationFovea {
        help: "Foveation of the rows: above 0 they are denser about the tilt, below 0 far from it.",
        name: "elevation_fovea", symbol: "", unit: "", kind: REAL,
        codes_per_unit: 1000, min: -400, max: 900, default: None, acts_in: "aim",
    }
    /// Time of a scan, µs.
    frame_us: Option<i32>, FrameTime {
        help: "Time of a scan of a steered sensor.",
        name: "frame_time", symbol: "", unit: "ms", kind: REAL,
        codes_per_unit: 1000, min: 10_000, max: 1_000_000, default: None, acts_in: "aim",
    }
}

impl ParameterId {
    /// Fields of the aim, which only a steered pattern has.
    pub const AIM: [Self; 8] = [
        Self::AzimuthSpan,
        Self::ElevationSpan,
        Self::Tilt,
        Self::Columns,
        Self::Rows,
        Self::AzimuthFovea,
        Self::ElevationFovea,
        Self::FrameTime,
    ];

    /// Row of the table for this identifier.
    pub fn parameter(self) -> &'static Parameter {
        PARAMETERS.get(self as usize).unwrap_or(&PARAMETERS[0]) // a row each: never out of bounds
    }

    /// Identifier of the parameter with this name.
    pub fn by_name(name: &str) -> Option<Self> {
        PARAMETERS.iter().find(|p| p.name == name).map(|p| p.id)
    }
}

impl fmt::Display for ParameterId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.parameter().name)
    }
}

impl Settings {
    /// ΔR in mm; 1.14·cW/2, rounded down, when it follows the pulse.
    pub fn separation_mm(&self) -> i32 {
        // 1.14 × c/2 = 170.88 µm per ps
        let following = i64::from(self.pulse_width_ps).saturating_mul(17_088) / 100_000;
        self.min_separation_mm.unwrap_or(i32::try_from(following).unwrap_or(i32::MAX))
    }

    /// Number of moments within a sample period at which shots of a beam begin: 1, 2 or 4.
    pub fn phases(&self) -> u32 {
        let dithered = self.dither == Dither::On.code();
        if dithered { (self.shots as u32).clamp(1, LANES as u32) } else { 1 }
    }

    /// Delay of a shot's samples against the mean of all shots, fs: (2 (k mod P) + 1 − P)/(2P) of
    /// the period, rounded towards 0.
    #[expect(
        clippy::arithmetic_side_effects,
        reason = "phases are 1 to 4: the product is below 2³⁵, divisors are not 0"
    )]
    pub fn offset_fs(&self, shot: u32, period_fs: u32) -> i32 {
        let phases = i64::from(self.phases());
        let twice = 2 * (i64::from(shot) % phases) + 1 - phases;
        (i64::from(period_fs) * twice / (2 * phases)) as i32
    }

    /// Number of samples before the trigger that the ambient estimator reads.
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
