//! Sub-sample time, height and width of a peak.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "times are Q16.16 within 2400 samples, 2²⁸; outputs Q9.23 within ±2²⁴, times a \
              fraction or a tap 2⁴¹; σ below 2³²; ranges Q.8 below 2²¹, their squares times \
              four samples 2⁵⁹; divisors are at least 1"
)]

use core::ops::Range;

use heapless::Vec;

use crate::clipped::dithered_edges::DitheredEdges;
use crate::clipped::edges::{EdgeFit, Edges, Run};
use crate::clipped::height::Height;
use crate::config::DetectorConfig;
use crate::limits::MAX_ECHOES;
use crate::q::{divide_round, shift_round};
use crate::rising_gain::near::Near;
use crate::settings::choice::TimingMethod;
use crate::stages::detect::{self, Threshold, hysteresis};
use crate::stages::flags::Flags;
use crate::stages::lagrange::interpolation;
use crate::stages::noise::Noise;
use crate::stages::peak::{Candidate, Candidates, Peak};

/// Peak with its time between samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refined {
    /// Time since sample 0, Q16.16 samples.
    pub time: i64,
    /// Height of the filter's output at the vertex, Q1.15.
    pub height: i32,
    /// Width at half height, Q16.16 samples.
    pub width: i64,
    /// Amplitude of the pulse over ambient as if it were not clipped, Q1.15; at least 1.
    pub amplitude: i64,
    /// σ of the time, Q16.16 samples.
    pub sigma: u32,
    /// [`Flags::SATURATED`], [`Flags::MERGED`], [`Flags::TRUNCATED`], [`Flags::WALK_CORRECTED`].
    pub flags: Flags,
}

/// Waveform in its three forms, all of the same length.
#[derive(Clone, Copy, Debug)]
pub struct Waveform<'a> {
    /// Codes of the ADC.
    pub codes: &'a [u16],
    /// Samples, clipped and without baseline, Q1.15.
    pub x: &'a [i16],
    /// Output of the filter, Q1.15.
    pub y: &'a [i16],
}

/// Peaks that become echoes.
pub type Chosen = Vec<Peak, MAX_ECHOES>;

/// Refiner of a waveform's peaks, with all that it reads.
#[derive(Clone, Copy, Debug)]
pub struct Refiner<'a> {
    /// Constants of the stages.
    pub config: &'a DetectorConfig,
    /// Waveform whose peaks are refined.
    pub waveform: Waveform<'a>,
    /// Threshold that the peaks reached.
    pub threshold: &'a Threshold,
    /// Noise of the samples.
    pub noise: &'a Noise,
    /// Shots of the waveform, where they were dithered.
    pub dithered: Option<DitheredEdges<'a>>,
    /// Near gain. Before a peak in front of the ramp's end is refined, the samples of `x` and `y`
    /// around it are brought to its gain; `threshold` and `noise` are then those at the peak.
    pub near: Option<Near<'a>>,
    /// Sample whose gain the samples around it have been brought to.
    pub level: Option<usize>,
}

