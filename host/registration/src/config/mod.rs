//! Settings of registration: Θ_reg of each method.

mod by_name;
mod convention;
mod error;
mod features;
mod fgr;
pub mod given;
mod icp;
mod mac;
mod method;
mod mode;
mod setting;
mod table;
mod voxels;

pub use by_name::MethodConfig;
pub use convention::Convention;
pub use error::ConfigError;
pub use method::Method;
pub(crate) use method::with_methods;
pub use mode::FgrMode;
pub use setting::{Bound, Range, Search, Setting, Use};
pub use table::*;
