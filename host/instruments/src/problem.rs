//! Faults in a file's content; the caller adds the path.

/// Fault in a file's content.
#[derive(Debug, PartialEq)]
pub(super) enum Problem {
    /// A cell that is no finite number: row and column from 1, its text, a likely reason.
    Cell(usize, usize, String, &'static str),
    /// Any other fault, as text.
    Format(String),
}
