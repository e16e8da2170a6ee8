//! Waveforms in columns: a time axis, and values beside it.

use super::rows::Rows;

/// Even steps of a time axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeAxis {
    /// Time from sample to sample.
    pub step: f64,
    /// True when it is known to be in seconds.
    pub is_in_seconds: bool,
}

/// Rows of a file in columns from which on these are looked for.
const LEAST: usize = 8;

/// Greatest deviation from even steps, in steps: of an axis that rounding may have moved, and of
/// one among numbers that might as well be samples.
pub(super) const ROUNDED: f64 = 0.5;
const EXACT: f64 = 1e-6;

/// Greatest deviation of times of single precision, in steps: coarser ones are no axis.
const SINGLE: f64 = 0.25;

/// Step of times that rise evenly, none more than so many steps off, nor more than the rounding of
/// single precision where all times have that.
pub(super) fn even_step(times: &[f64], off: f64) -> Option<f64> {
    let (&first, &last) = times.first().zip(times.last())?;
    let step = (last - first) / (times.len().max(2) - 1) as f64;
    let is_exact = |time: f64| f64::from(time as f32) == time;
    let is_single = times.iter().all(|&time| is_exact(time));
    let rounding =
        if is_single { first.abs().max(last.abs()) * f64::from(f32::EPSILON) } else { 0.0 };
    let most = (off * step).max(rounding.min(SINGLE * step));
    let is_even = |(n, time): (usize, &f64)| (time - first - n as f64 * step).abs() <= most;
    let step = if is_single && !is_exact(step) { six_digits(step) } else { step };
    (step > 0.0 && step.is_finite() && times.iter().enumerate().all(is_even)).then_some(step)
}

/// A number rounded to six digits: single precision has no more.
fn six_digits(number: f64) -> f64 {
    format!("{number:.5e}").parse().unwrap_or(number)
}

impl Rows {
    /// The rows as waveforms where the file has its samples one below the other: a value a line, a
    /// time and values a line, or a time axis as the first of a few rows. Else as they are.
    pub(super) fn into_waveforms(self) -> Self {
        let count = self.len();
        let width = if count == 0 { 0 } else { self.row_len(0) };
        let is_table = (1..count).all(|row| self.row_len(row) == width);
        if is_table && count >= 3 && width == 1 {
            return Self::of_column(self.into_numbers());
        }
        // No fewer rows than columns: else the first column numbers the rows.
        if is_table && width > 1 && count >= LEAST.max(width) {
            // A row of two numbers is no waveform, so that rounding is forgiven.
            let off = if width == 2 { ROUNDED } else { EXACT };
            if let Some(step) = even_step(&self.column(0), off) {
                let rows = (1..width).map(|column| self.column(column));
                return Self::in_columns(rows, TimeAxis { step, is_in_seconds: false });
            }
        }
        if is_table
            && count >= 2
            && width >= LEAST
            && let Some(step) = even_step(&self.row(0), EXACT)
        {
            let rows = (1..count).map(|row| self.row(row).into_owned());
            return Self::in_columns(rows, TimeAxis { step, is_in_seconds: false });
        }
        self
    }

    fn column(&self, column: usize) -> Vec<f64> {
        (0..self.len()).map(|row| self.number(row, column)).collect()
    }

    /// The one waveform of a file with a value a line.
    pub(super) fn of_column(samples: Vec<f64>) -> Self {
        let remark = format!("a value a line: one waveform of {} samples", samples.len());
        let ends = vec![samples.len() as u32];
        Self::of_text(samples, ends).with_remark(remark)
    }

    /// Waveforms beside a time axis.
    pub(super) fn in_columns(rows: impl IntoIterator<Item = Vec<f64>>, axis: TimeAxis) -> Self {
        let rows = Self::of_rows(rows);
        let (count, samples) = (rows.len(), rows.row(0).len());
        let unit = if axis.is_in_seconds { " s" } else { "" };
        let remark = format!(
            "a time axis in steps of {}{unit}: waveforms of {samples} samples, {count} in all",
            axis.step
        );
        rows.with_axis(axis).with_remark(remark)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &[&[f64]]) -> Rows {
        Rows::of_rows(text.iter().map(|row| row.to_vec())).into_waveforms()
    }

