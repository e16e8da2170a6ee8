//! Board as it is sold: a processor, a serial line, flash and a watchdog, without laser and
//! converter.
//!
//! The host sends the waveforms (`--front-end host`). A board with a front end needs its own
//! [`Board`], which can use the parts of this one.

use echoloop_dsp::{Echoes, Hardware, Pipeline, ScanPattern, Scratch};
use echoloop_sensor::Board;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use embedded_storage::nor_flash::NorFlash;

use crate::link::{HELD, Link, Port};

/// Watchdog that restarts the board when it was not fed for its period.
pub trait Watchdog {
    /// Restarts the period.
    fn feed(&mut self);
}

/// Clock that runs.
pub trait Clock {
    /// Microseconds since any moment, wrapping.
    fn now_us(&self) -> u32;
}

/// Board without a front end: a link, a store, a watchdog and a clock.
pub struct Bare<P, S, W, C> {
    front_end: FrontEnd,
    link: Link<P>,
    store: S,
    watchdog: W,
    clock: C,
    restarts: u32,
}

impl<P, S, W, C> Bare<P, S, W, C> {
    /// Board of these parts; `restarts` is the number of restarts since the power came on.
    pub fn new(link: Link<P>, store: S, watchdog: W, clock: C, restarts: u32) -> Self {
        Self { front_end: FrontEnd, link, store, watchdog, clock, restarts }
    }

    /// Sleeps until a byte comes on the link, or until another interrupt, such as the tick after
    /// which the watchdog is fed.
    #[cfg(all(target_arch = "arm", target_os = "none"))]
    pub fn idle(&mut self) {
        crate::sleep_unless(|| self.link.has_received());
        match self.link.lost() {
            0 => {}
            lost => defmt::warn!("the link lost bytes {=u32} times", lost),
        }
    }
}

/// Missing front end: every transaction fails.
pub struct FrontEnd;

impl ErrorType for FrontEnd {
    type Error = ErrorKind;
}

impl SpiDevice for FrontEnd {
    fn transaction(&mut self, _: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        Err(ErrorKind::Other)
    }
}

impl<P: Port, S: NorFlash, W: Watchdog, C: Clock> Board for Bare<P, S, W, C> {
    type Spi = FrontEnd;
    type Link = Link<P>;
    type Store = S;

    fn hardware(&self) -> Hardware {
        Hardware::REFERENCE
    }

    fn pattern(&self) -> ScanPattern {
        ScanPattern::default()
    }

    fn emitter(&mut self) -> &mut FrontEnd {
        &mut self.front_end
    }

    fn adc(&mut self) -> &mut FrontEnd {
        &mut self.front_end
    }

    fn link(&mut self) -> &mut Link<P> {
        &mut self.link
    }

    fn store(&mut self) -> &mut S {
        &mut self.store
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.feed();
    }

    fn restarts(&self) -> u32 {
        self.restarts
    }

    fn link_buffer(&self) -> usize {
        HELD
    }

    fn now_us(&mut self) -> Option<u32> {
        Some(self.clock.now_us())
    }

    fn samples(&mut self, _codes: &mut [u16]) -> bool {
        false
    }

    fn detect(&mut self, pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        pipeline.process(echoloop_kernels::FASTEST, codes, scratch)
    }
}
