//! How a program of the benches fails.

use std::error::Error;

/// What a `main` may return, whatever went wrong, and what threads may hand on.
pub(crate) type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;
