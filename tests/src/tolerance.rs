//! Tolerances of the integer code against the model that never rounds.

use crate::float_reference::Echo;

/// Bounds of the errors of an echo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// SNR behind the filter from which the bounds hold.
    pub from_snr: f64,
    /// Error of the slant range, mm.
    pub range_mm: f64,
    /// Error of the amplitude, fraction of full scale.
    pub amplitude: f64,
    /// Error of the filtered width, ns.
    pub width_ns: f64,
    /// Relative error of the SNR.
    pub snr: f64,
    /// Relative error of the range's σ.
    pub deviation: f64,
}

/// Tolerances at 12 bits, 5 ns, 0.5 to 3 GS/s, in noise of at least [`LEAST_NOISE_CODES`].
///
/// The rounding of the filter's output to Q1.15 dominates: an echo of SNR 5 in noise of 4 codes is
/// 25 to 75 LSB high. Height, width and SNR are read from that output; the time is read with eight
/// more bits.
pub const TOLERANCES: [Tolerance; 5] = [
    // from SNR, range mm, amplitude, width ns, SNR, deviation
    bounds(5.0, 4.0, 1.2e-4, 0.45, 0.040, 0.040),
    bounds(10.0, 2.0, 1.4e-4, 0.16, 0.030, 0.030),
    bounds(20.0, 1.0, 1.7e-4, 0.11, 0.020, 0.020),
    bounds(50.0, 0.6, 2.2e-4, 0.07, 0.012, 0.012),
    bounds(100.0, 0.6, 5.4e-4, 0.06, 0.010, 0.010),
];

const fn bounds(
    from_snr: f64,
    range_mm: f64,
    amplitude: f64,
    width_ns: f64,
    snr: f64,
    deviation: f64,
) -> Tolerance {
    Tolerance { from_snr, range_mm, amplitude, width_ns, snr, deviation }
}

/// Least σ of a sample for which [`TOLERANCES`] hold, ADC codes. The reference receiver's amplifier
/// alone has 6.7.
pub const LEAST_NOISE_CODES: f64 = 4.0;

/// Tolerance at an SNR; `None` below the table.
pub fn at(snr: f64) -> Option<&'static Tolerance> {
    TOLERANCES.iter().rfind(|t| snr >= t.from_snr)
}

impl Tolerance {
    /// Differences of two echoes relative to the bounds: range, amplitude, width, SNR, σ. At most 1
    /// within the tolerance.
    pub fn taken(&self, a: &Echo, b: &Echo) -> [f64; 5] {
        [
            (a.range_mm - b.range_mm).abs() / self.range_mm,
            (a.amplitude - b.amplitude).abs() / self.amplitude,
            (a.width_ns - b.width_ns).abs() / self.width_ns,
            (a.snr / b.snr - 1.0).abs() / self.snr,
            (a.deviation_mm / b.deviation_mm - 1.0).abs() / self.deviation,
        ]
    }
}
