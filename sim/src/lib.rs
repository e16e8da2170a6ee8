//! The world around the sensor: scenes, ray casting, the scanner, and the boards the firmware runs
//! on.

pub mod board;
pub mod import;
pub mod nor;
#[cfg(unix)]
pub mod qemu;
pub mod raycast;
pub mod scanner;
pub mod scene;
pub mod viewpoint;
