//! Result type of the benches' programs.

use std::error::Error;

/// Result with any error, which may be passed between threads.
pub(crate) type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;
