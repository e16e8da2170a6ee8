//! Peaks hidden in a broader one, found by a sharper filter.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "taps and samples are Q1.15 with Σ abs(s) ≤ 1: sums within 2³⁰; 64ths below 2⁸ of \
              taps below 2¹⁷; indices of memory"
)]

use core::ops::Range;

use heapless::Vec;

use crate::limits::MAX_TAPS;
use crate::q::shift_round;
use crate::stages::peak::{MAX_CANDIDATES, Peak, Peaks};
use crate::stages::template::Template;
use crate::stages::{detect, filter};

/// Sharper filter: taps narrower than the pulse, less a share of their own second difference.
///
/// ```text
/// s[k] = ((64 + 2L)·h[k] − L·(h[k − q] + h[k + q])) / (64 + 4L)    towards zero; |k| ≤ K + q
/// r    = √Σ s²                                σ of sharpened white noise over σ
/// ```
///
/// | name | meaning | format |
/// |---|---|---|
/// | `h` | the taps of a pulse of 2K + 1 taps, narrower than the emitted one | Q1.15 |
/// | `q` | lag, about half the pulse; at least 1, with at most [`MAX_TAPS`] taps | samples |
/// | `L` | share of the second difference that is taken off | 64ths, at most 64 |
/// | `s` | sharpener, Σ abs(s) ≤ 1 because Σ abs(h) ≤ 1 | Q1.15 |
/// | `r` | of the `s` in Q1.15, rounded down | Q1.15 |
///
/// The matched filter has the best SNR and the worst resolution: after it, two equal echoes split
/// 1.14·cτ/2 apart. Where SNR is to spare, a narrow pulse keeps the resolution of the waveform, and
/// taking off the second difference deepens the valley between two peaks by L/64 of the curvature
/// at the pulse's own scale ("resolution sharpening", known from spectra). A broad flat echo gets
/// horns of at most about L/200 of its height from it: less than [`prominence`] asks for.
#[derive(Clone, Debug)]
pub struct Sharpener {
    /// Taps and one zero.
    taps: Vec<i16, { MAX_TAPS + 1 }>,
    /// Lag q, samples.
    pub lag: usize,
    /// Noise gain r, Q1.15.
    pub noise_gain: u16,
}

/// L on the sensor, 64ths.
pub const SENSOR_SHARPNESS: i32 = 8;

/// Prominence that the sensor asks of a peak, in multiples of the sharpened noise.
pub const SENSOR_PROMINENCE_SIGMAS: u32 = 5;

impl Sharpener {
    /// Sharpener that smooths with `narrow` and sharpens by `strength` 64ths at a lag of `lag`
    /// samples.
    pub fn new(narrow: &Template, lag: usize, strength: i32) -> Self {
        let strength = strength.clamp(0, 64);
        let lag = lag.clamp(1, (MAX_TAPS / 2 - narrow.half().min(MAX_TAPS / 2)).max(1));
        let half = (narrow.half() + lag).min(MAX_TAPS / 2);
        let tap = |k: isize| sharpened_tap(narrow, k, lag as isize, strength);
        let mut taps = Vec::new();
        for k in -(half as isize)..=half as isize {
            let _ = taps.push(tap(k)); // half is bounded by MAX_TAPS: never full
        }
        let _ = taps.push(0);
        let energy: u64 = taps.iter().map(|&s| u64::from(s.unsigned_abs()).pow(2)).sum();
        Self { taps, lag, noise_gain: energy.isqrt() as u16 }
    }

    /// Sharpener of the sensor: half the emitted pulse's width, half a width as the lag,
    /// [`SENSOR_SHARPNESS`].
    pub fn for_pulse(width_ps: u32, sample_period_fs: u32) -> Self {
        let narrow = Template::sin_squared(width_ps / 2, sample_period_fs);
        let half_width = u64::from(width_ps) * 500 / u64::from(sample_period_fs.max(1));
        Self::new(&narrow, half_width as usize, SENSOR_SHARPNESS)
    }

    /// Taps and one zero, so that they can be read in pairs.
    pub fn taps_in_pairs(&self) -> &[i16] {
        &self.taps
    }

    /// Taps, centre in the middle.
    pub fn taps(&self) -> &[i16] {
        self.taps.split_last().map_or(&[], |(_, taps)| taps)
    }

    /// Number of taps on either side of the centre.
    pub fn half(&self) -> usize {
        self.taps().len() / 2
    }

    /// σ_s = σ̂·r: noise after the sharpener, Q13.19, nearest, of a waveform's σ̂.
    pub fn sigma(&self, sigma: u32) -> u32 {
        shift_round(i64::from(sigma) * i64::from(self.noise_gain), 15) as u32
    }

    /// Sharpened sample before it is rounded to Q1.15: Q9.23, nearest; 0 outside `x`.
    pub fn exact(&self, x: &[i16], n: i64) -> i64 {
        match usize::try_from(n) {
            Ok(index) if index < x.len() => shift_round(self.sum(x, n).into(), 7),
            _ => 0,
        }
    }

