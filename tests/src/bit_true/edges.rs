//! Fit of the pulse to the edges of a clipped run.

use super::noise::Noise;
use super::numbers::{floor_of, floor_root, product, two_to};
use super::pulse::Pulse;

/// Time and its σ in Q16.16 samples, amplitude in Q1.15.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edges {
    /// Time since sample 0.
    pub time: f64,
    /// Amplitude without clipping.
    pub amplitude: f64,
    /// σ of the time.
    pub sigma: f64,
}

const SAMPLE: f64 = 65_536.0;

/// Least σ, 2⁻¹⁰ samples.
const FINEST: f64 = 64.0;

/// A waveform whose samples `first..=last` are clipped at `level`.
#[derive(Clone, Copy, Debug)]
pub struct Clipped<'a> {
    /// The emitted pulse.
    pub pulse: &'a Pulse,
    /// Waveform without baseline, Q1.15.
    pub x: &'a [f64],
    /// Clip level, Q1.15.
    pub level: f64,
    /// First sample of the run.
    pub first: usize,
    /// Last sample of the run.
    pub last: usize,
    /// Noise of the waveform.
    pub noise: Noise,
}

/// Fit of the pulse to one sample of each edge.
#[derive(Clone, Copy, Debug)]
struct Pair {
    both_show: bool,
    time: f64,
    amplitude: f64,
    sigma: f64,
}

/// Phase x of the left sample in the pulse, amplitude A, σ of x.
type Solution = (f64, f64, f64);

impl Clipped<'_> {
    /// `None` when the run touches an end of the waveform.
    pub fn fit(&self) -> Option<Edges> {
        let nearest = self.pair(1)?;
        let pairs: Vec<Pair> =
            (1..=3).map_while(|i| self.pair(i).filter(|pair| pair.both_show)).collect();
        let level_or_more = |a: f64| a.max(self.level).min(two_to(25));
        if pairs.len() < 2 {
            return Some(Edges {
                time: nearest.time,
                amplitude: level_or_more(nearest.amplitude),
                sigma: nearest.sigma,
            });
        }
        let weight = |pair: &Pair| (two_to(40) / (pair.sigma * pair.sigma)).floor().max(1.0);
        let weights: f64 = pairs.iter().map(weight).sum();
        // Times relative to the first pair's, as the integer code rounds them.
        let later: f64 = pairs.iter().map(|pair| weight(pair) * (pair.time - nearest.time)).sum();
        Some(Edges {
            time: nearest.time + (later / weights).floor(),
            amplitude: level_or_more(nearest.amplitude),
            sigma: floor_root((two_to(40) / weights).floor() as u128).max(FINEST),
        })
    }

    /// Fit to the i-th samples before and after the run.
    fn pair(&self, i: usize) -> Option<Pair> {
        let (before, after) = (self.first.checked_sub(i)?, self.last + i);
        let (left, right) = (self.x[before], *self.x.get(after)?);
        let slack = self.pulse.length() - (after - before) as f64 * SAMPLE;
        let shows = (self.noise.shows(left), self.noise.shows(right));
        let (x, amplitude, sigma) = match shows {
            (true, true) => self.both(left, right, slack),
            (true, false) => self.one(left, slack),
            (false, true) => {
                let (x, amplitude, sigma) = self.one(right, slack);
                (slack - x, amplitude, sigma)
            }
            (false, false) => self.neither(slack),
        };
        let time = (((before + after) as f64 * SAMPLE + slack - 2.0 * x) / 2.0).floor();
        Some(Pair { both_show: shows == (true, true), time, amplitude, sigma: sigma.max(FINEST) })
    }

    fn both(&self, left: f64, right: f64, slack: f64) -> Solution {
        if slack <= 0.0 {
            return ((slack / 2.0).floor(), left.max(right), two_to(14) - (slack / 4.0).floor());
        }
        let p = |x: f64| self.pulse.at(x);
        let uneven = |x: f64| left * p(slack - x) - right * p(x);
        let (low, high) =
            bisect((slack - self.pulse.width).max(0.0), slack.min(self.pulse.width), &uneven);
        let (above, below) = (uneven(low).max(0.0), uneven(high).min(0.0));
        let coarse = |difference: f64| (difference / two_to(15)).floor();
        let x = low + ((high - low) * coarse(above) / coarse(above - below).max(1.0)).floor();
        let (at_left, at_right) = (p(x), p(slack - x));
        let amplitude = ((left + right) * two_to(30) / (at_left + at_right).max(1.0)).floor();
        // (p δv)², Q60
        let square = |p: f64, v: f64| {
            let p = (p / two_to(15)).floor() as u128;
            p * p * (self.noise.variance(v, two_to(15)) >> 8).min(1 << 32)
        };
        let shift = floor_root(square(at_right, left) + square(at_left, right));
        let stiffness = ((left * self.pulse.slope(slack - x) + right * self.pulse.slope(x))
            / two_to(15))
        .floor()
        .max(1.0);
        let sigma = floor_of(shift, SAMPLE, stiffness);
        (x, amplitude, sigma.min(two_to(24)))
    }

    fn one(&self, value: f64, slack: f64) -> Solution {
        let least = (slack.max(0.0) * SAMPLE / (SAMPLE + root(self.noise.hidden(), value))).floor();
        let most =
            ((slack + SAMPLE) * SAMPLE / (SAMPLE + root(self.level, value))).floor().max(least);
        let x = least + (2.0 * (most - least) / 3.0).floor();
        let within = slack.max(0.0) - least;
        let sigma = rising(most - least) + (within / 6.0).trunc();
        (x, (value * two_to(30) / self.pulse.at(x).max(1.0)).floor(), sigma)
    }

    fn neither(&self, slack: f64) -> Solution {
        let shown = (SAMPLE + (slack / 2.0).floor()).clamp(SAMPLE / 16.0, 2.0 * SAMPLE);
        let hidden = floor_of(root(self.noise.hidden(), self.level), shown, SAMPLE);
        let least = (slack - hidden).max(-SAMPLE);
        let most = hidden.min(slack + SAMPLE).max(least);
        let top = self.pulse.at((shown / 2.0).floor()).max(1.0);
        let doubt = (hidden / 6.0).floor() + ((slack / 2.0).floor() - hidden).max(0.0);
        (
            (slack / 2.0).floor(),
            (self.level * two_to(30) / top).floor(),
            uniform(most - least) + doubt,
        )
    }
}

/// Bisects an interval around the root of a falling function down to 2⁻⁵ samples.
fn bisect(low: f64, high: f64, falling: &impl Fn(f64) -> f64) -> (f64, f64) {
    let middle = ((low + high) / 2.0).floor();
    match high - low <= SAMPLE / 32.0 {
        true => (low, high),
        false if falling(middle) > 0.0 => bisect(middle, high, falling),
        false => bisect(low, middle, falling),
    }
}

/// √(a/b), Q16.16, at most 2⁸.
fn root(a: f64, b: f64) -> f64 {
    floor_root(product(a, two_to(32)) / b as u128).min(two_to(24))
}

/// σ of a density that rises linearly from 0: width/√18, the factor in Q0.16.
fn rising(width: f64) -> f64 {
    (width * (two_to(16) / 18f64.sqrt()).round() / two_to(16)).floor()
}

/// σ of a uniform distribution: width/√12, the factor in Q0.16.
fn uniform(width: f64) -> f64 {
    (width * (two_to(16) / 12f64.sqrt()).round() / two_to(16)).floor()
}
