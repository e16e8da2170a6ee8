//! Intervals and tests for the results of experiments: numbers in, numbers out.
//!
//! Two settings were tried on the same eight pairs. Is the second better?
//!
//! ```
//! use echoloop_statistics::{mean_interval, paired_difference, sign_test, wilson};
//!
//! let first_cm = [1.2, 3.4, 0.9, 2.2, 1.8, 2.9, 1.1, 4.0];
//! let second_cm = [0.8, 2.9, 0.7, 1.6, 1.9, 2.1, 0.9, 2.8];
//!
//! let gain = paired_difference(&first_cm, &second_cm);
//! assert!(gain.value < 0.0 && !gain.holds(0.0));      // shorter, and chance is out
//!
//! let [low, high] = mean_interval(&second_cm);        // of the mean 1.71 cm
//! assert!(1.0 < low && low < 1.71 && 1.71 < high && high < 2.5);
//!
//! let [low, high] = wilson(7.0 / 8.0, 8.0);           // recall: 7 of 8 pairs found
//! assert!(0.52 < low && high < 0.98);
//!
//! assert!(sign_test(1, 6) > 0.05);                    // 6 pairs gained, 1 lost: may be chance
//! ```
//!
//! | function | gives | source |
//! |---|---|---|
//! | [`median`], [`quantile`], [`mean`] | a figure of values | |
//! | [`standard_error`], [`paired_standard_error`] | standard error of a mean | |
//! | [`paired_t`] | mean difference in its standard errors | Student 1908 |
//! | [`bootstrap`], [`mean_interval`], [`paired_difference`] | 95 % interval | Efron 1993 |
//! | [`mean_of_groups`] | 95 % interval of a mean over runs | the same, Ch. 8 |
//! | [`wilson`] | 95 % interval of a share | Wilson 1927 |
//! | [`sign_test`] | p-value of wins against losses | McNemar 1947 |
//!
//! Values and their intervals share a unit; a share lies within 0 and 1. The mean of nothing, and
//! any other figure that does not exist, is NaN. Equal values give equal intervals, on every
//! machine: the seeds of the resamples are fixed.

mod bootstrap;
mod groups;
mod moments;
mod paired;
mod share;

use serde::Serialize;

pub use bootstrap::{bootstrap, mean_interval};
pub use groups::mean_of_groups;
pub use moments::{mean, median, quantile, standard_error};
pub use paired::{paired_difference, paired_standard_error, paired_t};
pub use share::{sign_test, wilson};

/// A figure and its 95 % interval. NaN where there is none, as the mean of nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The figure.
    pub value: f64,
    /// Lower and upper end.
    pub interval: [f64; 2],
}

impl Estimate {
    /// A figure of `count` things with its [`bootstrap`] interval.
    pub fn by_bootstrap(count: usize, figure: &dyn Fn(&[usize]) -> f64) -> Self {
        let value = figure(&(0..count).collect::<Vec<_>>());
        Self { value, interval: bootstrap(count, figure) }
    }

    /// True when the interval holds a value: a difference whose interval holds 0 may be chance.
    pub fn holds(&self, value: f64) -> bool {
        let [low, high] = self.interval;
        (low..=high).contains(&value)
    }
}
