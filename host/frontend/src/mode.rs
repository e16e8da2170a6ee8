//! The model that makes waveforms.

use echoloop_parameters::Value;
use serde::{Deserialize, Serialize};

/// Model that makes the waveforms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Optical power, currents, shot noise and amplifier noise.
    #[default]
    Physical,
    /// Arbitrary units and Poisson noise.
    LitlCompat,
}

impl Value for Mode {}
