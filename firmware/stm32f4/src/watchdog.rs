//! Watchdog: the independent one, or the tick in the emulator, which has no model of it.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// Period. The longest time between two feeds is the erase of a sector, 500 ms; the watchdog's
/// clock runs at 17 to 47 kHz instead of 32 kHz, so 2,000 ms leave a factor of more than two.
const PERIOD_MS: u32 = 2_000;

/// Number of ticks until the emulator's watchdog restarts the board: 4 s, because an emulator's
/// clock runs on while the emulator is not scheduled.
const EMULATED_TICKS: u32 = 80;

/// Number of ticks since the emulator's watchdog was fed.
static UNFED: AtomicU32 = AtomicU32::new(0);
/// Number of ticks after which it restarts the board; on the part, never.
static LIMIT: AtomicU32 = AtomicU32::new(u32::MAX);

/// Watchdog that runs.
pub enum Watchdog {
    /// Independent watchdog of the part: nothing stops it.
    Independent(IndependentWatchdog),
    /// Tick, in the emulator. A program that hangs with interrupts masked stops it, too.
    Tick,
}

impl Watchdog {
    /// Starts the independent watchdog.
    pub(crate) fn start(mut watchdog: IndependentWatchdog) -> Self {
        watchdog.start(PERIOD_MS.millis());
        Self::Independent(watchdog)
    }

    /// Starts the emulator's watchdog; the caller starts the tick.
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

/// Tick, which wakes the processor. In the emulator it is also the watchdog's count.
#[exception]
fn SysTick() {
    let unfed = UNFED.load(Ordering::Relaxed).saturating_add(1);
    UNFED.store(unfed, Ordering::Relaxed);
    if unfed > LIMIT.load(Ordering::Relaxed) {
        SCB::sys_reset();
    }
}
