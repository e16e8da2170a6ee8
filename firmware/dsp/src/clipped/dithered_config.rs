//! Constants for reading dithered shots, derived once with the settings.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "widths are below 2¹⁵ ps, shots at most 16, codes below 2¹⁵: products below 2⁴⁰"
)]

use crate::clipped::pulse::Pulse;
use crate::settings::Settings;

/// Longest pulse width that [`Pulse`] holds, samples.
const MOST_SAMPLES: u64 = 127;

/// Constants for reading dithered shots.
///
/// ```text
/// P         phases: as many as shots, at most 4
/// offset    (2 (k mod P) + 1 − P) / (2P) samples, by which shot k is sampled later
/// x[nP + k] of shots k, k + P, …: a waveform of P times the rate, at (j − (P − 1)/2)/P samples
/// ```
#[derive(Clone, Debug)]
pub struct DitheredConfig {
    /// log₂ P.
    pub(crate) phases_log2: u32,
    /// log₂ of the shots of a phase.
    pub(crate) shots_log2: u32,
    /// Left shift that brings a code of a single shot to Q1.15.
    pub(crate) code_shift: u32,
    /// Lowest saturated sum of a phase.
    pub(crate) clip: u16,
    /// The pulse at P times the rate.
    pub(crate) pulse: Pulse,
}

impl DitheredConfig {
    /// Derives the constants. `None` where shots are not dithered, or where the pulse is wider than
    /// 127 of the finer samples: such a pulse is sampled finely enough. `full_scale` is the code of
    /// one shot at full scale.
    pub(crate) fn new(
        settings: &Settings,
        period_fs: u32,
        full_scale: u16,
        code_shift: u32,
    ) -> Option<Self> {
        let phases_log2 = settings.phases().trailing_zeros();
        let shots_log2 = (settings.shots as u32).trailing_zeros() - phases_log2;
        let width_ps = (settings.pulse_width_ps as u32) << phases_log2;
        let fits = u64::from(width_ps) * 1000 <= MOST_SAMPLES * u64::from(period_fs);
        let most = u64::from(full_scale) << shots_log2;
        let clip = (settings.saturation_ppm as u64 * most + 500_000) / 1_000_000;
        (phases_log2 > 0 && fits).then(|| Self {
            phases_log2,
            shots_log2,
            code_shift,
            clip: clip.min(u16::MAX.into()) as u16,
            pulse: Pulse::new(width_ps, period_fs),
        })
    }
}
