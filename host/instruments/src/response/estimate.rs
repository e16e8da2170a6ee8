//! Estimate of an instrument's response from its own recording.

use super::curve::{Curve, FLAT, Family, PER_WIDTH};
use super::doubt::take_out;
use super::fit::{Fit, Part, samples};
use super::model::Later;
use super::robust::{beyond, densest_half, median, sigma_of_magnitudes};
use super::strong::Strong;

/// Default least number of strong echoes of a recording. What fewer have in common may come from
/// their targets.
pub const LEAST_ECHOES: usize = 40;

/// Least number of narrow echoes.
const FEWEST_NARROW: usize = 24;

/// Least number of values at a lag for a level and a spread; see [`densest_half`].
const FEWEST_VALUES: usize = 6;

/// Greatest number of averaged echoes: noise falls only with the root of their number.
const MOST: usize = 400;

/// Greatest width of a narrow echo, over that of the narrowest tenth.
const NARROW: f64 = 1.2;

/// Range of the response before and after its top, pulse widths.
const BEFORE: f64 = 2.5;
const AFTER: f64 = 12.0;

/// End of the main lobe, pulse widths from the top.
pub(super) const LOBE: f64 = 1.2;

/// Greatest spread of an instrument's own beside its lobe, over its level; and the greatest where
/// it has hardly a level, over the height: drift and wide surfaces move that.
const VARIES: f64 = 0.35;
const LEAST_VARIED: f64 = 0.01;

/// Rounds of averaging and aligning.
const ROUNDS: usize = 3;

/// Level and spread of a response.
#[derive(Clone, Debug)]
pub(super) struct Estimate {
    pub(super) curve: Curve,
    /// Spread of single echoes at each point, beyond noise, over their height.
    pub(super) spread: Vec<f64>,
    /// Number of averaged echoes.
    pub(super) echoes: usize,
    /// Later tops that may be targets; they are not in the curve.
    pub(super) doubtful: Vec<Later>,
    /// Share of the strong echoes that are narrow.
    pub(super) narrow: f64,
}

impl Estimate {
    /// Estimates from echoes, some of which have other echoes behind them.
    ///
    /// ```text
    /// narrow   width ≤ 1.2 times that of the narrowest tenth; at least 24 echoes, or three fifths
    ///          of fewer than 40; of them the 400 with the least noise
    /// h(lag)   mean of the densest half of x(t + lag)/A over the echoes
    /// t, A     least squares against h within 0.8 widths; 3 rounds with h. In the second only the
    ///          half stays that differs least from h after its lobe: the others have more echoes
    /// spread   σ of the densest half of n, without noise · (1 + 2/√n); on the lobe, σ of the
    ///          residuals of a fit of height, time and surface; beside it at most 0.35·max |h|
    ///          within half a width, or 0.01: before it without the lobe's, as light does not come
    ///          before the pulse
    /// ```
    ///
    /// Where the densest half is wider than noise and a third of its level explain, the records
    /// differ by their targets. Echoes only add, so h is then the lower end of the values: their
    /// lowest fifth, corrected for noise. Later tops that may be targets are taken out: see
    /// [`take_out`].
    ///
    /// `pulses` are the emitted pulses, as far as they were recorded. `None` with fewer than
    /// `least` echoes.
    pub(super) fn of(strong: &[Strong], least: usize, pulses: &[Strong]) -> Option<Self> {
        let (mut narrow, share) = narrow(strong, least)?;
        let width = narrow.iter().map(|s| s.width).sum::<f64>() / narrow.len() as f64;
        let mut estimate = averaged(&narrow, width)?;
        for round in 1..=ROUNDS {
            narrow.iter_mut().for_each(|s| align(s, &estimate.curve));
            if round == 2 && narrow.len() >= 2 * FEWEST_NARROW {
                keep_plainer_half(&mut narrow, &estimate.curve);
            }
            estimate = averaged(&narrow, width)?;
        }
        estimate.narrow = share;
        estimate.refine_lobe(&narrow);
        estimate.limit_spread();
        estimate.doubtful = take_out(&mut estimate.curve, &mut estimate.spread, strong, pulses);
        Some(estimate)
    }

