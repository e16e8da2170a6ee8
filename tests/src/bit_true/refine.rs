//! Refinement of a peak: sub-sample time, height, width, amplitude and σ.

use echoloop_dsp::choice::TimingMethod;

use super::config::BitTrue;
use super::edges::Clipped;
use super::filter::correlate;
use super::height::Saturated;
use super::noise::Noise;
use super::numbers::{nearest, nearest_ratio, product, two_to};
use super::peaks::hysteresis;
use super::values::{Peak, Refined, Threshold};

/// Bits of an echo's flags, as the wire has them.
pub(super) const SATURATED: u8 = 1;
pub(super) const MERGED: u8 = 2;
pub(super) const LOW_CONFIDENCE: u8 = 4;
const WALK_CORRECTED: u8 = 8;
pub(super) const TRUNCATED: u8 = 16;

/// A waveform at all stages, of the same length.
#[derive(Clone, Copy, Debug)]
pub struct Waveform<'a> {
    /// Codes.
    pub codes: &'a [u16],
    /// Without baseline, Q1.15.
    pub x: &'a [f64],
    /// Filtered, Q1.15.
    pub y: &'a [f64],
    /// Filtered, Q9.23.
    pub f: &'a [f64],
    /// Single shots that it is the sum of, if known.
    pub shots: Option<&'a [&'a [u16]]>,
    /// Sample whose gain the samples around it were rescaled to, and the ambient at full gain.
    pub level: Option<(usize, f64)>,
}

/// End of one side of a peak: its distance (Q16.16), and a flag with the reason.
#[derive(Clone, Copy, Debug)]
struct End {
    distance: f64,
    flag: u8,
}

/// Top of the parabola: its time (Q16.16) with and without the bias of interpolation, and its
/// height (Q1.15).
struct Vertex {
    time: f64,
    unbiased: f64,
    height: f64,
}

const SAMPLE: f64 = 65_536.0;

/// Largest σ.
const MOST: f64 = 4_294_967_295.0;

impl Refined {
    fn bounded(self) -> Self {
        Self { sigma: self.sigma.min(MOST), ..self }
    }
}

impl BitTrue {
    /// Refines a peak with the timing method of the settings.
    pub fn refine(
        &self,
        wave: &Waveform<'_>,
        peak: Peak,
        threshold: &Threshold,
        noise: &Noise,
    ) -> Refined {
        let half = (peak.height / 2.0).floor();
        let left = falling(wave.y[..peak.index].iter().rev(), peak.height, half, threshold.level);
        let right = falling(wave.y[peak.index + 1..].iter(), peak.height, half, threshold.level);
        let vertex = self.vertex(wave.f, self.summit(wave.f, peak.index as i64));
        let amplitude = self.amplitude(vertex.height).max(1.0);
        let run = self.clipped_run(wave.codes, peak.index);
        let top = Refined {
            time: vertex.time,
            height: vertex.height,
            width: left.distance + right.distance,
            amplitude,
            sigma: self.sigma_of_top(amplitude, noise),
            flags: left.flag | right.flag | if run.is_some() { SATURATED } else { 0 },
        };
        let refined = match (self.timing, run) {
            (TimingMethod::WalkCorrected, None) => Refined { time: vertex.unbiased, ..top },
            (TimingMethod::WalkCorrected | TimingMethod::ConstantFraction, Some((first, last))) => {
                let clipped = self.clipped(wave, (first, last), threshold, noise);
                let middle = ((2.0 * peak.index as f64 * SAMPLE + right.distance - left.distance)
                    / 2.0)
                    .floor();
                let fine = self.dithered.as_ref().zip(wave.shots).and_then(|(dithered, shots)| {
                    dithered.fit(
                        shots,
                        (first, last),
                        (threshold.ambient, |n, time, sum| {
                            self.level(wave, threshold.ambient, (n, time), sum)
                        }),
                        noise,
                    )
                });
                let fitted = match fine.or_else(|| clipped.fit()) {
                    Some(e) => {
                        Refined { time: e.time, amplitude: e.amplitude, sigma: e.sigma, ..top }
                    }
                    None => Refined { time: middle, ..top },
                };
                Refined { flags: fitted.flags | WALK_CORRECTED, ..fitted }
            }
            (TimingMethod::ConstantFraction, None) => {
                self.to_edge(wave, peak, vertex.height * two_to(7), threshold.level, noise, top)
            }
            (TimingMethod::RisingEdge, _) => {
                self.to_edge(wave, peak, threshold.level * two_to(8), threshold.level, noise, top)
            }
            _ => top,
        };
        let by_edges =
            matches!(self.timing, TimingMethod::WalkCorrected | TimingMethod::ConstantFraction);
        let walks = run.is_some() && !by_edges;
        let unknown = walks || refined.flags & TRUNCATED != 0;
        Refined { sigma: if unknown { MOST } else { refined.sigma }, ..refined }
    }

