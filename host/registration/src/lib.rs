//! Point-cloud registration: the rigid motion that brings one LiDAR scan onto another.
//!
//! An example: `README.md`.
//!
//! | to | take |
//! |---|---|
//! | register two scans from a good initial guess | [`Icp`], [`Gicp`] |
//! | register without an initial guess | [`Auto`]; by features of one scale [`Fgr`], [`Mac`] |
//! | refine the motion of one method by another | [`Refined`], or [`build`] from settings |
//! | check a motion on the scans themselves | [`overlap`] |
//! | do all of it for two clouds, as `echoloop register` does | [`pair`] |
//! | choose settings for two clouds | [`suggest`](mod@suggest) |
//! | thin clouds, estimate normals, search neighbours | [`geometry`] |
//! | describe and match points | [`features`] |
//! | read and write clouds, compare poses | [`clouds`], which is `echoloop-clouds` |
//! | add a method | the trait [`Registration`] |
//!
//! Lengths are metres; angles are radians, unless a name says degrees. The sensor of a cloud is at
//! its origin. A motion is called by what it maps: `target_from_source`. "Eq." and "Sec." are those
//! of "End-to-End LiDAR optimization for 3D point cloud registration" (BMVC 2025), unless another
//! source is named.

mod auto;
mod bits;
pub mod config;
mod correspondences;
pub mod covariance;
pub mod features;
pub mod fgr;
pub mod geometry;
pub mod gicp;
pub mod global;
pub mod icp;
pub mod mac;
mod methods;
mod normal_equations;
pub mod observability;
mod outcome;
pub mod overlap;
pub mod pair;
pub mod prepared;
pub mod refine;
mod registration;
pub mod rigid;
pub mod suggest;
pub mod survey;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

pub use auto::Auto;
pub use config::{
    AutoConfig, ConfigError, Convention, FeatureConfig, FgrConfig, FgrMode, GicpConfig, IcpConfig,
    MacConfig, Method, MethodConfig, SETTINGS, Setting, setting,
};
pub use covariance::Covariance;
pub use echoloop_clouds as clouds;
pub use echoloop_clouds::{Cloud, Pose, pose};
pub use echoloop_parameters::Kind;
pub use fgr::Fgr;
pub use gicp::Gicp;
pub use icp::Icp;
pub use mac::Mac;
pub use methods::build;
pub use observability::Observability;
pub use outcome::{Consensus, Outcome, StopReason};
pub use overlap::{Confirmed, OpenDirection, Overlap};
pub use prepared::{PrepareError, Source, Target};
pub use refine::Refined;
pub use registration::Registration;
pub use suggest::{Suggestions, suggest, suggest_features};

/// The example of the README runs as written there.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
