//! Echo, as the sensor reports it.

use fixed::types::{U1F15, U6F10, U8F8, U12F4, U24F8};
use heapless::Vec;

use crate::clipped::edges;
use crate::config::DetectorConfig;
use crate::limits::MAX_ECHOES;
use crate::q::{divide_round, saturate_u16, shift_round};
use crate::stages::detect::Threshold;
use crate::stages::flags::Flags;
use crate::stages::refine::Refined;

/// Echo of a waveform.
///
/// ```text
/// range        = origin + time · step
/// amplitude    = height / g                     a lower bound when saturated
/// deviation    = σ of the time · step
/// reflectivity = A R² / (U P G ξ v)             of a Lambertian surface square to the beam
/// snr          = height / σ_y                   both after the filter, to be compared with k
/// ```
///
/// v is the near gain at the echo ([`crate::rising_gain::ramp`]); amplitude is as converted, v in
/// it.
///
/// | field | unit | format |
/// |---|---|---|
/// | range | mm, slant | U24.8, nearest |
/// | amplitude | fraction of full scale, over ambient | U1.15, nearest, saturating |
/// | width | ns, at half height after the filter | U12.4, nearest, saturating |
/// | deviation | mm; the step rounded down to 2⁻¹⁶ mm | U8.8, rounded down, saturating |
/// | reflectivity | white = 1; R whole mm, A/(ξ v) down, A R² < 2⁶⁴ | U6.10, nearest, saturating |
/// | snr | σ_y at least 1 LSB | U8.8, rounded down, saturating |
///
/// A negative height counts as 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
pub struct Echo {
    /// Slant range, U24.8 mm.
    pub range: u32,
    /// Amplitude, U1.15 of full scale.
    pub amplitude: u16,
    /// Filtered width, U12.4 ns.
    pub width: u16,
    /// SNR, U8.8.
    pub snr: u16,
    /// σ of the range, U8.8 mm.
    pub deviation: u16,
    /// Reflectivity, U6.10.
    pub reflectivity: u16,
    /// Remarks on the echo.
    pub flags: Flags,
}

impl Echo {
    /// Slant range in millimetres.
    pub fn range_mm(&self) -> U24F8 {
        U24F8::from_bits(self.range)
    }

    /// Slant range in metres.
    pub fn range_m(&self) -> f64 {
        self.range_mm().to_num::<f64>() / 1e3
    }

    /// Amplitude as a fraction of full scale.
    pub fn amplitude_fraction(&self) -> U1F15 {
        U1F15::from_bits(self.amplitude)
    }

    /// Filtered width in nanoseconds.
    pub fn width_ns(&self) -> U12F4 {
        U12F4::from_bits(self.width)
    }

    /// SNR: height over σ, both after the filter.
    pub fn snr_ratio(&self) -> U8F8 {
        U8F8::from_bits(self.snr)
    }

    /// σ of the range in millimetres, from the noise and the timing method; 255.996 means at least
    /// that.
    pub fn deviation_mm(&self) -> U8F8 {
        U8F8::from_bits(self.deviation)
    }

    /// Reflectivity: 1 is white and square to the beam. For a saturated echo it comes from the
    /// edges if these time it ([`Flags::WALK_CORRECTED`]); else it is a lower bound.
    pub fn reflectivity_ratio(&self) -> U6F10 {
        U6F10::from_bits(self.reflectivity)
    }

    /// Turns a refined peak into an echo; `None` when it lies before range 0.
    #[expect(
        clippy::arithmetic_side_effects,
        reason = "time is below 2²⁸, 2400 samples, a step below 2³⁵, 1.2 m: W spans 2.5 samples; \
                  heights are Q1.15"
    )]
    pub fn from_peak(
        config: &DetectorConfig,
        refined: &Refined,
        threshold: &Threshold,
        index: usize,
    ) -> Option<Self> {
        let along = shift_round(refined.time * config.range_step, 32);
        let range = u32::try_from(config.range_origin + along).ok()?;
        let height = refined.height.max(0);
        let mut flags = refined.flags;
        if 4 * height < 5 * i32::from(threshold.level) {
            flags |= Flags::LOW_CONFIDENCE;
        }
        Some(Self {
            range,
            amplitude: saturate_u16(config.template.amplitude(height)),
            width: width(config, refined.width),
            snr: snr(height, threshold.sigma),
            deviation: saturate_u16((i64::from(refined.sigma) * (config.range_step >> 8)) >> 24),
            reflectivity: reflectivity(config, refined.amplitude, index, range),
            flags,
        })
    }
}

/// Q16.16 samples to U12.4 ns: `round(w · fs / 2¹⁶ · 16 / 10⁶)`.
#[expect(
    clippy::arithmetic_side_effects,
    reason = "a width is at most 2400 samples, 2²⁸, a period below 2³²"
)]
fn width(config: &DetectorConfig, width: i64) -> u16 {
    saturate_u16(divide_round(width * i64::from(config.sample_period_fs), 1_000_000 << 12))
}

/// A R² / (U P G ξ v), R in whole mm, rounded down; v is the near gain at sample `index`.
#[expect(
    clippy::arithmetic_side_effects,
    reason = "R² is below 2⁴⁸, ξ at least 2¹², the product of two u64 below 2¹²⁸ − 2⁶⁴"
)]
fn reflectivity(config: &DetectorConfig, amplitude: i64, index: usize, range: u32) -> u16 {
    let amplitude = amplitude.clamp(0, edges::MAX_AMPLITUDE) as u32;
    let amplitude = u64::from(config.at_full_gain(amplitude, index));
    let range_mm = u64::from(range >> 8);
    let whole = match overlap(config.overlap_mm, range >> 8) {
        FULL => amplitude,
        part => amplitude * u64::from(FULL) / u64::from(part), // below 2³² · 2¹⁶
    };
    let light = whole.saturating_mul(range_mm * range_mm);
    let ratio = (u128::from(light) * u128::from(config.reflectivity_scale) + (1 << 63)) >> 64;
    ratio.min(u16::MAX.into()) as u16
}

/// ξ = 1, Q16.
const FULL: u32 = 1 << 16;

/// ξ: 0 up to nine tenths of `full_mm`, 1 from `full_mm` on, linear between. Q16, rounded down, at
/// least 1/16.
#[expect(clippy::arithmetic_side_effects, reason = "mm of a range below 2¹⁵: times 2¹⁶ below 2³²")]
fn overlap(full_mm: u32, range_mm: u32) -> u32 {
    if range_mm >= full_mm {
        return FULL;
    }
    let begin_mm = full_mm * 9 / 10;
    let part = (range_mm.saturating_sub(begin_mm) << 16) / (full_mm - begin_mm).max(1);
    part.max(FULL / 16)
}

/// Q1.15 over Q13.19 to U8.8, rounded down.
#[expect(clippy::arithmetic_side_effects, reason = "the divisor is at least 1")]
fn snr(height: i32, sigma: u32) -> u16 {
    saturate_u16((i64::from(height) << 12) / i64::from(sigma.max(1)))
}

/// Echoes of one waveform.
pub type Echoes = Vec<Echo, MAX_ECHOES>;

#[cfg(feature = "defmt")]
impl defmt::Format for Echo {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(
            f,
            "{} mm, amplitude {}/32768, snr {}/256, {}",
            self.range >> 8,
            self.amplitude,
            self.snr,
            self.flags
        );
    }
}
