//! Bit-true model of `split`, the search for overlapping echoes.

use echoloop_dsp::template::Template;

use super::numbers::nearest;
use super::values::Peak;

/// Sharpening filter, Q1.15.
#[derive(Clone, Debug, PartialEq)]
pub struct Sharpener {
    /// s, taps.
    pub taps: Vec<f64>,
    /// q, lag of the second difference, samples.
    pub lag: usize,
    /// r, gain of noise.
    pub noise_gain: f64,
}

impl Sharpener {
    /// The sensor's sharpener: a pulse of half the width, a lag of half the width in whole samples,
    /// an eighth of the second difference.
    pub fn for_pulse(width_ps: u32, period_fs: f64) -> Self {
        let narrow = Template::sin_squared(width_ps / 2, period_fs as u32);
        Self::new(&narrow, (f64::from(width_ps) * 500.0 / period_fs).floor() as usize, 8.0)
    }

    /// Taps of a narrow pulse minus `strength`/64 of their second difference.
    pub fn new(narrow: &Template, lag: usize, strength: f64) -> Self {
        let taps: Vec<f64> = narrow.taps().iter().map(|&h| f64::from(h)).collect();
        let centre = taps.len() as i64 / 2;
        let most = echoloop_dsp::MAX_TAPS as i64 / 2 - centre;
        let q = (lag as i64).clamp(1, most.max(1));
        let h = |k: i64| {
            usize::try_from(k + centre).ok().and_then(|i| taps.get(i)).copied().unwrap_or(0.0)
        };
        let tap = |k: i64| {
            let sum = (64.0 + 2.0 * strength) * h(k) - strength * (h(k - q) + h(k + q));
            (sum / (64.0 + 4.0 * strength)).trunc()
        };
        let half = (centre + q).min(echoloop_dsp::MAX_TAPS as i64 / 2);
        let taps: Vec<f64> = (-half..=half).map(tap).collect();
        let energy: f64 = taps.iter().map(|s| s * s).sum();
        Self { noise_gain: energy.sqrt().floor(), taps, lag: q as usize }
    }

    /// The sharpened waveform; x is `outside(n)` at n < 0 and n ≥ N.
    pub fn sharpened(&self, x: &[f64], outside: impl Fn(i64) -> f64) -> Vec<f64> {
        let half = self.taps.len() as i64 / 2;
        let at = |n: i64| {
            usize::try_from(n).ok().and_then(|n| x.get(n)).copied().unwrap_or_else(|| outside(n))
        };
        let sum = |n: i64| self.taps.iter().zip(-half..).map(|(s, k)| s * at(n + k)).sum::<f64>();
        (0..x.len() as i64).map(|n| nearest(sum(n) / 32_768.0).clamp(-32_768.0, 32_767.0)).collect()
    }

    /// Noise behind the sharpener, σ_s, Q13.19.
    pub fn sigma(&self, sigma: f64) -> f64 {
        nearest(sigma * self.noise_gain / 32_768.0)
    }
}

/// Peaks at or above `level` with a prominence of `rise`, by index. `values` begin at sample
/// `first`.
pub fn prominent_peaks(
    values: &[f64],
    first: usize,
    level: f64,
    rise: impl Fn(f64) -> f64,
) -> Vec<Peak> {
    let mut found = Vec::new();
    let (mut top, mut n) = (0, 0);
    let end = values.len();
    while top < end {
        // Upwards: the first highest sample before the values have fallen by rise(top).
        n += 1;
        while n < end && values[n] >= values[top] - rise(values[top]) {
            if values[n] > values[top] {
                top = n;
            }
            n += 1;
        }
        if n < end || values[end - 1] < values[top] {
            found.push(top);
        }
        // Downwards: the valley, until the values have risen from it.
        let mut valley = f64::INFINITY;
        while n < end && values[n] <= valley + rise(values[n]) {
            valley = valley.min(values[n]);
            n += 1;
        }
        if n >= end {
            break;
        }
        top = n;
    }
    found.retain(|&top| top > 0 && values[top] >= level);
    let mut peaks: Vec<Peak> =
        found.iter().map(|&top| Peak { index: first + top, height: values[top] }).collect();
    strongest(&mut peaks, 32);
    peaks
}

/// Keeps the `count` highest peaks; of equal ones the first.
pub fn strongest(peaks: &mut Vec<Peak>, count: usize) {
    let mut order = peaks.clone();
    order.sort_by(|a, b| b.height.total_cmp(&a.height).then(a.index.cmp(&b.index)));
    order.truncate(count);
    order.sort_by_key(|p| p.index);
    *peaks = order;
}

/// Peaks of y including those hidden under others, and the indices of overlapping ones.
pub fn split(
    sharpener: &Sharpener,
    x: &[f64],
    y: &[f64],
    sigma: f64,
    level: f64,
    coarse: &[Peak],
    may_overlap: impl Fn(Peak) -> bool,
) -> (Vec<Peak>, Vec<usize>) {
    let sharp = sharpener.sharpened(x, |_| 0.0);
    let sigma = sharpener.sigma(sigma);
    let rise = |height: f64| (height / 16.0).floor().max((5.0 * sigma / 16.0).floor());
    let middles: Vec<usize> =
        coarse.windows(2).map(|two| (two[0].index + two[1].index) / 2 + 1).collect();
    let mut all = Vec::new();
    for (i, peak) in coarse.iter().enumerate() {
        let reach = 4 * sharpener.lag + 3;
        let from = peak.index.saturating_sub(reach).max(if i > 0 { middles[i - 1] } else { 0 });
        let to =
            (peak.index + reach + 1).min(middles.get(i).copied().unwrap_or(x.len())).min(x.len());
        let mut under = prominent_peaks(sharp.get(from..to).unwrap_or_default(), from, 1.0, rise);
        under.iter_mut().for_each(|p| p.height = y[p.index]);
        under.retain(|p| p.height >= level);
        let alone = under.len() < 2 || !may_overlap(*peak);
        if alone {
            under = vec![*peak];
        }
        all.extend(under.into_iter().map(|peak| (peak, alone)));
    }
    all.truncate(32);
    let overlapping = all.iter().filter(|(_, alone)| !alone).map(|(peak, _)| peak.index).collect();
    (all.into_iter().map(|(peak, _)| peak).collect(), overlapping)
}
