//! A board over the traits of any HAL.

use echoloop_dsp::{Echoes, Grid, Hardware, Pipeline, ScanPattern, Scratch};
use echoloop_kernels::FASTEST;
use echoloop_sensor::Board;
use embedded_hal::spi::SpiDevice;
use embedded_io::{Read, ReadReady, Write};
use embedded_storage::nor_flash::NorFlash;

/// The converter's buffer, which DMA fills when the emitter fires.
pub trait Buffer {
    /// The codes of the shot fired last, once all of them have come.
    fn finished(&mut self) -> Option<&[u16]>;
    /// They have been copied: DMA may fill the buffer with the next shot, which is fired at once.
    fn arm(&mut self);
}

/// The watchdog: no HAL's trait for it is part of embedded-hal 1.0.
pub trait Watchdog {
    /// Begins its period anew.
    fn feed(&mut self);
}

/// Your board.
pub struct OwnBoard<Spi, Link, Flash, Samples, Dog> {
    /// The laser driver, chip select included.
    pub emitter: Spi,
    /// The amplifier and converter.
    pub adc: Spi,
    /// The serial line to the host.
    pub link: Link,
    /// Flash for two slots of settings: nobody else may write there.
    pub flash: Flash,
    /// The converter's buffer.
    pub buffer: Samples,
    /// The watchdog, already started.
    pub watchdog: Dog,
    /// Starts since power came on, but for the first: count them in memory that a reset leaves.
    pub restarts: u32,
    /// Microseconds since any moment, of a timer: by them the host hears which scans were late.
    pub now_us: fn() -> Option<u32>,
}

/// Looks at the buffer before a shot counts as lost: take a bound of time if you have a timer.
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
        // Your converter's bits, your window, the greatest energy of a pulse that is safe.
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