    #[test]
    fn a_value_a_line_is_one_waveform() {
        let found = rows(&[&[5.0], &[7.0], &[6.0], &[5.0]]);
        assert_eq!((found.len(), &*found.row(0)), (1, &[5.0, 7.0, 6.0, 5.0][..]));
        assert!(found.remarks()[0].contains("one waveform of 4 samples"));
        assert_eq!(rows(&[&[5.0], &[7.0]]).len(), 2, "too few to be one");
    }

    #[test]
    fn a_number_of_the_row_is_no_time() {
        let table: Vec<Vec<f64>> = (0..10)
            .map(|n| (0..12).map(|k| if k == 0 { n.into() } else { 7.0 }).collect())
            .collect();
        assert_eq!(Rows::of_rows(table).into_waveforms().len(), 10);
    }

    #[test]
    fn values_beside_a_time_are_a_waveform_a_column() {
        let lines: Vec<Vec<f64>> =
            (0..9).map(|n| vec![0.25 * f64::from(n) - 1.0, f64::from(n % 4), 9.0]).collect();
        let found = rows(&lines.iter().map(Vec::as_slice).collect::<Vec<_>>());
        assert_eq!((found.len(), found.row(0).len(), found.row(1)[3]), (2, 9, 9.0));
        assert_eq!(found.axis(), Some(TimeAxis { step: 0.25, is_in_seconds: false }));
        // The same lying down.
        let line = |k: usize| lines.iter().map(|row| row[k]).collect::<Vec<f64>>();
        let across = [line(0), line(1), line(2)];
        let again = rows(&across.iter().map(Vec::as_slice).collect::<Vec<_>>());
        assert_eq!((again.len(), again.row(0), again.axis()), (2, found.row(0), found.axis()));
    }

    #[test]
    fn rows_whose_first_samples_drift_are_rows() {
        let drift: Vec<Vec<f64>> =
            (0..20).map(|n| vec![200.0 + f64::from(5 * n + n * 7 % 3), 201.0, 230.0]).collect();
        let drift: Vec<&[f64]> = drift.iter().map(Vec::as_slice).collect();
        assert_eq!(rows(&drift).len(), 20);
        let two: Vec<Vec<f64>> = (0..9).map(|n| vec![f64::from(n * n), 1.0]).collect();
        assert_eq!(rows(&two.iter().map(Vec::as_slice).collect::<Vec<_>>()).len(), 9);
        assert_eq!(rows(&[&[1.0, 2.0], &[3.0]]).len(), 2);
    }

    #[test]
    fn times_that_were_rounded_rise_evenly() {
        let times: Vec<f64> = (0..100).map(|n| (f64::from(n) * 0.4).round()).collect();
        let step = even_step(&times, 2.0).unwrap();
        assert!((step - 0.4).abs() < 0.01);
        assert_eq!(even_step(&times, EXACT), None);
        assert_eq!(even_step(&[2.0, 1.0, 0.0], ROUNDED), None);
        assert_eq!(even_step(&[], ROUNDED), None);
        // Nanoseconds in single precision, from a trigger a microsecond or a millisecond before.
        for begin in [0.0, 1e-6, 1e-3] {
            let times = (0..600).map(|n| begin + f64::from(n) * 1e-9);
            let single: Vec<f64> = times.map(|time| f64::from(time as f32)).collect();
            let step = even_step(&single, EXACT).unwrap();
            assert!((step / 1e-9 - 1.0).abs() < 1e-4, "{begin}: {step}");
        }
        // Samples have single precision, too.
        assert_eq!(even_step(&[300.0, 301.0, 303.0, 304.0], EXACT), None);
        assert_eq!(even_step(&[0.1, 0.2, 0.3001, 0.4], EXACT), None);
    }
}
