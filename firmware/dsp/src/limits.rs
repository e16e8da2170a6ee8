//! How much a waveform holds: what every buffer of the detector is sized by.

/// Samples a waveform may hold: the widest waveform resolution of
/// [`PARAMETERS`](crate::PARAMETERS).
pub const MAX_SAMPLES: usize = 2400;

/// Samples that are taken before the trigger, when the ambient light is measured there.
pub const PRE_TRIGGER: usize = 128;

/// Samples of a shot: those before the trigger and the waveform.
pub const MAX_CODES: usize = PRE_TRIGGER + MAX_SAMPLES;

/// Taps a template may hold: 20 ns at 3.02 GS/s need 121.
pub const MAX_TAPS: usize = 127;

/// Echoes a waveform may yield.
pub const MAX_ECHOES: usize = 4;
