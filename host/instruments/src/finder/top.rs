//! Place, height and width of a top of a waveform.

// No overflow: samples are Q1.15, times Q16.16 within 2400 samples, 2²⁸; divisors are at least 1;
// indices of memory.

use echoloop_dsp::flags::Flags;
use echoloop_dsp::q::divide_round;

/// A waveform, smoothed as much as its noise asks for, with the bounds of its shapes.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The waveform without ambient, or the filter's output, Q1.15.
    pub y: &'a [i16],
    /// Least rise after a valley, Q1.15: twice the noise, at least 1. A sixteenth of the top is
    /// required as well.
    pub prominence: i32,
    /// Least drop that a parabola of the same edges would have inside a plateau for it to be flat,
    /// Q1.15.
    pub flat: i32,
    /// Greatest difference of two samples of a clipped top, Q1.15: three codes, as a converter's
    /// last steps waver.
    pub waver: i32,
    /// The highest value of the record, Q1.15.
    pub top: i16,
}

/// The top of an echo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Top {
    /// Time since sample 0, Q16.16 samples.
    pub time: i64,
    /// Index of its sample, the first of a plateau.
    pub index: usize,
    /// Value there, Q1.15.
    pub height: i16,
    /// True when the record goes on beyond it on both sides.
    pub inside: bool,
    /// True when it is flat as only a limit makes it.
    pub flat: bool,
    /// True when it is flat at the record's highest value, but for a waver.
    pub clipped: bool,
}

/// Width of an echo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Width {
    /// Full width at half maximum, Q16.16 samples; `None` when neither side falls to half.
    pub samples: Option<i64>,
    /// [`Flags::MERGED`] and [`Flags::TRUNCATED`], of both sides.
    pub flags: Flags,
    /// True when one half is at least three times as wide as the other.
    pub is_tailed: bool,
}

/// Least ratio of the two halves of the width of a tailed echo: its middle says nothing of its top.
/// Two echoes in one lobe, or a slope, have less.
const TAILED: i64 = 3;

