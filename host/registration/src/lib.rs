//! Registration: the motion that lays one cloud on another.

mod bits;
pub mod cloud;
pub mod config;
mod correspondences;
pub mod features;
pub mod fgr;
pub mod gicp;
pub mod global;
pub mod icp;
pub mod mac;
mod methods;
pub mod normal_equations;
pub mod observability;
mod outcome;
pub mod pose;
pub mod prepared;
pub mod refine;
mod registration;
pub mod rigid;
pub mod suggest;

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;

pub use config::{
    ConfigError, Convention, FeatureConfig, FgrConfig, FgrMode, GicpConfig, IcpConfig, MacConfig,
    Method, MethodConfig, current_key, former_key,
};
pub use fgr::Fgr;
pub use gicp::Gicp;
pub use icp::Icp;
pub use mac::Mac;
pub use methods::build;
pub use observability::Observability;
pub use outcome::{Consensus, Outcome, StopReason};
pub use prepared::{PrepareError, Source, Target};
pub use refine::Refined;
pub use registration::Registration;
pub use suggest::{suggest, suggest_features, suggest_gicp, suggest_method, suggest_refinement};
