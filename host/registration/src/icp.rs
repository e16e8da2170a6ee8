//! Iterative closest point, point to plane.

pub(super) mod centred;
pub(super) mod descent;
pub(super) mod equations;
pub(super) mod kernel;
pub(super) mod lanes;
pub(super) mod normals;
pub(super) mod pairing;
pub(super) mod pairs;
pub(super) mod step;
pub(super) mod uncertainty;

use echoloop_clouds::{Cloud, Pose};

use self::descent::Descent;
use self::pairing::Moving;
use super::normal_equations::NormalEquations;
use super::{IcpConfig, Outcome, Registration, Source, Target};

/// Point-to-plane ICP: pair each point with the nearest, step to the least squares, repeat.
///
/// ```text
/// min Σ (n · (T s - q))²      q the target point nearest to T s, n its normal; anew each step
/// ```
///
/// Chen and Medioni, "Object modelling by registration of multiple range images", 1992. With
/// `max_normal_angle_rad` the normal is the mean of both points'. A target prepared once serves
/// many sources:
///
/// ```
/// use echoloop_registration::{Cloud, Icp, IcpConfig, Pose, Source, Target};
///
/// let field = |x: f32, y: f32| [x, y, (0.7 * x).sin() + (0.5 * y + 0.2 * x).cos() - 3.0].into();
/// let at = |i: i32| field((i % 100) as f32 * 0.2, (i / 100) as f32 * 0.2);
/// let cloud = Cloud::new((0..10_000).map(at).collect());
///
/// let icp = Icp::new(IcpConfig::outdoor())?;
/// let target = Target::prepare(&cloud, icp.config())?;
/// let source = Source::prepare(&cloud, icp.config())?;
/// let start = Pose::translation(0.2, 0.1, -0.1);
/// let outcome = icp.align(&target, &source, &start);
/// assert!(outcome.stop.is_success());
/// assert!(outcome.target_from_source.translation.vector.norm() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Icp {
    pub(super) config: IcpConfig,
}

impl Icp {
    /// Finds the motion that brings `source` onto `target`, both prepared with these settings, from
    /// `initial`.
    ///
    /// Points whose nearest has no normal form no pair. With too few pairs the outcome carries
    /// `initial`; with a direction left open it moves in the others.
    pub fn align(&self, target: &Target, source: &Source, initial: &Pose) -> Outcome {
        let Source { points, normals, noise } = source;
        let moving = Moving { points, normals, noise };
        Descent(self.config).run::<NormalEquations>(target, &moving, initial)
    }
}

impl Registration for Icp {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        let target = Target::prepare(target, &self.config);
        let source = Source::prepare(source, &self.config);
        Outcome::of_prepared(target, source, initial, |target, source| {
            self.align(target, source, initial)
        })
    }
}
