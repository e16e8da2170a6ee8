//! Flash controller and array of the part, for the flash driver.

use core::ptr;

use nrf52840_hal::pac::NVMC;

use crate::flash::{Access, Interface, OFFSET, PAGE, PAGES};

/// Flash controller. Its owner also owns the settings' pages.
pub struct Controller(pub(crate) NVMC);

impl Interface for Controller {
    fn is_ready(&self) -> bool {
        self.0.ready.read().ready().is_ready()
    }

    fn allow(&mut self, access: Access) {
        self.0.config.write(|w| match access {
            Access::Read => w.wen().ren(),
            Access::Write => w.wen().wen(),
            Access::Erase => w.wen().een(),
        });
        // The setting must take effect before the access that it allows.
        cortex_m::asm::dsb();
    }

    fn erase_page(&mut self, offset: u32) {
        if place(offset).is_some() {
            // SAFETY: a page of the settings; the linker puts no object there.
            self.0.erasepage().write(|w| unsafe { w.bits(offset) });
        }
    }

    fn word(&self, offset: u32) -> u32 {
        // SAFETY: aligned and within the array, which can always be read.
        place(offset).map_or(0, |word| unsafe { ptr::read_volatile(word) })
    }

    fn set_word(&mut self, offset: u32, word: u32) {
        if let Some(place) = place(offset) {
            // SAFETY: aligned and in the settings' pages; the linker puts no object there.
            unsafe { ptr::write_volatile(place, word) };
        }
    }
}

/// Address of a word of the settings' pages. The array begins at address 0.
fn place(offset: u32) -> Option<*mut u32> {
    let pages = OFFSET..OFFSET + PAGES * PAGE;
    let within = pages.contains(&offset) && offset.is_multiple_of(4);
    within.then_some(offset as usize as *mut u32)
}
