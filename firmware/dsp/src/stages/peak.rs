//! A local maximum of a waveform, and a list of them.

use heapless::Vec;

/// Candidates held at a time; when more turn up, the weakest goes.
pub const MAX_CANDIDATES: usize = 32;

/// A local maximum of the filter's output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peak {
    /// The sample, the first of a plateau.
    pub index: u16,
    /// The output there, Q1.15.
    pub height: i16,
}

/// A peak, and how strong its echo is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The peak.
    pub peak: Peak,
    /// Amplitude of the echo as if nothing had clipped it, Q1.15.
    pub strength: u32,
}

/// Candidates by rising index.
pub type Candidates = Vec<Candidate, MAX_CANDIDATES>;

/// Peaks by rising index.
pub type Peaks = Vec<Peak, MAX_CANDIDATES>;
