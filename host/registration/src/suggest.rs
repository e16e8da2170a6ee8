//! Suggested settings for two clouds.

use std::cell::OnceCell;

use echoloop_clouds::{Cloud, is_finite};
use nalgebra::Point3;

use super::{
    AutoConfig, FeatureConfig, FgrConfig, FgrMode, IcpConfig, MacConfig, Method, MethodConfig,
};
use crate::geometry::kdtree::KdTree;
use crate::geometry::quantile::quantile;
use crate::geometry::voxel;

/// Voxels across the radius of a cloud.
const VOXELS_A_RADIUS: f64 = 80.0;

/// Voxel of features, m. Distinctive shapes, such as corners and trunks, are as large in a wide
/// scene as in a narrow one.
const FEATURE_VOXEL_M: f64 = 1.2;

/// Radius of a cloud, m, below which the scales of features shrink with it: a room has no houses.
const SMALL_RADIUS_M: f64 = 8.0;

/// Voxels of the fits that finish a motion, outdoors, m.
const FINISH_VOXELS_M: [f64; 3] = [0.3, 0.15, 0.07];

/// Most points with features: more cost time and gain nothing.
const MOST_POINTS: usize = 30_000;

/// Number of neighbours, itself included, that half of the points should have within the normals'
/// radius.
const NORMAL_FILLED: usize = 8;

/// Number of neighbours that three quarters of the points should have within the features' radius.
const FEATURE_FILLED: usize = 15;

/// Largest growth of a voxel in a round. Coarser voxels leave fewer neighbours.
const GROWTH: f64 = 1.25;

/// Most rounds of growth: together to about twice the voxel. Points crowd near a sensor, and no
/// voxel makes the far ones as dense.
const ROUNDS: usize = 3;

/// Number of points from which a radius is computed.
const RADIUS_SAMPLES: usize = 200_000;

/// Number of points whose neighbours are counted.
const SAMPLES: usize = 500;

/// Settings that fit two clouds. The size of the clouds is computed once for all suggestions.
#[derive(Clone, Debug)]
pub struct Suggestions<'a> {
    target: &'a Cloud,
    source: &'a Cloud,
    radius_m: OnceCell<f64>,
}

impl<'a> Suggestions<'a> {
    /// Suggestions for these clouds.
    pub fn new(target: &'a Cloud, source: &'a Cloud) -> Self {
        Self { target, source, radius_m: OnceCell::new() }
    }

    /// As [`suggest()`].
    pub fn icp(&self) -> IcpConfig {
        let config = self.icp_of_voxel(self.radius_m() / VOXELS_A_RADIUS);
        if config.check().is_ok() { config } else { IcpConfig::outdoor() }
    }

    /// As [`suggest_features`].
    pub fn features(&self) -> FeatureConfig {
        let voxel_m = FEATURE_VOXEL_M * self.share_of_scene();
        let voxel_m = [self.target, self.source].iter().fold(voxel_m, |voxel_m, cloud| {
            let mut echoes = (*cloud).clone();
            echoes.drop_invalid();
            widened(&echoes, voxel_m)
        });
        let config = FeatureConfig::from_voxel(voxel_m);
        if config.check().is_ok() { config } else { FeatureConfig::outdoor() }
    }

    /// Settings of any method. If a voxel is given, the lengths that depend on it follow it.
    ///
    /// FGR in mode `open3d` gets the radii and the distance of Open3D's example.
    pub fn method(&self, method: Method, mode: FgrMode, voxel_m: Option<f64>) -> MethodConfig {
        let features = || voxel_m.map_or_else(|| self.features(), FeatureConfig::from_voxel);
        let icp = || voxel_m.map_or_else(|| self.icp(), |voxel_m| self.icp_of_voxel(voxel_m));
        match (method, mode) {
            (Method::Icp, _) => MethodConfig::Icp(icp()),
            (Method::Fgr, FgrMode::Annealed) => {
                MethodConfig::Fgr(FgrConfig::from_features(features()))
            }
            (Method::Fgr, FgrMode::Open3d) => {
                MethodConfig::Fgr(FgrConfig::open3d(features().voxel_m))
            }
            (Method::Mac, _) => MethodConfig::Mac(MacConfig::from_features(features())),
            (Method::Auto, _) => MethodConfig::Auto(self.auto(voxel_m)),
            (local, _) if !local.is_global() => with_lengths(local, icp()),
            (other, _) => MethodConfig::outdoor(other),
        }
    }

