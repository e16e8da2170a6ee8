//! Parameters that a search may change, and their ranges: choices that a configuration makes by
//! name.

use echoloop_dsp::{PARAMETERS, ParameterId};
use serde::{Deserialize, Serialize};

/// Quantity that a search minimises.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Objective {
    /// The error alone.
    Error,
    /// The error, and what a scan costs as far as `[tune.weights]` says.
    #[default]
    Weighted,
}

/// Mean of the errors of a candidate's pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum ErrorMean {
    /// Their mean (Eq. 4): the worst pairs decide.
    Arithmetic,
    /// Their geometric mean: each pair counts by how much nearer it comes.
    #[default]
    Geometric,
}

/// Parts of the loop that a search may change (Sec. 4.4).
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

/// Strategy of the search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Strategy {
    /// Either half alone, the sensor beside registration's winner, then both together, few pairs a
    /// generation.
    #[default]
    Fast,
    /// The paper's (Sec. 4.2): one search, all pairs, the plain mean of the errors.
    Paper,
}

impl Strategy {
    /// Name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Paper => "paper",
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

/// Parameters of Θ_lidar that a search may change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LidarPreset {
    /// The paper's eight, and how the gain rises with range.
    #[default]
    Usual,
    /// The eight that the paper names.
    Paper,
    /// All of them.
    Full,
}

impl LidarPreset {
    /// Its parameters.
    pub fn parameters(self) -> Vec<ParameterId> {
        match self {
            Self::Usual => [&PAPER_LIDAR[..], &BESIDE_THE_PAPER_S].concat(),
            Self::Paper => PAPER_LIDAR.to_vec(),
            Self::Full => PARAMETERS.iter().map(|p| p.id).collect(),
        }
    }
}

/// Lower end of the power in a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PowerRange {
    /// To 5 W, as in the paper.
    Paper,
    /// To a hundredth of a watt: half of a scan's points are then still there.
    Usual,
    /// As far as the sensor goes, to where nothing is detected: for whoever pays for energy.
    Whole,
}

/// The least power that the paper searched, W.
const PAPER_LEAST_POWER_W: f64 = 5.0;

/// The least of [`PowerRange::Usual`], W.
const USUAL_LEAST_POWER_W: f64 = 0.01;

impl From<LidarPreset> for PowerRange {
    fn from(preset: LidarPreset) -> Self {
        match preset {
            LidarPreset::Usual => Self::Usual,
            LidarPreset::Paper => Self::Paper,
            LidarPreset::Full => Self::Whole,
        }
    }
}

impl PowerRange {
    /// The least power of a search, W; one that starts below begins there.
    pub fn least_w(self, start_w: f64) -> f64 {
        let power = ParameterId::Power.parameter();
        match self {
            Self::Paper => PAPER_LEAST_POWER_W.min(start_w),
            Self::Usual => USUAL_LEAST_POWER_W.min(start_w),
            Self::Whole => power.to_unit(power.min),
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

/// Parameters tuned in addition, except with the paper's preset: a gain that rises with range
/// keeps near echoes, which hold a registration, off the converter's limit. Shots are not among
/// them: each costs a scan's time and light once more.
const BESIDE_THE_PAPER_S: [ParameterId; 2] = [ParameterId::GainSlope, ParameterId::GainRange];
