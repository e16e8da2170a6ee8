//! Order statistics by sorting, and the ambient level.

use std::f64::consts::PI;

use echoloop_dsp::MAX_SAMPLES;
use echoloop_dsp::choice::AmbientEstimator;

use super::config::BitTrue;
use super::numbers::{nearest, two_to};
use super::values::Statistics;

impl BitTrue {
    /// Median and median absolute deviation, by sorting.
    pub fn statistics(&self, codes: &[u16]) -> Statistics {
        let values: Vec<f64> = codes.iter().take(MAX_SAMPLES).map(|&c| f64::from(c)).collect();
        if values.is_empty() {
            return Statistics { median: 0.0, deviation: 0.0, ambient: 0.0, sigma: 0.0 };
        }
        let half = values.len() as f64 / 2.0;
        let of_codes = Order::from_values(values.clone());
        let of_deviations =
            Order::from_values(values.iter().map(|v| (v - of_codes.middle).abs()).collect());
        let fine = self.code * two_to(4);
        // v − ½ + (share − below)/at, in units of 1/`fine` of a code, the quotient rounded down.
        let grouped = |order: &Order| {
            (order.middle - 0.5) * fine + ((order.share - order.below) * fine / order.at).floor()
        };
        let mad = if of_deviations.middle == 0.0 {
            (half * fine / (2.0 * of_deviations.at)).floor()
        } else {
            grouped(&of_deviations)
        };
        let by_mad = nearest(mad * nearest(1.4826 * two_to(14)) / two_to(14));
        let is_clipped = of_codes.middle <= of_deviations.middle;
        let by_upper = if is_clipped {
            let count = values.len() as f64;
            let high = grouped(&Order::of_share(values, 7.0 / 8.0));
            if of_codes.middle == 0.0 {
                let slope = (2.0 * PI).sqrt();
                let zeros = (nearest(slope * two_to(14)) * of_codes.at / count).floor();
                let quantiles = nearest((1.1503 + 0.5 * slope) * two_to(14)) - zeros;
                let above = (high - 0.5 * fine).max(0.0);
                (above * two_to(14) / quantiles.max(1.0)).floor()
            } else {
                let above = (high - grouped(&of_codes)).max(0.0);
                nearest(above * nearest(two_to(14) / 1.1503) / two_to(14))
            }
        } else {
            0.0
        };
        Statistics {
            median: of_codes.middle,
            deviation: of_deviations.middle,
            ambient: nearest(grouped(&of_codes) / two_to(4)),
            sigma: by_mad.max(by_upper),
        }
    }

    /// Replaces the ambient by that of the estimator in the settings; `before` are the codes before
    /// the trigger.
    pub fn with_ambient(&self, statistics: Statistics, before: &[u16]) -> Statistics {
        let sum: f64 = before.iter().map(|&code| f64::from(code)).sum();
        let ambient = match self.ambient {
            AmbientEstimator::PreTrigger if !before.is_empty() => {
                (sum * self.code / before.len() as f64).floor()
            }
            AmbientEstimator::None => self.black,
            _ => statistics.ambient,
        };
        Statistics { ambient, ..statistics }
    }
}

/// Middle of sorted values, or another of their quantiles, with the numbers of values below it and
/// equal to it.
pub struct Order {
    /// Smallest value with at least half of all values, or another share, at or below it.
    pub middle: f64,
    /// Half of the number of values, or another share of it.
    pub share: f64,
    /// Number of values below the middle.
    pub below: f64,
    /// Number of values equal to the middle.
    pub at: f64,
}

impl Order {
    /// Order of at least one value.
    pub fn from_values(values: Vec<f64>) -> Self {
        Self::of_share(values, 0.5)
    }

    /// Quantile of at least one value.
    pub fn of_share(mut values: Vec<f64>, share: f64) -> Self {
        values.sort_by(f64::total_cmp);
        let share = share * values.len() as f64;
        let middle = values[share.ceil() as usize - 1];
        let below = values.iter().filter(|&&v| v < middle).count() as f64;
        let at = values.iter().filter(|&&v| v == middle).count() as f64;
        Self { middle, share, below, at }
    }
}
