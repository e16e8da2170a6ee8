//! Two clouds of files, registered as `echoloop register` does: by settings that fit them, checked
//! on the clouds, in the frames of the files.

use echoloop_clouds::{Pose, Recorded};

use crate::config::given::{Given, GivenError};
use crate::survey::Frames;
use crate::{
    ConfigError, Confirmed, IcpConfig, Method, MethodConfig, Outcome, Registration, Suggestions,
    build,
};

/// Largest difference of two shifts that become one, m, so that clouds nearly in place are
/// cut into the same voxels.
const SAME_FRAME_M: f64 = 10.0;

/// How to register two clouds.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Method.
    pub method: Method,
    /// True to finish what a global method finds with point-to-plane ICP.
    pub refine: bool,
    /// Settings that are given.
    pub given: Given,
    /// Settings that a run tuned, instead of those chosen from the clouds.
    pub tuned: Option<MethodConfig>,
}

/// Reason why a request makes no sense.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RequestError {
    /// Refinement of a method that finishes by itself.
    #[error(
        "refine goes with a method that leaves it to another (fgr, mac), not with {}",
        .0.name()
    )]
    Refine(Method),
    /// An initial guess for a method that takes none.
    #[error("{} searches everywhere, and takes no initial guess", .0.name())]
    Initial(Method),
    /// A setting.
    #[error(transparent)]
    Given(#[from] GivenError),
}

/// Two clouds registered.
#[derive(Clone, Debug)]
pub struct Registered {
    /// Settings used.
    pub config: MethodConfig,
    /// Outcome, in the frames of the clouds.
    pub outcome: Outcome,
    /// Frames of the clouds in those of their files.
    pub frames: Frames,
}

impl Request {
    /// Refuses what does not go together, before anything is read.
    ///
    /// # Errors
    ///
    /// [`RequestError`] names it.
    pub fn check(&self, has_initial: bool) -> Result<(), RequestError> {
        if self.refine && !self.method.is_rough() {
            return Err(RequestError::Refine(self.method));
        }
        if has_initial && self.method.is_rough() {
            return Err(RequestError::Initial(self.method));
        }
        Ok(self.given.check(self.method)?)
    }

    /// Registers two clouds that are in [one frame](in_one_frame), from a guess in the frames of
    /// their files.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names a setting that cannot run.
    pub fn register(
        &self,
        target: &Recorded,
        source: &Recorded,
        initial: &Pose,
    ) -> Result<Registered, ConfigError> {
        let frames = Frames::new(target, source);
        let (target, source) = (&target.cloud, &source.cloud);
        let suggestions = Suggestions::new(target, source);
        let config = match self.tuned {
            Some(tuned) => self.given.apply_to(tuned)?,
            None => self.given.config(self.method, &suggestions)?,
        };
        let voxel_m = config.get("voxel_m").unwrap_or_default();
        let finish = self.refine.then(|| match self.tuned {
            Some(_) => IcpConfig::refinement(voxel_m), // as in the run's evaluation
            None => suggestions.refinement(voxel_m),
        });
        let method = build(&config, finish)?;
        let method = Confirmed { method, voxel_m: suggestions.scene_voxel_m() };
        let outcome = method.register(target, source, &frames.inside(initial));
        Ok(Registered { config, outcome, frames })
    }
}

/// Takes the target's shift for a source nearly in place.
pub fn in_one_frame(target: &Recorded, source: &mut Recorded) {
    if (source.shift_m - target.shift_m).amax() <= SAME_FRAME_M {
        source.shift_by(target.shift_m);
    }
}

impl Registered {
    /// The motion, in the frames of the files.
    pub fn target_from_source(&self) -> Pose {
        self.frames.outside(&self.outcome.target_from_source)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn what_does_not_go_together_is_refused_by_name() {
        let said = |request: Request, has_initial| {
            request.check(has_initial).map_err(|error| error.to_string()).unwrap_err()
        };
        let of = |method| Request { method, ..Request::default() };
        let refined = Request { refine: true, ..of(Method::Icp) };
        let expected =
            "refine goes with a method that leaves it to another (fgr, mac), not with icp";
        assert_eq!(said(refined, false), expected);
        assert_eq!(
            said(of(Method::Fgr), true),
            "fgr searches everywhere, and takes no initial guess"
        );
        let mut given = Given::default();
        assert_eq!(given.set("voxels_m", 1.0), Err("voxels_m"));
        given.set("feature_radius_m", 1.0).unwrap();
        let request = Request { given, ..of(Method::Icp) };
        assert_eq!(said(request.clone(), false), "feature_radius_m is no setting of icp");
        assert_eq!(Request { method: Method::Mac, ..request }.check(false), Ok(()));
        let seeded = Given { seed: Some(1), ..Given::default() };
        let seeded = Request { given: seeded, ..of(Method::Mac) };
        assert_eq!(said(seeded, false), "seed is no setting of mac");
    }

    #[test]
    fn a_motion_is_that_of_the_files_whatever_shift_their_clouds_have() {
        let field = |x: f32, y: f32| [x, y, (0.7 * x).sin() + (0.5 * y + 0.2 * x).cos()];
        let at = |i: i32| field((i % 100 - 50) as f32 * 0.2, (i / 100 - 50) as f32 * 0.2).into();
        let cloud = crate::Cloud::new((0..10_000).map(at).collect());
        let near = Recorded { cloud, ..Recorded::default() };
        let shift_m = Vector3::new(500_000.0, 4_000_000.0, 100.0);
        let target = Recorded { shift_m, ..near.clone() };
        let request = Request { method: Method::Icp, ..Request::default() };
        let initial = Pose::from(nalgebra::Translation3::from(shift_m));
        let registered = request.register(&target, &near, &initial).unwrap();
        assert!(registered.outcome.stop.is_success(), "{}", registered.outcome.stop);
        let found = registered.target_from_source().translation.vector;
        assert!((found - shift_m).norm() < 1e-3, "{found}");
    }
}
