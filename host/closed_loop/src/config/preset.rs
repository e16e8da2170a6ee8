//! Parameters that a search may change, and their ranges: choices that a configuration makes by
//! name.

use echoloop_dsp::{PARAMETERS, ParameterId};
use echoloop_parameters::choice;

choice! {
    /// Quantity that a search minimises.
    pub enum Objective by default Weighted {
        /// The error alone.
        Error = "error",
        /// The error, and what a scan costs as far as `[tune.weights]` says.
        Weighted = "weighted",
    }
}

choice! {
    /// Mean of the errors of a candidate's pairs.
    pub enum ErrorMean by default SquareRoot {
        /// Their mean (Eq. 4): the worst pairs decide.
        Arithmetic = "arithmetic",
        /// Their geometric mean: each pair counts by how much nearer it comes.
        Geometric = "geometric",
        /// The square of the mean of their square roots: between the two.
        SquareRoot = "square-root",
    }
}

choice! {
    /// Parts of the loop that a search may change (Sec. 4.4).
    pub enum Protocol by default Joint {
        /// Nothing: the defaults are judged.
        Default = "default",
        /// Θ_lidar.
        Lidar = "lidar",
        /// Θ_reg.
        Registration = "registration",
        /// Both together.
        Joint = "joint",
    }
}

choice! {
    /// Strategy of the search.
    pub enum Strategy by default Fast {
        /// Either half alone, the sensor beside registration's winner, then both together, few
        /// pairs a generation.
        Fast = "fast",
        /// The paper's (Sec. 4.2): one search, all pairs, the plain mean of the errors.
        Paper = "paper",
    }
}

choice! {
    /// How candidates are drawn.
    pub enum Sampler by default CmaEs {
        /// By CMA-ES, which learns from the generations before.
        CmaEs = "cma-es",
        /// Evenly from all of the ranges, to compare with: what the same registrations find without
        /// an optimiser.
        Random = "random",
    }
}

choice! {
    /// Ranges and defaults of Θ_reg.
    pub enum Preset by default Outdoor {
        /// Settings for outdoor spacing.
        Outdoor = "outdoor",
        /// The paper's ranges (Sec. 3.3), made for indoor spacing.
        Paper = "paper",
    }
}

choice! {
    /// Parameters of Θ_lidar that a search may change.
    pub enum LidarPreset by default Usual {
        /// The paper's eight, how the gain rises with range, and the aim of a steered sensor.
        Usual = "usual",
        /// The eight that the paper names.
        Paper = "paper",
        /// Where the light goes: the aim of a steered sensor, and shots a beam.
        Aim = "aim",
        /// All of them.
        Full = "full",
    }
}

impl LidarPreset {
    /// Its parameters; only a steered sensor has an aim.
    pub fn parameters(self, is_steered: bool) -> Vec<ParameterId> {
        match self {
            Self::Usual => {
                let aim: &[ParameterId] = if is_steered { &AIM } else { &[] };
                [&PAPER_LIDAR[..], &BESIDE_THE_PAPER_S, aim].concat()
            }
            Self::Aim => AIM.to_vec(),
            Self::Paper => PAPER_LIDAR.to_vec(),
            Self::Full => PARAMETERS.iter().map(|p| p.id).collect(),
        }
    }

    /// The least power of a search, W; one that starts below begins there. At a hundredth of a watt
    /// half of a scan's points are still there; at the sensor's own least, nothing is detected.
    pub fn least_power_w(self, start_w: f64) -> f64 {
        let power = ParameterId::Power.parameter();
        match self {
            Self::Usual | Self::Aim => start_w.min(0.01),
            Self::Paper => start_w.min(5.0),
            Self::Full => power.to_unit(power.min),
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
/// keeps near echoes, which hold a registration, off the converter's limit.
const BESIDE_THE_PAPER_S: [ParameterId; 2] = [ParameterId::GainSlope, ParameterId::GainRange];

/// Parameters of where the light goes. Columns follow from the budget, and the time of a scan is as
/// long as that has.
const AIM: [ParameterId; 7] = [
    ParameterId::Shots,
    ParameterId::AzimuthSpan,
    ParameterId::ElevationSpan,
    ParameterId::Tilt,
    ParameterId::Rows,
    ParameterId::AzimuthFovea,
    ParameterId::ElevationFovea,
];
