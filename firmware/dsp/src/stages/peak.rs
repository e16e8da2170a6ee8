//! Peak of a waveform, and lists of peaks.

use heapless::Vec;

/// Most candidates held at a time; when there are more, the weakest is dropped.
pub const MAX_CANDIDATES: usize = 32;

/// Local maximum of the filter's output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peak {
    /// Index of the sample, the first of a plateau.
    pub index: u16,
    /// Output of the filter there, Q1.15.
    pub height: i16,
}

/// Peak with the strength of its echo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The peak.
    pub peak: Peak,
    /// Amplitude of the echo as if it were not clipped, Q1.15.
    pub strength: u32,
}

/// Candidates by rising index.
pub type Candidates = Vec<Candidate, MAX_CANDIDATES>;

/// Peaks by rising index.
pub type Peaks = Vec<Peak, MAX_CANDIDATES>;
