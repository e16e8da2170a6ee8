//! Emulated boards: their memory maps, and the sensor's [`Board`] over them.

use echoloop_dsp::{Echoes, Hardware, Pipeline, ScanPattern, Scratch};
use echoloop_sensor::{Board, mailbox};

use crate::clock::Clock;
use crate::flash::Flash;
use crate::front_end::{Device, FrontEnd};
use crate::idle::Idle;
use crate::uart::{Port, Uart};
use crate::watchdog::Watchdog;

/// Arm MPS2 with application note 385 (Cortex-M3), 386 (Cortex-M4F) or 500 (Cortex-M7). The maps
/// differ only in the PSRAM.
#[cfg(board = "mps2")]
mod map {
    use crate::clock::Counter;
    use crate::idle::InterruptLine;
    use crate::mmio::Block;
    use echoloop_sensor::mailbox;

    pub(super) type Link = crate::uart::Cmsdk;
    pub(super) type Log = crate::uart::Cmsdk;

    // SAFETY: UART0; no Rust object is there.
    pub(super) const LINK: Block = unsafe { Block::new(0x4000_4000, 0x1000) };
    // SAFETY: UART1; no Rust object is there.
    pub(super) const LOG: Block = unsafe { Block::new(0x4000_5000, 0x1000) };
    // SAFETY: the watchdog; no Rust object is there.
    pub(super) const WATCHDOG: Option<Block> = Some(unsafe { Block::new(0x4000_8000, 0x1000) });
    /// Clock of the watchdog.
    pub(super) const WATCHDOG_HZ: u32 = 25_000_000;
    // SAFETY: timer 0; no Rust object is there.
    const TIMER: Block = unsafe { Block::new(0x4000_0000, 0x1000) };
    /// Interrupt of a byte received on UART0.
    // SAFETY: the board has this interrupt.
    pub(super) const LINK_INTERRUPT: InterruptLine = unsafe { InterruptLine::new(0) };
    // SAFETY: the processor's identity register.
    const CPU_ID: Block = unsafe { Block::new(0xE000_ED00, 4) };
    const CORTEX_M7: u32 = 0xC27;

    pub(super) fn counter() -> Counter {
        Counter::start_cmsdk(TIMER, 25)
    }

    pub(super) fn psram() -> Block {
        let part = CPU_ID.read(0) >> 4 & 0xfff;
        let base = if part == CORTEX_M7 { 0x6000_0000 } else { 0x2100_0000 };
        // SAFETY: 16 MB of PSRAM, where the linker puts nothing.
        unsafe { Block::new(base, mailbox::BYTES) }
    }
}

/// Arm MPS2 with application note 505 (Cortex-M33), at the secure addresses.
#[cfg(board = "an505")]
mod map {
    use crate::clock::Counter;
    use crate::idle::InterruptLine;
    use crate::mmio::Block;
    use echoloop_sensor::mailbox;

    pub(super) type Link = crate::uart::Cmsdk;
    pub(super) type Log = crate::uart::Cmsdk;

    // SAFETY: UART0; no Rust object is there.
    pub(super) const LINK: Block = unsafe { Block::new(0x5020_0000, 0x1000) };
    // SAFETY: UART1; no Rust object is there.
    pub(super) const LOG: Block = unsafe { Block::new(0x5020_1000, 0x1000) };
    // SAFETY: the secure watchdog; no Rust object is there.
    pub(super) const WATCHDOG: Option<Block> = Some(unsafe { Block::new(0x5008_1000, 0x1000) });
    /// Clock of the watchdog.
    pub(super) const WATCHDOG_HZ: u32 = 20_000_000;
    // SAFETY: timer 0; no Rust object is there.
    const TIMER: Block = unsafe { Block::new(0x5000_0000, 0x1000) };
    /// Interrupt of a byte received on UART0.
    // SAFETY: the board has this interrupt.
    pub(super) const LINK_INTERRUPT: InterruptLine = unsafe { InterruptLine::new(32) };

    pub(super) fn counter() -> Counter {
        Counter::start_cmsdk(TIMER, 20)
    }

    pub(super) fn psram() -> Block {
        // SAFETY: 16 MB of PSRAM, where the linker puts nothing.
        unsafe { Block::new(0x8000_0000, mailbox::BYTES) }
    }
}

/// Arm MPS3 with application note 547 (Cortex-M55), at the secure addresses.
#[cfg(board = "an547")]
mod map {
    use crate::clock::Counter;
    use crate::idle::InterruptLine;
    use crate::mmio::Block;
    use echoloop_sensor::mailbox;

    pub(super) type Link = crate::uart::Cmsdk;
    pub(super) type Log = crate::uart::Cmsdk;

    // SAFETY: UART0; no Rust object is there.
    pub(super) const LINK: Block = unsafe { Block::new(0x5930_3000, 0x1000) };
    // SAFETY: UART1; no Rust object is there.
    pub(super) const LOG: Block = unsafe { Block::new(0x5930_4000, 0x1000) };
    // SAFETY: the watchdog of the slow clock; no Rust object is there.
    pub(super) const WATCHDOG: Option<Block> = Some(unsafe { Block::new(0x5802_E000, 0x1000) });
    /// Slow clock.
    pub(super) const WATCHDOG_HZ: u32 = 32_768;
    // SAFETY: the system's counter; no Rust object is there.
    const COUNTER: Block = unsafe { Block::new(0x5810_0000, 0x1000) };
    // SAFETY: timer 0, which reads that counter; no Rust object is there.
    const TIMER: Block = unsafe { Block::new(0x5800_0000, 0x1000) };
    /// Interrupt of a byte received on UART0.
    // SAFETY: the board has this interrupt.
    pub(super) const LINK_INTERRUPT: InterruptLine = unsafe { InterruptLine::new(33) };