impl Refiner<'_> {
    /// Refines a peak of `y`; `f` is the filter's output before rounding, Q9.23, 0 outside.
    ///
    /// ```text
    /// s      = index, moved later one sample at a time while f rises, at most K times
    /// z[j]   = f interpolated at s + j/o, j = −o−1..o+1          Q9.23, nearest
    /// δ      = (z₋ − z₊) / (2 (z₋ − 2 z₀ + z₊))                  Q16.16, nearest, within ±½
    /// height = z₀ − (z₋ − z₊)·δ/4                                Q9.23, then Q1.15, both nearest
    /// width  = right − left: crossings of half of y[index]       Q16.16
    /// middle = ⌊(left + right)/2⌋                                Q16.16
    /// ```
    ///
    /// | method | time, Q16.16 | σ of the time, Q16.16, rounded down |
    /// |---|---|---|
    /// | parabola | s + (j + δ)/o, nearest | gain · σ(A) / A |
    /// | walk-corrected | the same less β·⌊δ (1 − 4δ²)⌋, nearest, in δ | as parabola |
    /// | CFD | where f rises to half of the height, plus z | as parabola |
    /// | … both, clipped | [`DitheredEdges`], [`EdgeFit`] or the middle | theirs, or as whole |
    /// | rising edge | where f rises to T, plus z | σ(level/g) · r / the rise of f |
    ///
    /// Half of what is left of a clipped echo is no constant fraction of it. The pulse fitted to
    /// the edges is a whole one: where it rises to half of its height, plus z, is its middle.
    ///
    /// z₀ is the highest `z[j]`, j = −o..o; on a tie the sample itself (j = 0), else the first.
    /// With o = 1, j is 0. A denominator of 0 makes δ 0. K samples on either side of a pulse's
    /// middle lie inside it; gain, β, the share of the shot noise in σ(A) and z are
    /// [`Timing`](crate::stages::timing::Timing)'s.
    ///
    /// The difference to the same method in real numbers, with 12 bits and noise of 4 codes or
    /// more, is at most 4, 1 and 0.6 mm at SNR 5, 20 and 100. The reason for each step is in
    /// `benches/record/detector.md`, Sub-sample time.
    #[inline(never)]
    pub fn refine(&self, f: impl Fn(i64) -> i64, peak: Peak) -> Refined {
        let config = self.config;
        let half = i32::from(peak.height) >> 1;
        let (left, right) = (self.crossing(peak, half, -1), self.crossing(peak, half, 1));
        let clipped = self.clipped_run(peak);
        let corrects = config.method == TimingMethod::WalkCorrected;
        let bias = if corrects && clipped.is_none() { config.timing.bias.into() } else { 0 };
        let start = i64::from(peak.index);
        let vertex = vertex(&f, start, config.reach, config.upsampling_log2, bias);
        let amplitude = config.template.amplitude(vertex.height).max(1);
        let mut refined = Refined {
            time: vertex.time,
            height: vertex.height,
            width: right.time - left.time,
            amplitude,
            sigma: self.sigma_of_top(amplitude),
            flags: left.flags | right.flags,
        };
        match (config.method, clipped) {
            (TimingMethod::WalkCorrected | TimingMethod::ConstantFraction, Some(run)) => {
                // Sets time, amplitude and σ.
                self.time_by_edges(run, (left.time + right.time) >> 1, &mut refined);
            }
            (TimingMethod::ConstantFraction, None) => {
                self.time_by_rise(&f, peak, i64::from(vertex.height) << 7, &mut refined);
            }
            (TimingMethod::RisingEdge, _) => {
                self.time_by_rise(&f, peak, i64::from(self.threshold.level) << 8, &mut refined);
            }
            (TimingMethod::Parabola | TimingMethod::WalkCorrected, _) => {}
        }
        if clipped.is_some() {
            refined.flags |= Flags::SATURATED;
        }
        let by_edges = refined.flags.contains(Flags::WALK_CORRECTED);
        let walks = clipped.is_some() && !by_edges;
        if walks || refined.flags.contains(Flags::TRUNCATED) {
            refined.sigma = u32::MAX; // unknown: the time of these is biased
        }
        refined
    }

    /// Peaks that become echoes, in their order: at least the minimum separation apart, at most as
    /// many as asked for. A single peak is chosen at once.
    #[inline(never)]
    pub fn chosen(&self, peaks: &[Peak]) -> Chosen {
        let config = self.config;
        if let [only] = peaks {
            let mut chosen = Chosen::new();
            let _ = chosen.push(*only); // at least one is asked for
            return chosen;
        }
        let mut candidates = self.candidates(peaks);
        detect::separate(&mut candidates, config.min_separation);
        detect::choose(candidates, config.echoes, config.echo_choice)
    }

    /// Peaks with the strength of their echoes: [`Height`] of a clipped peak, else its amplitude; 0
    /// of the air.
    pub fn candidates(&self, peaks: &[Peak]) -> Candidates {
        let mut candidates = Candidates::new();
        for &peak in peaks {
            let strength = self.strength(peak, peaks);
            let _ = candidates.push(Candidate { peak, strength }); // fits
        }
        candidates
    }

    fn strength(&self, peak: Peak, all: &[Peak]) -> u32 {
        let run = self.clipped_run(peak);
        let at = peak.index.into();
        if self.is_air(run.unwrap_or(Run { first: at, last: at }), all) {
            return 0;
        }
        let (n, strength) = match run {
            Some(run) => ((run.first + run.last) >> 1, self.height(run)),
            None => {
                let amplitude = self.config.template.amplitude(peak.height.into());
                (peak.index.into(), amplitude.max(0) as u32)
            }
        };
        self.config.at_full_gain(strength, n)
    }

    /// True when a clipped run, or a peak, is that of the air before the sensor, as in fog: it
    /// begins where the receiver begins to see the beam, and `y` stays high behind it. Behind a
    /// surface there is no light, and another surface makes a peak.
    ///
    /// ```text
    /// first ≤ blind + 3 W                                 L = 2 (K + 1), the pulse's length
    /// y[n] ≥ max(T/2, y[last]·(R_last/R_n)²/4)            n = last + L .. last + 3/2 L
    /// no other peak in last .. last + 2 L
    /// or, instead of both, a run of at least L samples: no surface's pulse is as long
    /// ```
    ///
    /// Light of the air falls as e^(−2αR)/R². The quarter is for α: 0.3 /m, fog of 10 m, leaves
    /// that much over a pulse of 15 ns. R is in samples, Q.8, rounded down; the products are exact.
    fn is_air(&self, run: Run, all: &[Peak]) -> bool {
        let Self { config, waveform: Waveform { y, .. }, .. } = *self;
        let length = 2 * (config.reach + 1);
        let first = ((run.first as i64) << 16) - config.blind;
        if first > 3 * config.pulse.width() {
            return false;
        }
        if run.last - run.first >= length - 1 {
            return true;
        }
        let begin = run.last + length;
        let Some(behind) = y.get(begin..begin + length / 2) else { return false };
        let beside = run.last + 1..begin + length + 1;
        if all.iter().any(|peak| beside.contains(&usize::from(peak.index))) {
            return false;
        }
        let range = |n: usize| (config.origin_samples + ((n as i64) << 16)) >> 8;
        let light = |n: usize, y: i16| i64::from(y) * range(n) * range(n);
        let least = light(run.last, y.get(run.last).copied().unwrap_or(0));
        let half = self.threshold.level >> 1;
        behind.iter().zip(begin..).all(|(&y, n)| y >= half && 4 * light(n, y) >= least)
    }

    fn height(&self, run: Run) -> u32 {
        let Self { config, waveform: Waveform { codes, x, .. }, .. } = *self;
        let middle = (run.first + run.last) >> 1;
        let ambient = self.near.map_or(self.threshold.ambient, |near| near.rest(middle));
        Height { edges: self.edge_fit(ambient), clip_code: config.clip_code, codes, x }.of(run)
    }

    /// Range of samples that refining a peak reads: its clipped run, or its index, and on either
    /// side the reach of filter and pulse plus 16.
    pub fn around(&self, peak: Peak) -> Range<usize> {
        let index = peak.index.into();
        let run = self.clipped_run(peak).unwrap_or(Run { first: index, last: index });
        let beside = self.config.template.half() + 2 * self.config.reach + 16;
        run.first.saturating_sub(beside)..run.last + beside + 1
    }

    /// True when a peak may hide others: it is not clipped, and its width at half height exceeds w
    /// of [`Timing`](crate::stages::timing::Timing) or ends in a valley.
    pub fn may_overlap(&self, peak: Peak) -> bool {
        let half = i32::from(peak.height) >> 1;
        let (left, right) = (self.crossing(peak, half, -1), self.crossing(peak, half, 1));
        let merged = (left.flags | right.flags).contains(Flags::MERGED);
        (merged || right.time - left.time > self.config.timing.broad)
            && self.clipped_run(peak).is_none()
    }

    /// Times again a peak that was hidden in another, by the parabola through the sharper filter's
    /// output `f` (Q9.23), without correction for bias, and marks it as merged. A clipped peak
    /// keeps its time. σ is doubled, for the sharper filter's noise, and grows by W f_s/32 (rounded
    /// down), for the shift by the other echo: saturating.
    pub fn sharpen(&self, f: impl Fn(i64) -> i64, peak: Peak, refined: &mut Refined) {
        let config = self.config;
        let overlap = (config.pulse.width() >> 5) as u32;
        refined.flags |= Flags::MERGED;
        refined.sigma = refined.sigma.saturating_mul(2).saturating_add(overlap);
        if !refined.flags.contains(Flags::SATURATED) {
            let most = if self.level.is_some() { config.reach } else { 0 };
            let start = earliest(&f, peak.index.into(), most);
            refined.time = vertex(f, start, config.reach, config.upsampling_log2, 0).time;
        }
    }

    /// σ of the time of a top: gain · σ(A) / A.
    fn sigma_of_top(&self, amplitude: i64) -> u32 {
        let timing = &self.config.timing;
        let sigma = self.noise.with(amplitude, timing.shot_share);
        let scaled = (u64::from(timing.gain) * u64::from(sigma)) >> 4; // Q1.15 of σ
        (scaled / amplitude.max(1) as u64).min(u32::MAX.into()) as u32
    }

    /// Fit of the edges of clipped echoes. The level is the clip code in Q1.15 less the ambient, at
    /// least 2⁻¹⁵.
    fn edge_fit(&self, ambient: i16) -> EdgeFit<'_> {
        let Self { config, noise, .. } = *self;
        let clip = i64::from(config.clip_code) << config.code_shift;
        let level = (clip - i64::from(ambient)).max(1);
        EdgeFit { pulse: &config.pulse, noise, level }
    }

    /// Takes time, amplitude and σ from the edges of a clipped run; without edges, the time from
    /// the middle between the crossings.
    #[inline(always)]
    fn time_by_edges(&self, run: Run, middle: i64, refined: &mut Refined) {
        refined.flags |= Flags::WALK_CORRECTED;
        let dithered = self.dithered.as_ref().and_then(|edges| edges.fit(run));
        match dithered.or_else(|| self.edge_fit(self.threshold.ambient).fit(self.waveform.x, run)) {
            Some(Edges { time, amplitude, sigma }) => {
                (refined.time, refined.amplitude, refined.sigma) = (time, amplitude, sigma);
            }
            None => refined.time = middle,
        }
    }

    /// Takes the time from the crossing at which `f` rises to `level` (Q9.23).
    ///
    /// Going to earlier samples from the index, `y` falls below the level (rounded to Q1.15, no
    /// higher than the peak) between two samples. The crossing is at the earlier of them plus
    /// (level − f)/(rise of f): a fraction of 0 to 1, rounded down, with a rise of at least 2⁻²³.
    /// If a valley or the end comes first, the time is there plus z, σ is the parabola's, and the
    /// echo is flagged. σ(level/g) · r is rounded down to Q13.19 before it is divided by the rise.
    #[inline(never)]
    fn time_by_rise(&self, f: &impl Fn(i64) -> i64, peak: Peak, level: i64, refined: &mut Refined) {
        let config = self.config;
        let coarse = shift_round(level, 8).min(peak.height.into()) as i32;
        let crossing = self.crossing(peak, coarse, -1);
        refined.time = crossing.time + config.timing.offset;
        refined.flags |= crossing.flags;
        let Some(below) = crossing.below else { return };
        let (low, high) = (f(below), f(below + 1));
        let rise = (high - low).max(1);
        let fraction = (((level - low) << 16).div_euclid(rise)).clamp(0, 1 << 16);
        refined.time = (below << 16) + fraction + config.timing.offset;
        if config.method == TimingMethod::ConstantFraction {
            return; // σ stays that of `sigma_of_top`: its gain is the crossing's
        }
        let at_level = self.noise.of(config.template.amplitude(shift_round(level, 8) as i32));
        let noise_gain = u64::from(config.template.noise_gain);
        let filtered = (u64::from(at_level) * noise_gain) >> 15; // Q13.19
        refined.sigma = ((filtered << 20) / rise as u64).min(u32::MAX.into()) as u32;
    }

    /// Run of clipped samples that contains the clipped sample nearest to the peak, of two equally
    /// near the earlier; `None` where none lies within ⌈K/2⌉. Clipped is a code at or above the
    /// saturation level.
    fn clipped_run(&self, peak: Peak) -> Option<Run> {
        let (config, codes) = (self.config, self.waveform.codes);
        let reach = config.reach.div_ceil(2);
        let index = usize::from(peak.index);
        let is_clipped = |n: &usize| codes.get(*n).is_some_and(|&code| code >= config.clip_code);
        let nearest = (0..reach + 1).find_map(|step| {
            let before = index.checked_sub(step).filter(is_clipped);
            before.or_else(|| Some(index + step).filter(is_clipped))
        })?;
        let first = (0..nearest).rev().take_while(is_clipped).last().unwrap_or(nearest);
        let last = (nearest + 1..codes.len()).take_while(is_clipped).last().unwrap_or(nearest);
        Some(Run { first, last })
    }

    fn crossing(&self, peak: Peak, level: i32, direction: i64) -> Crossing {
        crossing(self.waveform.y, peak, level, self.threshold.level, direction)
    }
}

