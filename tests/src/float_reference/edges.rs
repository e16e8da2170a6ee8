//! Edge fit of a clipped echo in real numbers: solved in closed form instead of searched.

use std::f64::consts::PI;

use crate::vectors::pulse;

/// A waveform and a clipped run in it; amplitudes are fractions of full scale, times are samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clipped<'a> {
    /// Full width at half maximum.
    pub(super) width: f64,
    /// Waveform without baseline.
    pub(super) x: &'a [f64],
    /// Clip level, without baseline.
    pub(super) level: f64,
    /// First sample of the run.
    pub(super) first: usize,
    /// Last sample of the run.
    pub(super) last: usize,
    /// σ of a sample without light.
    pub(super) sigma: f64,
    /// Shot-noise variance of a signal of 1.
    pub(super) shot: f64,
}

impl Clipped<'_> {
    /// Time and its σ; `None` when the run touches an end of the waveform.
    pub(super) fn fit(&self) -> Option<(f64, f64)> {
        let nearest = self.pair(1)?;
        let pairs = (1..=3).map_while(|i| self.pair(i).filter(|pair| pair.both_show));
        let (weights, sum) = pairs.fold((0.0, 0.0), |(weights, sum), pair| {
            let weight = pair.sigma.powi(-2);
            (weights + weight, sum + weight * pair.time)
        });
        Some(if weights > 0.0 {
            (sum / weights, weights.powf(-0.5))
        } else {
            (nearest.time, nearest.sigma)
        })
    }

    fn noise(&self, value: f64) -> f64 {
        (self.sigma.powi(2) + self.shot * value.max(0.0)).sqrt()
    }

    /// Largest value hidden in noise: the solution of v = 3 σ(v).
    fn hidden(&self) -> f64 {
        4.5 * self.shot + (20.25 * self.shot.powi(2) + 9.0 * self.sigma.powi(2)).sqrt()
    }

    /// Pulse p at a time after its beginning.
    fn p(&self, x: f64) -> f64 {
        pulse(x - self.width, self.width)
    }

    fn slope(&self, x: f64) -> f64 {
        (PI / (2.0 * self.width) * (PI * x / self.width).sin()).abs()
    }

    fn pair(&self, i: usize) -> Option<Pair> {
        let (before, after) = (self.first.checked_sub(i)?, self.last + i);
        let (left, right) = (self.x[before], *self.x.get(after)?);
        let slack = 2.0 * self.width - (after - before) as f64;
        let shows = |v: f64| v > 3.0 * self.noise(v);
        let (x, sigma) = match (shows(left), shows(right)) {
            (true, true) => self.both(left, right, slack),
            (true, false) => self.one(left, slack),
            (false, true) => {
                let (x, sigma) = self.one(right, slack);
                (slack - x, sigma)
            }
            (false, false) => self.neither(slack),
        };
        let time = ((before + after) as f64 + slack) / 2.0 - x;
        Some(Pair { both_show: shows(left) && shows(right), time, sigma: sigma.max(1.0 / 1024.0) })
    }

    /// sin(a (D − x)) = s sin(a x), a = π/L, s = √(v_r/v_l):  tan(a x) = sin(a D) / (s + cos(a D)).
    fn both(&self, left: f64, right: f64, slack: f64) -> (f64, f64) {
        if slack <= 0.0 {
            return (slack / 2.0, (1.0 - slack) / 4.0);
        }
        let a = PI / (2.0 * self.width);
        let (sin, cos) = (a * slack).sin_cos();
        let x = sin.atan2((right / left).sqrt() + cos) / a;
        let x = x.clamp((slack - self.width).max(0.0), slack.min(self.width));
        let moved = (self.p(slack - x) * self.noise(left)).hypot(self.p(x) * self.noise(right));
        (x, moved / (left * self.slope(slack - x) + right * self.slope(x)))
    }

    fn one(&self, value: f64, slack: f64) -> (f64, f64) {
        let least = slack.max(0.0) / (1.0 + (self.hidden() / value).sqrt());
        let most = ((slack + 1.0) / (1.0 + (self.level / value).sqrt())).max(least);
        let sigma = (most - least) / 18f64.sqrt() + (slack.max(0.0) - least) / 6.0;
        (least + 2.0 * (most - least) / 3.0, sigma)
    }

    fn neither(&self, slack: f64) -> (f64, f64) {
        let shown = (1.0 + slack / 2.0).clamp(1.0 / 16.0, 2.0);
        let hidden = (self.hidden() / self.level).sqrt() * shown;
        let (least, most) = ((slack - hidden).max(-1.0), hidden.min(slack + 1.0));
        let doubt = hidden / 6.0 + (slack / 2.0 - hidden).max(0.0);
        (slack / 2.0, (most - least).max(0.0) / 12f64.sqrt() + doubt)
    }
}

struct Pair {
    both_show: bool,
    time: f64,
    sigma: f64,
}
