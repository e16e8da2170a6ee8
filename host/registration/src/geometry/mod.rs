//! Voxels, neighbours and normals of clouds.

pub(crate) mod box_tree;
pub mod eigen;
pub mod kdtree;
mod nearest;
pub mod neighbours;
pub mod normals;
pub(crate) mod quantile;
pub mod voxel;

#[cfg(test)]
mod tests {
    pub(super) mod scanned;
}