    /// A clipped run of this waveform.
    fn clipped<'a>(
        &'a self,
        wave: &Waveform<'a>,
        (first, last): (usize, usize),
        threshold: &Threshold,
        noise: &Noise,
    ) -> Clipped<'a> {
        let level = (self.clip_code * self.code - threshold.ambient).max(1.0);
        Clipped { pulse: &self.pulse, x: wave.x, level, first, last, noise: *noise }
    }

    /// Strength of a peak's echo without clipping, at full gain, Q1.15.
    pub fn strength(
        &self,
        wave: &Waveform<'_>,
        (peak, all): (Peak, &[Peak]),
        threshold: &Threshold,
        noise: &Noise,
    ) -> f64 {
        let run = self.clipped_run(wave.codes, peak.index);
        let place = run.unwrap_or((peak.index, peak.index));
        if self.is_air(wave.y, place, all, threshold) {
            return 0.0;
        }
        let Some(run) = run else {
            return self.at_full_gain(self.amplitude(peak.height).max(0.0), peak.index);
        };
        let middle = (run.0 + run.1) / 2;
        let ambient = self.rest(middle, threshold.ambient);
        let clipped = self.clipped(wave, run, &Threshold { ambient, ..*threshold }, noise);
        let (codes, clip_code) = (wave.codes, self.clip_code);
        let height = Saturated { clipped, codes, clip_code }.height();
        self.at_full_gain(height, middle)
    }

    /// True when a run that begins where the receiver begins to see is longer than a pulse, or when
    /// light goes on behind it.
    fn is_air(
        &self,
        y: &[f64],
        (first, last): (usize, usize),
        all: &[Peak],
        threshold: &Threshold,
    ) -> bool {
        let length = 2 * (self.reach + 1);
        let light = |n: usize| {
            let range = (self.origin_samples / two_to(8)).floor() + two_to(8) * n as f64;
            y[n] as i128 * range as i128 * range as i128
        };
        let begins = first as f64 * two_to(16) <= self.blind + 3.0 * self.pulse.width;
        let is_alone =
            || all.iter().all(|other| other.index <= last || other.index > last + 2 * length);
        let stays =
            |n: usize| y[n] >= (threshold.level / 2.0).floor() && 4 * light(n) >= light(last);
        let behind = last + length..last + length + length / 2;
        let goes_on = || behind.end <= y.len() && is_alone() && behind.clone().all(stays);
        begins && (last + 1 - first >= length || goes_on())
    }

    /// True when a peak is wider than one echo, or merged with a neighbour.
    pub(super) fn is_broad(&self, y: &[f64], peak: Peak, threshold: f64) -> bool {
        let half = (peak.height / 2.0).floor();
        let ends = [
            falling(y[..peak.index].iter().rev(), peak.height, half, threshold),
            falling(y[peak.index + 1..].iter(), peak.height, half, threshold),
        ];
        ends.iter().any(|end| end.flag == MERGED)
            || ends[0].distance + ends[1].distance > self.broad
    }

    /// Refines a peak that another hid, with the time behind the sharpening filter.
    pub fn sharpen(&self, wave: &Waveform<'_>, peak: Peak, refined: Refined) -> Refined {
        let Some(sharpener) = &self.sharpener else { return refined };
        let f: Vec<f64> =
            correlate(&sharpener.taps, wave.x).iter().map(|sum| nearest(sum / two_to(7))).collect();
        let flags = refined.flags | MERGED;
        let time = match refined.flags & SATURATED {
            0 => {
                let most = if wave.level.is_some() { self.reach } else { 0 };
                let rises =
                    |k: &usize| peak.index >= *k && f[peak.index - k] > f[peak.index + 1 - k];
                let earlier = (1..=most).take_while(rises).count();
                self.vertex(&f, self.summit(&f, (peak.index - earlier) as i64)).time
            }
            _ => refined.time,
        };
        let overlap = (self.pulse.width / 32.0).floor();
        Refined { time, flags, sigma: (2.0 * refined.sigma).min(MOST) + overlap, ..refined }
            .bounded()
    }

    /// Amplitude of a filtered height, both Q1.15.
    pub(super) fn amplitude(&self, height: f64) -> f64 {
        nearest(height * self.inverse_gain / two_to(14))
    }

    fn sigma_of_top(&self, amplitude: f64, noise: &Noise) -> f64 {
        // Q16.16 · Q13.19 over Q1.15
        let scaled = product(self.timing_gain, noise.with(amplitude, self.shot_share));
        ((scaled / 16 / amplitude as u128) as f64).min(two_to(32) - 1.0)
    }

    /// Replaces the time by that at which `f` rises to a level (Q9.23).
    fn to_edge(
        &self,
        wave: &Waveform<'_>,
        peak: Peak,
        level: f64,
        threshold: f64,
        noise: &Noise,
        top: Refined,
    ) -> Refined {
        let coarse = nearest(level / two_to(8)).min(peak.height);
        let end = falling(wave.y[..peak.index].iter().rev(), peak.height, coarse, threshold);
        let flags = top.flags | end.flag;
        if end.flag != 0 {
            let time = peak.index as f64 * SAMPLE - end.distance + self.timing_offset;
            return Refined { time, flags, ..top };
        }
        let above = peak.index - (end.distance / SAMPLE).floor() as usize;
        let (low, high) = (wave.f[above - 1], wave.f[above]);
        let rise = (high - low).max(1.0);
        let fraction = ((level - low) * SAMPLE / rise).floor().clamp(0.0, SAMPLE);
        let time = (above - 1) as f64 * SAMPLE + fraction + self.timing_offset;
        let sigma = match self.timing {
            TimingMethod::ConstantFraction => top.sigma,
            _ => {
                let at_level = noise.of(self.amplitude(nearest(level / two_to(8))));
                let filtered = product(at_level, self.noise_gain) >> 15;
                // Q13.19 over Q9.23 a sample
                (((filtered << 20) / rise as u128) as f64).min(two_to(32) - 1.0)
            }
        };
        Refined { time, flags, sigma, ..top }
    }

    /// First and last sample of the clipped run nearest to an index; of two as near, the earlier.
    pub(super) fn clipped_run(&self, codes: &[u16], index: usize) -> Option<(usize, usize)> {
        let clipped = |n: usize| f64::from(codes[n]) >= self.clip_code;
        let near =
            (0..codes.len()).filter(|&n| clipped(n) && n.abs_diff(index) <= self.reach.div_ceil(2));
        let nearest = near.min_by_key(|n| n.abs_diff(index))?; // takes the first of equals
        let first = (0..nearest).rfind(|&n| !clipped(n)).map_or(0, |n| n + 1);
        let last = (nearest..codes.len()).find(|&n| !clipped(n)).unwrap_or(codes.len()) - 1;
        Some((first, last))
    }

    /// End of a rising run of f, at most K samples after its start.
    fn summit(&self, f: &[f64], start: i64) -> i64 {
        let at = |n: i64| usize::try_from(n).ok().and_then(|n| f.get(n)).copied().unwrap_or(0.0);
        let rises = |n: &i64| at(n + 1) > at(*n);
        start + (start..start + self.reach as i64).take_while(rises).count() as i64
    }

    fn vertex(&self, f: &[f64], index: i64) -> Vertex {
        let o = self.upsampling as i64;
        let z = |j: i64| interpolate(f, index, j, o);
        let mut offsets: Vec<i64> = (-o..=o).collect();
        if o == 1 {
            offsets = vec![0];
        }
        offsets.sort_by_key(|&j| j != 0); // stable: the sample itself wins ties, then the earliest
        let top = offsets.iter().map(|&j| z(j)).fold(f64::MIN, f64::max);
        let j = offsets.into_iter().find(|&j| z(j) == top).unwrap_or(0);
        let (before, after) = (z(j - 1), z(j + 1));
        let slope = before - after;
        let curvature = before - 2.0 * top + after;
        let delta = nearest_ratio(slope * two_to(15), curvature).clamp(-32_768.0, 32_768.0);
        let time =
            |delta: f64| index as f64 * SAMPLE + nearest((j as f64 * SAMPLE + delta) / o as f64);
        // Q16.16 · Q32.32
        let cubic = (delta * (two_to(32) - 4.0 * delta * delta) / two_to(32)).floor();
        let height = top - nearest(slope * delta / two_to(18));
        Vertex {
            time: time(delta),
            unbiased: time(delta - nearest(self.timing_bias * cubic / two_to(15))),
            height: nearest(height / two_to(8)),
        }
    }
}