    /// Limits the spread beside the lobe to what the instrument's own can vary by, see
    /// [`Estimate::of`]; what varies more are other targets.
    fn limit_spread(&mut self) {
        let lobe = LOBE * self.curve.width;
        let reach = (PER_WIDTH / 2.0) as usize;
        for (point, spread) in self.spread.iter_mut().enumerate() {
            let (lag, values) = (self.curve.time(point), &self.curve.values);
            if lag.abs() <= lobe {
                continue;
            }
            let around = point.saturating_sub(reach)..(point + reach + 1).min(values.len());
            let is_beside = |&k: &usize| lag > 0.0 || self.curve.time(k) < -lobe;
            let level = around.filter(is_beside).map(|k| values[k].abs()).fold(0.0, f64::max);
            *spread = spread.min((VARIES * level).max(LEAST_VARIED));
        }
    }

    /// Sets the spread on the lobe to that of the residuals of a fit of height, time and surface.
    fn refine_lobe(&mut self, narrow: &[Strong]) {
        let family = Family::new(self.curve.clone());
        let noise = noise(narrow);
        let residuals: Vec<Strong> = narrow.iter().map(|s| unexplained(s, &family)).collect();
        let lobe = LOBE * self.curve.width;
        for (point, spread) in self.spread.iter_mut().enumerate() {
            let lag = self.curve.time(point);
            if lag.abs() < lobe {
                let mut off: Vec<f64> =
                    residuals.iter().filter_map(|s| Some(s.at(s.time + lag)?.abs())).collect();
                *spread = beyond(sigma_of_magnitudes(&mut off), noise);
            }
        }
    }
}

/// Greatest width of a narrow echo, of at least one.
pub(super) fn narrow_limit(strong: &[Strong]) -> f64 {
    let mut widths: Vec<f64> = strong.iter().map(|s| s.width).collect();
    widths.sort_by(f64::total_cmp);
    NARROW * widths[widths.len() / 10]
}

/// Narrow echoes, least noise first, and their share; `None` with too few echoes.
fn narrow(strong: &[Strong], least: usize) -> Option<(Vec<Strong>, f64)> {
    if strong.len() < least.max(FEWEST_VALUES) {
        return None;
    }
    let mut order: Vec<&Strong> = strong.iter().collect();
    order.sort_by(|a, b| a.width.total_cmp(&b.width));
    let limit = narrow_limit(strong);
    let enough = FEWEST_NARROW.min(3 * order.len() / 5);
    let within = order.iter().filter(|s| s.width <= limit).count();
    let share = within as f64 / order.len() as f64;
    let count = within.max(enough);
    order.truncate(count);
    order.sort_by(|a, b| a.noise().total_cmp(&b.noise()));
    Some((order.into_iter().take(MOST).cloned().collect(), share))
}

/// Median noise of a sample, over the echo's height.
fn noise(narrow: &[Strong]) -> f64 {
    median(&mut narrow.iter().map(Strong::noise).collect::<Vec<_>>())
}

/// Level and spread at every lag. `None` without a top.
fn averaged(narrow: &[Strong], width: f64) -> Option<Estimate> {
    let (step, noise) = (width / PER_WIDTH, noise(narrow));
    let points = 0..((BEFORE + AFTER) * PER_WIDTH) as usize;
    let level = |point: usize| {
        let lag = point as f64 / PER_WIDTH - BEFORE;
        let values = narrow.iter().filter_map(|s| s.at(s.time + lag * width));
        let (level, spread) = most(values.collect(), lag, noise);
        // Tapers to 0 within a width of either end.
        (level * (lag + BEFORE).min(AFTER - lag).clamp(0.0, 1.0), spread)
    };
    let (levels, spread) = points.map(level).unzip();
    let curve = Curve::normal(levels, step)?;
    Some(Estimate { curve, spread, echoes: narrow.len(), doubtful: Vec::new(), narrow: 0.0 })
}

