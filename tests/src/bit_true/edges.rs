//! The pulse, fitted to the edges of a clipped run.

use super::noise::Noise;
use super::numbers::{floor_of, floor_root, product, two_to};
use super::pulse::Pulse;

/// Time and its σ in Q16.16 samples, amplitude in Q1.15.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edges {
    /// Since sample 0.
    pub time: f64,
    /// As if nothing had clipped it.
    pub amplitude: f64,
    /// Of the time.
    pub sigma: f64,
}

const SAMPLE: f64 = 65_536.0;

/// 2⁻¹⁰ samples.
const FINEST: f64 = 64.0;

/// What is known of a pulse whose samples `first..=last` are clipped at `level`.
#[derive(Clone, Copy, Debug)]
pub struct Clipped<'a> {
    /// The pulse as it was emitted.
    pub pulse: &'a Pulse,
    /// Q1.15.
    pub x: &'a [f64],
    /// Q1.15.
    pub level: f64,
    /// The first of the run.
    pub first: usize,
    /// The last of the run.
    pub last: usize,
    /// Of the waveform.
    pub noise: Noise,
}

/// One sample of each edge: how both are explained by one pulse.
#[derive(Clone, Copy, Debug)]
struct Pair {
    both_show: bool,
    time: f64,
    amplitude: f64,
    sigma: f64,
}

/// x of the sample of one edge, A, σ of x.
type Solution = (f64, f64, f64);

impl Clipped<'_> {
    /// None where the run touches an end.
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
        // Relative to the first: the average rounds down all the same.
        let later: f64 = pairs.iter().map(|pair| weight(pair) * (pair.time - nearest.time)).sum();
        Some(Edges {
            time: nearest.time + (later / weights).floor(),
            amplitude: level_or_more(nearest.amplitude),
            sigma: floor_root((two_to(40) / weights).floor() as u128).max(FINEST),
        })
    }

    /// The i-th samples before and after the run.
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

/// Halves an interval around the root of a falling function until it is 2⁻⁵ samples.
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

/// σ of a density that rises from 0: 1/√18 in Q0.16.
fn rising(width: f64) -> f64 {
    (width * (two_to(16) / 18f64.sqrt()).round() / two_to(16)).floor()
}

/// σ of a uniform distribution: 1/√12 in Q0.16.
fn uniform(width: f64) -> f64 {
    (width * (two_to(16) / 12f64.sqrt()).round() / two_to(16)).floor()
}
