//! The twin that rounds where the DSP's tables say.
//!
//! Written from those tables, not from the code: in `f64`, by sorting instead of counting, with sums in no particular order.
//! `f64` holds every integer here exactly, so the comparison is `==`. Values are in LSB of the DSP's formats. Of the DSP it
//! takes only the filter's taps and their gain, which have a test of their own.

use echoloop_dsp::settings::{CHOICE_FIRST, CHOICE_LAST, TIMING_WALK_CORRECTED};
use echoloop_dsp::statistics::Statistics as DspStatistics;
use echoloop_dsp::template::Template;
use echoloop_dsp::{Hardware, MAX_SAMPLES, Settings, detect, echo, refine};

/// Speed of light, m/s.
pub const LIGHT: f64 = 299_792_458.0;

/// To the nearest integer, ties up.
pub fn nearest(value: f64) -> f64 {
    (value + 0.5).floor()
}

/// `numerator / denominator` to the nearest integer, ties up; zero over zero and the like are zero.
///
/// For integers below 2⁵² no rounding of the division reaches the next integer.
fn nearest_ratio(numerator: f64, denominator: f64) -> f64 {
    if denominator == 0.0 {
        return 0.0;
    }
    let sign = denominator.signum();
    ((2.0 * sign * numerator + denominator.abs()) / (2.0 * denominator.abs())).floor()
}

/// 2ⁿ.
fn two_to(n: i32) -> f64 {
    f64::powi(2.0, n)
}

/// Median, deviation (codes), ambient (Q1.15), σ̂ (Q13.19).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// m.
    pub median: f64,
    /// d.
    pub deviation: f64,
    /// a.
    pub ambient: f64,
    /// σ̂.
    pub sigma: f64,
}

/// σ_y (Q13.19) and T (Q1.15).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold {
    /// σ_y.
    pub sigma: f64,
    /// T.
    pub level: f64,
}

/// A sample of the filter's output that tops its surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Which sample.
    pub index: usize,
    /// Its value.
    pub height: f64,
}

/// A peak between samples: time and width in Q16.16 samples, height in Q1.15.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// Since sample 0.
    pub time: f64,
    /// At the vertex.
    pub height: f64,
    /// At half height.
    pub width: f64,
    /// As on the wire.
    pub flags: u8,
}

/// An echo in wire units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Echo {
    /// U24.8 mm.
    pub range: f64,
    /// U1.15.
    pub amplitude: f64,
    /// U12.4 ns.
    pub width: f64,
    /// U8.8.
    pub snr: f64,
    /// As on the wire.
    pub flags: u8,
}

impl From<DspStatistics> for Statistics {
    fn from(s: DspStatistics) -> Self {
        Self {
            median: s.median.into(),
            deviation: s.deviation.into(),
            ambient: s.ambient.into(),
            sigma: s.sigma.into(),
        }
    }
}

impl From<detect::Threshold> for Threshold {
    fn from(t: detect::Threshold) -> Self {
        Self { sigma: t.sigma.into(), level: t.level.into() }
    }
}

impl From<detect::Peak> for Peak {
    fn from(p: detect::Peak) -> Self {
        Self { index: p.index.into(), height: p.height.into() }
    }
}

impl From<refine::Refined> for Refined {
    fn from(r: refine::Refined) -> Self {
        Self { time: r.time as f64, height: r.height.into(), width: r.width as f64, flags: r.flags.0 }
    }
}

impl From<echo::Echo> for Echo {
    fn from(e: echo::Echo) -> Self {
        Self {
            range: e.range.into(),
            amplitude: e.amplitude.into(),
            width: e.width.into(),
            snr: e.snr.into(),
            flags: e.flags.0,
        }
    }
}

/// Bits of an echo's flags, as the wire has them.
const SATURATED: u8 = 1;
const MERGED: u8 = 2;
const LOW_CONFIDENCE: u8 = 4;
const WALK_CORRECTED: u8 = 8;
const TRUNCATED: u8 = 16;

/// Candidates held.
const CANDIDATES: usize = 32;

