//! Generalised ICP.

mod plane_to_plane;

use echoloop_clouds::{Cloud, Pose};

use self::plane_to_plane::PlaneToPlane;
use super::icp::descent::Descent;
use super::icp::pairing::Moving;
use super::{GicpConfig, IcpConfig, Outcome, Registration, Target};

/// Generalised ICP (Segal, Haehnel and Thrun, "Generalized-ICP", RSS 2009): both clouds are
/// surfaces, and a pair weighs by the uncertainty of its two planes.
///
/// ```text
/// E(T) = Σ dᵀ (C_q + R C_s Rᵀ)⁻¹ d      d = T s - q      C = I - (1 - ε) n nᵀ,  ε = 1e-3
/// ```
///
/// A plane's covariance is ε along its normal and 1 within, as there (small_gicp has the same
/// values). Steps are Gauss-Newton's with the weights of the last pose. Points without a normal
/// form no pair.
#[derive(Clone, Debug)]
pub struct Gicp {
    pub(super) config: GicpConfig,
}

impl Gicp {
    /// Finds the motion that brings `source` onto `target`, both prepared with these settings, from
    /// `initial`. The source of one pair can be the target of the next as it is.
    ///
    /// With too few pairs the outcome carries `initial`; with a direction left open it moves in the
    /// others.
    pub fn align(&self, target: &Target, source: &Target, initial: &Pose) -> Outcome {
        let Target { tree, normals, noise } = source;
        let moving = Moving { points: tree.points(), normals, noise };
        Descent(IcpConfig::from(&self.config)).run::<PlaneToPlane>(target, &moving, initial)
    }
}

impl Registration for Gicp {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        let target = Target::prepare(target, &self.config);
        let source = Target::prepare(source, &self.config);
        Outcome::of_prepared(target, source, initial, |target, source| {
            self.align(target, source, initial)
        })
    }
}
