//! The board: what the part has.
//!
//! | what | where |
//! |---|---|
//! | link | UART0: P0.06 sends, P0.08 receives, 1,000,000 baud |
//! | log | RTT |
//! | settings | two pages of the flash, from 0xF2000 |
//! | clock of the scans' times | timer 0 |
//! | front end | none: the host sends the waveforms (`--front-end host`) |
//!
//! The link's pins are those that the development kit (PCA10056) leads to its debugger's serial
//! port.

use echoloop_part::board::Bare;
use nrf52840_hal::clocks::Clocks;
use nrf52840_hal::gpio::p0;
use nrf52840_hal::pac::{Peripherals, UICR};

use crate::controller::Controller;
use crate::flash::Flash;
use crate::link::{self, Sender};
use crate::log::LOG;
use crate::times::{self, Microseconds};
use crate::watchdog::Watchdog;

/// An nRF52840 with a serial line.
pub type Nrf52840 = Bare<Sender, Flash<Controller>, Watchdog, Microseconds>;

/// The board this runs on, its clocks, port and watchdog started; `None` on later calls, and where
/// a watchdog runs that a program before this one has set up otherwise.
pub fn take() -> Option<Nrf52840> {
    let restarts = echoloop_restarts::count()?;
    let part = Peripherals::take()?;
    leave_debugger_in(&part.UICR);
    // The radio's crystal, which every module has: by the part's own oscillator, within some
    // per cent, a serial line would not work.
    let _running = Clocks::new(part.CLOCK).enable_ext_hfosc();
    // Instructions from flash without waits where they were run before.
    part.NVMC.icachecnf.write(|w| w.cacheen().enabled());
    LOG.start(None);
    let pins = p0::Parts::new(part.P0);
    let link = link::start(part.UART0, pins.p0_06, pins.p0_08);
    let watchdog = Watchdog::start(part.WDT)?;
    times::start_tick(part.TIMER1);
    let clock = Microseconds::start(part.TIMER0);
    let store = Flash::new(Controller(part.NVMC));
    Some(Bare::new(link, store, watchdog, clock, restarts))
}

/// Later revisions of the part shut a debugger out after each reset until the program lets it in.
/// This one does where the tool that flashed it has opened the access port for good (errata 249).
fn leave_debugger_in(configuration: &UICR) {
    const OPEN: u32 = 0x5A;
    /// APPROTECT.DISABLE, which the crate of the registers does not know.
    const DISABLE: *mut u32 = 0x4000_0558 as *mut u32;
    if configuration.approtect.read().bits() & 0xFF == OPEN {
        // SAFETY: a register of nobody else's; earlier revisions have nothing there.
        unsafe { DISABLE.write_volatile(OPEN) };
    }
}
