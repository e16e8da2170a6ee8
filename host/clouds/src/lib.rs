//! Point clouds and poses: reading and writing them.

mod cloud;
mod error;
mod format;
mod layout;
mod lzf;
mod pcd;
mod ply;
pub mod pose;
mod read;
mod recorded;
mod text;
mod vtk;

pub use cloud::{Cloud, Dropped, is_finite};
pub use echoloop_files::{Column, NumberType, attribute};
pub use error::CloudError;
pub use format::{CloudFormat, write_cloud};
pub use pose::Pose;
pub use read::{parse_cloud, parse_recorded, read_cloud, read_recorded};
pub use recorded::Recorded;
