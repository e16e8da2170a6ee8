//! Time and height of a clipped echo, from the edges that are not clipped.
#![expect(
    clippy::arithmetic_side_effects,
    reason = "samples are Q1.15, times within 2400 samples 2²⁸, of a pulse 2²³, p and its slope \
              at most 2³¹, σ at most 2¹⁹; divisors are at least 1"
)]

use crate::clipped::pulse::Pulse;
use crate::stages::noise::Noise;

/// Time and amplitude that the edges of a clipped pulse give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edges {
    /// Middle of the pulse, Q16.16 samples since sample 0.
    pub time: i64,
    /// Amplitude of the pulse as if it were not clipped, Q1.15, at most [`MAX_AMPLITUDE`].
    pub amplitude: i64,
    /// σ of the time, Q16.16 samples.
    pub sigma: u32,
}

/// Highest amplitude that is estimated: 1024 times full scale.
pub const MAX_AMPLITUDE: i64 = 1 << 25;

/// Number of pairs of samples that the edges are read from, nearest first.
const EDGE: usize = 3;

/// Width at which bisection stops, 2⁻⁵ samples; within it a straight line is good to 2⁻¹².
const RESOLUTION: i64 = 1 << 11;

/// Lowest σ of a time, 2⁻¹⁰ samples.
const LEAST_SIGMA: i64 = 1 << 6;

/// Fits the emitted pulse to the edges of a run of clipped samples.
///
/// ```text
/// p(u) = sin²(πu/L)                    u samples after the pulse began, L = 2 W f_s
/// n_l  = first − i,  n_r = last + i    a sample of each edge, i = 1, 2, 3; v_l, v_r their values
/// x_l  = n_l − begin,  x_r = end − n_r
/// D    = L − (n_r − n_l) = x_l + x_r   known, whatever the amplitude
/// v_l p(x_r) = v_r p(x_l)              both are of one height A: solved for x_l
/// A    = (v_l + v_r) / (p(x_l) + p(x_r))
/// time = (n_l + n_r)/2 + (x_r − x_l)/2
/// σ_x  = √((p(x_r) σ(v_l))² + (p(x_l) σ(v_r))²) / (v_l p′(x_r) + v_r p′(x_l))
/// ```
///
/// | name | meaning | format |
/// |---|---|---|
/// | `x` | samples without baseline | Q1.15 |
/// | shows | v > 3 σ(v); else v counts as 0 | |
/// | h | [`Noise::hidden`], the highest value that does not show | Q1.15 |
/// | `x_l`, time; σ | of a pair; σ at least 2⁻¹⁰ samples | Q16.16 |
/// | `A` | of the nearest pair, at least `level` | Q1.15 |
///
/// Products, quotients, halves and roots are rounded down; roots of ratios are at most 2⁸, divisors
/// at least one LSB. Derived, with a figure, in `benches/record/detector.md`, The edges of a
/// clipped echo.
#[derive(Clone, Copy, Debug)]
pub struct EdgeFit<'a> {
    /// Emitted pulse.
    pub pulse: &'a Pulse,
    /// Noise of a sample.
    pub noise: &'a Noise,
    /// Saturation level S without baseline, Q1.15, at least 1.
    pub level: i64,
}

/// Run of clipped samples: the indices of its first and last sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// Index of the first sample.
    pub first: usize,
    /// Index of the last sample.
    pub last: usize,
}

