//! Strongest echo of a record, from which the response is estimated.

use echoloop_dsp::{Flags, MAX_SAMPLES};

use crate::codes::Codes;
use crate::finder::baseline::{Baseline, KnownNoise};
use crate::finder::colour::Colour;
use crate::finder::{EchoFinder, FinderConfig, FoundEcho, samples};

/// A record and its strongest echo.
#[derive(Clone, Debug)]
pub(super) struct Strong {
    /// Codes without ambient.
    pub(super) x: Vec<f64>,
    /// Noise of a sample, codes.
    pub(super) sigma: f64,
    /// One code in the file's units.
    pub(super) unit: f64,
    /// Time of the strongest echo, samples.
    pub(super) time: f64,
    /// Its height, codes.
    pub(super) height: f64,
    /// Its full width at half maximum, samples.
    pub(super) width: f64,
    /// Lags from it of the other echoes that are at least a fifth as high, samples.
    pub(super) others: Vec<f64>,
    /// True when the pulse that fits the record best hides a clear top.
    pub(super) hides_top: bool,
}

/// Least SNR of an echo that shows the response, Q.8.
const LEAST_SNR: u32 = 20 << 8;

impl Strong {
    /// A record whose strongest echo stands alone, whole and clear of noise; else `None`. Only its
    /// first [`MAX_SAMPLES`] are searched; `best_fit` as of [`FinderConfig`].
    pub(super) fn of_record(
        finder: &mut EchoFinder,
        codes: &Codes,
        colour: Option<Colour>,
        best_fit: bool,
    ) -> Option<Self> {
        let first = beginning(codes);
        let echoes = finder
            .echoes(first, &FinderConfig { best_fit, ..FinderConfig::of_record(codes, colour) });
        let best = echoes.iter().max_by_key(|echo| echo.amplitude)?;
        let unfit = Flags::SATURATED | Flags::TRUNCATED | Flags::MERGED;
        if best.flags.0 & unfit.0 != 0 || best.snr < LEAST_SNR || !codes.gaps.is_empty() {
            return None;
        }
        let (x, sigma) = at_rest(codes, colour, None);
        let high = || echoes.iter().filter(|echo| 5 * echo.amplitude > best.amplitude);
        let lag = |echo: &FoundEcho| samples(echo.time - best.time);
        Some(Self {
            x,
            sigma,
            unit: codes.unit,
            time: samples(best.time),
            height: codes.of_height(best.amplitude),
            width: samples(best.width),
            others: high().map(lag).filter(|lag| *lag != 0.0).collect(),
            hides_top: finder.threshold().hides_top,
        })
    }

    /// Noise over the echo's height.
    pub(super) fn noise(&self) -> f64 {
        self.sigma / self.height
    }

    /// Value at a time over the echo's height, by Catmull and Rom's cubic; `None` outside.
    pub(super) fn at(&self, time: f64) -> Option<f64> {
        let index = time.floor();
        if !(index >= 1.0 && index + 2.0 < self.x.len() as f64) {
            return None;
        }
        let (i, f) = (index as usize, time - index);
        let (a, b, c, d) = (self.x[i - 1], self.x[i], self.x[i + 1], self.x[i + 2]);
        let bend = 2.0 * a - 5.0 * b + 4.0 * c - d + f * (3.0 * b - 3.0 * c + d - a);
        Some((b + 0.5 * f * (c - a + f * bend)) / self.height)
    }
}

/// The first [`MAX_SAMPLES`] of a record.
pub(crate) fn beginning(codes: &Codes) -> &[u16] {
    &codes.codes[..codes.codes.len().min(MAX_SAMPLES)]
}

/// Noise of a sample, Q13.19, as the first [`MAX_SAMPLES`] of a record tell it.
pub(crate) fn own_sigma(codes: &Codes, colour: Option<Colour>) -> u32 {
    let piece = beginning(codes);
    Baseline::sigma(piece, codes.shift, colour.as_ref(), &mut vec![0; piece.len()])
}

/// Samples of a record minus its ambient, and their noise, codes. Ambient and noise, if `sigma`,
/// Q13.19, is not known, are measured in its first [`MAX_SAMPLES`].
pub(crate) fn at_rest(
    codes: &Codes,
    colour: Option<Colour>,
    sigma: Option<u32>,
) -> (Vec<f64>, f64) {
    let piece = beginning(codes);
    let noise = KnownNoise { colour: colour.as_ref(), sigma };
    let baseline = Baseline::measure(piece, codes.shift, noise, &mut vec![0; piece.len()]);
    let ambient = codes.of_height(baseline.ambient.into());
    let x = codes.codes.iter().map(|&code| f64::from(code) - ambient);
    (x.collect(), codes.of_sigma(baseline.sigma))
}
