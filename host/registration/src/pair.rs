//! Two clouds of files, registered as `echoloop register` does: by settings that fit them, checked
//! on the clouds, in the frames of the files.

use echoloop_clouds::{Cloud, Pose, Recorded};

use crate::config::given::{Given, GivenError};
use crate::overlap::{Scene, asked};
use crate::survey::Frames;
use crate::{
    ConfigError, Confirmed, Gicp, Icp, IcpConfig, Method, MethodConfig, Outcome, PrepareError,
    Registration, Source, StopReason, Suggestions, Target, build,
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
    /// True to believe the method, without asking both clouds about its motion ([`Confirmed`]).
    pub unchecked: bool,
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
    /// No check, of a method that chooses by it.
    #[error("auto chooses by the check; it cannot be left out")]
    Check,
    /// A setting.
    #[error(transparent)]
    Given(#[from] GivenError),
}

/// Reason why a target cannot be prepared.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TargetError {
    /// A request that makes no sense.
    #[error(transparent)]
    Request(#[from] RequestError),
    /// A setting that cannot run.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A method that prepares nothing of a target alone.
    #[error("a target is prepared for icp or gicp, not for {}", .0.name())]
    Method(Method),
    /// A cloud that cannot be thinned.
    #[error(transparent)]
    Cloud(#[from] PrepareError),
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
        if self.unchecked && self.method == Method::Auto {
            return Err(RequestError::Check);
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
        let initial = frames.inside(initial);
        let outcome = match self.unchecked {
            true => method.register(target, source, &initial),
            false => {
                let method = Confirmed { method, voxel_m: suggestions.scene_voxel_m() };
                method.register(target, source, &initial)
            }
        };
        Ok(Registered { config, outcome, frames })
    }
}

/// A target prepared once for many sources, by a local method.
#[derive(Clone, Debug)]
pub struct PreparedTarget {
    /// Settings used, chosen from the target alone where they are not given.
    pub config: MethodConfig,
    target: Recorded,
    prepared: Target,
    /// For the check, with the voxel of the sources' scenes, m; none without it.
    scene: Option<(Scene, f64)>,
}

impl PreparedTarget {
    /// Prepares a target for the method of a request, which is icp or gicp.
    ///
    /// # Errors
    ///
    /// [`TargetError`] names what cannot be used.
    pub fn new(request: &Request, target: Recorded) -> Result<Self, TargetError> {
        request.check(false)?;
        let suggestions = Suggestions::new(&target.cloud, &target.cloud);
        let config = request.given.config(request.method, &suggestions)?;
        let prepared = match &config {
            MethodConfig::Icp(config) => Target::prepare(&target.cloud, config)?,
            MethodConfig::Gicp(config) => Target::prepare(&target.cloud, config)?,
            _ => return Err(TargetError::Method(request.method)),
        };
        let voxel_m = suggestions.scene_voxel_m();
        let scene = (!request.unchecked).then(|| Scene::new(&target.cloud, voxel_m)).transpose()?;
        let scene = scene.map(|scene| (scene, voxel_m));
        Ok(Self { config, target, prepared, scene })
    }

    /// Number of points that are left of the target.
    pub fn len(&self) -> usize {
        self.prepared.len()
    }

    /// True without points, which [`PreparedTarget::new`] refuses.
    pub fn is_empty(&self) -> bool {
        self.prepared.is_empty()
    }

    /// The target.
    pub fn target(&self) -> &Recorded {
        &self.target
    }

    /// Registers a source that is in [one frame](in_one_frame) with the target. With the same
    /// settings, as [`Request::register`] does.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names a setting that cannot run.
    pub fn register(&self, source: &Recorded, initial: &Pose) -> Result<Registered, ConfigError> {
        let frames = Frames::new(&self.target, source);
        let initial = frames.inside(initial);
        let outcome = match &self.config {
            MethodConfig::Icp(config) => {
                let (icp, source) = (Icp::new(*config)?, &source.cloud);
                self.align(source, &initial, Source::prepare(source, config), |source, from| {
                    icp.align(&self.prepared, source, from)
                })
            }
            MethodConfig::Gicp(config) => {
                let (gicp, source) = (Gicp::new(*config)?, &source.cloud);
                self.align(source, &initial, Target::prepare(source, config), |source, from| {
                    gicp.align(&self.prepared, source, from)
                })
            }
            _ => Outcome::nothing(&initial, StopReason::BadSettings), // refused by `new`
        };
        Ok(Registered { config: self.config, outcome, frames })
    }

    /// The outcome of a fit, asked of both clouds as [`Confirmed`] does, if it is to be checked.
    fn align<S>(
        &self,
        source: &Cloud,
        initial: &Pose,
        prepared: Result<S, PrepareError>,
        align: impl Fn(&S, &Pose) -> Outcome,
    ) -> Outcome {
        let source_prepared = match prepared {
            Ok(prepared) => prepared,
            Err(error) => return Outcome::nothing(initial, error.into()),
        };
        let outcome = align(&source_prepared, initial);
        let Some((target, voxel_m)) = self.scene.as_ref().filter(|_| outcome.iterations > 0) else {
            return outcome;
        };
        let Ok(source) = Scene::new(source, *voxel_m) else { return outcome };
        asked(outcome, (target, &source), |from| align(&source_prepared, from))
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
        let unchecked = Request { unchecked: true, ..of(Method::Auto) };
        assert_eq!(said(unchecked, false), "auto chooses by the check; it cannot be left out");
        let seeded = Given { seed: Some(1), ..Given::default() };
        let seeded = Request { given: seeded, ..of(Method::Mac) };
        assert_eq!(said(seeded, false), "seed is no setting of mac");
    }

    #[test]
    fn a_prepared_target_finds_what_the_request_finds() {
        let field = |x: f32, y: f32| [x, y, (0.7 * x).sin() + (0.5 * y + 0.2 * x).cos()];
        let at = |i: i32, x: f32| {
            let [u, v] = [i % 100 - 50, i / 100 - 50].map(|k| k as f32 * 0.2);
            let [_, v, w] = field(u, v);
            [u - x, v, w].into()
        };
        let cloud = |x| {
            let points = (0..10_000).map(|i| at(i, x)).collect();
            Recorded { cloud: Cloud::new(points), ..Recorded::default() }
        };
        let (target, source) = (cloud(0.0), cloud(0.3));
        for method in [Method::Icp, Method::Gicp] {
            let mut given = Given::default();
            given.set("voxel_m", 0.3).unwrap();
            let request = Request { method, given, ..Request::default() };
            let prepared = PreparedTarget::new(&request, target.clone()).unwrap();
            let found = prepared.register(&source, &Pose::identity()).unwrap();
            let settings = &mut Request::default().given;
            for (setting, _) in method.settings() {
                prepared.config.get(setting.key).map(|value| settings.set(setting.key, value));
            }
            let request = Request { given: settings.clone(), ..request };
            let alone = request.register(&target, &source, &Pose::identity()).unwrap();
            assert_eq!(found.outcome, alone.outcome, "{method:?}");
            let shift = found.target_from_source().translation.vector.x;
            assert!((shift - 0.3).abs() < 0.01, "{method:?}: {shift}");
            let unchecked = Request { unchecked: true, ..request };
            let alone = unchecked.register(&target, &source, &Pose::identity()).unwrap().outcome;
            let prepared = PreparedTarget::new(&unchecked, target.clone()).unwrap();
            let prepared = prepared.register(&source, &Pose::identity()).unwrap().outcome;
            for outcome in [alone, prepared] {
                assert_eq!(outcome.target_from_source, found.outcome.target_from_source);
                assert!(found.outcome.overlap.is_some() && outcome.overlap.is_none());
            }
        }
        let global = Request { method: Method::Mac, ..Request::default() };
        let refused = PreparedTarget::new(&global, target).unwrap_err().to_string();
        assert_eq!(refused, "a target is prepared for icp or gicp, not for mac");
    }

    #[test]
    fn a_motion_is_that_of_the_files_whatever_shift_their_clouds_have() {
        let field = |x: f32, y: f32| [x, y, (0.7 * x).sin() + (0.5 * y + 0.2 * x).cos()];
        let at = |i: i32| field((i % 100 - 50) as f32 * 0.2, (i / 100 - 50) as f32 * 0.2).into();
        let cloud = Cloud::new((0..10_000).map(at).collect());
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
