//! Any method, from its settings.

use crate::{ConfigError, Fgr, Gicp, Icp, IcpConfig, Mac, MethodConfig, Refined, Registration};

/// A method with its settings, ready to run; `finish` goes on from where it ends.
///
/// # Errors
///
/// [`ConfigError`] names the setting that cannot run.
pub fn build(
    method: &MethodConfig,
    finish: Option<IcpConfig>,
) -> Result<Box<dyn Registration>, ConfigError> {
    let global: Box<dyn Registration> = match method {
        MethodConfig::Icp(config) => Box::new(Icp::new(*config)?),
        MethodConfig::Gicp(config) => Box::new(Gicp::new(*config)?),
        MethodConfig::Fgr(config) => Box::new(Fgr::new(*config)?),
        MethodConfig::Mac(config) => Box::new(Mac::new(*config)?),
    };
    Ok(match finish {
        Some(config) => Box::new(Refined { global, local: Icp::new(config)? }),
        None => global,
    })
}
