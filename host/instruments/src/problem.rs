//! What can be wrong with a file, before anybody knows its name.

/// What is wrong with a file's content.
#[derive(Debug, PartialEq)]
pub(super) enum Problem {
    /// This cell: row and column from 1, what it says, what may be the matter.
    Cell(usize, usize, String, &'static str),
    /// Something else.
    Format(String),
}
