//! Axes for any data: bounds around the finite values, marks at round numbers, all other values at
//! the edge.

use std::ops::Range;

use plotters::coord::combinators::{IntoLogRange, LogCoord};
use plotters::coord::ranged1d::{
    BoldPoints, KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter,
};
use plotters::coord::types::RangedCoordf64;

use super::format::{fixed, significant};

/// Ratio of the ends above which an axis becomes logarithmic.
const LOG_RATIO: f64 = 20.0;

/// Ratio of the ends below which powers of ten alone are too few marks.
const FEW_DECADES: f64 = 200.0;

/// Greatest end of a logarithmic axis, and one over its least: values beyond are drawn at the edge.
const MAX: f64 = 1e100;

/// A linear or logarithmic axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    low: f64,
    high: f64,
    log: bool,
    ticks: Vec<f64>,
    decimals: Option<usize>,
}

impl Axis {
    /// Exactly these bounds; unusable ones are replaced.
    pub(super) fn between(low: f64, high: f64, log: bool) -> Self {
        // plotters multiplies by ten until it passes the end of a logarithmic axis: near the
        // largest number it would loop for ever.
        let (low, high) = match log && low > 0.0 {
            true => (low.clamp(1.0 / MAX, MAX / 10.0), high.clamp(10.0 / MAX, MAX)),
            false => (low, high),
        };
        let (low, high) = match (high - low).is_finite() {
            true if low < high => (low, high),
            true if low == high => (low - 0.5, high + 0.5),
            _ => (0.0, 1.0),
        };
        let axis = Self { low, high, log: log && low > 0.0, ticks: vec![], decimals: None };
        if axis.log { axis.with_log_ticks() } else { axis.with_linear_ticks() }
    }

    /// Bounds a little beyond the finite values; logarithmic when these are positive and span more
    /// than [`LOG_RATIO`].
    pub(super) fn around(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = range(values);
        if low > 0.0 && high / low > LOG_RATIO {
            return Self::between(low / 1.2, high * 1.2, true);
        }
        let margin = 0.06 * (high - low);
        let least = if low >= 0.0 { 0.0 } else { f64::NEG_INFINITY };
        Self::between((low - margin).max(least), high + margin, false)
    }

    /// Logarithmic bounds a little beyond the finite positive values, each counted as at least
    /// `floor`.
    pub(super) fn log_around(values: impl Iterator<Item = f64>, floor: f64) -> Self {
        match range(values.filter(|v| *v > 0.0).map(|v| v.max(floor))) {
            (low, high) if low.is_finite() => {
                Self::between(low / 1.3, high.max(low * 5.0) * 1.3, true)
            }
            _ => Self::between(floor, floor * 100.0, true),
        }
    }

    /// Marks at the finite values of `ticks` instead of at round numbers.
    pub(super) fn with_ticks(self, ticks: &[f64]) -> Self {
        let ticks = ticks.iter().copied().filter(|tick| tick.is_finite()).collect();
        Self { ticks, decimals: None, ..self }
    }

    fn with_linear_ticks(mut self) -> Self {
        self.ticks = RangedCoordf64::from(self.range()).key_points(BoldPoints(8));
        let decimals =
            |tick: &f64| significant(*tick).split_once('.').map_or(0, |(_, digits)| digits.len());
        self.decimals = self.ticks.iter().map(decimals).max().filter(|decimals| *decimals > 0);
        self
    }

    fn with_log_ticks(mut self) -> Self {
        let decades =
            LogCoord::from((self.low / 10.0..self.high).log_scale()).key_points(BoldPoints(8));
        let digits: &[f64] =
            if self.high / self.low < FEW_DECADES { &[1.0, 2.0, 5.0] } else { &[1.0] };
        self.ticks = decades
            .iter()
            .flat_map(|decade| digits.iter().map(move |digit| digit * decade))
            .collect();
        self.ticks.retain(|tick| (self.low..=self.high).contains(tick));
        self
    }

    pub(super) fn is_log(&self) -> bool {
        self.log
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    /// Values beyond the bounds lie at the nearer end, NaN at the high end.
    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let value = if value.is_nan() { self.high } else { value.clamp(self.low, self.high) };
        match self.log {
            true => LogCoord::from(self.range().log_scale()).map(&value, limit),
            false => RangedCoordf64::from(self.range()).map(&value, limit),
        }
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        self.decimals.map_or_else(|| significant(*value), |decimals| fixed(*value, decimals))
    }
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks.iter().map(|tick| axis.format_ext(tick)).collect()
    }

    #[test]
    fn a_wide_span_turns_logarithmic() {
        let axis = Axis::around([0.03, f64::NAN, 4.0].into_iter());
        assert!(axis.is_log());
        assert_eq!(labels(&axis), ["0.05", "0.1", "0.2", "0.5", "1", "2"]);
        assert_eq!(
            labels(&Axis::between(1e-3, 1e3, true)),
            ["0.001", "0.01", "0.1", "1", "10", "100", "1000"]
        );
    }

    #[test]
    fn a_narrow_span_stays_linear_with_equal_decimals() {
        let axis = Axis::around([0.31, 1.12].into_iter());
        assert!(!axis.is_log());
        assert_eq!(labels(&axis), ["0.4", "0.6", "0.8", "1.0"]);
    }

    #[test]
    fn useless_values_still_give_an_axis() {
        let pairs = [
            [-1.0, 0.0],
            [1e-308, 1e308],
            [0.1, 1e308],
            [1e307, 1e308],
            [-1e308, 1e308],
            [1e16, 1e16 + 2.0],
            [1.0, 1.0 + 1e-15],
            [1e-12, 1e-2],
        ];
        let lone = [vec![], vec![f64::NAN], vec![f64::INFINITY], vec![2.0]];
        for values in lone.into_iter().chain(pairs.map(Vec::from)) {
            for axis in [
                Axis::around(values.iter().copied()),
                Axis::log_around(values.iter().copied(), 1e-3),
                Axis::between(f64::NAN, f64::INFINITY, true),
            ] {
                assert!(!axis.ticks.is_empty(), "{values:?}");
                assert_eq!([f64::NAN, f64::NEG_INFINITY].map(|v| axis.map(&v, (0, 100))), [100, 0]);
            }
        }
    }
}
