//! One seed, many independent uses.

/// What a derived seed is for. Values are part of every published result: never renumber.
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
    /// Noise of the judgement.
    TestNoise = 5,
    /// The optimiser's samples.
    Search = 6,
    /// Which pairs a generation sees.
    Batch = 7,
    /// How the sensor shakes while it scans.
    Motion = 8,
    /// Noise of the check of the last choice.
    Check = 9,
    /// What the search for a front draws.
    Front = 16,
    /// Its noise.
    FrontNoise = 17,
}

/// A seed for one purpose and one index of it.
pub fn derive(seed: u64, purpose: Purpose, index: u64) -> u64 {
    echoloop_random::derive(seed, purpose as u64, index)
}

/// The seed of the noise where there is no pair: of a scan alone, and of a sensor that serves a
/// port.
pub fn scan_noise(seed: u64) -> u64 {
    derive(seed, Purpose::TestNoise, 0)
}
