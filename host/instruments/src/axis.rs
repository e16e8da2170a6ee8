//! Waveforms in columns: a time axis, and values beside it.

use super::response::robust::median;
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

/// Index of the first time that does not follow the one before by the usual step.
pub(super) fn uneven(times: &[f64]) -> Option<usize> {
    let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let usual = median(&mut steps.clone());
    steps.iter().position(|step| (step - usual).abs() > ROUNDED * usual.abs()).map(|n| n + 1)
}

impl Rows {
    /// The rows, unless these are times and values whose times do not rise evenly.
    ///
    /// # Errors
    ///
    /// Row of the first uneven time; rows of two numbers.
    pub(super) fn not_of_uneven_times(self) -> Result<Self, String> {
        let longest = (0..self.len()).map(|row| self.row_len(row)).max().unwrap_or_default();
        let expected = "expected a waveform a row, or values after times that rise in even steps";
        if longest > LEAST || self.axis().is_some() {
            return Ok(self);
        }
        let (first, last) = (self.column(0), self.column(longest.max(1) - 1));
        let is_monotone = |x: &[f64]| {
            x.windows(2).all(|pair| pair[0] < pair[1]) || x.windows(2).all(|pair| pair[0] > pair[1])
        };
        let lines = first.len();
        match () {
            () if lines >= LEAST && longest > 1 && is_monotone(&first) => {
                let mut of_line = (0..self.len()).filter(|&row| self.row_len(row) > 0);
                let row = of_line.nth(uneven(&first).unwrap_or_default()).unwrap_or_default();
                Err(format!("row {}, column 1: {expected}", row + 1))
            }
            () if lines >= LEAST && longest > 1 && even_step(&last, ROUNDED).is_some() => {
                Err(format!("row 1, column {longest}: {expected}; found the times last"))
            }
            () if longest == 2 => Err(format!("{expected}; found {lines} rows of two numbers")),
            () => Ok(self),
        }
    }

    /// The rows as waveforms where the file has its samples one below the other: a value a line, a
    /// time and values a line, or a time axis as the first of a few rows. Else as they are.
    ///
    /// A blank line in a column is a missing sample, or parts waveforms of one length; beside a
    /// time axis it is nothing, and a value that is not there is a missing sample.
    pub(super) fn into_waveforms(self) -> Self {
        let width = (0..self.len()).map(|row| self.row_len(row)).max().unwrap_or_default();
        let lines = (0..self.len()).filter(|&row| self.row_len(row) > 0).count();
        let is_table = (0..self.len()).all(|row| self.row_len(row) == width);
        if is_table && lines >= LEAST && width > LEAST && self.is_numbered() {
            return self.without_numbers();
        }
        if width == 1 && lines >= 3 {
            return if is_table { Self::of_column(self.into_numbers()) } else { self.of_lines() };
        }
        // No fewer rows than columns: else they are waveforms. So are many columns of which some
        // are shorter.
        if width > 1 && lines >= LEAST.max(width) && (is_table || width <= LEAST) {
            // A row of two numbers is no waveform, so that rounding is forgiven.
            let off = if width == 2 { ROUNDED } else { EXACT };
            if let Some(step) = even_step(&self.column(0), off) {
                let rows: Vec<_> = (1..width).map(|column| self.column(column)).collect();
                return Self::in_columns(rows, TimeAxis { step, is_in_seconds: false })
                    .after(&self);
            }
        }
        if is_table
            && lines >= 2
            && width >= LEAST
            && let Some(step) = even_step(&self.row(0), EXACT)
        {
            let rows: Vec<_> = (1..lines).map(|row| self.row(row).into_owned()).collect();
            return Self::in_columns(rows, TimeAxis { step, is_in_seconds: false }).after(&self);
        }
        self
    }

    /// True when the first column counts the rows.
    fn is_numbered(&self) -> bool {
        let first = self.number(0, 0);
        first.fract() == 0.0 && (0..self.len()).all(|row| self.number(row, 0) == first + row as f64)
    }

    fn without_numbers(self) -> Self {
        let (first, last) = (self.number(0, 0), self.number(self.len() - 1, 0));
        let remark =
            format!("the first column numbers the rows, {first} to {last}: it is no sample");
        let rows = (0..self.len()).map(|row| self.row(row)[1..].to_vec());
        Self::of_rows(rows).after(&self).with_remark(remark)
    }

    /// The numbers of a column, of each line that is not blank; NaN of a shorter line.
    fn column(&self, column: usize) -> Vec<f64> {
        let lines = (0..self.len()).map(|row| (row, self.row_len(row))).filter(|line| line.1 > 0);
        let number = |(row, len)| if column < len { self.number(row, column) } else { f64::NAN };
        lines.map(number).collect()
    }