/// Weights of the Lagrange polynomial through samples −3..=4 at `t` in 0..1.
pub fn lagrange(t: f64) -> [f64; 8] {
    std::array::from_fn(|k| {
        let node = k as f64 - 3.0;
        (-3..=4)
            .map(f64::from)
            .filter(|&other| other != node)
            .map(|other| (t - other) / (node - other))
            .product()
    })
}

/// As [`lagrange`], rounded to Q1.15; the weight nearest to `t` makes the sum 2¹⁵.
pub fn rounded_lagrange(t: f64) -> [f64; 8] {
    let mut weights = lagrange(t).map(|w| (w * two_to(15)).round());
    let closest = if t <= 0.5 { 3 } else { 4 };
    weights[closest] += two_to(15) - weights.iter().sum::<f64>();
    weights
}

/// f interpolated at `index + j/o`, Q9.23; zero outside.
fn interpolate(f: &[f64], index: i64, j: i64, o: i64) -> f64 {
    let whole = index + j.div_euclid(o);
    let phase = j.rem_euclid(o);
    let at = |n: i64| if (0..f.len() as i64).contains(&n) { f[n as usize] } else { 0.0 };
    if phase == 0 {
        return at(whole);
    }
    let weights = rounded_lagrange(phase as f64 / o as f64);
    let sum: f64 = weights.iter().zip(-3..).map(|(weight, k)| weight * at(whole + k)).sum();
    nearest(sum / two_to(15))
}