/// The whole detector, constants first.
#[derive(Clone, Debug)]
pub struct Twin {
    /// Q1.15 LSB of one code.
    pub code: f64,
    /// The lowest saturated code.
    pub clip_code: f64,
    /// The filter, Q1.15.
    pub taps: Vec<f64>,
    /// r, Q1.15.
    pub noise_gain: f64,
    /// 1/g, Q2.14.
    pub inverse_gain: f64,
    /// g·N, Q1.15.
    pub floor: f64,
    /// k, Q8.8.
    pub snr_threshold: f64,
    /// o.
    pub upsampling: f64,
    /// Whether clipped echoes are timed by their edges.
    pub walk_corrected: bool,
    /// ΔR, samples.
    pub min_separation: f64,
    /// E.
    pub echoes: usize,
    /// Which of them.
    pub choice: i32,
    /// Sample period, fs.
    pub period_fs: f64,
    /// Range of sample 0, 1/256 mm.
    pub range_origin: f64,
    /// Range per sample, 2⁻²⁴ mm.
    pub range_step: f64,
}

/// Sample period, fs: 2 (R_max − R_min) / (c·N).
pub fn period_fs(bins: i32, hardware: &Hardware) -> f64 {
    let round_trip_mm = 2.0 * (f64::from(hardware.range_max_mm) - f64::from(hardware.range_min_mm));
    nearest(round_trip_mm * 1e12 / (f64::from(bins) * LIGHT))
}

impl Twin {
    /// Everything the stages read.
    pub fn new(settings: &Settings, hardware: &Hardware) -> Self {
        let period_fs = period_fs(settings.bins, hardware);
        let template = Template::sin_squared(settings.pulse_width_ps as u32, period_fs as u32);
        let taps: Vec<f64> = template.taps().iter().map(|&h| f64::from(h)).collect();
        let peak_gain = f64::from(template.peak_gain());
        let full_scale = two_to(hardware.adc_bits as i32) - 1.0;
        let range_step = nearest(period_fs * LIGHT * two_to(23) / 1e12);
        let separation_um = match settings.min_separation_mm {
            Some(mm) => f64::from(mm) * 1e3,
            None => (f64::from(settings.pulse_width_ps) * 17_088.0 / 100.0).floor(),
        };
        Self {
            code: two_to(15 - hardware.adc_bits as i32),
            clip_code: nearest(f64::from(settings.saturation_ppm) * full_scale / 1e6),
            noise_gain: taps.iter().map(|h| h * h).sum::<f64>().sqrt().floor(),
            inverse_gain: (two_to(29) / peak_gain).floor().min(65_535.0),
            floor: nearest(f64::from(settings.noise_floor_ppm) * peak_gain / 1e6),
            taps,
            snr_threshold: nearest(f64::from(settings.snr_threshold_milli) * 256.0 / 1e3),
            upsampling: settings.upsampling.into(),
            walk_corrected: settings.timing == TIMING_WALK_CORRECTED,
            min_separation: nearest(separation_um * two_to(24) / (range_step * 1e3)).max(1.0),
            echoes: settings.echoes as usize,
            choice: settings.echo_choice,
            period_fs,
            range_origin: f64::from(hardware.range_min_mm) * 256.0,
            range_step,
        }
    }

    /// Median and MAD, by sorting.
    pub fn statistics(&self, codes: &[u16]) -> Statistics {
        let values: Vec<f64> = codes.iter().take(MAX_SAMPLES).map(|&c| f64::from(c)).collect();
        if values.is_empty() {
            return Statistics { median: 0.0, deviation: 0.0, ambient: 0.0, sigma: 0.0 };
        }
        let half = values.len() as f64 / 2.0;
        let of_codes = Order::of(values.clone());
        let of_deviations = Order::of(values.iter().map(|v| (v - of_codes.middle).abs()).collect());
        // v − ½ + (N/2 − below)/at in LSB of which a code has `lsb`, the quotient rounded down
        let grouped =
            |order: &Order, lsb: f64| (order.middle - 0.5) * lsb + ((half - order.below) * lsb / order.at).floor();
        let fine = self.code * two_to(4);
        let mad = if of_deviations.middle == 0.0 {
            (half * fine / (2.0 * of_deviations.at)).floor()
        } else {
            grouped(&of_deviations, fine)
        };
        Statistics {
            median: of_codes.middle,
            deviation: of_deviations.middle,
            ambient: grouped(&of_codes, self.code),
            sigma: nearest(mad * nearest(1.4826 * two_to(14)) / two_to(14)),
        }
    }

