//! Several shots of a beam become one waveform.

use crate::limits::MAX_CODES;

/// Sums of codes, 9.9 kB.
///
/// ```text
/// Σ[n]    = Σ_m code_m[n]                       m = 1, 2, 4, 8 or 16 shots
/// code[n] = round( Σ[n] / 2^d )                 b' = min(14, b + log₂ m),  d = b + log₂ m − b'
/// ```
///
/// | name | meaning | format | shape |
/// |---|---|---|---|
/// | `code_m` | ADC codes of a shot, b bits | integers | `[N]`, at most [`MAX_CODES`] |
/// | `Σ` | exact | integers in `u32` | `[N]` |
/// | `code` | codes of b' bits: nearest, ties up, saturating | integers in `u16` | `[N]` |
///
/// Signal grows with m, noise with √m, the ADC's steps stay: averaging white noise of σ ≥ ½ code
/// gains √m to the last bit that 14 of them hold.
#[derive(Clone, Debug)]
pub struct Accumulator {
    sums: [u32; MAX_CODES],
}

impl Default for Accumulator {
    fn default() -> Self {
        Self::new()
    }
}

impl Accumulator {
    /// Nothing yet.
    pub const fn new() -> Self {
        Self { sums: [0; MAX_CODES] }
    }

    /// Adds a shot; number 0 begins anew. Codes beyond [`MAX_CODES`] are ignored.
    pub fn add(&mut self, shot: u32, codes: &[u16]) {
        for (sum, &code) in self.sums.iter_mut().zip(codes) {
            let before = if shot == 0 { 0 } else { *sum };
            *sum = before.wrapping_add(u32::from(code)); // 16 shots of 16 bits are 20
        }
    }

    /// Reads the sums, divided by `2^shift`, into as many codes as there is room for.
    pub fn read(&self, shift: u32, codes: &mut [u16]) {
        let half = (1u32 << shift.min(31)) >> 1;
        for (code, &sum) in codes.iter_mut().zip(&self.sums) {
            *code = (sum.saturating_add(half) >> shift.min(31)).min(u32::from(u16::MAX)) as u16;
        }
    }
}