impl EdgeFit<'_> {
    /// Fits the edges of a run of `x`; `None` where it touches an end of the waveform.
    ///
    /// | name | of up to three pairs | format |
    /// |---|---|---|
    /// | w | ⌊2⁴⁰/σ²⌋, at least 1 | integer |
    /// | time | that of the nearest + ⌊Σ w (time − that) / Σ w⌋ | Q16.16 |
    /// | σ of the time | ⌊√⌊2⁴⁰/Σ w⌋⌋, at least 2⁻¹⁰; of one pair its own | Q16.16 |
    #[inline(never)]
    pub fn fit(&self, x: &[i16], run: Run) -> Option<Edges> {
        let nearest = self.pair(x, run, 1)?;
        let solved = self.solve(&nearest);
        let (mut sum, mut weights) = (0, weight(&solved));
        // Pairs count as long as both values show.
        let farther = (2..=EDGE).map_while(|i| self.pair(x, run, i)).take_while(Pair::both_show);
        // A nearest pair with a hidden value gives only bounds, which others would not improve.
        for pair in farther.take(if nearest.both_show() { EDGE } else { 0 }) {
            let farther = self.solve(&pair);
            let delay = pair.time(self.pulse, farther.x) - nearest.time(self.pulse, solved.x);
            sum += weight(&farther) * delay;
            weights += weight(&farther);
        }
        let alone = weights == weight(&solved);
        let sigma = match alone {
            true => solved.sigma as u64,
            false => ((1u64 << 40) / weights.max(1) as u64).isqrt(),
        };
        Some(Edges {
            time: nearest.time(self.pulse, solved.x) + sum.div_euclid(weights.max(1)),
            amplitude: solved.amplitude.max(self.level).min(MAX_AMPLITUDE),
            sigma: sigma.clamp(LEAST_SIGMA as u64, u32::MAX.into()) as u32,
        })
    }

    /// Amplitude of [`Self::fit`] alone, which the nearest pair gives.
    #[inline(never)]
    pub fn amplitude(&self, x: &[i16], run: Run) -> Option<i64> {
        let solved = self.solve(&self.pair(x, run, 1)?);
        Some(solved.amplitude.max(self.level).min(MAX_AMPLITUDE))
    }

    /// Pair of samples `i` before the run and `i` after it; a value that noise hides is 0.
    fn pair(&self, x: &[i16], run: Run, i: usize) -> Option<Pair> {
        let (left, right) = (run.first.checked_sub(i)?, run.last.checked_add(i)?);
        let hides = |v: i16| self.noise.hides(v.into());
        let value = |n: usize| x.get(n).map(|&v| if hides(v) { 0 } else { i64::from(v) });
        Some(Pair { left: left as i64, right: right as i64, values: (value(left)?, value(right)?) })
    }

    fn solve(&self, pair: &Pair) -> Solved {
        let slack = pair.slack(self.pulse);
        let mut solved = match pair.values {
            (0, 0) => self.neither(slack),
            (left, 0) => self.one(left, slack),
            (0, right) => {
                let mirrored = self.one(right, slack);
                Solved { x: slack - mirrored.x, ..mirrored }
            }
            (left, right) => self.both(left, right, slack),
        };
        solved.sigma = solved.sigma.max(LEAST_SIGMA);
        solved
    }

    /// Solves a pair in which both values show: x is the root of F(x) = v_l p(D − x) − v_r p(x),
    /// which falls.
    ///
    /// Bisected in max(0, D − ⌊L/2⌋) ..= min(D, ⌊L/2⌋) to 2⁻⁵ samples, then by a line: low +
    /// (high − low) a / (a − b) with a = max(F(low), 0), b = min(F(high), 0), F in Q17.45, a and
    /// a − b shifted right by 15. A run longer than the pulse, D ≤ 0, has its middle as its time,
    /// the higher value as its A and ¼ − ⌊D/4⌋ as its σ.
    fn both(&self, left: i64, right: i64, slack: i64) -> Solved {
        let pulse = self.pulse;
        if slack <= 0 {
            return Solved {
                x: slack >> 1,
                amplitude: left.max(right),
                sigma: (1 << 14) - (slack >> 2),
            };
        }
        let uneven = |x: i64| left * pulse.at(slack - x) - right * pulse.at(x);
        let (mut low, mut high) = ((slack - pulse.width()).max(0), slack.min(pulse.width()));
        while high - low > RESOLUTION {
            let middle = (low + high) >> 1;
            if uneven(middle) > 0 { low = middle } else { high = middle }
        }
        let (above, below) = (uneven(low).max(0), uneven(high).min(0));
        let x = low + (high - low) * (above >> 15) / ((above - below) >> 15).max(1);
        let amplitude = ((left + right) << 30) / (pulse.at(x) + pulse.at(slack - x)).max(1);
        Solved { x, amplitude, sigma: self.sigma_of_both(left, right, x, slack) }
    }

    /// σ_x: p there in Q1.15, σ² in Q2.30, at most 4, root and denominator Q2.30, at most 256
    /// samples.
    #[inline(always)]
    fn sigma_of_both(&self, left: i64, right: i64, x: i64, slack: i64) -> i64 {
        let pulse = self.pulse;
        // p² Q30 · σ² Q38 >> 8, its root Q30; v Q15 · p′ Q30 >> 15.
        let part = |p: i64, value: i64| {
            let p = (p >> 15) as u64;
            p * p * (self.noise.variance(value, 1 << 15) >> 8).min(1 << 32)
        };
        let shift = (part(pulse.at(slack - x), left) + part(pulse.at(x), right)).isqrt();
        let stiffness = (left * pulse.slope(slack - x) + right * pulse.slope(x)) >> 15;
        ((shift << 16) / (stiffness.max(1) as u64)).min(1 << 24) as i64
    }

    /// Solves a pair in which one value shows, between two bounds: A = v / p(x).
    ///
    /// ```text
    /// x from max(D, 0) / (1 + √(h/v)) to (D + 1) / (1 + √(level/v)),  two thirds of the way
    /// σ = (to − from)/√18 + (max(D, 0) − from)/6
    /// ```
    fn one(&self, value: i64, slack: i64) -> Solved {
        let hidden = root_of_ratio(self.noise.hidden(), value);
        let clipped = root_of_ratio(self.level, value);
        let least = (slack.max(0) << 16) / ((1 << 16) + hidden);
        let most = least.max(((slack + (1 << 16)) << 16) / ((1 << 16) + clipped));
        let x = least + 2 * (most - least) / 3; // the mean of a rising density
        Solved {
            x,
            amplitude: (value << 30) / self.pulse.at(x).max(1),
            sigma: rising(most - least) + (slack.max(0) - least) / 6,
        }
    }

    /// Solves a pair in which no value shows, as both edges fall between two samples: A = level /
    /// p((1 + D/2)/2).
    ///
    /// ```text
    /// x = D/2,  t = √(h/level)·(1 + D/2)               1 + D/2 within 1/16 ..= 2
    /// x_l in max(−1, D − t) ..= min(t, D + 1)
    /// σ = width of that/√12 + t/6 + max(D/2 − t, 0)
    /// ```
    fn neither(&self, slack: i64) -> Solved {
        let reach = ((1 << 16) + (slack >> 1)).clamp(1 << 12, 1 << 17);
        let hidden = (root_of_ratio(self.noise.hidden(), self.level) * reach) >> 16;
        let least = (slack - hidden).max(-1 << 16);
        let most = hidden.min(slack + (1 << 16)).max(least);
        let doubt = hidden / 6 + ((slack >> 1) - hidden).max(0);
        let amplitude = (self.level << 30) / self.pulse.at(reach >> 1).max(1);
        Solved { x: slack >> 1, amplitude, sigma: uniform(most - least) + doubt }
    }
}

