//! Reading and writing LiDAR point clouds and poses, with everything that a file says of each
//! point.
//!
//! | to | take |
//! |---|---|
//! | read points alone | [`read_cloud`], [`parse_cloud`]; survey coordinates [`read_points`] |
//! | keep intensity, ring, time and every other column | [`read_recorded`], [`parse_recorded`] |
//! | write | [`write_cloud`], [`write_recorded`], [`CloudFormat`] |
//! | read a pose or a trajectory, compare two poses | [`pose`] |
//! | name a column as the drivers of sensors do | [`attribute`] |
//!
//! The formats, and an example: `README.md`.
//!
//! Lengths are metres. Coordinates are `f32`; of survey coordinates, as UTM's, a shift is taken out
//! first ([`survey`]). A [`Pose`] is called by what it maps: `a_from_b`. Readers
//! take bounded memory, and refuse a bad file by its name, with what was expected and what was
//! found. Registration of clouds is in `echoloop-registration`.

mod cloud;
mod error;
mod format;
pub mod pose;
mod read;
mod recorded;
pub mod survey;
mod write;

pub use cloud::{Cloud, Dropped, is_finite};
pub use echoloop_files::{Column, Coordinates, FileError, NumberType, attribute};
pub use error::CloudError;
pub use format::{CloudFormat, read_extensions, read_formats};
pub use pose::Pose;
pub use read::{is_readable, parse_cloud, parse_recorded, read_cloud, read_points, read_recorded};
pub use recorded::Recorded;
pub use write::{write_cloud, write_recorded};

/// The examples of the README run as written there.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
