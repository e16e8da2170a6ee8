//! Flash interface and array of the part, for the flash driver.

use core::ptr;

use stm32f4xx_hal::pac::FLASH;

use crate::flash::{Interface, Register};

/// Address of the array.
const ARRAY: usize = 0x0800_0000;
/// Size of the array in bytes.
const BYTES: u32 = 1 << 20;

/// Flash interface. Its owner also owns the settings' sectors of the array.
pub struct Registers(pub(crate) FLASH);

impl Interface for Registers {
    fn get(&self, register: Register) -> u32 {
        match register {
            Register::Acr => self.0.acr().read().bits(),
            Register::Keyr => 0, // write-only
            Register::Sr => self.0.sr().read().bits(),
            Register::Cr => self.0.cr().read().bits(),
        }
    }

    fn set(&mut self, register: Register, value: u32) {
        // SAFETY: any bits may be written to these four registers. They act on the flash, of which
        // the driver changes the settings' sectors only, and on its caches.
        unsafe {
            match register {
                Register::Acr => self.0.acr().write(|w| w.bits(value)),
                Register::Keyr => self.0.keyr().write(|w| w.bits(value)),
                Register::Sr => self.0.sr().write(|w| w.bits(value)),
                Register::Cr => self.0.cr().write(|w| w.bits(value)),
            };
        }
    }

    fn word(&self, offset: u32) -> u32 {
        // SAFETY: aligned and within the array, which can always be read.
        place(offset).map_or(0, |word| unsafe { ptr::read_volatile(word) })
    }

    fn set_word(&mut self, offset: u32, word: u32) {
        if let Some(place) = place(offset) {
            // SAFETY: aligned and within the array. The linker puts no object into the settings'
            // sectors, and the driver writes nowhere else.
            unsafe { ptr::write_volatile(place, word) };
        }
    }
}

/// Address of a word of the array.
fn place(offset: u32) -> Option<*mut u32> {
    let within = offset < BYTES && offset.is_multiple_of(4);
    within.then_some(ARRAY.wrapping_add(offset as usize) as *mut u32)
}
