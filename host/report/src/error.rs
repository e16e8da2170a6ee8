//! Why a report cannot be drawn.

/// Why a [`Report`](super::Report) cannot be drawn: its parts do not fit together.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReportError {
    /// A chart cannot be drawn as a picture.
    #[error("{0}")]
    Drawing(String),
    /// A series must hold one value for each generation (or none, where its documentation says so).
    #[error("{series} holds {found} values, not one for each of {expected}")]
    Length {
        /// Which series.
        series: String,
        /// What the values belong to, and how many there are of it.
        expected: String,
        /// How many values there are.
        found: usize,
    },
}
