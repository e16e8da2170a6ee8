//! Rows of numbers in their stored form: a sample of one byte takes one byte until its row is read.

use std::borrow::Cow;
use std::ops::Range;

use super::array::Array;
use super::axis::TimeAxis;
use super::codes::Codes;
use super::missing::fill_values;
use super::polarity::Polarity;

/// Rows of a file, each read on demand.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    stored: Stored,
    /// Numbers that stand for a missing sample.
    fills: Vec<f64>,
    /// True when the samples are turned over: echoes fall in the file.
    is_turned: bool,
    axis: Option<TimeAxis>,
    remarks: Vec<String>,
}

#[derive(Clone, Debug, PartialEq)]
enum Stored {
    /// Numbers of a text, all rows end to end, and the end of each row. A missing one is NaN.
    Text { numbers: Vec<f64>, ends: Vec<u32> },
    /// Array as it was written.
    Array(Array),
}

impl Rows {
    pub(super) fn of_array(array: Array) -> Self {
        Self::of(Stored::Array(array))
    }

    pub(super) fn of_text(numbers: Vec<f64>, ends: Vec<u32>) -> Self {
        Self::of(Stored::Text { numbers, ends })
    }

    /// Rows of numbers.
    pub(super) fn of_rows(rows: impl IntoIterator<Item = Vec<f64>>) -> Self {
        let (mut numbers, mut ends) = (Vec::new(), Vec::new());
        for row in rows {
            numbers.extend(row);
            ends.push(numbers.len() as u32);
        }
        Self::of_text(numbers, ends)
    }

    fn of(stored: Stored) -> Self {
        Self { stored, fills: Vec::new(), is_turned: false, axis: None, remarks: Vec::new() }
    }

    pub(super) fn with_axis(self, axis: TimeAxis) -> Self {
        Self { axis: Some(axis), ..self }
    }

    pub(super) fn with_remark(mut self, remark: String) -> Self {
        self.remarks.push(remark);
        self
    }

    /// The rows with the remarks of what they were made of before their own.
    pub(super) fn after(mut self, before: &Self) -> Self {
        self.remarks.splice(0..0, before.remarks.iter().cloned());
        self
    }

    /// The rows without samples that the file does not have: its fill values, if it has any. A file
    /// that names its own has said so already.
    pub(super) fn without_fill(self) -> Self {
        if !self.fills.is_empty() {
            return self;
        }
        let fills = fill_values(&self);
        fills.into_iter().fold(self, |rows, (fill, count)| rows.without(fill, count))
    }

    /// The rows without the samples that have the value named by the file.
    pub(super) fn with_fill(self, fill: Option<f64>) -> Self {
        let Some(fill) = fill else { return self };
        let is_fill = |value: &&f64| **value == fill || value.is_nan() && fill.is_nan();
        let count = (0..self.len()).map(|row| self.row(row).iter().filter(is_fill).count()).sum();
        if count > 0 { self.without(fill, count) } else { self }
    }

    fn without(mut self, fill: f64, count: usize) -> Self {
        self.fills.push(fill);
        self.remarks.push(match count {
            1 => format!("1 sample of {fill} is taken for missing"),
            _ => format!("{count} samples of {fill} are taken for missing"),
        });
        self
    }

    /// The rows with rising echoes: turned over where their polarity is negative, as found or as
    /// given.
    #[must_use]
    pub fn with_polarity(mut self, given: Option<Polarity>) -> Self {
        let polarity = given.unwrap_or_else(|| Polarity::of(&self));
        self.is_turned = polarity == Polarity::Negative;
        if self.is_turned && given.is_none() {
            let remark = "echoes fall below the ambient: their amplitudes are depths";
            self.remarks.push(remark.to_owned());
        }
        self
    }

    /// What was read otherwise than as rows of samples.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Time axis of the file, if it has one.
    pub fn axis(&self) -> Option<TimeAxis> {
        self.axis
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        match &self.stored {
            Stored::Text { ends, .. } => ends.len(),
            Stored::Array(array) => array.rows(),
        }
    }

    /// True when there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All numbers as the file has them, row by row, without a second copy of a text's.
    pub(super) fn into_numbers(self) -> Vec<f64> {
        match self.stored {
            Stored::Text { numbers, .. } => numbers,
            Stored::Array(array) => {
                let count = (0..array.rows()).map(|row| array.row_len(row)).sum();
                let mut numbers = Vec::with_capacity(count);
                (0..array.rows()).for_each(|row| numbers.extend(array.row(row)));
                numbers
            }
        }
    }

    /// Number of numbers of a row that exists.
    pub(super) fn row_len(&self, row: usize) -> usize {
        match &self.stored {
            Stored::Text { ends, .. } => text_row(ends, row).len(),
            Stored::Array(array) => array.row_len(row),
        }
    }

    /// A number as the file has it, of a row and column that exist.
    pub(super) fn number(&self, row: usize, column: usize) -> f64 {
        match &self.stored {
            Stored::Text { numbers, ends } => numbers[text_row(ends, row).start + column],
            Stored::Array(array) => array.number(row, column),
        }
    }

