//! Board of the nRF52840, and its start.
//!
//! | function | part of the nRF52840 |
//! |---|---|
//! | link | UART0: P0.06 sends, P0.08 receives, 1,000,000 baud |
//! | log | RTT |
//! | settings | two pages of the flash, from 0xF2000 |
//! | clock of the scans' times | timer 0 |
//! | front end | none: the host sends the waveforms (`--front-end host`) |
//!
//! The development kit (PCA10056) connects the link's pins to its debugger's serial port.

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

/// nRF52840 with a serial line.
pub type Nrf52840 = Bare<Sender, Flash<Controller>, Watchdog, Microseconds>;

/// Takes the board that the program runs on and starts its clocks, port and watchdog; `None` on
/// later calls, and when an earlier program has left a watchdog running that is set up differently.
pub fn take() -> Option<Nrf52840> {
    let restarts = echoloop_restarts::count()?;
    let part = Peripherals::take()?;
    leave_debugger_in(&part.UICR);
    // The radio's crystal, which every module has. The part's own oscillator is off by some per
    // cent, with which a serial line would not work.
    let _running = Clocks::new(part.CLOCK).enable_ext_hfosc();
    // The cache gives instructions that ran before without waits for the flash.
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

/// Lets the debugger in. Later revisions of the part lock it out after each reset until the program
/// lets it in; this program does if the tool that flashed it has opened the access port permanently
/// (errata 249).
fn leave_debugger_in(configuration: &UICR) {
    const OPEN: u32 = 0x5A;
    /// APPROTECT.DISABLE, which the register crate does not have.
    const DISABLE: *mut u32 = 0x4000_0558 as *mut u32;
    if configuration.approtect.read().bits() & 0xFF == OPEN {
        // SAFETY: nothing else uses this register; earlier revisions have none there.
        unsafe { DISABLE.write_volatile(OPEN) };
    }
}
