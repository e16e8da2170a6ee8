//! Numbers of a binary file, each read on demand.

use std::ops::Range;

use echoloop_files::{NumberType, padded};

use super::read::no_number;

/// An array whose numbers are all finite, but for missing ones.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    /// The numbers end to end.
    bytes: Vec<u8>,
    number: Number,
    layout: Layout,
}

/// Places of the rows.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Layout {
    /// Rows of as many columns each.
    Table {
        rows: usize,
        columns: usize,
        /// True in Fortran's order.
        by_columns: bool,
    },
    /// Rows of any length: the indices of each one's numbers.
    Pieces(Vec<Range<usize>>),
}

/// Format of a stored number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Number {
    pub(super) big_endian: bool,
    pub(super) kind: NumberType,
}

impl Number {
    /// A number as the processor stores it.
    pub(super) fn native(kind: NumberType) -> Self {
        Self { big_endian: cfg!(target_endian = "big"), kind }
    }

    /// One number of as many bytes as its type has.
    pub(super) fn read(&self, bytes: &[u8]) -> f64 {
        let mut whole = padded(bytes);
        if self.big_endian {
            whole[..bytes.len()].reverse();
        }
        self.kind.value(whole)
    }
}

impl Array {
    /// From bytes that hold every number of the layout. `missing` stands for a sample that the file
    /// does not have, and may be NaN.
    ///
    /// # Errors
    ///
    /// A number that is not finite, by row and column.
    pub(super) fn new(
        bytes: Vec<u8>,
        number: Number,
        layout: Layout,
        missing: Option<f64>,
    ) -> Result<Self, String> {
        let array = Self { bytes, number, layout };
        let may_be_nan = missing.is_some_and(f64::is_nan);
        let is_refused = |value: f64| !(value.is_finite() || may_be_nan && value.is_nan());
        for row in 0..array.rows() {
            let mut values = array.row(row).enumerate();
            if let Some((column, value)) = values.find(|(_, value)| is_refused(*value)) {
                return Err(no_number(row + 1, column + 1, &value.to_string(), ""));
            }
        }
        Ok(array)
    }

    pub(super) fn rows(&self) -> usize {
        match &self.layout {
            Layout::Table { rows, .. } => *rows,
            Layout::Pieces(pieces) => pieces.len(),
        }
    }

    /// Number of numbers of a row that exists.
    pub(super) fn row_len(&self, row: usize) -> usize {
        match &self.layout {
            Layout::Table { columns, .. } => *columns,
            Layout::Pieces(pieces) => pieces[row].len(),
        }
    }

    /// Numbers of a row; panics when the row does not exist.
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = f64> + '_ {
        (0..self.row_len(row)).map(move |column| self.number(row, column))
    }

    /// A number; panics when it does not exist.
    pub(super) fn number(&self, row: usize, column: usize) -> f64 {
        let index = match &self.layout {
            Layout::Table { rows, by_columns: true, .. } => column * rows + row,
            Layout::Table { columns, .. } => row * columns + column,
            Layout::Pieces(pieces) => pieces[row].start + column,
        };
        let at = index * self.number.kind.size();
        self.number.read(&self.bytes[at..at + self.number.kind.size()])
    }
}