/// Level and spread of the values at a lag, pulse widths; 0 with too few values.
fn most(mut values: Vec<f64>, lag: f64, noise: f64) -> (f64, f64) {
    if values.len() < FEWEST_VALUES {
        return (0.0, 0.0);
    }
    values.sort_by(f64::total_cmp);
    let (level, spread) = densest_half(&values);
    let steady = (3.0 * noise).max(0.02).max(VARIES * level.abs());
    if lag.abs() < LOBE || spread <= steady {
        let inexact = 1.0 + 2.0 / (values.len() as f64).sqrt();
        return (level, beyond(spread, noise * inexact));
    }
    // The lowest fifth of normal values ends 0.84 σ below their middle, the lowest twentieth
    // another 0.80 σ below.
    let (fifth, twentieth) = (values[values.len() / 5], values[values.len() / 20]);
    (level.min(fifth + 0.84 * noise), beyond((fifth - twentieth) / 0.80, noise))
}

/// Fits height and time of a record's echo to the response by least squares.
fn align(strong: &mut Strong, curve: &Curve) {
    let reach = 0.8 * curve.width;
    for _ in 0..3 {
        let range = samples(strong.time - reach..strong.time + reach, strong.x.len());
        let [mut aa, mut ab, mut bb, mut ar, mut br] = [0.0; 5];
        for n in range {
            let (value, slope) = curve.at(n as f64 - strong.time);
            let (b, r) = (-strong.height * slope, strong.x[n] - strong.height * value);
            aa += value * value;
            ab += value * b;
            bb += b * b;
            ar += value * r;
            br += b * r;
        }
        let det = aa * bb - ab * ab;
        let height = strong.height + (bb * ar - ab * br) / det;
        if !(det > 0.0 && height > 0.5 * strong.height) {
            return;
        }
        strong.height = height;
        strong.time += ((aa * br - ab * ar) / det).clamp(-0.5, 0.5);
    }
}

/// Keeps the half whose samples after the lobe differ least from the response.
fn keep_plainer_half(narrow: &mut Vec<Strong>, curve: &Curve) {
    let off = |s: &Strong| {
        let after = s.time + LOBE * curve.width..s.time + AFTER * curve.width;
        let range = samples(after, s.x.len());
        let count = range.len().max(1) as f64;
        range.map(|n| (s.x[n] / s.height - curve.at(n as f64 - s.time).0).abs()).sum::<f64>()
            / count
    };
    let half = narrow.len().div_ceil(2);
    let mut by_difference: Vec<_> = narrow.drain(..).map(|strong| (off(&strong), strong)).collect();
    by_difference.sort_by(|a, b| a.0.total_cmp(&b.0));
    narrow.extend(by_difference.into_iter().take(half).map(|(_, strong)| strong));
}

/// A record minus its echo, fitted as the response on a surface.
fn unexplained(strong: &Strong, family: &Family) -> Strong {
    let width = family.response().width;
    let lobe = strong.time - LOBE * width..strong.time + LOBE * width;
    let range = samples(lobe, strong.x.len());
    let mut part = [Part { height: strong.height, time: strong.time, surface: FLAT }];
    Fit { family, x: &strong.x, range, leash: width }.run(&mut part);
    let [part] = part;
    let mut left = Strong { time: part.time, ..strong.clone() };
    part.add(family, -1.0, &mut left.x);
    left
}

#[cfg(test)]
mod tests {
    use echoloop_random::Generator;

    use super::*;

    #[test]
    fn noise_alone_is_hardly_ever_a_spread_of_few_echoes() {
        let spreads = (0..200).filter(|&seed| {
            let noise = 0.03;
            let values = Generator::new(seed, 0).normals(24).iter().map(|z| noise * z).collect();
            most(values, 3.0, noise).1 > 0.0
        });
        // The spread of as many values is as often above as below their noise.
        let found = spreads.count();
        assert!(found < 50, "{found} of 200");
    }
}
