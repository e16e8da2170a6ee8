//! Clocks, and detection of an emulator, which does not model them.

use stm32f4xx_hal::pac::RCC;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Rcc};

/// True in an emulator without a model of the clocks. The part runs by its own oscillator after
/// every reset, whose bits in RCC_CR (0x0000_XX83) are never all zero; QEMU reads zero.
pub fn is_emulated(rcc: &RCC) -> bool {
    rcc.cr().read().bits() == 0
}

/// Leaves the clocks as they are after a reset, for an emulator.
pub fn leave(rcc: RCC) -> Rcc {
    rcc.constrain()
}

/// Starts the clocks: 168 MHz from the part's own 16 MHz, so on any board. They are within 1 % at
/// 25 °C, and a serial line tolerates some 3 %. For a wide range of temperatures use the board's
/// crystal: `Config::hse(8.MHz())`.
///
/// The HAL's search for the divisors can panic. Its result depends on this line alone: either every
/// start panics, or none. This is a function of its own so that the check for panics can recognise
/// it.
#[inline(never)]
pub fn start(rcc: RCC) -> Rcc {
    rcc.freeze(Config::hsi().sysclk(168.MHz()))
}
