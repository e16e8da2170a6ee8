//! A board over the traits of any HAL.

use echoloop_dsp::{Echoes, Grid, Hardware, Pipeline, ScanPattern, Scratch};
use echoloop_kernels::FASTEST;
use echoloop_sensor::Board;
use embedded_hal::spi::SpiDevice;
use embedded_io::{Read, ReadReady, Write};
use embedded_storage::nor_flash::NorFlash;

/// Buffer of the converter, which DMA fills when the emitter fires.
pub trait Buffer {
    /// Codes of the last shot, once all of them have arrived.
    fn finished(&mut self) -> Option<&[u16]>;
    /// Releases the copied codes: DMA may fill the buffer with the next shot, which follows at
    /// once.
    fn arm(&mut self);
}

/// The watchdog; embedded-hal 1.0 has no trait for it.
pub trait Watchdog {
    /// Restarts its period.
    fn feed(&mut self);
}

/// Your board.
pub struct OwnBoard<Spi, Link, Flash, Samples, Dog> {
    /// Laser driver, chip select included.
    pub emitter: Spi,
    /// Amplifier and converter.
    pub adc: Spi,
    /// Serial line to the host.
    pub link: Link,
    /// Flash for two slots of settings; nothing else may write there.
    pub flash: Flash,
    /// Buffer of the converter.
    pub buffer: Samples,
    /// The watchdog, already started.
    pub watchdog: Dog,
    /// Number of restarts since power-on: count them in memory that survives a reset.
    pub restarts: u32,
    /// Microseconds of a timer, from any start: the host learns from them which scans were late.
    pub now_us: fn() -> Option<u32>,
}

/// Number of polls of the buffer before a shot counts as lost; better use a time limit if you have
/// a timer.
const SHOT_TIMEOUT: u32 = 1_000_000;

impl<Spi, Link, Flash, Samples, Dog> Board for OwnBoard<Spi, Link, Flash, Samples, Dog>
where
    Spi: SpiDevice,
    Link: Read + ReadReady + Write,
    Flash: NorFlash,
    Samples: Buffer,
    Dog: Watchdog,
{
    type Spi = Spi;
    type Link = Link;
    type Store = Flash;

    fn hardware(&self) -> Hardware {
        // Your converter's bits, your window, the largest safe energy of a pulse.
        Hardware { adc_bits: 12, range_min_mm: 1_000, range_max_mm: 120_000, ..Hardware::REFERENCE }
    }

    fn pattern(&self) -> ScanPattern {
        ScanPattern::Grid(Grid {
            columns: 64,
            rows: 16,
            azimuth_cdeg: 9_000,
            elevation_cdeg: 3_000,
        })
    }

    fn emitter(&mut self) -> &mut Spi {
        &mut self.emitter
    }

    fn adc(&mut self) -> &mut Spi {
        &mut self.adc
    }

    fn link(&mut self) -> &mut Link {
        &mut self.link
    }

    fn store(&mut self) -> &mut Flash {
        &mut self.flash
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }

    fn restarts(&self) -> u32 {
        self.restarts
    }

    fn now_us(&mut self) -> Option<u32> {
        (self.now_us)()
    }

    fn samples(&mut self, codes: &mut [u16]) -> bool {
        for _ in 0..SHOT_TIMEOUT {
            if let Some(finished) = self.buffer.finished() {
                let Some(finished) = finished.get(..codes.len()) else { return false };
                codes.copy_from_slice(finished);
                self.buffer.arm();
                return true;
            }
            self.watchdog.feed();
        }
        false
    }

    fn detect(&mut self, pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        pipeline.process(FASTEST, codes, scratch)
    }
}
