//! Voxels, neighbours and normals of clouds.

pub(crate) mod box_tree;
pub mod eigen;
pub mod kdtree;
#[cfg(test)]
mod kiddo_tree;
mod nearest;
pub mod neighbours;
pub mod normals;
pub(crate) mod quantile;
#[cfg(test)]
mod scanned;
pub mod voxel;
