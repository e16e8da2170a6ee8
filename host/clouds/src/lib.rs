//! Reading and writing LiDAR point clouds and poses, with everything that a file says of each
//! point.
//!
//! Read a scan, move it into the world, write it in another format:
//!
//! ```
//! use echoloop_clouds::pose::read_pose;
//! use echoloop_clouds::{read_recorded, write_recorded};
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = |name: &str| folder.path().join(name);
//! # let xyz = "x y z\n1 2 3\n0 0 0\n";
//! # std::fs::write(path("scan.txt"), xyz)?;
//! # std::fs::write(path("pose.txt"), "1 0 0 10  0 1 0 0  0 0 1 0")?;
//! let (mut scan, dropped) = read_recorded(&path("scan.txt"))?;
//! println!("{} points, {dropped}", scan.cloud.points.len());
//!
//! let world_from_sensor = read_pose(&path("pose.txt"))?;
//! scan.transform(&world_from_sensor);
//! write_recorded(&path("scan.pcd"), &scan)?;
//! # assert_eq!(scan.cloud.points, [[11.0, 2.0, 3.0].into()]);
//! # assert_eq!(dropped.at_origin, 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | extension | format | read | written |
//! |---|---|---|---|
//! | `.ply` | PLY, ASCII or binary, any numeric type | points and columns | binary |
//! | `.pcd` | PCD, all three encodings | points and columns | binary, 0.7 |
//! | `.vtk` | legacy VTK polydata, ASCII or binary | points | – |
//! | `.bin` | KITTI: x y z intensity, little-endian `f32` | points and intensity | – |
//! | `.xyz`, `.txt`, `.asc`, `.csv` | text: x y z first, or as a header names them | points | – |
//!
//! | to | take |
//! |---|---|
//! | read points alone | [`read_cloud`], [`parse_cloud`] |
//! | keep intensity, ring, time and every other column | [`read_recorded`], [`parse_recorded`] |
//! | write | [`write_cloud`], [`write_recorded`], [`CloudFormat`] |
//! | read a pose or a trajectory, compare two poses | [`pose`] |
//! | name a column as the drivers of sensors do | [`attribute`] |
//!
//! Lengths are metres, coordinates `f32`. A [`Pose`] is called by what it maps: `a_from_b`. Readers
//! take bounded memory, and refuse a bad file by its name, with what was expected and what was
//! found. Registration of clouds is in `echoloop-registration`.

mod cloud;
mod error;
mod format;
pub mod pose;
mod read;
mod recorded;
mod write;

pub use cloud::{Cloud, Dropped, is_finite};
pub use echoloop_files::{Column, NumberType, attribute};
pub use error::CloudError;
pub use format::CloudFormat;
pub use pose::Pose;
pub use read::{parse_cloud, parse_recorded, read_cloud, read_recorded};
pub use recorded::Recorded;
pub use write::{write_cloud, write_recorded};

/// The examples of the README run as written there.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
