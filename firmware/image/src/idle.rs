//! Sleep until a byte or a tick comes. Interrupts stay masked: a pending one wakes the processor,
//! and no handler runs.

#[cfg(target_arch = "arm")]
pub use arm::Idle;
#[cfg(not(target_arch = "arm"))]
pub use spin::Idle;

/// An interrupt line of the processor.
#[derive(Clone, Copy)]
pub struct InterruptLine(u16);

impl InterruptLine {
    /// The line of a number.
    ///
    /// # Safety
    ///
    /// The processor must have it.
    pub const unsafe fn new(number: u16) -> Self {
        Self(number)
    }

    /// Its number.
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

    /// Ticks of the processor's clock between wake-ups, at which the watchdog is fed: some 10 ms.
    const TICKS: u32 = 250_000;

    // SAFETY: who made it promised that the line exists, and its number never changes.
    unsafe impl InterruptNumber for InterruptLine {
        fn number(self) -> u16 {
            self.0
        }
    }

    /// Sleep that a byte on the link ends, or a tick.
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

        /// Sleeps. What woke the processor is no longer pending afterwards; whoever calls looks
        /// what has come.
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

    /// No sleep: turns until something comes.
    pub struct Idle;

    impl Idle {
        /// Nothing to prepare.
        pub fn new(_link: InterruptLine) -> Option<Self> {
            Some(Self)
        }

        /// One turn.
        pub fn sleep(&self, clear_link: impl FnOnce()) {
            core::hint::spin_loop();
            clear_link();
        }
    }
}
