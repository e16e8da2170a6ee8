//! Conventions on which published implementations differ.

/// A convention of voxels and normals. It changes the result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Convention {
    /// The grid starts at the frame's origin; normals face the sensor; points without a normal have
    /// no feature.
    #[default]
    Sensor,
    /// As in Open3D 0.20: the grid starts half a voxel below the least point, normals have the
    /// sign that its eigenvector solver leaves, and a point with fewer than 3 neighbours has the
    /// normal (0, 0, 1).
    Open3d,
}
