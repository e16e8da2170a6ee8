//! From values to places on the paper, and the round numbers along the way.

use libm::{exp10, log, log10};

use super::format::{fixed, significant};

/// Values that span more than this factor are easier to read on a logarithmic axis.
const LOG_RATIO: f64 = 20.0;

/// A linear or logarithmic axis from `low` at `start` to `high` at `end`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    log: bool,
    low: f64,
    high: f64,
    start: f64,
    end: f64,
}

impl Axis {
    /// Exactly these bounds, made usable if they are not.
    pub(super) fn between(low: f64, high: f64, log: bool, [start, end]: [f64; 2]) -> Self {
        let usable = low.is_finite() && high.is_finite() && low < high;
        let (low, high) = match usable {
            true => (low, high),
            false if low.is_finite() && low == high => (low - 0.5, high + 0.5),
            false => (0.0, 1.0),
        };
        Self {
            log: log && low > 0.0,
            low,
            high,
            start,
            end,
        }
    }

    /// Round bounds around all finite values; logarithmic when they are positive and span much.
    pub(super) fn around(values: impl Iterator<Item = f64>, ends: [f64; 2]) -> Self {
        let (low, high) = range(values);
        if low > 0.0 && high / low > LOG_RATIO {
            return Self::between(round_down(low), round_up(high), true, ends);
        }
        let step = step(high - low);
        let (down, up) = ((low / step).floor() * step, (high / step).ceil() * step);
        Self::between(down, up, false, ends)
    }

    /// Round bounds around the finite positive values, logarithmic, and never under `floor`.
    pub(super) fn log_around(
        values: impl Iterator<Item = f64>,
        floor: f64,
        ends: [f64; 2],
    ) -> Self {
        let (low, high) = range(values.filter(|v| *v > 0.0).map(|v| v.max(floor)));
        if !low.is_finite() {
            return Self::between(floor, floor * 100.0, true, ends);
        }
        let high = round_up(high).max(round_down(low) * 10.0);
        Self::between(round_down(low), high, true, ends)
    }

    /// Where `value` stands; beyond the bounds, at the nearer end; unknown, at the far end.
    pub(super) fn at(&self, value: f64) -> f64 {
        if value.is_nan() {
            return self.end;
        }
        let value = value.clamp(self.low, self.high);
        let share = match self.log {
            true => log(value / self.low) / log(self.high / self.low),
            false => (value - self.low) / (self.high - self.low),
        };
        self.start + share * (self.end - self.start)
    }

    pub(super) fn is_log(&self) -> bool {
        self.log
    }

    pub(super) fn low(&self) -> f64 {
        self.low
    }

    pub(super) fn high(&self) -> f64 {
        self.high
    }

    pub(super) fn ends(&self) -> [f64; 2] {
        [self.start, self.end]
    }

    /// Round values with their labels, from low to high.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
        if self.log {
            self.log_ticks()
        } else {
            self.linear_ticks()
        }
    }

    fn linear_ticks(&self) -> Vec<(f64, String)> {
        let step = step(self.high - self.low);
        let decimals = (-log10(step).floor()).max(0.0) as usize;
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        (first..=last)
            .map(|k| k as f64 * step)
            .map(|value| (value, fixed(value, decimals)))
            .collect()
    }

    fn log_ticks(&self) -> Vec<(f64, String)> {
        let decades = log10(self.high / self.low);
        let steps: &[f64] = match decades {
            d if d < 1.5 => &[1.0, 2.0, 5.0],
            d if d < 3.0 => &[1.0, 3.0],
            _ => &[1.0],
        };
        let first = log10(self.low).floor() as i32;
        let last = log10(self.high).ceil() as i32;
        (first..=last)
            .flat_map(|decade| steps.iter().map(move |m| m * exp10(f64::from(decade))))
            .filter(|v| (self.low * 0.999..=self.high * 1.001).contains(v))
            .map(|value| (value, significant(value)))
            .collect()
    }
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        })
}

/// 1, 2 or 5 times a power of ten, so that four to nine fit into `span`.
fn step(span: f64) -> f64 {
    if !(span.is_finite() && span > 0.0) {
        return 1.0;
    }
    let power = exp10(log10(span / 5.0).floor());
    let digit = span / 5.0 / power;
    power
        * [1.0, 2.0, 5.0]
            .into_iter()
            .rfind(|d| *d <= digit)
            .unwrap_or(1.0)
}

/// The largest 1, 2 or 5 times a power of ten that is not above `value`.
fn round_down(value: f64) -> f64 {
    let power = exp10(log10(value).floor());
    let digit = value / power * (1.0 + 1e-9);
    power
        * [1.0, 2.0, 5.0]
            .into_iter()
            .rfind(|d| *d <= digit)
            .unwrap_or(1.0)
}

fn round_up(value: f64) -> f64 {
    let power = exp10(log10(value).floor());
    let digit = value / power * (1.0 - 1e-9);
    power
        * [1.0, 2.0, 5.0]
            .into_iter()
            .find(|d| *d >= digit)
            .unwrap_or(10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks().into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn a_wide_span_turns_logarithmic() {
        let axis = Axis::around([0.03, f64::NAN, 4.0].into_iter(), [100.0, 0.0]);
        assert!(axis.is_log());
        assert_eq!((axis.low(), axis.high()), (0.02, 5.0));
        assert_eq!(labels(&axis), ["0.03", "0.1", "0.3", "1", "3"]);
    }

    #[test]
    fn a_narrow_span_stays_linear_with_round_bounds() {
        let axis = Axis::around([0.31, 1.12].into_iter(), [100.0, 0.0]);
        assert!(!axis.is_log());
        assert_eq!(
            labels(&axis),
            [
                "0.3", "0.4", "0.5", "0.6", "0.7", "0.8", "0.9", "1.0", "1.1", "1.2"
            ]
        );
    }

    #[test]
    fn useless_values_still_give_an_axis() {
        for values in [
            vec![],
            vec![f64::NAN],
            vec![f64::INFINITY],
            vec![2.0],
            vec![-1.0, 0.0],
        ] {
            let axis = Axis::around(values.iter().copied(), [0.0, 100.0]);
            assert!(axis.at(1.0).is_finite() && axis.at(f64::NAN) == 100.0);
            assert!(!axis.ticks().is_empty(), "{values:?}");
            let log = Axis::log_around(values.iter().copied(), 1e-3, [0.0, 100.0]);
            assert!(log.at(0.0).is_finite() && !log.ticks().is_empty());
        }
    }
}