impl View<'_> {
    fn value(&self, index: usize) -> Option<i64> {
        self.y.get(index).map(|&v| i64::from(v))
    }

    /// Climbs from a sample to the top above it.
    ///
    /// ```text
    /// climb    towards the higher neighbour (ties to the earlier), at most `reach` samples
    /// run      a..b, the equal samples around where it ends; L = b − a + 1
    ///          within a waver of the record's highest, t: those within a waver of t, if they are
    ///          four times as flat with t for y
    /// time     L = 1: index + δ, δ the parabola's vertex; else (a + b)/2              Q16.16
    /// drop     D = (y − y[a − 1]) + (y − y[b + 1]), y the value there
    /// flat     L ≥ 3 and D·(L − 1)² > 2·flat·(L + 1)²
    /// ```
    ///
    /// `δ = (y₋ − y₊) / (2 (y₋ − 2y₀ + y₊))`, Q16.16, nearest, within ±½; 0 at an end of the
    /// record. A run at an end of the record is not flat. The last line: a parabola through the
    /// samples beside the plateau would drop by D/2·(L − 1)²/(L + 1)² inside it. Inside a run of a
    /// waver it drops by three codes, one and a half times `flat`.
    pub fn climb(&self, start: usize, reach: usize) -> Top {
        let mut index = start.min(self.y.len().saturating_sub(1));
        for _ in 0..reach {
            let at = |i: Option<usize>| i.and_then(|i| self.value(i)).unwrap_or(i64::MIN);
            let (before, here, after) =
                (at(index.checked_sub(1)), at(Some(index)), at(Some(index + 1)));
            index = match () {
                () if before > here && before >= after => index - 1,
                () if after > here => index + 1,
                () => break,
            };
        }
        self.top(index)
    }

    /// The top at a sample.
    fn top(&self, index: usize) -> Top {
        let height = self.y.get(index).copied().unwrap_or_default();
        let limit = i32::from(self.top) - self.waver;
        let wavering = (i32::from(height) >= limit)
            .then(|| self.run(index, |v| i32::from(v) >= limit))
            .filter(|&(first, last)| self.is_flat(first, last, i64::from(self.top), 4));
        let (first, last) = wavering.unwrap_or_else(|| self.run(index, |v| v == height));
        let wavers = wavering.is_some();
        let flat = wavers || self.is_flat(first, last, i64::from(height), 1);
        let time = match last - first {
            0 => ((index as i64) << 16) + self.vertex(index),
            _ => ((first + last) as i64) << 15,
        };
        let inside = first > 0 && last + 1 < self.y.len();
        let clipped = flat && (wavers || height == self.top);
        Top { time, index: first, height, inside, flat, clipped }
    }

    /// First and last of the samples around one that are alike.
    fn run(&self, index: usize, is_like: impl Fn(i16) -> bool) -> (usize, usize) {
        let like = |v: &&i16| is_like(**v);
        let before = self.y.get(..index).unwrap_or_default().iter().rev().take_while(like).count();
        let after = self.y.get(index..).unwrap_or_default().iter().skip(1).take_while(like).count();
        (index - before, index + after)
    }

    fn vertex(&self, index: usize) -> i64 {
        let around = index.checked_sub(1).and_then(|first| self.y.get(first..first + 3));
        let Some(&[before, here, after]) = around else { return 0 };
        let (before, here, after) = (i64::from(before), i64::from(here), i64::from(after));
        divide_round((before - after) << 15, before - 2 * here + after).clamp(-0x8000, 0x8000)
    }

    fn is_flat(&self, first: usize, last: usize, height: i64, times: i64) -> bool {
        let length = (last - first + 1) as i64;
        let (Some(before), Some(after)) =
            (first.checked_sub(1).and_then(|i| self.value(i)), self.value(last + 1))
        else {
            return false;
        };
        let drop = 2 * height - before - after;
        let least = 2 * times * i64::from(self.flat);
        length >= 3 && drop * (length - 1).pow(2) > least * (length + 1).pow(2)
    }

    /// Full width at half of a top's height (rounded down), linear between samples.
    ///
    /// A side ends at its crossing; or without one in a valley before a rise of more than the
    /// prominence and a sixteenth of the height ([`Flags::MERGED`]), or with the record
    /// ([`Flags::TRUNCATED`]). With one crossing the width is twice the distance from the top to
    /// it; with none it is `None`. Crossings are Q16.16, the fraction of a sample rounded down,
    /// towards the top.
    pub fn width(&self, top: &Top) -> Width {
        let (left, left_flag) = self.crossing(top, -1);
        let (right, right_flag) = self.crossing(top, 1);
        let samples = match (left, right) {
            (Some(left), Some(right)) => Some(right - left),
            (Some(side), None) | (None, Some(side)) => Some(2 * (side - top.time).abs()),
            (None, None) => None,
        };
        let half = |side: Option<i64>| side.map(|side| (side - top.time).abs());
        let is_tailed = half(left)
            .zip(half(right))
            .is_some_and(|(left, right)| left.max(right) >= TAILED * left.min(right));
        Width { samples, flags: left_flag | right_flag, is_tailed }
    }

    fn crossing(&self, top: &Top, direction: isize) -> (Option<i64>, Flags) {
        let height = i64::from(top.height);
        let (half, rise) = (height >> 1, i64::from(self.prominence).max(height >> 4));
        let mut inner = self.value(top.index).unwrap_or(height);
        let (mut index, mut valley) = (top.index, height);
        loop {
            let next = index.checked_add_signed(direction);
            let Some((next, value)) = next.and_then(|next| Some((next, self.value(next)?))) else {
                return (None, Flags::TRUNCATED);
            };
            if value < half {
                let fraction = ((inner - half) << 16) / (inner - value).max(1);
                return (Some(((index as i64) << 16) + direction as i64 * fraction), Flags::NONE);
            }
            if value > valley + rise {
                return (None, Flags::MERGED);
            }
            valley = valley.min(value);
            (index, inner) = (next, value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(y: &[i16]) -> View<'_> {
        View {
            y,
            prominence: 1,
            flat: 2,
            waver: 0,
            top: y.iter().copied().max().unwrap_or_default(),
        }
    }

    #[test]
    fn a_plateau_s_time_is_its_middle() {
        let top = view(&[0, 50, 90, 90, 60, 0]).climb(1, 9);
        assert_eq!((top.time, top.flat), (5 << 15, false));
    }

    #[test]
    fn a_clipped_top_is_told_from_a_broad_one() {
        assert!(view(&[0, 10, 60, 90, 90, 90, 50, 0]).climb(3, 9).clipped);
        assert!(!view(&[0, 60, 85, 89, 90, 90, 90, 89, 84, 50, 0]).climb(3, 9).flat);
        let low = View { top: 200, ..view(&[0, 10, 60, 90, 90, 90, 50, 0]) }.climb(3, 9);
        assert!(low.flat && !low.clipped);
    }

    #[test]
    fn a_clipped_top_that_wavers_is_one_plateau() {
        let y = [0, 12, 231, 249, 247, 249, 250, 249, 106, 12, 0];
        for start in 3..8 {
            let top = View { waver: 3, ..view(&y) }.climb(start, 2);
            assert_eq!((top.time, top.clipped), (5 << 16, true), "from {start}");
        }
        // A broad top has samples as close to each other, and the next are hardly lower.
        let broad = [0, 90, 180, 220, 240, 247, 249, 250, 249, 247, 240, 220, 180, 90, 0];
        let top = View { waver: 3, ..view(&broad) }.climb(7, 2);
        assert_eq!((top.time, top.flat), (7 << 16, false));
        // Nor is one below the record's highest clipped.
        let low = View { waver: 3, top: 900, ..view(&y) }.climb(4, 2);
        assert!(!low.clipped);
    }

    #[test]
    fn the_width_is_that_at_half_height() {
        let y = view(&[0, 0, 40, 80, 40, 0, 0]);
        let top = y.climb(2, 9);
        assert_eq!(
            y.width(&top),
            Width { samples: Some(2 << 16), flags: Flags::NONE, is_tailed: false }
        );
    }

    #[test]
    fn a_side_without_a_crossing_has_a_flag() {
        let merged = view(&[0, 40, 80, 60, 70, 90, 0]);
        assert_eq!(merged.width(&merged.climb(2, 9)).flags, Flags::MERGED);
        let cut = view(&[0, 40, 80, 60]);
        let top = cut.climb(2, 9);
        assert_eq!(
            cut.width(&top),
            Width {
                samples: Some(2 * (top.time - (1 << 16))),
                flags: Flags::TRUNCATED,
                is_tailed: false
            }
        );
    }

    #[test]
    fn no_waveform_and_no_start_panics() {
        for y in [&[] as &[i16], &[5], &[5; 9], &[i16::MIN, i16::MAX]] {
            for start in [0, 1, usize::MAX] {
                let view = view(y);
                view.width(&view.climb(start, 3));
            }
        }
    }
}
