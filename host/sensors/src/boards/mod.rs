//! Boards that the sensor's program runs on without hardware: this PC and emulated processors.
//!
//! [`pc::PcSensor`] runs the program in this process behind a front end that renders a scene.
//! `qemu::Qemu` does the same with the image of a microcontroller. [`shots::Shots`] drives such a
//! front end alone, for a board that has none.

pub mod nor_flash;
pub mod pc;
#[cfg(unix)]
pub mod qemu;
pub mod shots;