    /// Settings that refine the motion of a global method with voxel `global_voxel_m`. The voxel is
    /// that of [`suggest()`], if smaller. The first pairs are at most as far apart as the error of
    /// the global method, two of its voxels, and at least four voxels of the refinement.
    pub fn refinement(&self, global_voxel_m: f64) -> IcpConfig {
        self.refined(global_voxel_m, self.icp().voxel_m)
    }

    fn refined(&self, global_voxel_m: f64, voxel_m: f64) -> IcpConfig {
        let config = IcpConfig::refinement(voxel_m.min(global_voxel_m));
        let first_m = (2.0 * global_voxel_m).max(config.first_pair_distance_m.unwrap_or_default());
        IcpConfig { first_pair_distance_m: Some(first_m), ..config }
    }

    /// Settings of three fits that finish a motion found with voxels of `global_voxel_m`, from the
    /// coarsest. Where ranges are good to millimetres the finest is the best; where they are good
    /// to centimetres, the coarser ones.
    /// None is smaller than `least_m`, if that is less than `global_voxel_m`.
    pub(crate) fn finish(&self, global_voxel_m: f64, least_m: f64) -> [IcpConfig; 3] {
        let [coarse_m, middle_m, fine_m] = FINISH_VOXELS_M.map(|m| m * self.share_of_scene());
        let coarse_m = coarse_m.min(1.5 * self.radius_m() / VOXELS_A_RADIUS);
        let coarse = self.refined(global_voxel_m, coarse_m.max(least_m));
        let finer = [middle_m, fine_m].map(|m| m.max(least_m).min(coarse.voxel_m));
        // From where a coarser fit ended: no pair is far apart.
        let finer = finer.map(|voxel_m| IcpConfig {
            first_pair_distance_m: None,
            ..IcpConfig::refinement(voxel_m)
        });
        let fits = [coarse, finer[0], finer[1]];
        let can_run = fits.iter().all(|config| config.check().is_ok());
        if can_run { fits } else { FINISH_VOXELS_M.map(IcpConfig::refinement) }
    }

    /// Voxel of the finest fit, m.
    pub(crate) fn finest_voxel_m(&self) -> f64 {
        FINISH_VOXELS_M[2] * self.share_of_scene()
    }

    /// Voxel of the clouds for checking a motion, m: that of [`crate::Auto`].
    pub fn scene_voxel_m(&self) -> f64 {
        self.auto(None).voxel_m
    }

    /// Settings of [`crate::Auto`]; the voxel is the finest of its features.
    fn auto(&self, voxel_m: Option<f64>) -> AutoConfig {
        let outdoor = AutoConfig::outdoor();
        let voxel_m = voxel_m.unwrap_or(outdoor.voxel_m * self.share_of_scene());
        let config = AutoConfig { voxel_m, ..outdoor };
        if config.check().is_ok() { config } else { outdoor }
    }

    fn icp_of_voxel(&self, voxel_m: f64) -> IcpConfig {
        let config = IcpConfig::refinement(voxel_m);
        let outdoor_m = IcpConfig::outdoor().first_pair_distance_m.unwrap_or_default();
        let first_m = (outdoor_m * self.share_of_scene()).max(self.radius_m() / 4.0);
        let first_m = first_m.max(config.max_pair_distance_m).min(1e6);
        IcpConfig { first_pair_distance_m: Some(first_m), ..config }
    }

    /// Factor of lengths: 1 outdoors, less in a cloud smaller than [`SMALL_RADIUS_M`].
    fn share_of_scene(&self) -> f64 {
        (self.radius_m() / SMALL_RADIUS_M).min(1.0)
    }

    /// Radius of the larger cloud: see [`suggest()`].
    fn radius_m(&self) -> f64 {
        *self.radius_m.get_or_init(|| radius_m(self.target).max(radius_m(self.source)))
    }
}

/// Suggests settings of ICP, scaled to the clouds, coarse to fine.
///
/// The radius of a cloud is that of the ball around its median point that holds 9 of 10 points; of
/// two clouds, the larger. On four outdoor pairs (radii 10 to 37 m, motions up to 3.4 m and 10°),
/// each registered in both directions from the identity, ICP ends 0.1 to 1.1 cm and at most 0.22°
/// from the truth; plain ICP with pairs within 1 m misses one of the eight by 2.6 m. From 24 starts
/// 2 m and 11° off it ends there too, all on three pairs, 20 on the fourth (radius 10 m).
///
/// | setting | share of the radius | at a radius of 24 m |
/// |---|---|---|
/// | voxel | 1/80 | 0.3 m |
/// | normals, of the nearest 20 within | 20 voxels, at most 3 m | 3 m |
/// | pair distance, first | 1/4, at least 5 m; 5/8 of a radius below 8 m | 6 m |
/// | pair distance, last | 2 voxels | 0.6 m |
pub fn suggest(target: &Cloud, source: &Cloud) -> IcpConfig {
    Suggestions::new(target, source).icp()
}

