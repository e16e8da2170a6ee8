//! The detector alone: no link, no session, no board.

use echoloop_dsp::{Echoes, Hardware, Pipeline, Refusal, Scratch, Settings};
use echoloop_kernels::FASTEST;

/// Settings made ready, and 30 kB of memory that every waveform uses again.
///
/// ```
/// use echoloop_dsp::{Hardware, Settings};
/// use echoloop_own_firmware::Detector;
///
/// let mut detector = Detector::new(&Settings::default(), &Hardware::REFERENCE)?;
/// let codes = [100; 800]; // from your converter: right-aligned, as wide as `Hardware::adc_bits`
/// for echo in detector.echoes(&codes) {
///     let _ = (echo.range_m(), echo.deviation_mm(), echo.snr_ratio());
/// }
/// # Ok::<(), echoloop_dsp::Refusal>(())
/// ```
pub struct Detector {
    pipeline: Pipeline,
    scratch: Scratch,
}

impl Detector {
    /// A detector; `hardware` says what your converter and window are.
    ///
    /// # Errors
    ///
    /// [`Refusal`] names the field that cannot be, and its bound.
    pub fn new(settings: &Settings, hardware: &Hardware) -> Result<Self, Refusal> {
        Ok(Self { pipeline: Pipeline::new(settings, hardware)?, scratch: Scratch::new() })
    }

    /// The echoes of one waveform, in the fastest loops that the processor has.
    pub fn echoes(&mut self, codes: &[u16]) -> Echoes {
        self.pipeline.process(FASTEST, codes, &mut self.scratch)
    }
}