    /// Numbers of a row; a missing one is NaN.
    ///
    /// # Panics
    ///
    /// When the row does not exist.
    pub fn row(&self, row: usize) -> Cow<'_, [f64]> {
        let stored = match &self.stored {
            Stored::Text { numbers, ends } => Cow::Borrowed(&numbers[text_row(ends, row)]),
            Stored::Array(array) => Cow::Owned(array.row(row).collect()),
        };
        if self.fills.is_empty() && !self.is_turned {
            return stored;
        }
        let sign = if self.is_turned { -1.0 } else { 1.0 };
        let read = |&value: &f64| if self.fills.contains(&value) { f64::NAN } else { sign * value };
        Cow::Owned(stored.iter().map(read).collect())
    }

    /// A row without its padding, as codes.
    pub(super) fn codes(&self, row: usize) -> Codes {
        Codes::from_samples(without_padding(&self.row(row)))
    }
}

/// Greatest number of rows that an instrument is estimated from, which bounds the time.
const LOOKED: usize = 2048;

/// Indices of the rows that an instrument is estimated from, evenly spaced.
pub(super) fn evenly_spaced(rows: usize) -> Vec<usize> {
    let looked = rows.min(LOOKED);
    (0..looked).map(|i| (i as u64 * rows as u64 / looked as u64) as usize).collect()
}

/// Range of a row's numbers.
fn text_row(ends: &[u32], row: usize) -> Range<usize> {
    row.checked_sub(1).map_or(0, |before| ends[before] as usize)..ends[row] as usize
}

/// A waveform without the zeros that pad its row to the others' length, and without missing samples
/// at its end.
///
/// Zeros at the end are padding, with two exceptions. The samples before them fall towards zero:
/// the last step, d down to v, has v ≤ d. Or the row begins with two zeros. Such a record rests at
/// zero, and the zeros are the end of an echo: up to 16 of them stay.
pub(super) fn without_padding(row: &[f64]) -> &[f64] {
    let row = &row[..row.iter().rposition(|v| !v.is_nan()).map_or(0, |last| last + 1)];
    let end = row.iter().rposition(|&v| v != 0.0).map_or(0, |last| last + 1);
    let falls_to_zero = match row[..end] {
        [.., before, last] => {
            last.abs() <= (before - last).abs() && (before > last) == (last > 0.0)
        }
        _ => false,
    };
    let kept = if falls_to_zero || row.len() > 1 && row[..2].iter().all(|&v| v == 0.0) && end > 0 {
        (end + 16).min(row.len())
    } else {
        end
    };
    &row[..kept]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_bytes_loses_its_padding_and_its_least_number() {
        let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (2, 5), }";
        let length = (header.len() as u16).to_le_bytes();
        let data = [0, 0, 200, 7, 0, 9, 3, 255, 0, 0];
        let file = [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), &data].concat();
        let rows = Rows::of_array(super::super::npy::parse(file).expect("an array"));
        assert_eq!(rows.codes(1).codes, [6, 0, 252]);
    }

    #[test]
    fn zeros_after_a_record_are_padding() {
        assert_eq!(without_padding(&[200., 210., 300., 222., 0., 0.]), [200., 210., 300., 222.]);
        assert_eq!(without_padding(&[3., 5., 10., 19., 0., 0., 0.]), [3., 5., 10., 19.]);
        assert!(without_padding(&[0.; 9]).is_empty());
        assert!(without_padding(&[]).is_empty());
        assert_eq!(without_padding(&[0., 4., 0., 1.]), [0., 4., 0., 1.]);
    }

    #[test]
    fn zeros_that_an_echo_falls_to_are_samples() {
        assert_eq!(without_padding(&[0., 5., 10., 5., 0., 0.]), [0., 5., 10., 5., 0., 0.]);
        assert_eq!(without_padding(&[0., 0., 100., 0., 0.]), [0., 0., 100., 0., 0.]);
        let mut row = vec![0., 50., 20., 4.];
        row.resize(100, 0.);
        assert_eq!(without_padding(&row).len(), 20);
    }

    #[test]
    fn missing_samples_keep_their_places_and_go_at_the_end() {
        let row = [65_535.0, 200.0, 65_535.0, 220.0, 210.0, 65_535.0];
        let rows = Rows::of_rows([row.to_vec()]).without_fill();
        assert_eq!(rows.remarks(), ["3 samples of 65535 are taken for missing"]);
        let codes = rows.codes(0);
        assert_eq!((codes.codes, codes.gaps), (vec![0, 0, 10, 20, 10], vec![0..1, 2..3]));
    }

    #[test]
    fn falling_echoes_are_turned_over() {
        let row: Vec<f64> = (0..60).map(|n| if n == 30 { 10.0 } else { 500.0 }).collect();
        let rows = Rows::of_rows([row.clone()]).with_polarity(None);
        assert_eq!((rows.row(0)[30], rows.row(0)[0]), (-10.0, -500.0));
        assert!(rows.remarks()[0].contains("fall below"));
        let told = Rows::of_rows([row.clone()]).with_polarity(Some(Polarity::Negative));
        assert_eq!((told.row(0)[30], told.remarks().len()), (-10.0, 0));
        let kept = Rows::of_rows([row]).with_polarity(Some(Polarity::Positive));
        assert_eq!(kept.row(0)[30], 10.0);
    }
}
