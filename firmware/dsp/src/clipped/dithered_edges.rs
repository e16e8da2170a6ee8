//! Edges of clipped echoes, read from shots that were dithered against the sampling clock.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "samples below 2400·4, times 2³¹, sums of lanes 2¹⁸ with shifts up to 7"
)]

use crate::clipped::dithered_config::DitheredConfig;
use crate::clipped::edges::{EdgeFit, Edges, Run};
use crate::rising_gain::near::Near;
use crate::rising_gain::ramp::levelled;
use crate::stages::accumulate::{Accumulator, LANES};
use crate::stages::noise::Noise;

/// Most finer samples of a run and of the samples beside it. A longer run is timed from the sum of
/// its shots.
pub const MAX_FINER_SAMPLES: usize = 512;

/// Samples of the waveform that are read on either side of a run.
const BESIDE: usize = 4;

/// Dithered shots of a waveform, and the constants for reading their edges.
#[derive(Clone, Copy, Debug)]
pub struct DitheredEdges<'a> {
    /// Constants for reading the shots.
    pub config: &'a DitheredConfig,
    /// The shots, summed by phase.
    pub shots: &'a Accumulator,
    /// Number of samples before the trigger, which come first.
    pub before: usize,
    /// Number of samples of the waveform.
    pub samples: usize,
    /// Ambient light that the baseline removed, Q1.15.
    pub ambient: i16,
    /// Noise of a sample of the waveform.
    pub noise: &'a Noise,
    /// Near gain, and the sample whose gain all samples are brought to, where the gain rises.
    pub level: Option<(Near<'a>, usize)>,
}

impl DitheredEdges<'_> {
    /// Fits the edges of a run of clipped samples. `None` where the run is longer than
    /// [`MAX_FINER_SAMPLES`] or touches an end, or where its middle is not clipped in all phases.
    ///
    /// | name | value | format |
    /// |---|---|---|
    /// | x | sum of a phase's shots, at most S, over their number, less ambient | Q1.15, down |
    /// | … where the gain rises | less b of its sample, and as [`Near`]'s z of the echo | Q1.15 |
    /// | σ̂; κ | of the waveform times ⌊2¹⁵ √P⌋/2¹⁵; P | as [`Noise`], saturating |
    /// | level | S of the phase less ambient, at least 1 | Q1.15 |
    /// | time; σ | of a finer sample over P, rounded down | Q16.16 |
    #[inline(never)]
    pub fn fit(&self, run: Run) -> Option<Edges> {
        let Self { config, .. } = *self;
        let log2 = config.phases_log2;
        let first = run.first.checked_sub(BESIDE)? << log2;
        let end = (run.last + BESIDE + 1).min(self.samples) << log2;
        let mut buffer = [0i16; MAX_FINER_SAMPLES];
        let x = buffer.get_mut(..end.checked_sub(first)?)?;
        for (x, j) in x.iter_mut().zip(first..) {
            *x = self.level(j, self.in_q15(self.sum(j).min(config.clip)));
        }
        let run = self.clipped((run.first + run.last) << log2 >> 1, first..end)?;
        let run = Run { first: run.first - first, last: run.last - first };
        let level = (self.in_q15(config.clip) - i64::from(self.ambient)).max(1);
        let noise = self.noise();
        let edges = EdgeFit { pulse: &config.pulse, noise: &noise, level }.fit(x, run)?;
        let twice = 2 * (edges.time + ((first as i64) << 16)) - (((1 << log2) - 1) << 16);
        Some(Edges { time: twice >> (log2 + 1), sigma: edges.sigma >> log2, ..edges })
    }

    /// Finer sample without its baseline, as if it had the gain of the echo.
    fn level(&self, j: usize, value: i64) -> i16 {
        let log2 = self.config.phases_log2;
        let Some((near, at)) = self.level else {
            return (value - i64::from(self.ambient)).clamp(-0x8000, 0x7fff) as i16;
        };
        let time = (((2 * j + 1) as i64 - (1 << log2)) << 15 >> log2) as i32;
        let octaves = near.ramp.octaves(time) - near.ramp.below(at);
        let above = value - i64::from(near.rest(j >> log2));
        levelled(above as i32, octaves) // below 2²³
    }

    /// Run of clipped finer samples around sample `middle`.
    fn clipped(&self, middle: usize, within: core::ops::Range<usize>) -> Option<Run> {
        let clips = |&j: &usize| self.sum(j) >= self.config.clip;
        let middle = Some(middle).filter(clips)?;
        let first = (within.start..middle).rev().take_while(clips).last().unwrap_or(middle);
        let last = (middle + 1..within.end).take_while(clips).last().unwrap_or(middle);
        Some(Run { first, last })
    }

    /// Sum of the codes of a finer sample's shots.
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
