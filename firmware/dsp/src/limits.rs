//! Largest waveform, template and number of echoes: the sizes of the detector's buffers.

/// Most samples of a waveform: the highest waveform resolution in
/// [`PARAMETERS`](crate::PARAMETERS).
pub const MAX_SAMPLES: usize = 2400;

/// Samples before the trigger, taken when the ambient light is measured there.
pub const PRE_TRIGGER: usize = 128;

/// Most samples of a shot: those before the trigger and the waveform's.
pub const MAX_CODES: usize = PRE_TRIGGER + MAX_SAMPLES;

/// Gains that a [`Ramp`](crate::rising_gain::ramp::Ramp) stores, one a sample, instead of computing
/// them for every waveform: 10 kB, which a PC has and a microcontroller needs for its waveforms. A
/// 64-bit processor counts as a PC.
pub const MAX_GAINS: usize = if cfg!(target_pointer_width = "64") { MAX_SAMPLES } else { 0 };

/// Most taps of a template: 20 ns at 3.02 GS/s need 121.
pub const MAX_TAPS: usize = 127;

/// Most echoes of a waveform.
pub const MAX_ECHOES: usize = 4;
