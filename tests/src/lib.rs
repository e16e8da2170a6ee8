//! Twins and vectors shared by the cross-crate tests.
//!
//! | module | answers |
//! |---|---|
//! | [`vectors`] | which waveforms? |
//! | [`quantised`] | is the integer code what its tables say? Rounds where they say; compared with `==` |
//! | [`ideal`] | is what the tables say good enough? Never rounds; compared within [`tolerance`] |

pub mod ideal;
pub mod quantised;
pub mod tolerance;
pub mod vectors;