    pub(super) fn counter() -> Counter {
        const CONTROL: usize = 0x00;
        const ON: u32 = 1;
        COUNTER.write(CONTROL, ON);
        Counter::up(TIMER, 0, 32)
    }

    pub(super) fn psram() -> Block {
        // SAFETY: the first 16 MB of DDR4, where the linker puts nothing.
        unsafe { Block::new(0x6000_0000, mailbox::BYTES) }
    }
}

/// QEMU's virt machine, 32-bit RISC-V. It has one serial port, so the log is dropped, and no
/// watchdog.
#[cfg(board = "virt")]
mod map {
    use crate::clock::Counter;
    use crate::idle::InterruptLine;
    use crate::mmio::Block;
    use echoloop_sensor::mailbox;

    pub(super) type Link = crate::uart::Ns16550;
    pub(super) type Log = crate::uart::Void;

    // SAFETY: the serial port; no Rust object is there.
    pub(super) const LINK: Block = unsafe { Block::new(0x1000_0000, 8) };
    pub(super) const LOG: Block = LINK;
    pub(super) const WATCHDOG: Option<Block> = None;
    pub(super) const WATCHDOG_HZ: u32 = 0;
    // SAFETY: the lower half of mtime; no Rust object is there.
    const MTIME: Block = unsafe { Block::new(0x0200_BFF8, 4) };
    // SAFETY: the board has this interrupt.
    pub(super) const LINK_INTERRUPT: InterruptLine = unsafe { InterruptLine::new(10) };

    pub(super) fn counter() -> Counter {
        Counter::up(MTIME, 0, 10)
    }

    pub(super) fn psram() -> Block {
        // SAFETY: the second 16 MB of RAM, where the linker puts nothing (link/virt.x).
        unsafe { Block::new(0x8100_0000, mailbox::BYTES) }
    }
}

/// Size of the PSRAM that the maps keep free for the mailbox.
const PSRAM_BYTES: usize = 16 << 20;
const _: () = assert!(mailbox::BYTES <= PSRAM_BYTES);

/// Port of the log.
pub fn log_port() -> impl Port {
    map::Log::new(map::LOG)
}

/// Port of the link, for an image that prints text instead.
pub fn text_port() -> impl Port {
    map::Link::new(map::LINK)
}

/// Watchdog period in ticks: 4 s, because an emulator's clock runs on while the emulator is not
/// scheduled. After one period the board hangs in its interrupt, after two it restarts.
const WATCHDOG_TICKS: u32 = 4 * map::WATCHDOG_HZ;

/// Emulated board: the machine's serial ports and watchdog, and a front end in shared memory.
pub struct EmulatedBoard {
    hardware: Hardware,
    pattern: ScanPattern,
    front_end: FrontEnd,
    flash: Flash,
    link: Uart<map::Link>,
    watchdog: Option<Watchdog>,
    clock: Clock,
    restarts: u32,
    idle: Idle,
}

impl EmulatedBoard {
    /// Takes the board that the program runs on; `None` without a front end or straps, and on later
    /// calls.
    pub fn take() -> Option<Self> {
        let restarts = echoloop_restarts::count()?;
        let front_end = FrontEnd::new(map::psram())?;
        let (hardware, pattern) = front_end.straps()?;
        let watchdog = map::WATCHDOG.map(|block| Watchdog::start(block, WATCHDOG_TICKS));
        let clock = Clock::new(map::counter());
        let flash = Flash::new(front_end.flash());
        let idle = Idle::new(map::LINK_INTERRUPT)?;
        let link = Uart(map::Link::new(map::LINK));
        Some(Self { hardware, pattern, front_end, flash, link, watchdog, clock, restarts, idle })
    }

    /// Sleeps until a byte comes on the link, or for some milliseconds.
    pub fn idle(&mut self) {
        let link = &mut self.link.0;
        self.idle.sleep(|| link.clear_interrupt());
    }
}

impl Board for EmulatedBoard {
    type Spi = Device;
    type Link = Uart<map::Link>;
    type Store = Flash;

    fn hardware(&self) -> Hardware {
        self.hardware
    }

    fn pattern(&self) -> ScanPattern {
        self.pattern
    }

    fn emitter(&mut self) -> &mut Device {
        &mut self.front_end.emitter
    }

    fn adc(&mut self) -> &mut Device {
        &mut self.front_end.adc
    }

    fn link(&mut self) -> &mut Self::Link {
        &mut self.link
    }

    fn store(&mut self) -> &mut Flash {
        &mut self.flash
    }

    fn feed_watchdog(&mut self) {
        if let Some(watchdog) = &self.watchdog {
            watchdog.feed();
        }
    }

    fn restarts(&self) -> u32 {
        self.restarts
    }

    fn now_us(&mut self) -> Option<u32> {
        Some(self.clock.now_us())
    }

    fn begin_shot(&mut self) {
        self.front_end.ring();
    }

    fn samples(&mut self, codes: &mut [u16]) -> bool {
        let watchdog = self.watchdog;
        self.front_end.samples(codes, || {
            if let Some(watchdog) = &watchdog {
                watchdog.feed();
            }
        })
    }

    fn detect(&mut self, pipeline: &Pipeline, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        pipeline.process(echoloop_kernels::FASTEST, codes, scratch)
    }
}
