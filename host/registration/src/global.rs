//! Matches of the features of two clouds, the start of every global method.

use echoloop_clouds::Cloud;

use super::features::{Described, PointPair, matching, pairs};
use super::{FeatureConfig, StopReason};

/// Thins and describes the target and the source.
///
/// # Errors
///
/// [`StopReason::EmptyCloud`] when a cloud holds no echo, [`StopReason::BadSettings`] when a voxel
/// is too small for it.
pub fn described(
    target: &Cloud,
    source: &Cloud,
    config: &FeatureConfig,
) -> Result<(Described, Described), StopReason> {
    let (target, source) =
        rayon::join(|| Described::prepare(target, config), || Described::prepare(source, config));
    Ok((target?, source?))
}

/// Describes both clouds and matches their features: the points that found each other, ordered by
/// source point.
///
/// # Errors
///
/// As [`described`].
pub fn matched(
    target: &Cloud,
    source: &Cloud,
    config: &FeatureConfig,
) -> Result<Vec<PointPair>, StopReason> {
    let (target, source) = described(target, source, config)?;
    Ok(pairs(&matching::mutual(&source.features, &target.features), &source, &target))
}
