//! The watchdog: the independent one, or the tick where the emulator has no model of it.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// Twice the longest between two calls that feed it: the erase of a sector, 500 ms, twice because
/// its clock runs at 17 to 47 kHz where 32 are meant.
const PERIOD_MS: u32 = 2_000;

/// Ticks until the emulator's restarts the board: 4 s, because an emulator's clock runs on while
/// the emulator is kept from running.
const EMULATED_TICKS: u32 = 80;

/// Ticks since the emulator's was fed.
static UNFED: AtomicU32 = AtomicU32::new(0);
/// After how many it restarts the board; never, on the part.
static LIMIT: AtomicU32 = AtomicU32::new(u32::MAX);

/// A watchdog that runs.
pub enum Watchdog {
    /// On the part: nothing stops it.
    Independent(IndependentWatchdog),
    /// In the emulator: a program that hangs with interrupts masked stops it, too.
    Tick,
}

impl Watchdog {
    /// Starts the part's.
    pub(crate) fn start(mut watchdog: IndependentWatchdog) -> Self {
        watchdog.start(PERIOD_MS.millis());
        Self::Independent(watchdog)
    }

    /// Starts the emulator's; somebody starts the tick.
    pub(crate) fn start_emulated() -> Self {
        LIMIT.store(EMULATED_TICKS, Ordering::Relaxed);
        Self::Tick
    }
}

impl echoloop_part::board::Watchdog for Watchdog {
    fn feed(&mut self) {
        match self {
            Self::Independent(watchdog) => watchdog.feed(),
            Self::Tick => UNFED.store(0, Ordering::Relaxed),
        }
    }
}

/// The tick. It wakes the processor, and in the emulator it counts.
#[exception]
fn SysTick() {
    let unfed = UNFED.load(Ordering::Relaxed).saturating_add(1);
    UNFED.store(unfed, Ordering::Relaxed);
    if unfed > LIMIT.load(Ordering::Relaxed) {
        SCB::sys_reset();
    }
}