    /// x, Q1.15.
    pub fn baseline(&self, codes: &[u16], ambient: f64) -> Vec<f64> {
        let ambient = ambient.clamp(-32_768.0, 32_767.0);
        let fraction = |&code: &u16| f64::from(code).min(self.clip_code) * self.code;
        codes.iter().map(|code| (fraction(code) - ambient).clamp(-32_768.0, 32_767.0)).collect()
    }

    /// y, Q1.15: as long as x.
    pub fn filter(&self, x: &[f64]) -> Vec<f64> {
        let round = |sum: &f64| nearest(sum / two_to(15)).clamp(-32_768.0, 32_767.0);
        self.sums(x).iter().map(round).collect()
    }

    /// f, Q9.23: as long as x.
    pub fn exact(&self, x: &[f64]) -> Vec<f64> {
        self.sums(x).iter().map(|sum| nearest(sum / two_to(7))).collect()
    }

    /// The filter's sums, Q2.30.
    fn sums(&self, x: &[f64]) -> Vec<f64> {
        let half = self.taps.len() / 2;
        let mut padded = vec![0.0; half];
        padded.extend(x);
        padded.extend(vec![0.0; half]);
        let sum = |window: &[f64]| window.iter().zip(&self.taps).map(|(x, h)| x * h).sum::<f64>();
        padded.windows(self.taps.len()).map(sum).collect()
    }

    /// σ_y and T.
    pub fn threshold(&self, statistics: &Statistics) -> Threshold {
        let sigma = nearest(statistics.sigma * self.noise_gain / two_to(15));
        let by_noise = nearest(sigma * self.snr_threshold / two_to(12));
        Threshold { sigma, level: by_noise.max(self.floor).clamp(1.0, 32_767.0) }
    }

    /// Sub-sample time, height and width of a peak.
    pub fn refine(&self, codes: &[u16], y: &[f64], f: &[f64], peak: Peak, threshold: f64) -> Refined {
        let (vertex_time, height) = self.vertex(f, self.summit(f, peak.index));
        let half = (peak.height / 2.0).floor();
        let rise = hysteresis(peak.height, threshold);
        let (left, left_flag) = edge(y[..peak.index].iter().rev(), peak.height, half, rise);
        let (right, right_flag) = edge(y[peak.index + 1..].iter(), peak.height, half, rise);
        let index = peak.index as f64 * two_to(16);
        let mut time = vertex_time;
        let mut flags = left_flag | right_flag;
        if self.clipped(codes, peak.index) {
            flags |= SATURATED;
            if self.walk_corrected {
                flags |= WALK_CORRECTED;
                time = ((2.0 * index + right - left) / 2.0).floor();
            }
        }
        Refined { time, height, width: left + right, flags }
    }

    fn clipped(&self, codes: &[u16], index: usize) -> bool {
        let reach = (self.taps.len() / 2).div_ceil(2);
        codes.iter().enumerate().any(|(n, &code)| n.abs_diff(index) <= reach && f64::from(code) >= self.clip_code)
    }

    /// The end of a rising run of f, K samples later at most.
    fn summit(&self, f: &[f64], index: usize) -> usize {
        let reach = self.taps.len() / 2;
        index + f[index..].windows(2).take(reach).take_while(|w| w[1] > w[0]).count()
    }

    /// Time (Q16.16) and height (Q1.15) of the parabola's top.
    fn vertex(&self, f: &[f64], index: usize) -> (f64, f64) {
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
        let time = index as f64 * two_to(16) + nearest((j as f64 * two_to(16) + delta) / o as f64);
        let height = top - nearest(slope * delta / two_to(18));
        (time, nearest(height / two_to(8)))
    }