    /// Sharpened sample, Q1.15: `round(Σ s[k] · x[n + k])`, x = 0 outside.
    pub fn at(&self, x: &[i16], n: usize) -> i16 {
        filter::round(self.sum(x, n as i64))
    }

    /// `Σ s[k] · x[n + k]`, Q2.30.
    #[inline(always)]
    fn sum(&self, x: &[i16], n: i64) -> i32 {
        let taps = self.taps().iter().zip(n - self.half() as i64..);
        let sample =
            |i: i64| usize::try_from(i).ok().and_then(|i| x.get(i)).map_or(0, |&x| i32::from(x));
        taps.map(|(&s, i)| i32::from(s) * sample(i)).sum()
    }
}

fn sharpened_tap(narrow: &Template, k: isize, lag: isize, strength: i32) -> i16 {
    let h = |k: isize| {
        let index = usize::try_from(k + narrow.half() as isize).ok();
        index.and_then(|i| narrow.taps().get(i)).map_or(0, |&h| i32::from(h))
    };
    (((64 + 2 * strength) * h(k) - strength * (h(k - lag) + h(k + lag))) / (64 + 4 * strength))
        as i16
}

/// Finds the peaks of `values`, sample `first` onwards: local maxima at or above `level` that
/// stand out.
///
/// ```text
/// rising   v > peak: the new peak;       v < peak − prominence(peak): a peak is found → falling
/// falling  v < valley: the new valley;     v > valley + prominence(v) → rising
/// ```
///
/// The state is rising at the first sample. First and last sample are no peaks, because the top may
/// lie outside. A peak that the end cuts off before `values` fell far enough counts if they fell at
/// all. A peak is the first sample of its plateau. Beyond [`MAX_CANDIDATES`] the lowest are
/// dropped, of equals the last.
pub fn prominent_peaks(
    values: impl IntoIterator<Item = i16>,
    first: usize,
    level: i16,
    prominence: impl Fn(i16) -> i32,
    found: &mut Peaks,
) {
    found.clear();
    let mut samples =
        values.into_iter().zip(first..).map(|(height, n)| Peak { index: n as u16, height });
    let Some(mut peak) = samples.next() else { return };
    let mut keep = |peak: Peak| {
        if peak.height >= level && usize::from(peak.index) != first {
            detect::insert(found, peak);
        }
    };
    let (mut valley, mut last) = (None, peak);
    for here in samples {
        last = here;
        match valley {
            None if here.height > peak.height => peak = here,
            None if i32::from(here.height) < i32::from(peak.height) - prominence(peak.height) => {
                keep(peak);
                valley = Some(here.height);
            }
            None => {}
            Some(lowest) if here.height < lowest => valley = Some(here.height),
            Some(lowest)
                if i32::from(here.height) > i32::from(lowest) + prominence(here.height) =>
            {
                (peak, valley) = (here, None);
            }
            Some(_) => {}
        }
    }
    if valley.is_none() && last.height < peak.height {
        keep(peak);
    }
}

/// Prominence that the sensor asks of a peak: [`SENSOR_PROMINENCE_SIGMAS`] σ_s or a sixteenth of
/// the height, whichever is more, both rounded down to whole LSB.
///
/// The sixteenth keeps an echo of a slanted or rough surface whole, however quiet the receiver.
pub fn prominence(height: i16, sigma: u32) -> i32 {
    (i32::from(height) >> 4)
        .max(((u64::from(sigma) * u64::from(SENSOR_PROMINENCE_SIGMAS)) >> 4) as i32)
}

/// Indices of peaks that were hidden in others.
pub type Overlapping = Vec<u16, MAX_CANDIDATES>;

/// Replaces each coarse peak by the peaks that the sharpener finds under it, if there are two or
/// more.
///
/// | name | meaning | format |
/// |---|---|---|
/// | `x` | waveform without ambient | Q1.15 |
/// | `y` | output of the denoise filter, with the coarse peaks | Q1.15 |
/// | `sigma` | σ̂ of x | Q13.19 |
/// | `level` | T on y | Q1.15 |
/// | `coarse` | peaks of y by rising index | |
///
/// Under a peak that `may_overlap` others: up to 4q + 3 samples to either side, not past the middle
/// (rounded down) to the next coarse peak. A peak there is one of the sharpened waveform with
/// [`prominence`], of positive height; it becomes a peak of `y`'s height at its index if that
/// reaches T. Work is bounded: 8q + 7 sharpened samples a coarse peak. Peaks beyond the first
/// [`MAX_CANDIDATES`] are dropped.
///
/// `overlapping` becomes the indices of the peaks that replaced another: `y` need not have a
/// maximum there.
///
/// Two equal sin² echoes of S = 50 come apart from 1.14·cτ/2 on at 0.5, 1 and 2 GS/s
/// (`tests/tests/detector/limits.rs`).
#[derive(Clone, Copy, Debug)]
pub struct Splitter<'a> {
    /// Sharper filter.
    pub sharpener: &'a Sharpener,
    /// Waveform without ambient, Q1.15.
    pub x: &'a [i16],
    /// Output of the denoise filter, Q1.15.
    pub y: &'a [i16],
    /// σ̂ of x, Q13.19.
    pub sigma: u32,
    /// T on y, Q1.15.
    pub level: i16,
}

