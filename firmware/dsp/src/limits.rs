//! How much a waveform holds: what every buffer of the detector is sized by.

/// Samples a waveform may hold: the widest waveform resolution of
/// [`PARAMETERS`](crate::PARAMETERS).
pub const MAX_SAMPLES: usize = 2400;

/// Samples that are taken before the trigger, when the ambient light is measured there.
pub const PRE_TRIGGER: usize = 128;

/// Samples of a shot: those before the trigger and the waveform.
pub const MAX_CODES: usize = PRE_TRIGGER + MAX_SAMPLES;

/// Gains of a [`Ramp`](crate::rising_gain::ramp::Ramp) that are kept, one a sample, instead of
/// being worked out for every waveform again: 10 kB that a PC has, and a microcontroller wants for
/// its waveforms. A 64-bit processor is taken for one that has them.
pub const MAX_GAINS: usize = if cfg!(target_pointer_width = "64") { MAX_SAMPLES } else { 0 };

/// Taps a template may hold: 20 ns at 3.02 GS/s need 121.
pub const MAX_TAPS: usize = 127;

/// Echoes a waveform may yield.
pub const MAX_ECHOES: usize = 4;
