//! The board: what the part has, and the [`Board`] over it.
//!
//! | what | where |
//! |---|---|
//! | link | USART1: PA9 sends, PA10 receives, 921,600 baud |
//! | log | RTT, and USART2: PA2 sends, 921,600 baud |
//! | settings | sectors 1 and 2 of the flash |
//! | clock of the scans' times | timer 5 |
//! | front end | none: a board with a laser and a converter puts its own in [`FrontEnd`]'s place |
//!
//! Without one the host sends the waveforms (`--front-end host`).

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use echoloop_dsp::{Echoes, Hardware, Pipeline, ScanPattern, Scratch};
use echoloop_sensor::Board;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use stm32f4xx_hal::pac::Peripherals;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Config, Serial};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use crate::file::File;
use crate::flash::Flash;
use crate::link::{BAUD, HELD, Link};
use crate::microseconds::Microseconds;
use crate::registers::Registers;
use crate::store::Store;
use crate::watchdog::Watchdog;
use crate::{clock, log};

/// Cycles between wake-ups, at which the watchdog is fed: 50 ms at 168 MHz.
const TICK: u32 = 8_400_000;

/// An STM32F405 with two serial lines.
pub struct Stm32f405 {
    front_end: FrontEnd,
    link: Link,
    store: Store,
    watchdog: Watchdog,
    clock: Microseconds,
    restarts: u32,
}

impl Stm32f405 {
    /// The board this runs on, its clocks, ports and watchdog started; `None` on later calls, and
    /// where a port or the emulator's file cannot be had.
    pub fn take() -> Option<Self> {
        let restarts = echoloop_restarts::count()?;
        let mut core = cortex_m::Peripherals::take()?;
        let part = Peripherals::take()?;
        let emulated = clock::is_emulated(&part.RCC);
        let mut rcc = if emulated { clock::leave(part.RCC) } else { clock::start(part.RCC) };

        let pins = part.GPIOA.split(&mut rcc);
        let config = Config::default().baudrate(BAUD.bps());
        let port = Serial::tx(part.USART2, pins.pa2, config, &mut rcc).ok()?;
        log::start(port);
        let port = Serial::new(part.USART1, (pins.pa9, pins.pa10), config, &mut rcc).ok()?;
        let link = Link::new(port);

        let (store, watchdog) = if emulated {
            defmt::warn!(
                "QEMU: no clocks, flash interface and independent watchdog here; settings in a \
                 file, the tick is the watchdog"
            );
            (Store::File(File::open()?), Watchdog::start_emulated())
        } else {
            let watchdog = IndependentWatchdog::new(part.IWDG);
            watchdog.stop_on_debug(&part.DBGMCU, true);
            // A probe reads RTT while the processor sleeps, too.
            part.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
            (Store::Flash(Flash::new(Registers(part.FLASH))), Watchdog::start(watchdog))
        };
        start(&mut core.SYST);
        let clock = Microseconds::start(part.TIM5, &mut rcc, emulated);
        Some(Self { front_end: FrontEnd, link, store, watchdog, clock, restarts })
    }

    /// Sleeps until a byte comes on the link, or a tick.
    pub fn idle(&mut self) {
        // Masked, so that a byte that comes after the look wakes the processor and is not slept
        // over: it is taken when the mask goes.
        cortex_m::interrupt::disable();
        if !self.link.has_received() {
            cortex_m::asm::wfi();
        }
        // SAFETY: no section is under way that this would cut short.
        unsafe { cortex_m::interrupt::enable() };
        match self.link.lost() {
            0 => {}
            lost => defmt::warn!("{=u32} bytes of the link lost", lost),
        }
    }
}

fn start(tick: &mut SYST) {
    tick.set_clock_source(SystClkSource::Core);
    tick.set_reload(TICK.wrapping_sub(1));
    tick.clear_current();
    tick.enable_interrupt();
    tick.enable_counter();
}

/// In the place of laser driver, amplifier and converter: nobody answers.
pub struct FrontEnd;

impl ErrorType for FrontEnd {
    type Error = ErrorKind;
}

impl SpiDevice for FrontEnd {
    fn transaction(&mut self, _: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        Err(ErrorKind::Other)
    }
}

impl Board for Stm32f405 {
    type Spi = FrontEnd;
    type Link = Link;
    type Store = Store;

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

    fn link(&mut self) -> &mut Link {
        &mut self.link
    }

    fn store(&mut self) -> &mut Store {
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
        Some(self.clock.now())
    }

    fn samples(&mut self, _codes: &mut [u16]) -> bool {
        false
    }

    fn detect(&mut self, pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        pipeline.process(echoloop_kernels::FASTEST, codes, scratch)
    }
}