impl Splitter<'_> {
    /// Peaks, with those that were hidden in broad ones.
    pub fn split(
        &self,
        coarse: &Peaks,
        may_overlap: impl Fn(Peak) -> bool,
        overlapping: &mut Overlapping,
    ) -> Peaks {
        let sigma = self.sharpener.sigma(self.sigma);
        let (mut all, mut under) = (Peaks::new(), Peaks::new());
        overlapping.clear();
        let mut start = 0;
        for (i, &peak) in coarse.iter().enumerate() {
            let middle = coarse.get(i + 1).map_or(self.x.len(), |next| {
                usize::midpoint(peak.index.into(), next.index.into()) + 1
            });
            under.clear();
            if may_overlap(peak) {
                self.peaks_under(peak, start..middle, sigma, &mut under);
            }
            start = middle;
            let split: &[Peak] =
                if under.len() > 1 { &under } else { core::slice::from_ref(&peak) };
            for &peak in split {
                if split.len() > 1 {
                    let _ = overlapping.push(peak.index); // fits: one per peak
                }
                let _ = all.push(peak); // dropped if full
            }
        }
        all
    }

    /// Peaks of the sharpened waveform around a coarse one, within `bounds`, that reach T on y.
    fn peaks_under(&self, peak: Peak, bounds: Range<usize>, sigma: u32, under: &mut Peaks) {
        let index = usize::from(peak.index);
        let reach = 4 * self.sharpener.lag + 3;
        let from = index.saturating_sub(reach).max(bounds.start);
        let to = (index + reach + 1).min(bounds.end).min(self.x.len());
        let sharpened = (from..to).map(|n| self.sharpener.at(self.x, n));
        prominent_peaks(sharpened, from, 1, |height| prominence(height, sigma), under);
        for peak in under.iter_mut() {
            peak.height = self.y.get(usize::from(peak.index)).copied().unwrap_or_default();
        }
        under.retain(|peak| peak.height >= self.level);
    }
}

const _: () = assert!(MAX_CANDIDATES >= 2, "a peak may become two");

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    fn find(values: &[i16], level: i16, rise: i32) -> std::vec::Vec<(u16, i16)> {
        let mut found = Peaks::new();
        prominent_peaks(values.iter().copied(), 0, level, |_| rise, &mut found);
        found.iter().map(|p| (p.index, p.height)).collect()
    }

    #[test]
    fn the_taps_are_symmetric_and_add_up_to_at_most_one_in_size() {
        for (width, lag, strength) in
            [(2, 1, 3), (2, 12, 3), (16, 24, 64), (48, 40, 8), (1, 9, 0), (3, 0, 5)]
        {
            let sharpener =
                Sharpener::new(&Template::sin_squared(width * 1000, 1_000_000), lag, strength);
            let taps = sharpener.taps();
            assert!(taps.len() % 2 == 1 && taps.iter().eq(taps.iter().rev()));
            assert!(
                taps.iter().map(|&s| i32::from(s).abs()).sum::<i32>() <= 0x7fff,
                "{width} {lag} {strength}"
            );
        }
    }

    #[test]
    fn a_peak_is_neither_the_first_nor_the_last_sample() {
        assert_eq!(find(&[9, 8, 7, 6, 5], 1, 1), []);
        assert_eq!(find(&[5, 6, 7, 8, 9], 1, 1), []);
        assert_eq!(find(&[5, 6, 7, 9, 9], 1, 1), []);
        assert_eq!(find(&[5, 6, 9, 8], 1, 4), [(2, 9)]);
        assert_eq!(find(&[8, 9, 5, 5], 1, 4), [(1, 9)]);
    }

    #[test]
    fn a_peak_stands_out_on_both_sides() {
        assert_eq!(find(&[0, 50, 48, 51, 0], 1, 4), [(3, 51)]);
        assert_eq!(find(&[0, 50, 40, 51, 0], 1, 4), [(1, 50), (3, 51)]);
    }

    #[test]
    fn no_waveform_panics() {
        let sharpener = Sharpener::for_pulse(5_000, 1_000_000);
        for x in [&[] as &[i16], &[i16::MIN], &[i16::MAX; 40], &[i16::MIN, i16::MAX, i16::MIN]] {
            let mut coarse = Peaks::new();
            coarse.push(Peak { index: 1, height: 3 }).unwrap();
            coarse.push(Peak { index: u16::MAX, height: 3 }).unwrap();
            let splitter = Splitter { sharpener: &sharpener, x, y: &[], sigma: u32::MAX, level: 1 };
            assert_eq!(splitter.split(&coarse, |_| true, &mut Overlapping::new()).len(), 2);
        }
    }
}
