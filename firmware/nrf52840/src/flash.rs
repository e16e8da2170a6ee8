//! Flash driver: two pages as the settings' store (nRF52840 Product Specification, 4.3).
//!
//! The pages, of 4 KB, hold a slot of [`echoloop_sensor::store`] each and nothing else
//! (`link/nrf52840.x`). An erase takes at most 85 ms. A page withstands 10,000 erases, so 20,000
//! saves of settings that differ; saving the same settings again erases nothing. Between two erases
//! each word is written once.
//!
//! While the flash is erased or written the processor waits for its next instruction, interrupts
//! included, so bytes that come on the link are lost. The host waits for the answer to its save, or
//! asks again.
//!
//! The HAL's driver is not used: it indexes its array, which can panic, and writes it as memory, so
//! that the compiler may drop writes.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

/// Size of a page in bytes.
pub const PAGE: u32 = 4 << 10;
/// Number of pages.
pub const PAGES: u32 = 2;
/// Offset of the first page from the beginning of the flash.
pub const OFFSET: u32 = 0xF_2000;
/// Number of erases that a page withstands.
pub const ENDURANCE: u32 = 10_000;

/// Size of a word in bytes.
const WORD: usize = 4;

/// Access to the flash that the controller allows (register CONFIG).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reading only.
    Read,
    /// Writing of words: bits go from one to zero.
    Write,
    /// Erasing of pages.
    Erase,
}

/// Flash controller (NVMC), and the array behind it.
pub trait Interface {
    /// True when no operation is under way (READY).
    fn is_ready(&self) -> bool;
    /// Sets the allowed access (CONFIG).
    fn allow(&mut self, access: Access);
    /// Begins to erase the page at an offset in bytes (ERASEPAGE).
    fn erase_page(&mut self, offset: u32);
    /// Reads a word of the array at an offset in bytes, a multiple of 4.
    fn word(&self, offset: u32) -> u32;
    /// Writes a word of the array.
    fn set_word(&mut self, offset: u32, word: u32);
}

/// Flash of the settings: both pages.
pub struct Flash<I>(I);

impl<I: Interface> Flash<I> {
    /// Flash over an interface that nothing else uses.
    pub fn new(interface: I) -> Self {
        Self(interface)
    }

    /// Interface of the flash.
    pub fn interface_mut(&mut self) -> &mut I {
        &mut self.0
    }

    /// Runs an operation for each step with the given access; before and after, the flash is
    /// read-only.
    fn with<T>(&mut self, access: Access, steps: impl Iterator<Item = T>, run: fn(&mut I, T)) {
        self.wait();
        self.0.allow(access);
        for step in steps {
            run(&mut self.0, step);
            self.wait();
        }
        self.0.allow(Access::Read);
    }

    /// Waits for the end of an operation. The controller ends each by itself; if it does not, the
    /// watchdog restarts the board.
    fn wait(&self) {
        while !self.0.is_ready() {}
    }
}

impl<I> ErrorType for Flash<I> {
    type Error = NorFlashErrorKind;
}

impl<I: Interface> ReadNorFlash for Flash<I> {
    const READ_SIZE: usize = WORD;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        let words = (OFFSET.saturating_add(offset)..).step_by(WORD);
        for (word, at) in bytes.as_chunks_mut::<WORD>().0.iter_mut().zip(words) {
            *word = self.0.word(at).to_le_bytes();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        (PAGES * PAGE) as usize
    }
}

impl<I: Interface> NorFlash for Flash<I> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        let [from, to] = [from, to].map(|at| OFFSET.saturating_add(at));
        self.with(Access::Erase, (from..to).step_by(PAGE as usize), I::erase_page);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        let words = bytes.as_chunks::<WORD>().0.iter().map(|word| u32::from_le_bytes(*word));
        let places = (OFFSET.saturating_add(offset)..).step_by(WORD);
        self.with(Access::Write, places.zip(words), |part, (at, word)| part.set_word(at, word));
        Ok(())
    }
}