    /// A refined peak in wire units; none before range 0.
    pub fn echo(&self, refined: &Refined, threshold: &Threshold) -> Option<Echo> {
        // time · step may take 61 bits: whole samples and the fraction apart, and floors of floors
        let samples = (refined.time / two_to(16)).floor();
        let fraction = refined.time - samples * two_to(16);
        let along = samples * self.range_step + (fraction * self.range_step / two_to(16)).floor();
        let range = self.range_origin + nearest(along / two_to(16));
        if !(0.0..two_to(32)).contains(&range) {
            return None;
        }
        let height = refined.height.max(0.0);
        let low = if height < 1.25 * threshold.level { LOW_CONFIDENCE } else { 0 };
        let in_u16 = |value: f64| value.clamp(0.0, 65_535.0);
        Some(Echo {
            range,
            amplitude: in_u16(nearest(height * self.inverse_gain / two_to(14))),
            width: in_u16(nearest_ratio(refined.width * self.period_fs, 1e6 * two_to(12))),
            snr: in_u16((height * two_to(12) / threshold.sigma.max(1.0)).floor()),
            flags: refined.flags | low,
        })
    }

    /// All stages.
    pub fn process(&self, codes: &[u16]) -> Vec<Echo> {
        let codes = &codes[..codes.len().min(MAX_SAMPLES)];
        let statistics = self.statistics(codes);
        let x = self.baseline(codes, statistics.ambient);
        let (y, f) = (self.filter(&x), self.exact(&x));
        let threshold = self.threshold(&statistics);
        let separate = separate(&peaks(&y, threshold.level), self.min_separation);
        choose(&separate, self.echoes, self.choice)
            .into_iter()
            .filter_map(|peak| self.echo(&self.refine(codes, &y, &f, peak, threshold.level), &threshold))
            .collect()
    }
}

/// The middle of sorted values, and how many lie below it and at it.
pub struct Order {
    /// The smallest value with at least half of all at or below it.
    pub middle: f64,
    /// Values below.
    pub below: f64,
    /// Values equal.
    pub at: f64,
}

impl Order {
    /// Of at least one value.
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let middle = values[values.len().div_ceil(2) - 1];
        let below = values.iter().filter(|&&v| v < middle).count() as f64;
        let at = values.iter().filter(|&&v| v == middle).count() as f64;
        Self { middle, below, at }
    }
}

/// What counts as a fall or a rise, whole LSB.
pub fn hysteresis(height: f64, threshold: f64) -> f64 {
    (threshold / 2.0).floor().max((height / 16.0).floor())
}

/// Local maxima by rising index, the 32 highest (of equals the first).
pub fn peaks(y: &[f64], threshold: f64) -> Vec<Peak> {
    let found = climbs(y, threshold, (threshold / 2.0).floor(), |height| hysteresis(height, threshold));
    let mut strongest = by_strength(&found);
    strongest.truncate(CANDIDATES);
    strongest.sort_by_key(|p| p.index);
    strongest
}

/// Climbs from valley to peak to valley; below `rest` it waits for the threshold again.
pub fn climbs(y: &[f64], threshold: f64, rest: f64, hysteresis: impl Fn(f64) -> f64) -> Vec<Peak> {
    let mut found = Vec::new();
    let mut samples = y.iter().copied().enumerate().map(|(index, height)| Peak { index, height });
    let Some(mut top) = samples.find(|s| s.height >= threshold) else { return found };
    loop {
        // Up, until it has fallen far enough from the top.
        let fallen = samples.by_ref().find(|s| {
            if s.height > top.height {
                top = *s;
            }
            s.height < top.height - hysteresis(top.height)
        });
        found.push(top);
        let Some(fallen) = fallen else { return found };
        // Down, until it has risen far enough from the valley, or from rest to the threshold.
        let mut valley = fallen.height;
        let mut resting = valley < rest;
        let risen = samples.by_ref().find(|s| {
            if !resting && s.height < valley {
                valley = s.height;
                resting = valley < rest;
                return false;
            }
            s.height >= threshold && (resting || s.height > valley + hysteresis(s.height))
        });
        let Some(risen) = risen else { return found };
        top = risen;
    }
}

/// Strongest first, of equals the first.
fn by_strength(peaks: &[Peak]) -> Vec<Peak> {
    let mut peaks = peaks.to_vec();
    peaks.sort_by(|a, b| b.height.total_cmp(&a.height).then(a.index.cmp(&b.index)));
    peaks
}