/// Suggests settings of features for both clouds.
///
/// ```text
/// voxel = 1.2 m · min(1, radius / 8 m)      of the larger cloud
/// ```
///
/// It is enlarged in at most three rounds, by at most a quarter each for the sake of neighbours,
/// until half of the points have 8 neighbours within the normals' radius of three voxels, three
/// quarters have 15 within the features' of five, and at most 30,000 points are left. With it FGR
/// registers as many of the hard pairs (benches/record/registration.md) as with the best of 0.3,
/// 0.5, 0.8 and 1.2 m: 75 %, and no fewer in any kind of place, at any distance, in dense scans or
/// sparse ones. With 0.3 to 0.7 m, by the radius alone, it registers 62 %. The larger the voxel,
/// the rougher the motion: refine it.
pub fn suggest_features(target: &Cloud, source: &Cloud) -> FeatureConfig {
    Suggestions::new(target, source).features()
}

/// Defaults of a local method with the lengths of settings of ICP.
fn with_lengths(method: Method, icp: IcpConfig) -> MethodConfig {
    let (mut config, icp) = (MethodConfig::outdoor(method), MethodConfig::Icp(icp));
    for (setting, _) in Method::Icp.settings().filter(|(setting, _)| setting.unit == "m") {
        if let Some(length_m) = icp.get(setting.key) {
            config.set(setting.key, length_m);
        }
    }
    config
}

/// The voxel, or a larger one that leaves few enough points with enough neighbours; unchanged if
/// the cloud cannot be thinned.
fn widened(cloud: &Cloud, mut voxel_m: f64) -> f64 {
    for _ in 0..ROUNDS {
        let Ok(thinned) = voxel::downsample(cloud, voxel_m) else { return voxel_m };
        // Points on surfaces: their number falls with the square of the voxel. The least growth
        // of 1.05 makes up for rounding.
        let excess = thinned.points.len() as f64 / MOST_POINTS as f64;
        let wanted_m = if excess > 1.0 {
            voxel_m * excess.sqrt().max(1.05)
        } else {
            filling_voxel_m(&thinned)
        };
        if wanted_m <= voxel_m {
            return voxel_m;
        }
        voxel_m = if excess > 1.0 { wanted_m } else { wanted_m.min(GROWTH * voxel_m) };
    }
    voxel_m
}

/// The voxel, m, at which the radii of normals and features hold enough neighbours; 0 if there are
/// too few points.
fn filling_voxel_m(thinned: &Cloud) -> f64 {
    let tree = KdTree::new(&thinned.points);
    let stride = thinned.points.len().div_ceil(SAMPLES).max(1);
    let mut found = Vec::new();
    let mut farthest = [Vec::new(), Vec::new()];
    for point in thinned.points.iter().step_by(stride) {
        tree.within(point, f32::MAX.sqrt() / 2.0, FEATURE_FILLED, &mut found);
        for (far, count) in farthest.iter_mut().zip([NORMAL_FILLED, FEATURE_FILLED]) {
            far.extend(found.get(count - 1).map(|near| near.0.sqrt()));
        }
    }
    let [normal_m, feature_m] = farthest;
    let normal_m = f64::from(quantile(normal_m.into_iter(), 0.5)) / FeatureConfig::NORMAL_VOXELS;
    let feature_m = f64::from(quantile(feature_m.into_iter(), 0.75)) / FeatureConfig::RADIUS_VOXELS;
    normal_m.max(feature_m)
}

