//! Height of a clipped echo as if it were not clipped, by which echoes are compared.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "indices and widths are at most 2400 samples, a level below 2¹⁷; with the \
              clamps stated products stay below 2⁶³; divisors are at least 1"
)]

use crate::clipped::edges::{EdgeFit, MAX_AMPLITUDE, Run};

/// Estimates the height of a clipped echo from the width of its run and from how fast its sides
/// fall. The echo is hard (the emitted pulse) or soft (spread in range, as from fog).
///
/// ```text
/// e      from the end of the run to where x falls below level/4
/// w      samples of the run;  L = 2 W f_s
/// hard   A of the edges, at most level·(0.8 L)², and that where a pulse is too short
/// soft   level · 4^(w² / ((w + 2e)² − w²))                      a Gaussian through both widths
/// height = min(hard, soft)
/// ```
///
/// A soft echo is wider at a quarter of the level than a hard one of the same run, so the lower of
/// both models holds.
///
/// | name | meaning | format |
/// |---|---|---|
/// | side | outwards from the run, at most 8 ⌈L⌉ samples | |
/// | noise | a dip above 7/8 of the level before a clipped sample: the run goes on there | |
/// | too short | L ≤ the distance of the run's ends, each a sample on where that one shows | |
/// | e | linear between samples, the inner at most level; less ½; at least ¼ | Q16.16, down |
/// | both e | the mean where neither is more than twice the other, else the shorter | Q16.16 |
/// | exponent of 2 | w²/(2e(w + e)), e and w + e Q.8, at most 24 | Q.12, down |
/// | 2^f | 1 + f (2689 + 1407 f)/4096 | Q.12, each product down |
/// | height | `level` to [`MAX_AMPLITUDE`] | Q1.15 |
///
/// Another dip than that of noise ends the side without an e. Without an e on either side the
/// height is the hard one: `level` where the run touches an end. Derived, and compared with the
/// truth, in `benches/record/detector.md`, The strongest of clipped echoes.
#[derive(Clone, Copy, Debug)]
pub struct Height<'a> {
    /// Fit of the edges of hard echoes.
    pub edges: EdgeFit<'a>,
    /// Lowest saturated code.
    pub clip_code: u16,
    /// Codes of the waveform.
    pub codes: &'a [u16],
    /// Samples without baseline, Q1.15.
    pub x: &'a [i16],
}

const ONE: i64 = 1 << 16;

/// Bits of the exponent of a soft echo's height.
const FINE: u32 = 12;

/// Samples beside a run.
struct Side {
    /// Samples by which the run goes on beyond a dip of noise.
    longer: usize,
    /// e, Q16.16.
    fall: Option<i64>,
    /// Lowest sample up to where the side ends.
    lowest: Option<i64>,
}

impl Height<'_> {
    /// Height of the echo that clipped these samples, Q1.15.
    #[inline(never)]
    pub fn of(&self, run: Run) -> u32 {
        let left = self.side(|steps| run.first.checked_sub(steps));
        let right = self.side(|steps| run.last.checked_add(steps));
        let run = Run { first: run.first - left.longer, last: run.last + right.longer };
        let soft = mean(left.fall, right.fall).map(|fall| self.soft(run, fall));
        let height = self.hard(run).min(soft.unwrap_or(MAX_AMPLITUDE));
        height.max(self.edges.level).min(MAX_AMPLITUDE) as u32
    }

    /// Follows one side of the run; `at` gives the index of the sample that many steps outwards.
    fn side(&self, at: impl Fn(usize) -> Option<usize>) -> Side {
        let level = self.edges.level;
        let quarter = level >> 2;
        let steps = 8 * ((2 * self.edges.pulse.width() + ONE - 1) >> 16) as usize;
        let mut side = Side { longer: 0, fall: None, lowest: None };
        let mut inner = level;
        for step in 1..steps + 1 {
            let Some(n) = at(step) else { break };
            let (Some(&code), Some(&value)) = (self.codes.get(n), self.x.get(n)) else { break };
            let value = i64::from(value);
            if code >= self.clip_code {
                if side.lowest.is_some_and(|low| 8 * low <= 7 * level) {
                    break;
                }
                side = Side { longer: step, fall: None, lowest: None };
                inner = level;
                continue;
            }
            let from_run = step - side.longer;
            if value < quarter {
                let whole = (from_run as i64 - 1) << 16;
                let part = ((inner - quarter) << 16) / (inner - value).max(1);
                side.fall = Some((whole + part - ONE / 2).max(ONE / 4));
                break;
            }
            side.lowest = Some(side.lowest.map_or(value, |low| low.min(value)));
            inner = value.min(level);
        }
        side
    }

    /// Height of a hard echo.
    fn hard(&self, run: Run) -> i64 {
        let Self { edges, x, .. } = *self;
        let width = edges.pulse.width();
        let square = (width >> 8) * (width >> 8) * 64 / 25; // (0.8 L)², Q.16
        let most = (edges.level * square) >> 16;
        let shows = |n: Option<usize>| {
            n.and_then(|n| x.get(n)).is_some_and(|&v| !edges.noise.hides(v.into()))
        };
        let beside = [run.first.checked_sub(1), run.last.checked_add(1)];
        let lit = (run.last - run.first + beside.into_iter().filter(|&n| shows(n)).count()) as i64;
        if 2 * width <= lit << 16 {
            return most;
        }
        edges.amplitude(x, run).map_or(edges.level, |amplitude| amplitude.min(most))
    }

    /// Height of a soft echo.
    fn soft(&self, run: Run, fall: i64) -> i64 {
        let samples = (run.last - run.first + 1) as i64;
        let fall = fall >> 8;
        let exponent = (((samples * samples) << (16 + FINE))
            / (2 * fall * ((samples << 8) + fall)).max(1))
        .min(24 << FINE);
        let f = exponent & ((1 << FINE) - 1);
        let mantissa = (1 << FINE) + ((f * (2_689 + ((1_407 * f) >> FINE))) >> FINE);
        ((self.edges.level * mantissa) << (exponent >> FINE)) >> FINE
    }
}

/// Mean e of both sides; the shorter where one is more than twice the other.
fn mean(left: Option<i64>, right: Option<i64>) -> Option<i64> {
    match (left, right) {
        (Some(left), Some(right)) if left.max(right) <= 2 * left.min(right) => {
            Some((left + right) >> 1)
        }
        (Some(left), Some(right)) => Some(left.min(right)),
        (left, right) => left.or(right),
    }
}