/// Distance from a peak to where the samples beside it, nearest first, fall below `level`; else to
/// the valley before they rise by more than the hysteresis; else to the end of the waveform.
fn falling<'a>(
    outwards: impl Iterator<Item = &'a f64>,
    height: f64,
    level: f64,
    threshold: f64,
) -> End {
    let rise = hysteresis(height, threshold);
    let mut walked = vec![height];
    for &value in outwards {
        let inner = walked[walked.len() - 1];
        if value < level {
            let fraction = ((inner - level) * SAMPLE / (inner - value)).floor();
            return End { distance: (walked.len() - 1) as f64 * SAMPLE + fraction, flag: 0 };
        }
        let lowest = walked.iter().copied().fold(f64::MAX, f64::min);
        if value > lowest + rise {
            let valley = walked.iter().position(|&v| v == lowest).unwrap_or(0);
            return End { distance: valley as f64 * SAMPLE, flag: MERGED };
        }
        walked.push(value);
    }
    End { distance: (walked.len() - 1) as f64 * SAMPLE, flag: TRUNCATED }
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_dsp::lagrange::LAGRANGE;

    #[test]
    fn the_interpolation_table_is_the_rounded_lagrange_polynomial() {
        for (row, taps) in LAGRANGE.iter().enumerate() {
            assert_eq!(taps.map(f64::from), rounded_lagrange((row + 1) as f64 / 8.0), "row {row}");
        }
    }
}
