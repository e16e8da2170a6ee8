//! Models of the DSP and vectors, shared by the cross-crate tests.
//!
//! | module | answers |
//! |---|---|
//! | [`vectors`] | which waveforms? |
//! | [`bit_true`] | is the integer code what its tables say? Rounds as they do; compared by `==` |
//! | [`float_reference`] | is that good enough? Never rounds; compared within [`tolerance`] |
//! | [`target`], [`gdb`] | does the microcontroller say the same? Boards in QEMU |
//! | [`faults`] | what if the line is bad? |
//! | [`instruments`] | whose recordings, and which echoes are in them? |
//! | [`harness`] | what if the bytes are any? |
//! | [`wall`] | what does the sensor see? |
//! | [`readers`] | what if a file is any? |

pub mod bit_true;
pub mod faults;
pub mod float_reference;
#[cfg(unix)]
pub mod gdb;
pub mod harness;
pub mod instruments;
pub mod readers;

#[cfg(unix)]
pub mod target;
pub mod tolerance;
pub mod vectors;
pub mod wall;