/// ⌊2⁴⁰/σ²⌋, at least 1.
fn weight(solved: &Solved) -> i64 {
    ((1 << 40) / (solved.sigma * solved.sigma).max(1)).max(1)
}

/// A sample of each edge: indices, and values, which are 0 where noise hides them.
struct Pair {
    left: i64,
    right: i64,
    values: (i64, i64),
}

/// Solution for a pair: x of the left sample, A, σ of x.
struct Solved {
    x: i64,
    amplitude: i64,
    sigma: i64,
}

impl Pair {
    fn both_show(&self) -> bool {
        self.values.0 > 0 && self.values.1 > 0
    }

    /// D.
    fn slack(&self, pulse: &Pulse) -> i64 {
        2 * pulse.width() - ((self.right - self.left) << 16)
    }

    fn time(&self, pulse: &Pulse, x: i64) -> i64 {
        (((self.left + self.right) << 16) + self.slack(pulse) - 2 * x) >> 1
    }
}

/// √(a/b), Q16.16, rounded down, at most 2⁸: `b` at least 1.
fn root_of_ratio(a: i64, b: i64) -> i64 {
    (((a << 32) / b.max(1)) as u64).isqrt().min(1 << 24) as i64
}

/// σ of a distribution that rises from 0 in proportion: width / √18, 15 447/2¹⁶.
fn rising(width: i64) -> i64 {
    (width * 15_447) >> 16
}

