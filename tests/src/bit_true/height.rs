//! Height of a clipped echo without clipping.

use super::edges::Clipped;
use super::numbers::{floor_of, two_to};

const SAMPLE: f64 = 65_536.0;
const MOST: f64 = 33_554_432.0;

/// A clipped run in its waveform.
#[derive(Clone, Copy, Debug)]
pub(super) struct Saturated<'a> {
    /// The run, with its edge fit.
    pub(super) clipped: Clipped<'a>,
    /// Codes of the waveform.
    pub(super) codes: &'a [u16],
    /// Lowest saturated code.
    pub(super) clip_code: f64,
}

/// One side of a run.
struct Beside {
    /// Last clipped sample, with those behind shallow dips.
    end: usize,
    /// Distance from there to a quarter of the clip level.
    fall: Option<f64>,
}

impl Saturated<'_> {
    /// Height without clipping, Q1.15.
    pub(super) fn height(&self) -> f64 {
        let Clipped { pulse, level, first, last, .. } = self.clipped;
        let reach = 8 * (pulse.length() / SAMPLE).ceil() as usize;
        let length = self.codes.len().min(self.clipped.x.len());
        let before: Vec<usize> = (0..first).rev().take(reach).collect();
        let after: Vec<usize> = (last + 1..length).take(reach).collect();
        let (left, right) = (self.beside(first, &before), self.beside(last, &after));
        let run = Clipped { first: left.end, last: right.end, ..self.clipped };
        let fall = match (left.fall, right.fall) {
            (Some(a), Some(b)) if a <= 2.0 * b && b <= 2.0 * a => Some(((a + b) / 2.0).floor()),
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
        let height = match fall {
            Some(fall) => hard(&run).min(soft(&run, fall)),
            None => hard(&run),
        };
        height.clamp(level.min(MOST), MOST)
    }

    /// Follows one side of the run; `outwards` are the samples beyond its `end`, nearest first.
    fn beside(&self, end: usize, outwards: &[usize]) -> Beside {
        let level = self.clipped.level;
        let quarter = (level / 4.0).floor();
        let value = |n: usize| self.clipped.x[n];
        let clips = |&n: &usize| f64::from(self.codes[n]) >= self.clip_code;
        let low = |&n: &usize| !clips(&n) && value(n) < quarter;
        // Goes to the first low sample, or to the first clipped one behind a deep dip.
        let mut end = end;
        let mut rest = outwards;
        loop {
            let stop = rest.iter().position(|n| clips(n) || low(n)).unwrap_or(rest.len());
            let dip = &rest[..stop];
            let lowest = dip.iter().map(|&n| value(n)).reduce(f64::min);
            match rest.get(stop) {
                Some(n) if low(n) => {
                    let inner = dip.last().map_or(level, |&n| value(n).min(level));
                    let part = (inner - quarter) * SAMPLE / (inner - value(*n)).max(1.0);
                    let fall = stop as f64 * SAMPLE + part.floor() - SAMPLE / 2.0;
                    let fall = Some(fall.max(SAMPLE / 4.0));
                    return Beside { end, fall };
                }
                Some(&n) if lowest.is_none_or(|low| low > 0.875 * level) => {
                    end = n;
                    rest = &rest[stop + 1..];
                }
                _ => return Beside { end, fall: None },
            }
        }
    }
}

fn hard(run: &Clipped<'_>) -> f64 {
    let Clipped { pulse, level, first, last, .. } = *run;
    let width = (pulse.width / 256.0).floor();
    let most = floor_of(level, (width * width * 2.56).floor(), SAMPLE);
    let shows = |n: usize| run.x.get(n).is_some_and(|&v| run.noise.shows(v));
    let lit_from = if first > 0 && shows(first - 1) { first - 1 } else { first };
    let lit_to = if shows(last + 1) { last + 1 } else { last };
    if (lit_to - lit_from) as f64 * SAMPLE >= pulse.length() {
        return most;
    }
    run.fit().map_or(level, |edges| edges.amplitude.min(most))
}

fn soft(run: &Clipped<'_>, fall: f64) -> f64 {
    let samples = (run.last - run.first + 1) as f64;
    let fall = (fall / 256.0).floor();
    let below = 2.0 * fall * (256.0 * samples + fall);
    let exponent = floor_of(samples * samples, two_to(28), below).min(24.0 * 4096.0);
    let f = exponent % 4096.0;
    let slope = 2_689.0 + (1_407.0 * f / 4096.0).floor();
    let mantissa = 4096.0 + (f * slope / 4096.0).floor();
    floor_of(run.level * mantissa, two_to((exponent / 4096.0).floor() as i32), 4096.0)
}
