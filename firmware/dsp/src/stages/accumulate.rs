//! Accumulation: several shots of a beam become one waveform.

use crate::limits::MAX_CODES;

/// Number of lanes; shots are added to them in turn.
pub const LANES: usize = 4;

/// Sums of the codes of several shots, 20 kB.
///
/// ```text
/// Λ_k[n]  = Σ code_m[n]  over m mod 4 = k       m of 1, 2, 4, 8 or 16 shots
/// Σ[n]    = Λ_0 + … + Λ_3
/// code[n] = round( Σ[n] / 2^d )                 b' = min(14, b + log₂ m),  d = b + log₂ m − b'
/// ```
///
/// | name | meaning | format | shape |
/// |---|---|---|---|
/// | `code_m` | ADC codes of a shot, b bits | integers | `[N]`, at most [`MAX_CODES`] |
/// | `Λ` | exact up to 14 bits, else saturating | integers in `u16` | `[N][4]` |
/// | `Σ` | exact | integers in `u32` | `[N]` |
/// | `code` | codes of b' bits: nearest, ties up, saturating | integers in `u16` | `[N]` |
///
/// Signal grows with m, noise with √m, the ADC's steps stay: averaging white noise of σ ≥ ½ code
/// gains √m to the last bit that 14 of them hold. Lanes stay apart for
/// [`crate::clipped::dithered_edges`].
#[derive(Clone, Debug)]
pub struct Accumulator {
    lanes: [[u16; LANES]; MAX_CODES],
    /// Number of shots added since shot 0.
    added: u32,
}

impl Default for Accumulator {
    fn default() -> Self {
        Self::new()
    }
}

impl Accumulator {
    /// Accumulator without shots.
    pub const fn new() -> Self {
        Self { lanes: [[0; LANES]; MAX_CODES], added: 0 }
    }

    /// Adds a shot; shot 0 clears the sums first. Codes beyond [`MAX_CODES`] are ignored.
    pub fn add(&mut self, shot: u32, codes: &[u16]) {
        let turn = shot as usize % LANES;
        for (lanes, &code) in self.lanes.iter_mut().zip(codes) {
            if shot == 0 {
                *lanes = [0; LANES];
            }
            if let Some(lane) = lanes.get_mut(turn) {
                *lane = lane.saturating_add(code);
            }
        }
        self.added = if shot == 0 { 1 } else { self.added.saturating_add(1) };
    }

    /// Fills `codes` with the sums, divided by `2^shift`.
    pub fn read(&self, shift: u32, codes: &mut [u16]) {
        let half = (1u32 << shift.min(31)) >> 1;
        for (code, lanes) in codes.iter_mut().zip(&self.lanes) {
            let sum = lanes.iter().fold(0u32, |sum, &lane| sum.saturating_add(lane.into()));
            *code = (sum.saturating_add(half) >> shift.min(31)).min(u32::from(u16::MAX)) as u16;
        }
    }

    /// Sums of a sample by lane.
    pub fn lanes(&self, sample: usize) -> [u16; LANES] {
        self.lanes.get(sample).copied().unwrap_or_default()
    }

    /// True when exactly `shots` shots have been added since the last call.
    pub fn take(&mut self, shots: u32) -> bool {
        core::mem::take(&mut self.added) == shots
    }
}
