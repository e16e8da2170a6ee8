//! Why a value of the configuration is refused.

use std::borrow::Cow;

use echoloop_files::shown;
use echoloop_frontend::OpticsError;
use thiserror::Error;

/// A value of the configuration that makes no sense.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RunConfigError {
    /// Out of bounds.
    #[error("{field} = {value} must be {expected}")]
    Bound {
        /// The key.
        field: &'static str,
        /// Its value, as much as a message can hold.
        value: String,
        /// What it must be.
        expected: Cow<'static, str>,
    },
    /// A table of beams that is none.
    #[error("scanner.pattern = {path}: {reason}")]
    Table {
        /// The file.
        path: String,
        /// Which line, and what is wrong.
        reason: String,
    },
    /// In the receiver.
    #[error(transparent)]
    Optics(#[from] OpticsError),
}

/// Refuses a value that does not hold.
pub(super) fn require(
    field: &'static str,
    value: impl ToString,
    holds: bool,
    expected: impl Into<Cow<'static, str>>,
) -> Result<(), RunConfigError> {
    if holds {
        Ok(())
    } else {
        Err(RunConfigError::Bound {
            field,
            value: shown(&value.to_string()),
            expected: expected.into(),
        })
    }
}
