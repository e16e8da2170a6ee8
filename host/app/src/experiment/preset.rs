//! What a search may change, and between which bounds: the choices that a configuration makes by
//! name.

use echoloop_dsp::{PARAMETERS, ParameterId};
use serde::{Deserialize, Serialize};

/// What a search may change (Sec. 4.4).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Protocol {
    /// Nothing: the defaults are judged.
    Default,
    /// Θ_lidar.
    Lidar,
    /// Θ_reg.
    Registration,
    /// Both together.
    #[default]
    Joint,
}

impl Protocol {
    /// Name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Lidar => "lidar",
            Self::Registration => "registration",
            Self::Joint => "joint",
        }
    }
}

/// Ranges and defaults of Θ_reg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// What outdoor spacing needs.
    #[default]
    Outdoor,
    /// The paper's ranges (Sec. 3.3), made for indoor spacing.
    Paper,
}

/// Which of Θ_lidar a search may change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LidarPreset {
    /// The eight that the paper names.
    #[default]
    Paper,
    /// All of them.
    Full,
}

impl LidarPreset {
    /// Its parameters.
    pub fn parameters(self) -> Vec<ParameterId> {
        match self {
            Self::Paper => PAPER_LIDAR.to_vec(),
            Self::Full => PARAMETERS.iter().map(|p| p.id).collect(),
        }
    }
}

/// The eight of Θ_lidar that the paper names.
pub const PAPER_LIDAR: [ParameterId; 8] = [
    ParameterId::Power,
    ParameterId::Gain,
    ParameterId::NoiseFloor,
    ParameterId::SnrThreshold,
    ParameterId::Saturation,
    ParameterId::PulseWidth,
    ParameterId::WaveformResolution,
    ParameterId::Upsampling,
];
