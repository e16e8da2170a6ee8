//! The detector alone: no link, no session, no board.

use echoloop_dsp::{Echoes, Hardware, Pipeline, Refusal, Scratch, Settings};
use echoloop_kernels::FASTEST;

/// Prepared settings, and 30 kB of memory that all waveforms share.
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
    /// A detector; `hardware` describes your converter and window.
    ///
    /// # Errors
    ///
    /// [`Refusal`] names the refused field and its bound.
    pub fn new(settings: &Settings, hardware: &Hardware) -> Result<Self, Refusal> {
        Ok(Self { pipeline: Pipeline::new(settings, hardware)?, scratch: Scratch::new() })
    }

    /// Echoes of one waveform, found with the fastest loops for the processor.
    pub fn echoes(&mut self, codes: &[u16]) -> Echoes {
        self.pipeline.process(FASTEST, codes, &mut self.scratch)
    }
}
