//! Twins and vectors shared by the cross-crate tests.
//!
//! | module | answers |
//! |---|---|
//! | [`vectors`] | which waveforms? |
//! | [`quantised`] | is the integer code what its tables say? Rounds where they say; compared with `==` |
//! | [`split_twin`], [`recording_twin`] | the same of the stages for hidden peaks and for others' records |
//! | [`ideal`] | is what the tables say good enough? Never rounds; compared within [`tolerance`] |
//! | [`target`], [`gdb`] | does the microcontroller say the same? Boards in QEMU, and a hand inside them |
//! | [`faults`] | what if the line is bad?
//! | [`harness`] | what if the bytes are any?

pub mod faults;
#[cfg(unix)]
pub mod gdb;
pub mod harness;
pub mod ideal;
pub mod quantised;
pub mod recording_twin;
pub mod split_twin;
#[cfg(unix)]
pub mod target;
pub mod tolerance;
pub mod vectors;
