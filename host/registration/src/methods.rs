//! Any method, from its settings.

use crate::{
    Auto, ConfigError, Fgr, Gicp, Icp, IcpConfig, Mac, MethodConfig, Refined, Registration,
};

/// A method with its settings, ready to run; ICP with those of `refinement` goes on from its end.
///
/// # Errors
///
/// [`ConfigError`] names the setting that cannot run.
pub fn build(
    method: &MethodConfig,
    refinement: Option<IcpConfig>,
) -> Result<Box<dyn Registration>, ConfigError> {
    let global: Box<dyn Registration> = match method {
        MethodConfig::Icp(config) => Box::new(Icp::new(*config)?),
        MethodConfig::Gicp(config) => Box::new(Gicp::new(*config)?),
        MethodConfig::Fgr(config) => Box::new(Fgr::new(*config)?),
        MethodConfig::Mac(config) => Box::new(Mac::new(*config)?),
        MethodConfig::Auto(config) => Box::new(Auto::new(*config)?),
    };
    Ok(match refinement {
        Some(config) => Box::new(Refined { global, local: Icp::new(config)? }),
        None => global,
    })
}
