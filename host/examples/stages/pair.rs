//! Two clouds, the settings that fit a voxel, and what stages start from.

use std::path::Path;

use echoloop_host::cloud::kdtree::KdTree;
use echoloop_host::cloud::{Cloud, read_cloud, voxel};
use echoloop_host::pose::Pose;
use echoloop_host::registration::features::Described;
use echoloop_host::registration::{FeatureConfig, FgrConfig, GicpConfig, IcpConfig, MacConfig, Source, Target};

use crate::Result;

/// Pairs of a local method may be this far apart, m: small_gicp's default.
const LOCAL_PAIR_DISTANCE_M: f64 = 1.0;

/// Steps of a local method at most: Open3D's default.
const LOCAL_ITERATIONS: usize = 30;

/// Two clouds to register, and what has been worked out of them.
pub(crate) struct Pair {
    pub(crate) target: Cloud,
    pub(crate) source: Cloud,
    pub(crate) initial: Pose,
    voxel_m: f64,
    thinned: Option<Cloud>,
    described: Option<[Described; 2]>,
    icp: Option<(Target, Source)>,
}

impl Pair {
    pub(crate) fn load(target: &Path, source: &Path, voxel_m: f64, initial: Pose) -> Result<Self> {
        let (target, source) = (read_cloud(target)?.0, read_cloud(source)?.0);
        Ok(Self { target, source, initial, voxel_m, thinned: None, described: None, icp: None })
    }

    pub(crate) fn features(&self) -> FeatureConfig {
        FeatureConfig::of_voxel(self.voxel_m)
    }

    pub(crate) fn fgr(&self) -> FgrConfig {
        FgrConfig { features: self.features(), max_pair_distance_m: self.voxel_m, ..FgrConfig::outdoor() }
    }

    pub(crate) fn mac(&self) -> MacConfig {
        let scale = self.voxel_m / MacConfig::outdoor().features.voxel_m;
        MacConfig {
            features: self.features(),
            max_pair_distance_m: scale * MacConfig::outdoor().max_pair_distance_m,
            max_stretch_m: scale * MacConfig::outdoor().max_stretch_m,
            ..MacConfig::outdoor()
        }
    }

    pub(crate) fn icp(&self) -> IcpConfig {
        IcpConfig {
            voxel_m: self.voxel_m,
            normal_radius_m: 3.0 * self.voxel_m,
            max_pair_distance_m: LOCAL_PAIR_DISTANCE_M,
            max_iterations: LOCAL_ITERATIONS,
            ..IcpConfig::outdoor()
        }
    }

    pub(crate) fn gicp(&self) -> GicpConfig {
        GicpConfig {
            voxel_m: self.voxel_m,
            normal_radius_m: 5.0 * self.voxel_m,
            max_pair_distance_m: LOCAL_PAIR_DISTANCE_M,
            max_iterations: LOCAL_ITERATIONS,
            ..GicpConfig::outdoor()
        }
    }

    pub(crate) fn voxel_m(&self) -> f64 {
        self.voxel_m
    }

    /// The thinned source.
    pub(crate) fn thinned(&mut self) -> Result<&Cloud> {
        if self.thinned.is_none() {
            self.thinned = Some(voxel::downsample(&self.source, self.voxel_m)?);
        }
        self.thinned.as_ref().ok_or_else(|| "no cloud".into())
    }

    /// Source and target with features.
    pub(crate) fn described(&mut self) -> Result<&[Described; 2]> {
        if self.described.is_none() {
            let config = self.features();
            let both = [Described::prepare(&self.source, &config)?, Described::prepare(&self.target, &config)?];
            self.described = Some(both);
        }
        self.described.as_ref().ok_or_else(|| "no features".into())
    }

    /// Both clouds prepared for ICP.
    pub(crate) fn prepared(&mut self) -> Result<&(Target, Source)> {
        if self.icp.is_none() {
            let config = self.icp();
            self.icp = Some((Target::prepare(&self.target, &config)?, Source::prepare(&self.source, &config)?));
        }
        self.icp.as_ref().ok_or_else(|| "not prepared".into())
    }

    /// A tree of the thinned source.
    pub(crate) fn tree(&mut self) -> Result<KdTree> {
        Ok(KdTree::new(&self.thinned()?.points))
    }
}
