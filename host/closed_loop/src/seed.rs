//! Seeds of independent random streams, derived from one.

/// Purpose of a derived seed. Values are part of every published result: never renumber.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Viewpoints of the training pairs.
    TrainPoses = 1,
    /// Viewpoints of the test pairs.
    TestPoses = 2,
    /// Noise of the search.
    TrainNoise = 3,
    /// Noise of the final choice among the shortlist.
    ShortlistNoise = 4,
    /// Noise of the evaluation on held-out pairs.
    TestNoise = 5,
    /// The optimiser's samples.
    Search = 6,
    /// Draw of a generation's pairs.
    Batch = 7,
    /// Vibration of the sensor during a scan.
    Motion = 8,
    /// Noise of the check of the last choice.
    Check = 9,
    /// Place of another LiDAR.
    OtherLidar = 10,
    /// Draws of the search for a front.
    Front = 16,
    /// Noise of the search for a front.
    FrontNoise = 17,
}

/// Seed for one index of a purpose.
pub fn derive(seed: u64, purpose: Purpose, index: u64) -> u64 {
    echoloop_random::derive(seed, purpose as u64, index)
}

/// Seed of the noise without a pair: a single scan, and a sensor that serves a port.
pub fn scan_noise(seed: u64) -> u64 {
    derive(seed, Purpose::TestNoise, 0)
}
