//! The direction of a pair, from the normals of its points.

use nalgebra::Vector3;

/// The normals that pairs need. If both, points make a pair when the cosine between them, whatever
/// their signs, is at least as large.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Normals {
    /// The target's normal alone.
    Target,
    /// The normals of target and source.
    Both(f64),
    /// The mean of both in the place of the target's. It is the shorter the less they agree.
    Mean(f64),
}

impl Normals {
    /// The normals of a pair, the source's turned as the source is: the target's and the
    /// source's, zeros if it is not wanted; none where they make no pair.
    #[inline(always)]
    pub(crate) fn of(
        self,
        target: &Vector3<f64>,
        source: impl FnOnce() -> Vector3<f64>,
    ) -> Option<[Vector3<f64>; 2]> {
        if *target == Vector3::zeros() {
            return None;
        }
        let (Self::Both(least) | Self::Mean(least)) = self else {
            return Some([*target, Vector3::zeros()]);
        };
        let source = source();
        let cosine = target.dot(&source);
        if source == Vector3::zeros() || cosine.abs() < least {
            return None;
        }
        Some(match self {
            Self::Mean(_) => [(target + source * cosine.signum()) / 2.0, source],
            _ => [*target, source],
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn normals_that_differ_too_much_make_no_pair_whichever_way_they_face() {
        let target = Vector3::z();
        let tilted = |angle: f64| Vector3::new(angle.sin(), 0.0, angle.cos());
        let of = |normals: Normals, angle: f64| normals.of(&target, || tilted(angle));
        for least in [Normals::Both, Normals::Mean] {
            let normals = least(0.5f64.cos());
            assert!(of(normals, 0.49).is_some() && of(normals, PI - 0.49).is_some());
            assert!(of(normals, 0.51).is_none() && of(normals, PI - 0.51).is_none());
            assert!(normals.of(&target, Vector3::zeros).is_none(), "none is no normal");
            assert!(normals.of(&Vector3::zeros(), || target).is_none());
        }
        assert_eq!(of(Normals::Target, 3.0), Some([target, Vector3::zeros()]));
        assert_eq!(of(Normals::Both(0.0), 3.0), Some([target, tilted(3.0)]));
    }

    #[test]
    fn the_mean_of_two_normals_lies_between_them_and_faces_as_the_targets() {
        let source = Vector3::new(0.6, 0.0, -0.8);
        let mean = Normals::Mean(0.5).of(&Vector3::z(), || source).map(|[mean, _]| mean);
        assert!((mean.unwrap() - Vector3::new(-0.3, 0.0, 0.9)).norm() < 1e-12, "{mean:?}");
    }
}