    /// The waveforms of a file with a value a line and blank lines.
    fn of_lines(self) -> Self {
        let line = |row| (self.row_len(row) > 0).then(|| self.number(row, 0));
        let lines: Vec<Option<f64>> = (0..self.len()).map(line).collect();
        let blocks = || lines.split(Option::is_none).filter(|block| !block.is_empty());
        let (count, length) =
            (blocks().count(), blocks().map(<[_]>::len).max().unwrap_or_default());
        if count > 1 && length >= LEAST && blocks().all(|block| block.len() == length) {
            let rows =
                Self::of_rows(blocks().map(|block| block.iter().copied().flatten().collect()));
            let remark = format!("a value a line: {count} waveforms of {length} samples");
            return rows.with_remark(remark);
        }
        let blank = lines.iter().filter(|line| line.is_none()).count();
        let samples = lines.into_iter().map(|line| line.unwrap_or(f64::NAN)).collect();
        let remark = match blank {
            1 => "1 blank line is a missing sample".to_owned(),
            _ => format!("{blank} blank lines are missing samples"),
        };
        Self::of_column(samples).with_remark(remark)
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
    fn blank_lines_in_a_column_part_waveforms_of_one_length_or_are_missing_samples() {
        let block = [5.0, 7.0, 6.0, 5.0, 5.0, 9.0, 5.0, 6.0];
        let column = |from: &[f64]| from.iter().map(|v| vec![*v]).collect::<Vec<_>>();
        let found = |lines: Vec<Vec<f64>>| Rows::of_rows(lines).into_waveforms();
        let two = found([column(&block), vec![vec![]], column(&block)].concat());
        assert_eq!((two.len(), &*two.row(1)), (2, &block[..]));
        assert!(two.remarks()[0].contains("2 waveforms of 8 samples"), "{:?}", two.remarks());
        let one = found([column(&block), vec![vec![]], column(&block[..5])].concat());
        assert_eq!((one.len(), one.row(0).len(), one.row(0)[8].is_nan()), (1, 14, true));
        assert!(one.remarks()[1].contains("1 blank line is a missing sample"));
    }

    #[test]
    fn a_time_without_a_value_is_that_of_a_missing_sample() {
        let lines = |n: u32| match n {
            4 => vec![],
            7 => vec![6.0],
            _ => vec![f64::from(n) - f64::from(u8::from(n > 4)), f64::from(n % 3)],
        };
        let found = Rows::of_rows((0..20).map(lines)).into_waveforms();
        assert_eq!((found.len(), found.row(0).len(), found.row(0)[6].is_nan()), (1, 19, true));
        assert_eq!(found.axis(), Some(TimeAxis { step: 1.0, is_in_seconds: false }));
    }

    #[test]
    fn times_that_do_not_rise_evenly_are_refused_by_row() {
        let refused = |time: &dyn Fn(u32) -> f64| {
            let rows = Rows::of_rows((0..12).map(|n| vec![time(n), 7.0])).into_waveforms();
            rows.not_of_uneven_times().expect_err("refused")
        };
        let hole = refused(&|n| f64::from(n + u32::from(n > 4)));
        assert!(hole.starts_with("row 6, column 1: expected"), "{hole}");
        assert!(refused(&|n| -f64::from(n)).starts_with("row 1, column 1: "));
        assert!(refused(&|n| f64::from(n % 2)).ends_with("found 12 rows of two numbers"));
        let last = Rows::of_rows((0..12).map(|n| vec![f64::from(n % 5), f64::from(n)]));
        let problem = last.into_waveforms().not_of_uneven_times().expect_err("refused");
        assert!(problem.starts_with("row 1, column 2: "), "{problem}");
        let short = Rows::of_rows((0..12).map(|n| vec![7.0, f64::from(n % 5), 6.0, 7.0]));
        assert_eq!(short.into_waveforms().not_of_uneven_times().unwrap().len(), 12);
    }

    #[test]
    fn a_number_of_the_row_is_no_time() {
        let table: Vec<Vec<f64>> = (0..10)
            .map(|n| (0..12).map(|k| if k == 0 { n.into() } else { 7.0 }).collect())
            .collect();
        let found = Rows::of_rows(table).into_waveforms();
        assert_eq!((found.len(), found.row(0).len(), found.axis()), (10, 11, None));
        // Nor is it where there are more rows than samples.
        let row = |n: u32| [vec![1000.0 + f64::from(n)], [7.0, 8.0, 7.0].repeat(4)].concat();
        let found = Rows::of_rows((0..40).map(row)).into_waveforms();
        assert_eq!((found.len(), found.row(39).len(), found.row(39)[0]), (40, 12, 7.0));
        assert!(found.remarks()[0].contains("numbers the rows, 1000 to 1039"));
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
            assert!(begin == 1e-3 || step == 1e-9, "told to six digits: {step}");
        }
        // Samples have single precision, too.
        assert_eq!(even_step(&[300.0, 301.0, 303.0, 304.0], EXACT), None);
        assert_eq!(even_step(&[0.1, 0.2, 0.3001, 0.4], EXACT), None);
    }
}
