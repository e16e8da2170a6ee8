//! Clock of microseconds: timer 5, which has 32 bits.

use echoloop_part::board::Clock;
use stm32f4xx_hal::pac::TIM5;
use stm32f4xx_hal::rcc::{Enable, Rcc};

/// Divisor to microseconds for QEMU's model, which counts nanoseconds, whatever the clocks.
const EMULATED_PER_US: u32 = 1_000;

/// Clock: the running timer.
pub struct Microseconds(TIM5);

impl Microseconds {
    /// Starts the timer. Its clock has a whole number of ticks a microsecond: 84, or 16 after a
    /// reset.
    pub(crate) fn start(timer: TIM5, rcc: &mut Rcc, emulated: bool) -> Self {
        TIM5::enable(rcc);
        let per_us = match emulated {
            true => EMULATED_PER_US,
            false => rcc.clocks.timclk1().raw() / 1_000_000,
        };
        // SAFETY: a reload of all 32 bits, the register's value after a reset.
        timer.arr().write(|w| unsafe { w.bits(u32::MAX) });
        timer.psc().write(|w| w.psc().set(per_us.saturating_sub(1) as u16));
        timer.egr().write(|w| w.ug().set_bit()); // loads the divisor
        timer.cr1().modify(|_, w| w.cen().set_bit());
        Self(timer)
    }
}

impl Clock for Microseconds {
    /// Wraps after 71 minutes.
    fn now_us(&self) -> u32 {
        self.0.cnt().read().bits()
    }
}
