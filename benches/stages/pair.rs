//! Two clouds, the settings for a voxel size, and the inputs of the stages.

use std::path::Path;

use echoloop_benches::Result;
use echoloop_clouds::{Cloud, Pose, read_cloud};
use echoloop_registration::features::{Described, PointPair, matching, pairs};
use echoloop_registration::global::described;
use echoloop_registration::{
    FeatureConfig, FgrConfig, GicpConfig, IcpConfig, MacConfig, Source, Target,
};

/// Radius of ICP's normals in voxels, the same as for the peers.
const ICP_NORMAL_VOXELS: f64 = 3.0;

/// Largest number of neighbours of ICP's normals, the same as for the peers.
const ICP_NORMAL_NEIGHBOURS: usize = 30;

/// Radius of GICP's normals, whose 20 neighbours are small_gicp's.
const GICP_NORMAL_VOXELS: f64 = 5.0;

/// Maximum pair distance of a local method, m: small_gicp's default.
const LOCAL_PAIR_DISTANCE_M: f64 = 1.0;

/// Largest number of steps of a local method: Open3D's default.
const LOCAL_ITERATIONS: usize = 30;

/// Two clouds to register, and the inputs computed from them.
pub(crate) struct Pair {
    pub(crate) target: Cloud,
    pub(crate) source: Cloud,
    pub(crate) initial: Pose,
    pub(crate) voxel_m: f64,
    described: Option<(Described, Described)>,
    matches: Option<Vec<PointPair>>,
    icp: Option<(Target, Source)>,
    gicp: Option<(Target, Target)>,
}

impl Pair {
    pub(crate) fn load(target: &Path, source: &Path, voxel_m: f64, initial: Pose) -> Result<Self> {
        let (target, source) = (read_cloud(target)?.0, read_cloud(source)?.0);
        Ok(Self {
            target,
            source,
            initial,
            voxel_m,
            described: None,
            matches: None,
            icp: None,
            gicp: None,
        })
    }

    pub(crate) fn features(&self) -> FeatureConfig {
        FeatureConfig::from_voxel(self.voxel_m)
    }

    pub(crate) fn fgr(&self) -> FgrConfig {
        FgrConfig::from_features(self.features())
    }

    pub(crate) fn mac(&self) -> MacConfig {
        MacConfig::from_features(self.features())
    }

    pub(crate) fn icp(&self) -> IcpConfig {
        IcpConfig {
            voxel_m: self.voxel_m,
            normal_radius_m: ICP_NORMAL_VOXELS * self.voxel_m,
            normal_neighbours: ICP_NORMAL_NEIGHBOURS,
            max_pair_distance_m: LOCAL_PAIR_DISTANCE_M,
            first_pair_distance_m: None,
            max_iterations: LOCAL_ITERATIONS,
            ..IcpConfig::outdoor()
        }
    }

    pub(crate) fn gicp(&self) -> GicpConfig {
        GicpConfig {
            voxel_m: self.voxel_m,
            normal_radius_m: GICP_NORMAL_VOXELS * self.voxel_m,
            max_pair_distance_m: LOCAL_PAIR_DISTANCE_M,
            first_pair_distance_m: None,
            max_iterations: LOCAL_ITERATIONS,
            ..GicpConfig::outdoor()
        }
    }

    /// GICP that refines a global method, with the distances that ICP would have.
    pub(crate) fn refinement_gicp(&self) -> GicpConfig {
        GicpConfig::from(&IcpConfig::refinement(self.voxel_m))
    }

    /// Target and source with features.
    pub(crate) fn described(&mut self) -> Result<&(Described, Described)> {
        if self.described.is_none() {
            let both = described(&self.target, &self.source, &self.features());
            self.described = Some(both.map_err(|stop| stop.to_string())?);
        }
        self.described.as_ref().ok_or_else(|| "no features".into())
    }

    /// Matches between both clouds.
    pub(crate) fn matches(&mut self) -> Result<&[PointPair]> {
        if self.matches.is_none() {
            let (target, source) = self.described()?;
            let found = matching::mutual(&source.features, &target.features);
            self.matches = Some(pairs(&found, source, target));
        }
        self.matches.as_deref().ok_or_else(|| "no matches".into())
    }

    /// Both clouds prepared for ICP.
    pub(crate) fn prepared(&mut self) -> Result<&(Target, Source)> {
        if self.icp.is_none() {
            let config = self.icp();
            self.icp = Some((
                Target::prepare(&self.target, &config)?,
                Source::prepare(&self.source, &config)?,
            ));
        }
        self.icp.as_ref().ok_or_else(|| "not prepared".into())
    }

    /// Both clouds prepared for GICP.
    pub(crate) fn prepared_gicp(&mut self) -> Result<&(Target, Target)> {
        if self.gicp.is_none() {
            let config = self.gicp();
            self.gicp = Some((
                Target::prepare(&self.target, &config)?,
                Target::prepare(&self.source, &config)?,
            ));
        }
        self.gicp.as_ref().ok_or_else(|| "not prepared".into())
    }
}
