//! Timers: the clock that times scans, and the tick that wakes the processor.

use cortex_m::peripheral::NVIC;
use echoloop_part::board::Clock;
use nrf52840_hal::pac::{Interrupt, TIMER0, TIMER1, interrupt};
use nrf52840_hal::timer::{Periodic, Timer};

/// Microseconds between wake-ups, after which the watchdog is fed. The processor's own tick stops
/// while this part sleeps.
const TICK_US: u32 = 50_000;

/// Clock of microseconds: timer 0, which has 32 bits.
pub struct Microseconds(Timer<TIMER0, Periodic>);

impl Microseconds {
    /// Starts the clock.
    pub(crate) fn start(timer: TIMER0) -> Self {
        let mut timer = Timer::periodic(timer);
        timer.start(u32::MAX);
        Self(timer)
    }
}

impl Clock for Microseconds {
    /// Wraps after 71 minutes and skips a microsecond there: the HAL restarts at the count that it
    /// compares with.
    fn now_us(&self) -> u32 {
        self.0.read()
    }
}

/// Starts the tick.
pub(crate) fn start_tick(timer: TIMER1) {
    let mut timer = Timer::periodic(timer);
    timer.enable_interrupt();
    timer.start(TICK_US);
    // SAFETY: the handler uses only the timer, which is running.
    unsafe { NVIC::unmask(Interrupt::TIMER1) };
}

/// Tick, which only wakes the processor.
#[interrupt]
fn TIMER1() {
    // SAFETY: nothing else uses the timer once it runs.
    let timer = unsafe { &*TIMER1::ptr() };
    timer.events_compare[0].reset();
    // Read back, so that the event is cleared before the handler returns: else it would come twice.
    let _ = timer.events_compare[0].read();
}
