//! Features as rows of numbers.

/// Numbers of a feature: three histograms of eleven bins.
pub const DIMENSIONS: usize = 33;

/// A feature per point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Features {
    /// Histograms, `[n][33]`; all zero for a point without a feature, which matches nothing.
    pub rows: Vec<[f32; DIMENSIONS]>,
}
