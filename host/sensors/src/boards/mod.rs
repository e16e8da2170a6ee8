//! Boards without hardware that run the sensor's program: this PC and emulated processors.
//!
//! [`pc::PcSensor`] runs the program in this process with a front end that renders a scene.
//! `qemu::Qemu` runs the image of a microcontroller with the same front end. [`shots::Shots`]
//! drives a front end alone, for a board that has none.

pub mod nor_flash;
pub mod pc;
#[cfg(unix)]
pub mod qemu;
pub mod shots;
