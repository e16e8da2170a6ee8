//! Interface that the application needs of the hardware.

use echoloop_dsp::loops::Portable;
use echoloop_dsp::{Echoes, Hardware, Pipeline, ScanPattern, Scratch};
use embedded_hal::spi::SpiDevice;
use embedded_io::{Read, ReadReady, Write};
use embedded_storage::nor_flash::NorFlash;

/// Board: two SPI devices, a sample buffer, a serial link, a little flash and a watchdog.
pub trait Board {
    /// SPI device of emitter and converter.
    type Spi: SpiDevice;
    /// Serial link to the host.
    type Link: Read + ReadReady + Write;
    /// Flash that settings are saved in; [`crate::store`] uses all of it.
    type Store: NorFlash;

    /// Constants of the hardware.
    fn hardware(&self) -> Hardware;
    /// Scan pattern.
    fn pattern(&self) -> ScanPattern;
    /// Laser driver.
    fn emitter(&mut self) -> &mut Self::Spi;
    /// Amplifier and converter.
    fn adc(&mut self) -> &mut Self::Spi;
    /// Link to the host.
    fn link(&mut self) -> &mut Self::Link;
    /// Flash for the settings.
    fn store(&mut self) -> &mut Self::Store;

    /// Tells the watchdog that the program still runs. The longest time between two calls is that
    /// of measuring a beam, sending an answer, or erasing and writing a slot.
    fn feed_watchdog(&mut self) {}

    /// Number of starts since power came on, except the first: by the watchdog.
    fn restarts(&self) -> u32 {
        0
    }

    /// Number of bytes that the link buffers while the program works. With 0, bytes that come
    /// before the answer to a frame may be lost, and a host that sends waveforms waits for each
    /// answer. Room for a frame ([`MAX_FRAME`](echoloop_link::MAX_FRAME)) keeps the line busy.
    fn link_buffer(&self) -> usize {
        0
    }

    /// Microseconds since any moment, wrapping, with which the sensor times scans; `None` without a
    /// clock.
    fn now_us(&mut self) -> Option<u32> {
        None
    }

    /// Begins the shot whose registers have just been written, on boards where writing FIRE does
    /// not begin it. The converter fills its buffer while the program works on the shot before.
    fn begin_shot(&mut self) {}

    /// Waits for the last shot and fills `codes` with its samples; the converter's buffer is then
    /// free for the next shot. False when the shot never came.
    fn samples(&mut self, codes: &mut [u16]) -> bool;

    /// Runs the DSP, as fast as this board can; results are the same to the bit on all boards.
    #[inline(always)]
    fn detect(&mut self, pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        pipeline.process(Portable, codes, scratch)
    }
}
