//! The part's own flash interface and array.

use core::ptr;

use stm32f4xx_hal::pac::FLASH;

use crate::flash::{Interface, Register};

/// Where the array lies.
const ARRAY: usize = 0x0800_0000;
/// Its bytes.
const BYTES: u32 = 1 << 20;

/// The flash interface: whoever has it has the array's settings, too.
pub struct Registers(pub(crate) FLASH);

impl Interface for Registers {
    fn get(&self, register: Register) -> u32 {
        match register {
            Register::Acr => self.0.acr().read().bits(),
            Register::Keyr => 0, // is written only
            Register::Sr => self.0.sr().read().bits(),
            Register::Cr => self.0.cr().read().bits(),
        }
    }

    fn set(&mut self, register: Register, value: u32) {
        // SAFETY: any bits may be written to these four: what they do is to the flash, of which the
        // driver above changes the settings' sectors alone, and to its caches.
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
            // SAFETY: aligned and within the array; the linker puts no object into the settings'
            // sectors, and elsewhere the driver does not write.
            unsafe { ptr::write_volatile(place, word) };
        }
    }
}

/// A word of the array.
fn place(offset: u32) -> Option<*mut u32> {
    let within = offset < BYTES && offset.is_multiple_of(4);
    within.then_some(ARRAY.wrapping_add(offset as usize) as *mut u32)
}
