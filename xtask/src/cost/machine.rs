//! Machines on which the cost is counted.

use crate::target::{ARMV7EM, ARMV8M, CORTEX_M55, RV32, Target};

/// A processor, and QEMU's machine with it.
pub(super) struct Machine {
    pub(super) processor: &'static str,
    pub(super) target: Target,
    pub(super) emulator: &'static str,
    /// Debian's package of the emulator.
    pub(super) package: &'static str,
    pub(super) machine: &'static str,
    /// Nanoseconds an instruction takes, as a power of two: SysTick sees 64, minstret is scaled by
    /// it.
    pub(super) shift: u32,
}

/// Emulated machines, in the order of the table.
pub(super) const MACHINES: [Machine; 5] = {
    const fn arm(processor: &'static str, target: Target, machine: &'static str) -> Machine {
        let (emulator, package) = ("qemu-system-arm", "qemu-system-arm");
        Machine { processor, target, emulator, package, machine, shift: 6 }
    }
    [
        arm("cortex-m4", ARMV7EM, "mps2-an386"),
        arm("cortex-m7", ARMV7EM, "mps2-an500"),
        arm("cortex-m33", ARMV8M, "mps2-an505"),
        arm("cortex-m55", CORTEX_M55, "mps3-an547"),
        Machine {
            processor: "rv32imac",
            target: RV32,
            emulator: "qemu-system-riscv32",
            package: "qemu-system-misc",
            machine: "virt",
            shift: 0,
        },
    ]
};
