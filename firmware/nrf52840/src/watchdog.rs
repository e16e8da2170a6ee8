//! Watchdog. It runs by the part's own slow oscillator, also while the processor sleeps, and stops
//! while a debugger halts the processor.

use nrf52840_hal::clocks::LFCLK_FREQ;
use nrf52840_hal::pac::WDT;
use nrf52840_hal::wdt::count::One;
use nrf52840_hal::wdt::handles::Hdl0;
use nrf52840_hal::wdt::{self, WatchdogHandle};

/// Period in seconds: many times the longest time between two feeds, the erase of a page, 85 ms.
const PERIOD_S: u32 = 2;

/// Watchdog that runs: nothing stops it.
pub struct Watchdog(WatchdogHandle<Hdl0>);

impl Watchdog {
    /// Starts the watchdog, or takes over one that a reset has left running. `None` when that one
    /// is set up differently; unfed, it restarts the board once more.
    pub(crate) fn start(watchdog: WDT) -> Option<Self> {
        let ticks = PERIOD_S * LFCLK_FREQ;
        let parts = match wdt::Watchdog::try_new(watchdog) {
            Ok(mut idle) => {
                idle.set_lfosc_ticks(ticks);
                idle.activate::<One>()
            }
            Err(running) if running.crv.read().bits() == ticks => {
                wdt::Watchdog::try_recover::<One>(running).ok()?
            }
            Err(_) => return None,
        };
        Some(Self(parts.handles.0))
    }
}

impl echoloop_part::board::Watchdog for Watchdog {
    fn feed(&mut self) {
        self.0.pet();
    }
}
