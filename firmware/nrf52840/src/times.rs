//! Timers: the clock of the scans' times, and the tick that wakes the processor.

use cortex_m::peripheral::NVIC;
use echoloop_part::board::Clock;
use nrf52840_hal::pac::{Interrupt, TIMER0, TIMER1, interrupt};
use nrf52840_hal::timer::{Periodic, Timer};

/// Microseconds between wake-ups, at which the watchdog is fed. The processor's own tick stands
/// still while this part sleeps.
const TICK_US: u32 = 50_000;

/// A clock of microseconds: timer 0, which has 32 bits.
pub struct Microseconds(Timer<TIMER0, Periodic>);

impl Microseconds {
    /// Starts it.
    pub(crate) fn start(timer: TIMER0) -> Self {
        let mut timer = Timer::periodic(timer);
        timer.start(u32::MAX);
        Self(timer)
    }
}

impl Clock for Microseconds {
    /// Wraps after 71 minutes, where it leaves out one microsecond: the HAL begins anew at a count
    /// that it compares with.
    fn now_us(&self) -> u32 {
        self.0.read()
    }
}

/// Starts the tick.
pub(crate) fn start_tick(timer: TIMER1) {
    let mut timer = Timer::periodic(timer);
    timer.enable_interrupt();
    timer.start(TICK_US);
    // SAFETY: what the handler touches is the timer's, which is running.
    unsafe { NVIC::unmask(Interrupt::TIMER1) };
}

/// It wakes the processor, and does nothing else.
#[interrupt]
fn TIMER1() {
    // SAFETY: nobody else touches the timer once it runs.
    let timer = unsafe { &*TIMER1::ptr() };
    timer.events_compare[0].reset();
    // Read back, so that the event is gone before the handler is: it would come twice.
    let _ = timer.events_compare[0].read();
}
