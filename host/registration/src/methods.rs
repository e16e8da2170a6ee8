//! Methods from their settings.

use crate::config::with_methods;
use crate::*;

macro_rules! declare {
    ($($method:ident $config:ident $name:literal $searched:ident $help:literal;)+) => {
        $(impl $method {
            /// Method with these settings.
            ///
            /// # Errors
            ///
            /// [`ConfigError`] names the field that cannot run.
            pub fn new(config: $config) -> Result<Self, ConfigError> {
                config.check()?;
                Ok(Self { config })
            }

            /// The settings.
            pub fn config(&self) -> &$config {
                &self.config
            }
        })+

        fn alone(method: &MethodConfig) -> Result<Box<dyn Registration>, ConfigError> {
            Ok(match method {
                $(MethodConfig::$method(config) => Box::new($method::new(*config)?),)+
            })
        }
    };
}

with_methods!(declare);

/// The method of these settings, ready to run. With settings of a `refinement`, ICP goes on from
/// the motion it finds.
///
/// # Errors
///
/// [`ConfigError`] names the setting that cannot run.
pub fn build(
    method: &MethodConfig,
    refinement: Option<IcpConfig>,
) -> Result<Box<dyn Registration>, ConfigError> {
    let global = alone(method)?;
    Ok(match refinement {
        Some(config) => Box::new(Refined { global, local: Icp::new(config)? }),
        None => global,
    })
}
