//! Models, test vectors and fixtures shared by the tests that cross crates.
//!
//! | module | contents |
//! |---|---|
//! | [`vectors`] | random settings and waveforms |
//! | [`bit_true`] | detector model that rounds as specified; the integer code must equal it |
//! | [`float_reference`] | detector model that never rounds; compared within [`tolerance`] |
//! | [`wall`] | a sensor in front of a wall |
//! | [`instruments`] | random recording instruments, and records with known echoes |
//! | [`moments`] | mean and standard deviation of samples |
//! | [`target`], [`gdb`] | boards in QEMU, and a debugger for them |
//! | [`faults`] | a line that damages messages, a cheap scene |
//! | [`recording`] | a line that records its bytes |
//! | [`harness`] | fuzz targets for link, session, store and waveforms |
//! | [`readers`] | fuzz targets for file readers |

pub mod bit_true;
pub mod faults;
pub mod float_reference;
#[cfg(unix)]
pub mod gdb;
pub mod harness;
pub mod instruments;
pub mod moments;
pub mod readers;
pub mod recording;
#[cfg(unix)]
pub mod target;
pub mod tolerance;
pub mod vectors;
pub mod wall;
