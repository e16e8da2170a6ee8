//! Board of the STM32F405, and its start.
//!
//! | function | part of the STM32F405 |
//! |---|---|
//! | link | USART1: PA9 sends, PA10 receives, 921,600 baud |
//! | log | RTT, and USART2: PA2 sends, 921,600 baud |
//! | settings | sectors 1 and 2 of the flash |
//! | clock of the scans' times | timer 5 |
//! | front end | none: the host sends the waveforms (`--front-end host`) |

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use echoloop_part::board::Bare;
use stm32f4xx_hal::pac::{Peripherals, USART1};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Config, Serial};
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use crate::file::File;
use crate::flash::Flash;
use crate::link::{BAUD, Sender};
use crate::log::LOG;
use crate::microseconds::Microseconds;
use crate::registers::Registers;
use crate::store::Store;
use crate::watchdog::Watchdog;
use crate::{clock, link};

/// Cycles between wake-ups, after which the watchdog is fed: 50 ms at 168 MHz.
const TICK: u32 = 8_400_000;

/// STM32F405 with two serial lines.
pub type Stm32f405 = Bare<Sender<USART1>, Store, Watchdog, Microseconds>;

/// Takes the board that the program runs on and starts its clocks, ports and watchdog; `None` on
/// later calls, and without a port or the emulator's file.
pub fn take() -> Option<Stm32f405> {
    let restarts = echoloop_restarts::count()?;
    let mut core = cortex_m::Peripherals::take()?;
    let part = Peripherals::take()?;
    let emulated = clock::is_emulated(&part.RCC);
    let mut rcc = if emulated { clock::leave(part.RCC) } else { clock::start(part.RCC) };

    let pins = part.GPIOA.split(&mut rcc);
    let config = Config::default().baudrate(BAUD.bps());
    let port = Serial::tx(part.USART2, pins.pa2, config, &mut rcc).ok()?;
    LOG.start(Some(Sender(port)));
    let port = Serial::new(part.USART1, (pins.pa9, pins.pa10), config, &mut rcc).ok()?;
    let link = link::start(port);

    let (store, watchdog) = if emulated {
        defmt::warn!(
            "QEMU: no clocks, flash interface and independent watchdog here; settings in a \
             file, the tick is the watchdog"
        );
        (Store::File(File::open()?), Watchdog::start_emulated())
    } else {
        let watchdog = IndependentWatchdog::new(part.IWDG);
        watchdog.stop_on_debug(&part.DBGMCU, true);
        // Lets a probe read RTT while the processor sleeps, too.
        part.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
        (Store::Flash(Flash::new(Registers(part.FLASH))), Watchdog::start(watchdog))
    };
    start(&mut core.SYST);
    let clock = Microseconds::start(part.TIM5, &mut rcc, emulated);
    Some(Bare::new(link, store, watchdog, clock, restarts))
}

fn start(tick: &mut SYST) {
    tick.set_clock_source(SystClkSource::Core);
    tick.set_reload(TICK.wrapping_sub(1));
    tick.clear_current();
    tick.enable_interrupt();
    tick.enable_counter();
}