struct Vertex {
    time: i64,
    height: i32,
}

/// Number of samples of `f` on either side of the summit that interpolation reads; without
/// upsampling it is one.
const MARGIN: i64 = 5;

/// Values of `f` around the summit, which is in the middle.
type Around = [i64; 2 * MARGIN as usize + 1];

/// Vertex of the parabola through the highest interpolated value and its neighbours.
fn vertex(
    f: impl Fn(i64) -> i64,
    start: i64,
    reach: usize,
    upsampling_log2: u32,
    bias: i64,
) -> Vertex {
    let ratio = 1i64 << upsampling_log2;
    let Climb { summit, height, next } = climb(&f, start, reach);
    let margin = if ratio > 1 { MARGIN } else { 1 };
    let around: Around = core::array::from_fn(|i| match i as i64 - MARGIN {
        0 => height,
        1 => next,
        offset if offset.abs() <= margin => f(summit + offset),
        _ => 0,
    });
    let at = |j: i64| interpolate(&around, j, upsampling_log2);
    let mut best = (at(0), 0);
    let others = if ratio > 1 { -ratio..ratio + 1 } else { 0..0 };
    for j in others {
        let z = at(j);
        if z > best.0 {
            best = (z, j);
        }
    }
    let (z0, j) = best;
    let (before, after) = (at(j - 1), at(j + 1));
    let slope = before - after;
    let delta = divide_round(slope << 15, before - 2 * z0 + after).clamp(-0x8000, 0x8000);
    let unbiased =
        delta - shift_round(bias * ((delta * ((1 << 32) - 4 * delta * delta)) >> 32), 15);
    let fine = (j << 16) + unbiased;
    let time = (summit << 16) + if ratio > 1 { shift_round(fine, upsampling_log2) } else { fine };
    // The parabola's height is z₀ − (z₋ − z₊)·δ/4, in Q9.23.
    let height = z0 - shift_round(slope * delta, 18);
    Vertex { time, height: shift_round(height, 8) as i32 }
}

