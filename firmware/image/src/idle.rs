//! Sleep until a byte or a tick comes. Interrupts stay masked: a pending one wakes the processor
//! without running a handler.

#[cfg(target_arch = "arm")]
pub use arm::Idle;
#[cfg(not(target_arch = "arm"))]
pub use spin::Idle;

/// Interrupt line of the processor.
#[derive(Clone, Copy)]
pub struct InterruptLine(u16);

impl InterruptLine {
    /// Line with this number.
    ///
    /// # Safety
    ///
    /// The processor must have this line.
    pub const unsafe fn new(number: u16) -> Self {
        Self(number)
    }

    /// Number of the line.
    pub const fn number(self) -> u16 {
        self.0
    }
}

#[cfg(target_arch = "arm")]
mod arm {
    use cortex_m::interrupt::InterruptNumber;
    use cortex_m::peripheral::syst::SystClkSource;
    use cortex_m::peripheral::{NVIC, Peripherals, SCB, SYST};

    use super::InterruptLine;

    /// Ticks of the processor's clock between wake-ups, after which the watchdog is fed: some 10
    /// ms.
    const TICKS: u32 = 250_000;

    // SAFETY: the caller of `new` promised that the line exists, and its number never changes.
    unsafe impl InterruptNumber for InterruptLine {
        fn number(self) -> u16 {
            self.0
        }
    }

    /// Sleep that a byte on the link or a tick ends.
    pub struct Idle {
        link: InterruptLine,
    }

    impl Idle {
        /// Masks interrupts for good, and lets the link's line and the tick wake the processor.
        /// `None` on later calls.
        pub fn new(link: InterruptLine) -> Option<Self> {
            cortex_m::interrupt::disable();
            let Peripherals { mut SYST, .. } = Peripherals::take()?;
            start(&mut SYST);
            // SAFETY: interrupts are masked, so no handler takes part in anything.
            unsafe { NVIC::unmask(link) };
            Some(Self { link })
        }

        /// Sleeps. Afterwards no interrupt is pending; the caller checks for a byte.
        pub fn sleep(&self, clear_link: impl FnOnce()) {
            cortex_m::asm::wfi();
            SCB::clear_pendst();
            clear_link();
            NVIC::unpend(self.link);
        }
    }

    fn start(tick: &mut SYST) {
        tick.set_clock_source(SystClkSource::Core);
        tick.set_reload(TICKS);
        tick.clear_current();
        tick.enable_interrupt();
        tick.enable_counter();
    }
}

#[cfg(not(target_arch = "arm"))]
mod spin {
    use super::InterruptLine;

    /// No sleep: the caller polls.
    pub struct Idle;

    impl Idle {
        /// Nothing to prepare.
        pub fn new(_link: InterruptLine) -> Option<Self> {
            Some(Self)
        }

        /// Returns at once.
        pub fn sleep(&self, clear_link: impl FnOnce()) {
            core::hint::spin_loop();
            clear_link();
        }
    }
}
