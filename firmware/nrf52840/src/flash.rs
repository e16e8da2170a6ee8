//! Two pages of the flash as the settings' store (nRF52840 Product Specification, 4.3).
//!
//! 4 KB each: a slot of [`echoloop_sensor::store`] each, and nobody else's (`link/nrf52840.x`). An
//! erase takes 85 ms at most. A page stands 10,000 erases, so 20,000 saves of settings that differ;
//! saving what is saved already erases nothing. Between two erases each word is written once.
//!
//! While the flash is erased or written the processor waits for its next instruction, interrupts
//! included: what comes on the link then is lost. The host waits for the answer to its save, or
//! asks again.
//!
//! This is not the HAL's driver: that one indexes its array, which can panic, and writes it as
//! memory, where the compiler may leave writes out.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

/// Bytes of a page.
pub const PAGE: u32 = 4 << 10;
/// How many pages there are.
pub const PAGES: u32 = 2;
/// Where the first one begins, from the flash's beginning.
pub const OFFSET: u32 = 0xF_2000;
/// Erases that a page stands.
pub const ENDURANCE: u32 = 10_000;

/// Bytes of a word.
const WORD: usize = 4;

/// What the controller lets be done to the flash (register CONFIG).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reading alone.
    Read,
    /// Words may be written: bits go from one to zero.
    Write,
    /// Pages may be erased.
    Erase,
}

/// The controller (NVMC), and the array behind it.
pub trait Interface {
    /// Whether it is done with what it was told (READY).
    fn is_ready(&self) -> bool;
    /// Sets what may be done (CONFIG).
    fn allow(&mut self, access: Access);
    /// Begins to erase the page at a distance in bytes from the array's beginning (ERASEPAGE).
    fn erase_page(&mut self, offset: u32);
    /// A word of the array, by its distance in bytes from the array's beginning: a multiple of 4.
    fn word(&self, offset: u32) -> u32;
    /// Writes one.
    fn set_word(&mut self, offset: u32, word: u32);
}

/// The settings' pages.
pub struct Flash<I>(I);

impl<I: Interface> Flash<I> {
    /// Over an interface of nobody else's.
    pub fn new(interface: I) -> Self {
        Self(interface)
    }

    /// The interface.
    pub fn interface_mut(&mut self) -> &mut I {
        &mut self.0
    }

    /// Does one thing after the other to the flash, which is read only before and after.
    fn with<T>(&mut self, access: Access, steps: impl Iterator<Item = T>, run: fn(&mut I, T)) {
        self.wait();
        self.0.allow(access);
        for step in steps {
            run(&mut self.0, step);
            self.wait();
        }
        self.0.allow(Access::Read);
    }

    /// The controller ends each operation by itself, and the watchdog runs.
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
