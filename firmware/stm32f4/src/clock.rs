//! The clocks, and whether this is the part or an emulator without them.

use stm32f4xx_hal::pac::RCC;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Rcc};

/// Whether nothing models the clocks: the part runs by its own oscillator after every reset, and
/// that one's bits in RCC_CR (0x0000_XX83) are never all zero. QEMU reads zero.
pub fn is_emulated(rcc: &RCC) -> bool {
    rcc.cr().read().bits() == 0
}

/// The clocks as they are after a reset, for an emulator.
pub fn leave(rcc: RCC) -> Rcc {
    rcc.constrain()
}

/// 168 MHz from the part's own 16 MHz, so from any board: within 1 % at 25 °C, and a serial line
/// bears some 3 %. Where it gets hot or cold, name the board's crystal: `Config::hse(8.MHz())`.
///
/// The HAL's search for the divisors can panic. What it finds depends on this line alone: either
/// every start panics, or none. A function of its own, so that the check for panics can tell.
#[inline(never)]
pub fn start(rcc: RCC) -> Rcc {
    rcc.freeze(Config::hsi().sysclk(168.MHz()))
}
