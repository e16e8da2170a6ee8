//! Clouds and their geometry by one path: what `echoloop_clouds` and [`crate::geometry`] have.

pub use echoloop_clouds::{
    Cloud, CloudError, CloudFormat, Column, Dropped, NumberType as Kind, Recorded, attribute,
    parse_cloud, parse_recorded, read_cloud, read_recorded, write_cloud,
};

pub use crate::geometry::{eigen, kdtree, neighbours, normals, voxel};
