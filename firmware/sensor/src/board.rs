//! What the application needs of the hardware under it.

use echoloop_dsp::loops::Portable;
use echoloop_dsp::{Echoes, Hardware, Pipeline, ScanPattern, Scratch};
use embedded_hal::spi::SpiDevice;
use embedded_io::{Read, ReadReady, Write};
use embedded_storage::nor_flash::NorFlash;

/// A board: two SPI devices, a sample buffer, a serial link, a little flash and a watchdog.
pub trait Board {
    /// The bus the emitter and the converter sit on.
    type Spi: SpiDevice;
    /// The serial link to the host.
    type Link: Read + ReadReady + Write;
    /// The flash that settings are saved in: all of it is [`crate::store`]'s.
    type Store: NorFlash;

    /// What the hardware fixes.
    fn hardware(&self) -> Hardware;
    /// Where the beams point.
    fn pattern(&self) -> ScanPattern;
    /// The laser driver.
    fn emitter(&mut self) -> &mut Self::Spi;
    /// The amplifier and converter.
    fn adc(&mut self) -> &mut Self::Spi;
    /// The link.
    fn link(&mut self) -> &mut Self::Link;
    /// The flash.
    fn store(&mut self) -> &mut Self::Store;

    /// Says that the program still runs. The longest time without is one beam, one answer sent, or
    /// one slot erased and written.
    fn feed_watchdog(&mut self) {}

    /// Starts since power came on, but for the first: by the watchdog.
    fn restarts(&self) -> u32 {
        0
    }

    /// Bytes of the link that are kept for it while it works. Where it is 0, what comes before the
    /// answer to a frame may be lost, and a host that sends waveforms waits for each answer. Room
    /// for a frame ([`MAX_FRAME`](echoloop_link::MAX_FRAME)) keeps the line busy.
    fn link_buffer(&self) -> usize {
        0
    }

    /// Microseconds since any moment, wrapping: by them the sensor says which scans were late.
    /// `None`: there is no clock.
    fn now_us(&mut self) -> Option<u32> {
        None
    }

    /// Begins the shot whose registers have just been written, where writing FIRE does not do it.
    /// The converter fills its buffer while the program works on the shot before.
    fn begin_shot(&mut self) {}

    /// Waits for the shot fired last and copies its samples out of the converter's buffer, which
    /// the next shot may then have. False: it never came.
    fn samples(&mut self, codes: &mut [u16]) -> bool;

    /// Runs the DSP, as fast as this board can; the bytes are the same on all.
    #[inline(always)]
    fn detect(&mut self, pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        pipeline.process(Portable, codes, scratch)
    }
}