/// Index at which a climb to earlier samples, at most `most` of them, ends: a peak that was found
/// before the rising gain was removed lies late.
fn earliest(f: impl Fn(i64) -> i64, start: i64, most: usize) -> i64 {
    let mut at = start;
    for _ in 0..most {
        if f(at - 1) <= f(at) {
            break;
        }
        at -= 1;
    }
    at
}

/// Summit of `f`, its height, and the height of the sample after it.
struct Climb {
    summit: i64,
    height: i64,
    next: i64,
}

/// Climbs `f` from `start` to later samples, at most `reach` of them. Earlier ones are lower: a
/// peak is the first sample of its plateau of `y`.
fn climb(f: impl Fn(i64) -> i64, start: i64, reach: usize) -> Climb {
    let mut at = Climb { summit: start, height: f(start), next: f(start + 1) };
    for _ in 0..reach {
        if at.next <= at.height {
            break;
        }
        at = Climb { summit: at.summit + 1, height: at.next, next: f(at.summit + 2) };
    }
    at
}

/// `f` interpolated at `j / 2^log2` from the summit, Q9.23, by a polynomial through the eight
/// samples around.
fn interpolate(around: &Around, j: i64, log2: u32) -> i64 {
    let sample = |offset: i64| {
        usize::try_from(MARGIN + offset).ok().and_then(|i| around.get(i)).map_or(0, |&v| v)
    };
    let whole = j >> log2;
    let Some(taps) = interpolation(j, log2) else { return sample(whole) };
    let sum: i64 = taps.iter().zip(-3..).map(|(&tap, t)| i64::from(tap) * sample(whole + t)).sum();
    shift_round(sum, 15)
}