/// Radius of the ball around the median point that holds 9 of 10 points, m; 0 without points. Of
/// more than 200,000 points, that of a sample.
pub fn radius_m(cloud: &Cloud) -> f64 {
    // Odd, since scans hold a power of two of rings, one point of each after the other.
    let stride = cloud.points.len().div_ceil(RADIUS_SAMPLES) | 1;
    let sample = cloud.points.iter().step_by(stride);
    let echoes: Vec<&Point3<f32>> =
        sample.filter(|p| is_finite(p) && p.coords.norm() > 0.0).collect();
    let middle = Point3::from([0, 1, 2].map(|axis| quantile(echoes.iter().map(|p| p[axis]), 0.5)));
    f64::from(quantile(echoes.iter().map(|p| (*p - middle).norm()), 0.9))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::GicpConfig;

    /// A square of floor with points `spacing_m` apart on a lattice, 2 m below the sensor.
    fn floor(side_m: f64, spacing_m: f64) -> Cloud {
        let count = (side_m / spacing_m) as usize;
        let at = |i: usize| ((i as f64 + 0.5) * spacing_m - side_m / 2.0) as f32;
        Cloud::new(
            (0..count * count).map(|i| Point3::new(at(i % count), at(i / count), -2.0)).collect(),
        )
    }

    #[test]
    fn the_voxel_is_the_same_for_all_but_small_clouds() {
        for (side_m, spacing_m, expected_m) in
            [(6.0, 0.1, 0.50), (25.0, 0.1, 1.2), (50.0, 0.2, 1.2)]
        {
            let cloud = floor(side_m, spacing_m);
            let voxel_m = suggest_features(&cloud, &cloud).voxel_m;
            assert!((voxel_m - expected_m).abs() < 0.02, "{voxel_m} at {side_m}");
        }
    }

    #[test]
    fn a_sparse_cloud_gets_a_voxel_whose_neighbourhoods_are_filled() {
        let cloud = floor(50.0, 2.0);
        let config = suggest_features(&cloud, &cloud);
        assert!(config.normal_radius_m >= 2.0 * 2f64.sqrt() - 1e-3, "{config:?}");
    }

    #[test]
    fn features_are_of_30_000_points_at_most() {
        let cloud = floor(400.0, 0.5);
        let config = suggest_features(&cloud, &cloud);
        assert!(
            voxel::downsample(&cloud, config.voxel_m)
                .is_ok_and(|thin| thin.points.len() <= MOST_POINTS)
        );
        assert!(config.voxel_m < 2.6, "and not of far fewer: {config:?}");
    }

    #[test]
    fn the_radius_of_a_large_cloud_is_that_of_all_its_rings() {
        // 64 rings of 16,384 points, one of each ring after the other.
        let at = |i: usize| {
            let (ring, turn) = ((i % 64) as f32, (i / 64) as f32 * 0.001);
            Point3::new(ring * turn.cos(), ring * turn.sin(), 0.0)
        };
        let points: Vec<_> = (0..64 * 16_384).map(at).collect();
        // Every second ring alone, as an even stride would see them.
        let odd = |(i, point): (usize, &Point3<f32>)| point * (i % 2) as f32;
        let odd_only = Cloud::new(points.iter().enumerate().map(odd).collect());
        for cloud in [Cloud::new(points), odd_only] {
            let radius_m = radius_m(&cloud);
            assert!((radius_m - 57.0).abs() < 2.0, "{radius_m}");
        }
    }

    #[test]
    fn whatever_the_clouds_the_settings_can_run() {
        let table = [
            Cloud::default(),
            Cloud::new(vec![Point3::origin(); 9]),
            Cloud::new(vec![Point3::new(f32::NAN, 1.0, 1.0); 9]),
            Cloud::new(vec![Point3::new(1.0, 1.0, 1.0); 9]),
            Cloud::new(vec![Point3::new(f32::MAX, 0.0, 0.0), Point3::new(f32::MIN, 0.0, 0.0)]),
            floor(1.0, 0.1),
            floor(9e5, 3e4),
        ];
        for (a, b) in table.iter().flat_map(|a| table.iter().map(move |b| (a, b))) {
            assert_eq!(suggest(a, b).check(), Ok(()));
            let voxel_m = suggest_features(a, b).voxel_m;
            let suggestions = Suggestions::new(a, b);
            assert_eq!(suggestions.refinement(voxel_m).check(), Ok(()));
            for least_m in [0.0, 1.0, 1e9] {
                let fits = suggestions.finish(voxel_m, least_m);
                assert!(fits.iter().all(|fit| fit.check().is_ok()), "{fits:?}");
                assert!(fits.is_sorted_by(|a, b| a.voxel_m >= b.voxel_m), "{fits:?}");
            }
            assert_eq!(suggest_features(a, b).check(), Ok(()));
            let gicp = MethodConfig::Gicp(GicpConfig::from(&suggest(a, b)));
            assert_eq!(suggestions.method(Method::Gicp, FgrMode::Annealed, None), gicp);
            for method in Method::ALL {
                for mode in [FgrMode::Annealed, FgrMode::Open3d] {
                    assert_eq!(suggestions.method(method, mode, None).check(), Ok(()));
                }
            }
        }
    }
}