/// σ of a uniform distribution: width / √12, 18 919/2¹⁶.
fn uniform(width: i64) -> i64 {
    (width * 18_919) >> 16
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    const QUIET: Noise = Noise { sigma: 100, shot: 0 }; // 6 LSB of Q1.15

    fn fit(pulse: &Pulse, x: &[i16], first: usize, last: usize) -> Option<Edges> {
        EdgeFit { pulse, noise: &QUIET, level: 16_384 }.fit(x, Run { first, last })
    }

    /// Q1.15 samples of a pulse of 5 samples a width around `middle`, clipped at half of full
    /// scale.
    fn clipped(middle: f64, amplitude: f64) -> (Vec<i16>, usize, usize) {
        let value = |n: usize| {
            let u = n as f64 - middle;
            let p = if u.abs() < 5.0 {
                0.5 + 0.5 * libm::cos(core::f64::consts::PI * u / 5.0)
            } else {
                0.0
            };
            (amplitude * p * 32768.0).min(16_384.0) as i16
        };
        let x: Vec<i16> = (0..60).map(value).collect();
        let first = x.iter().position(|&v| v == 16_384).unwrap();
        let last = x.iter().rposition(|&v| v == 16_384).unwrap();
        (x, first, last)
    }

    #[test]
    fn edges_give_the_time_and_the_height_of_what_was_clipped() {
        let pulse = Pulse::new(5_000, 1_000_000);
        for amplitude in [0.55, 1.0, 3.0, 6.0] {
            for phase in 0..32 {
                let middle = 30.0 + f64::from(phase) / 32.0;
                let (x, first, last) = clipped(middle, amplitude);
                let edges = fit(&pulse, &x, first, last).unwrap();
                // Else an edge fell between two samples.
                let shows = x[first - 1].min(x[last + 1]) > 100;
                let error = edges.time as f64 / 65536.0 - middle;
                let bound = if shows { 0.01 } else { 0.05 };
                assert!(
                    error.abs() < bound,
                    "amplitude {amplitude}, middle {middle}: {error} samples"
                );
                let height = edges.amplitude as f64 / 32768.0;
                if !shows {
                    continue;
                }
                assert!(
                    (height / amplitude - 1.0).abs() < 0.03,
                    "amplitude {amplitude}, middle {middle}: {height}"
                );
            }
        }
    }

    #[test]
    fn an_edge_between_two_samples_is_only_bounded_and_sigma_says_so() {
        let pulse = Pulse::new(5_000, 1_000_000);
        for phase in 0..64 {
            let middle = 30.0 + f64::from(phase) / 64.0;
            let (x, first, last) = clipped(middle, 1_000.0);
            let edges = fit(&pulse, &x, first, last).unwrap();
            let error = (edges.time as f64 / 65536.0 - middle).abs();
            let sigma = f64::from(edges.sigma) / 65536.0;
            assert!(
                error < 0.5 && error < 3.0 * sigma + 0.02,
                "middle {middle}: {error} samples, σ {sigma}"
            );
        }
    }

    #[test]
    fn a_run_at_an_end_of_the_waveform_has_no_edges() {
        let pulse = Pulse::new(5_000, 1_000_000);
        let (x, first, last) = clipped(30.0, 2.0);
        assert_eq!(fit(&pulse, &x[first..], 0, last - first), None);
        assert_eq!(fit(&pulse, &x[..=last], first, last), None);
        assert_eq!(fit(&pulse, &[], 0, 0), None);
    }
}
