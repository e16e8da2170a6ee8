//! What an image needs that measures: a counter of instructions, a line of text, an end.

use core::fmt;

use crate::uart::Port;

/// Instructions that `run` takes, once, while the emulator's clock counts instructions (QEMU:
/// `-icount shift=6`).
///
/// Exact and the same every time, but for the resolution of the clock; `run` takes less than ten
/// million.
pub fn instructions(run: impl FnOnce()) -> u32 {
    let start = clock::now();
    run();
    let ticks = clock::since(start);
    clock::instructions(ticks)
}

/// Arm's SysTick, the processor's clock divided by nothing: 64 ns an instruction.
#[cfg(target_arch = "arm")]
mod clock {
    use crate::mmio::Block;

    // SAFETY: SysTick's registers, and nothing of Rust's.
    const SYS_TICK: Block = unsafe { Block::new(0xE000_E010, 16) };
    const CONTROL: usize = 0;
    const RELOAD: usize = 4;
    const VALUE: usize = 8;
    const LARGEST: u32 = 0x00ff_ffff;
    /// On, by the processor's clock, no interrupt.
    const ON: u32 = 0b101;

    /// The processor's clock.
    const MHZ: u64 = match () {
        () if cfg!(board = "an505") => 20,
        () if cfg!(board = "an547") => 32,
        () => 25,
    };
    /// What the emulator lets an instruction take.
    const INSTRUCTION_NS: u64 = 64;

    pub(super) fn now() -> u32 {
        SYS_TICK.write(RELOAD, LARGEST);
        SYS_TICK.write(VALUE, 0);
        SYS_TICK.write(CONTROL, ON);
        SYS_TICK.read(VALUE)
    }

    pub(super) fn since(start: u32) -> u32 {
        start.wrapping_sub(SYS_TICK.read(VALUE)) & LARGEST
    }

    /// The nearest.
    pub(super) fn instructions(ticks: u32) -> u32 {
        const THOUSAND: u64 = INSTRUCTION_NS * MHZ; // ticks of a thousand instructions
        (u64::from(ticks).saturating_mul(1_000).saturating_add(THOUSAND / 2) / THOUSAND) as u32
    }
}

/// RISC-V counts instructions itself.
#[cfg(target_arch = "riscv32")]
mod clock {
    pub(super) fn now() -> u32 {
        let count: u32;
        // SAFETY: reads a counter.
        unsafe { core::arch::asm!("csrr {}, minstret", out(reg) count, options(nostack)) };
        count
    }

    pub(super) fn since(start: u32) -> u32 {
        now().wrapping_sub(start)
    }

    pub(super) fn instructions(ticks: u32) -> u32 {
        ticks
    }
}

/// Text on the first serial port.
pub struct Text(());

impl Text {
    /// The port, as the emulator starts it. To be called where nothing else uses it.
    pub fn new() -> Self {
        Self(())
    }
}

impl Default for Text {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let mut port = crate::board::text_port();
        text.bytes().for_each(|byte| port.send(byte));
        Ok(())
    }
}

/// Ends the emulator: with success or not.
#[cfg(target_arch = "arm")]
pub fn end(success: bool) -> ! {
    const EXIT_EXTENDED: u32 = 0x20;
    const APPLICATION_EXIT: u32 = 0x2_0026;
    let reason = [APPLICATION_EXIT, u32::from(!success)];
    // SAFETY: semihosting reads the two words and does not return. Without a host it is a fault,
    // which ends the program too.
    unsafe {
        core::arch::asm!(
            "bkpt 0xab",
            inout("r0") EXIT_EXTENDED => _,
            in("r1") &reason,
            options(nostack)
        )
    };
    loop {
        core::hint::spin_loop();
    }
}

/// Ends the emulator: with success or not.
#[cfg(target_arch = "riscv32")]
pub fn end(success: bool) -> ! {
    // SAFETY: the virt machine's test device, and nothing of Rust's.
    let device = unsafe { crate::mmio::Block::new(0x0010_0000, 4) };
    device.write(0, if success { 0x5555 } else { 0x1_3333 });
    loop {
        core::hint::spin_loop();
    }
}