/// Greedily, strongest first: whatever lies nearer than `min_separation` to one kept goes. By rising index.
pub fn separate(peaks: &[Peak], min_separation: f64) -> Vec<Peak> {
    let mut kept: Vec<Peak> = Vec::new();
    for peak in by_strength(peaks) {
        if !kept.iter().any(|k| (k.index.abs_diff(peak.index) as f64) < min_separation) {
            kept.push(peak);
        }
    }
    kept.sort_by_key(|p| p.index);
    kept
}

/// At most `count` of peaks that stand by rising index.
pub fn choose(peaks: &[Peak], count: usize, choice: i32) -> Vec<Peak> {
    let mut order = match choice {
        CHOICE_FIRST => peaks.to_vec(),
        CHOICE_LAST => peaks.iter().rev().copied().collect(),
        _ => by_strength(peaks),
    };
    order.truncate(count);
    order
}

/// The Lagrange polynomial through samples −3..=4 at `t` in 0..1: its eight weights.
pub fn lagrange(t: f64) -> [f64; 8] {
    std::array::from_fn(|k| {
        let node = k as f64 - 3.0;
        (-3..=4).map(f64::from).filter(|&other| other != node).map(|other| (t - other) / (node - other)).product()
    })
}

/// As [`lagrange`], in Q1.15: each to the nearest, then the one nearest to `t` takes what is missing from 2¹⁵.
pub fn rounded_lagrange(t: f64) -> [f64; 8] {
    let mut weights = lagrange(t).map(|w| (w * two_to(15)).round());
    let closest = if t <= 0.5 { 3 } else { 4 };
    weights[closest] += two_to(15) - weights.iter().sum::<f64>();
    weights
}

/// y at `index + j/o`, Q9.23; zero outside.
fn interpolate(f: &[f64], index: usize, j: i64, o: i64) -> f64 {
    let whole = index as i64 + j.div_euclid(o);
    let phase = j.rem_euclid(o);
    let at = |n: i64| if (0..f.len() as i64).contains(&n) { f[n as usize] } else { 0.0 };
    if phase == 0 {
        return at(whole);
    }
    let weights = rounded_lagrange(phase as f64 / o as f64);
    let sum: f64 = weights.iter().zip(-3..).map(|(weight, k)| weight * at(whole + k)).sum();
    nearest(sum / two_to(15))
}

/// Distance (Q16.16) from a peak to where the samples beside it, nearest first, fall below `half`; or to the valley before
/// they rise by more than `rise`; or to the end of the waveform.
fn edge<'a>(outwards: impl Iterator<Item = &'a f64>, height: f64, half: f64, rise: f64) -> (f64, u8) {
    let mut walked = vec![height];
    for &value in outwards {
        let inner = walked[walked.len() - 1];
        if value < half {
            let fraction = ((inner - half) * two_to(16) / (inner - value)).floor();
            return ((walked.len() - 1) as f64 * two_to(16) + fraction, 0);
        }
        let lowest = walked.iter().copied().fold(f64::MAX, f64::min);
        if value > lowest + rise {
            let valley = walked.iter().position(|&v| v == lowest).unwrap_or(0);
            return (valley as f64 * two_to(16), MERGED);
        }
        walked.push(value);
    }
    ((walked.len() - 1) as f64 * two_to(16), TRUNCATED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interpolation_table_is_the_rounded_lagrange_polynomial() {
        for (row, taps) in refine::LAGRANGE.iter().enumerate() {
            assert_eq!(taps.map(f64::from), rounded_lagrange((row + 1) as f64 / 8.0), "row {row}");
        }
    }

    #[test]
    fn ties_round_up_in_every_helper() {
        assert_eq!([nearest(1.5), nearest(-1.5), nearest(-0.5)], [2.0, -1.0, 0.0]);
        assert_eq!([nearest_ratio(3.0, 2.0), nearest_ratio(-3.0, 2.0), nearest_ratio(3.0, -2.0)], [2.0, -1.0, -1.0]);
        assert_eq!(nearest_ratio(3.0, 0.0), 0.0);
    }
}
