//! Rows of numbers in their stored form: a sample of one byte takes one byte until its row is read.

use std::borrow::Cow;

use super::codes::Codes;
use super::npy::Array;

/// Rows of a file, each read on demand.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows(Stored);

#[derive(Clone, Debug, PartialEq)]
enum Stored {
    /// Numbers of a text, all rows end to end, and the end of each row.
    Text { numbers: Vec<f64>, ends: Vec<u32> },
    /// Array as it was written.
    Array(Array),
}

impl Rows {
    pub(super) fn of_array(array: Array) -> Self {
        Self(Stored::Array(array))
    }

    pub(super) fn of_text(numbers: Vec<f64>, ends: Vec<u32>) -> Self {
        Self(Stored::Text { numbers, ends })
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        match &self.0 {
            Stored::Text { ends, .. } => ends.len(),
            Stored::Array(array) => array.rows(),
        }
    }

    /// True when there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Numbers of a row.
    ///
    /// # Panics
    ///
    /// When the row does not exist.
    pub fn row(&self, row: usize) -> Cow<'_, [f64]> {
        match &self.0 {
            Stored::Text { numbers, ends } => {
                let start = row.checked_sub(1).map_or(0, |before| ends[before] as usize);
                Cow::Borrowed(&numbers[start..ends[row] as usize])
            }
            Stored::Array(array) => Cow::Owned(array.row(row).collect()),
        }
    }

    /// A row without its padding, as codes.
    pub(super) fn codes(&self, row: usize) -> Codes {
        Codes::from_samples(without_padding(&self.row(row)))
    }
}

/// A waveform without the zeros that pad its row to the others' length.
///
/// Zeros at the end are padding, with two exceptions. The samples before them fall towards zero:
/// the last step, d down to v, has v ≤ d. Or the row begins with two zeros. Such a record rests at
/// zero, and the zeros are the end of an echo: up to 16 of them stay.
pub(super) fn without_padding(row: &[f64]) -> &[f64] {
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
}
