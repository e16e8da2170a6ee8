//! Refusals of a report.

/// Reason why a [`Report`](super::Report) cannot be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReportError {
    /// A chart cannot be drawn as a picture.
    #[error("{0}")]
    Drawing(String),
    /// A series must hold one value for each generation (or none, where its documentation says so).
    #[error("{series} holds {found} values, not one for each of {expected}")]
    Length {
        /// Name of the series.
        series: String,
        /// Expected number of values, with what each belongs to.
        expected: String,
        /// Number of values.
        found: usize,
    },
}
