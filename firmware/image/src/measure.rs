//! Parts of a measuring image: a counter of instructions, text output, an exit.

use core::fmt;

use crate::uart::Port;

/// Number of instructions that a call of `run` takes, if the emulator's clock counts instructions
/// (QEMU: `-icount shift=6`).
///
/// It is exact to the resolution of the clock and the same every time; `run` must take less than
/// ten million.
pub fn instructions(run: impl FnOnce()) -> u32 {
    let start = clock::now();
    run();
    let ticks = clock::since(start);
    clock::instructions(ticks)
}

/// Arm's SysTick at the undivided clock of the processor; an instruction takes 64 ns.
#[cfg(target_arch = "arm")]
mod clock {
    use crate::mmio::Block;

    // SAFETY: SysTick's registers; no Rust object is there.
    const SYS_TICK: Block = unsafe { Block::new(0xE000_E010, 16) };
    const CONTROL: usize = 0;
    const RELOAD: usize = 4;
    const VALUE: usize = 8;
    const LARGEST: u32 = 0x00ff_ffff;
    /// Value of CONTROL: on, by the processor's clock, without interrupt.
    const ON: u32 = 0b101;

    /// Clock of the processor.
    const MHZ: u64 = match () {
        () if cfg!(board = "an505") => 20,
        () if cfg!(board = "an547") => 32,
        () => 25,
    };
    /// Time that the emulator gives an instruction.
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

    /// Number of instructions, nearest, that take this many ticks.
    pub(super) fn instructions(ticks: u32) -> u32 {
        const THOUSAND: u64 = INSTRUCTION_NS * MHZ; // ticks of a thousand instructions
        (u64::from(ticks).saturating_mul(1_000).saturating_add(THOUSAND / 2) / THOUSAND) as u32
    }
}

/// RISC-V's own counter of instructions.
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
    /// Port as the emulator starts it. Nothing else may use it.
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

/// Ends the emulator, with success or failure.
#[cfg(target_arch = "arm")]
pub fn end(success: bool) -> ! {
    const EXIT_EXTENDED: u32 = 0x20;
    const APPLICATION_EXIT: u32 = 0x2_0026;
    let reason = [APPLICATION_EXIT, u32::from(!success)];
    // SAFETY: semihosting reads the two words and does not return. Without a host it faults, which
    // ends the program too.
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

/// Ends the emulator, with success or failure.
#[cfg(target_arch = "riscv32")]
pub fn end(success: bool) -> ! {
    // SAFETY: the virt machine's test device; no Rust object is there.
    let device = unsafe { crate::mmio::Block::new(0x0010_0000, 4) };
    device.write(0, if success { 0x5555 } else { 0x1_3333 });
    loop {
        core::hint::spin_loop();
    }
}
