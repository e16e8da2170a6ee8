//! Sleep until a byte or a tick comes. Interrupts stay masked: a pending one wakes the processor,
//! and no handler runs.

#[cfg(target_arch = "arm")]
pub use arm::Idle;
#[cfg(not(target_arch = "arm"))]
pub use spin::Idle;

#[cfg(target_arch = "arm")]
mod arm {
    use cortex_m::interrupt::InterruptNumber;
    use cortex_m::peripheral::syst::SystClkSource;
    use cortex_m::peripheral::{NVIC, Peripherals, SCB, SYST};

    /// Ticks of the processor's clock between wake-ups, at which the watchdog is fed: some 10 ms.
    const TICKS: u32 = 250_000;

    #[derive(Clone, Copy)]
    struct Interrupt(u16);

    // SAFETY: the board's map gives the number of an interrupt line that exists.
    unsafe impl InterruptNumber for Interrupt {
        fn number(self) -> u16 {
            self.0
        }
    }

    /// Sleep that a byte on the link ends, or a tick.
    pub struct Idle {
        link: Interrupt,
    }

    impl Idle {
        /// Masks interrupts for good, and lets the link's line and the tick wake the processor.
        /// `None` on later calls.
        pub fn new(link_interrupt: u16) -> Option<Self> {
            cortex_m::interrupt::disable();
            let Peripherals { mut SYST, .. } = Peripherals::take()?;
            start(&mut SYST);
            let link = Interrupt(link_interrupt);
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
    /// No sleep: turns until something comes.
    pub struct Idle;

    impl Idle {
        /// Nothing to prepare.
        pub fn new(_link_interrupt: u16) -> Option<Self> {
            Some(Self)
        }

        /// One turn.
        pub fn sleep(&self, clear_link: impl FnOnce()) {
            core::hint::spin_loop();
            clear_link();
        }
    }
}
