//! The edges of clipped echoes, read from shots that were dithered against the sampling clock.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "samples below 2400·4, times 2³¹, sums of lanes 2¹⁸ with shifts up to 7"
)]

use crate::accumulate::{Accumulator, LANES};
use crate::edges::{EdgeFit, Edges, Run};
use crate::noise::Noise;
use crate::pulse::Pulse;
use crate::ramp::{Ramp, levelled};
use crate::settings::Settings;

/// Finer samples that are looked at: a run with what lies beside it. A longer one is timed by the
/// sum of its shots.
pub const FINE_SAMPLES: usize = 512;

/// Samples of the waveform on either side of a run that are looked at.
const BESIDE: usize = 4;

/// The longest pulse width that [`Pulse`] holds, samples.
const MOST_SAMPLES: u64 = 127;

/// What dithered shots are read with.
///
/// ```text
/// P         phases: as many as shots, at most 4
/// offset    (2 (k mod P) + 1 − P) / (2P) samples, by which shot k is sampled later
/// x[nP + k] of shots k, k + P, …: a waveform of P times the rate, at (j − (P − 1)/2)/P samples
/// ```
#[derive(Clone, Debug)]
pub struct FineConfig {
    /// log₂ P.
    pub(crate) phases_log2: u32,
    /// log₂ of the shots of a phase.
    pub(crate) shots_log2: u32,
    /// Left shift that brings a code of one shot to Q1.15.
    pub(crate) code_shift: u32,
    /// Sums of a phase at or above it are saturated.
    pub(crate) clip: u16,
    /// The pulse at P times the rate.
    pub(crate) pulse: Pulse,
}

impl FineConfig {
    /// `None` where shots are not dithered, or where a pulse's width is more than 127 of the finer
    /// samples, which need no help. `full_scale` is the code of one shot there.
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

/// The shots of a waveform.
#[derive(Clone, Copy, Debug)]
pub struct Fine<'a> {
    /// What they are read with.
    pub config: &'a FineConfig,
    /// Themselves.
    pub shots: &'a Accumulator,
    /// Samples before the trigger, which come first.
    pub before: usize,
    /// Samples of the waveform.
    pub samples: usize,
    /// What the baseline removed, Q1.15.
    pub ambient: i16,
    /// Of a sample of the waveform.
    pub noise: &'a Noise,
    /// The near gain.
    pub ramp: Option<&'a Ramp>,
}

impl Fine<'_> {
    /// Fits the edges of a run of clipped samples; `None` where it is longer than
    /// [`FINE_SAMPLES`] hold, or touches an end, or where its middle is not clipped in all phases.
    ///
    /// | name | value | format |
    /// |---|---|---|
    /// | x | sum of a phase's shots, at most S, over their number, less ambient | Q1.15, down |
    /// | … where the gain rises | as if all had the gain of the run's middle | as [`Ramp`]'s z |
    /// | σ̂; κ | of the waveform times ⌊2¹⁵ √P⌋/2¹⁵; P | as [`Noise`], saturating |
    /// | level | S of the phase less ambient, at least 1 | Q1.15 |
    /// | time; σ | of a finer sample over P, rounded down | Q16.16 |
    #[inline(never)]
    pub fn fit(&self, run: Run) -> Option<Edges> {
        let Self { config, .. } = *self;
        let log2 = config.phases_log2;
        let first = run.first.checked_sub(BESIDE)? << log2;
        let end = (run.last + BESIDE + 1).min(self.samples) << log2;
        let mut buffer = [0i16; FINE_SAMPLES];
        let x = buffer.get_mut(..end.checked_sub(first)?)?;
        let middle = (run.first + run.last) << log2 >> 1;
        for (x, j) in x.iter_mut().zip(first..) {
            let value = self.in_q15(self.sum(j).min(config.clip)) - i64::from(self.ambient);
            *x = self.levelled(value, j, middle);
        }
        let run = self.clipped(middle, first..end)?;
        let run = Run { first: run.first - first, last: run.last - first };
        let level = (self.in_q15(config.clip) - i64::from(self.ambient)).max(1);
        let noise = self.noise();
        let edges = EdgeFit { pulse: &config.pulse, noise: &noise, level }.fit(x, run)?;
        let twice = 2 * (edges.time + ((first as i64) << 16)) - (((1 << log2) - 1) << 16);
        Some(Edges { time: twice >> (log2 + 1), sigma: edges.sigma >> log2, ..edges })
    }

    /// A finer sample as if it had the gain of another.
    fn levelled(&self, value: i64, j: usize, of: usize) -> i16 {
        let log2 = self.config.phases_log2;
        let octaves = self.ramp.map_or(0, |ramp| {
            let time = |j: usize| (((2 * j + 1) as i64 - (1 << log2)) << 15 >> log2) as i32;
            ramp.octaves(time(j)) - ramp.octaves(time(of))
        });
        levelled(value as i32, octaves) // below 2²³
    }

    /// The run of clipped finer samples around one of them.
    fn clipped(&self, middle: usize, within: core::ops::Range<usize>) -> Option<Run> {
        let clips = |&j: &usize| self.sum(j) >= self.config.clip;
        let middle = Some(middle).filter(clips)?;
        let first = (within.start..middle).rev().take_while(clips).last().unwrap_or(middle);
        let last = (middle + 1..within.end).take_while(clips).last().unwrap_or(middle);
        Some(Run { first, last })
    }

    /// Codes of the shots of a finer sample.
    fn sum(&self, j: usize) -> u16 {
        let lanes = self.shots.lanes(self.before + (j >> self.config.phases_log2));
        let phase = j & ((1 << self.config.phases_log2) - 1);
        lanes.get(phase % LANES).copied().unwrap_or(0)
    }

    fn in_q15(&self, sum: u16) -> i64 {
        (i64::from(sum) << self.config.code_shift) >> self.config.shots_log2
    }

    fn noise(&self) -> Noise {
        const ROOTS: [u64; 3] = [32_768, 46_340, 65_536]; // ⌊2¹⁵ √P⌋
        let log2 = self.config.phases_log2;
        let root = ROOTS.get(log2 as usize).copied().unwrap_or(65_536);
        let sigma = (u64::from(self.noise.sigma) * root) >> 15;
        let shot = u64::from(self.noise.shot) << log2;
        Noise { sigma: sigma.min(u32::MAX.into()) as u32, shot: shot.min(u32::MAX.into()) as u32 }
    }
}