struct Crossing {
    time: i64,
    /// Index of the sample below the level, if there is one.
    below: Option<i64>,
    flags: Flags,
}

/// Crossing at which `y`, going in `direction` from the peak, falls below a level: linear between
/// samples, Q16.16, the fraction of a sample rounded down, towards the peak.
///
/// It ends early in the valley (of equals the one nearest to the peak) before a neighbour that
/// rises by more than the peak's [`hysteresis`] ([`Flags::MERGED`]), or at the last sample
/// ([`Flags::TRUNCATED`]).
fn crossing(y: &[i16], peak: Peak, level: i32, threshold: i16, direction: i64) -> Crossing {
    let rise = i32::from(hysteresis(peak.height, threshold));
    let mut inner = (i64::from(peak.index), i32::from(peak.height));
    let mut valley = inner;
    loop {
        let index = inner.0 + direction;
        let Some(&value) = usize::try_from(index).ok().and_then(|i| y.get(i)) else {
            return Crossing { time: inner.0 << 16, below: None, flags: Flags::TRUNCATED };
        };
        let value = i32::from(value);
        if value < level {
            let fraction = (((inner.1 - level) as u32) << 16) / (inner.1 - value).max(1) as u32;
            let time = (inner.0 << 16) + direction * i64::from(fraction);
            return Crossing { time, below: Some(index), flags: Flags::NONE };
        }
        if value > valley.1 + rise {
            return Crossing { time: valley.0 << 16, below: None, flags: Flags::MERGED };
        }
        inner = (index, value);
        if value < valley.1 {
            valley = inner;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_reproduces_a_slow_sine_within_two_lsb() {
        let wave = |t: f64| 20_000.0 * (0.3 * t).sin();
        let around: Around =
            core::array::from_fn(|i| (256.0 * wave(25.0 + i as f64)).round() as i64);
        for j in 0..8 {
            let expected = wave(30.0 + j as f64 / 8.0);
            let got = interpolate(&around, j, 3) as f64 / 256.0;
            assert!((got - expected).abs() < 2.0, "phase {j}: {got} against {expected}");
        }
    }

    #[test]
    fn a_plateau_is_climbed_to_its_summit_and_no_further_than_the_reach() {
        let hill = |n: i64| 100 - (n - 7).abs();
        assert_eq!(climb(hill, 4, 10).summit, 7);
        assert_eq!(climb(hill, 0, 3).summit, 3);
        assert_eq!(climb(|_| 5, 4, 10).summit, 4, "a flat top stays where it was found");
    }
}
