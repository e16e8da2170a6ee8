//! The watchdog. It runs by the part's own slow oscillator, also while the processor sleeps, and
//! stands still while a debugger holds the processor.

use nrf52840_hal::clocks::LFCLK_FREQ;
use nrf52840_hal::pac::WDT;
use nrf52840_hal::wdt::count::One;
use nrf52840_hal::wdt::handles::Hdl0;
use nrf52840_hal::wdt::{self, WatchdogHandle};

/// Seconds, many times the longest between two calls that feed it: the erase of a page, 85 ms.
const PERIOD_S: u32 = 2;

/// A watchdog that runs: nothing stops it.
pub struct Watchdog(WatchdogHandle<Hdl0>);

impl Watchdog {
    /// Starts it, or takes over one that a reset has left running. `None`: it is set up otherwise,
    /// and restarts the board once more when it is not fed.
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
