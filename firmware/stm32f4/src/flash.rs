//! Flash driver: two sectors as the settings' store (RM0090, chapter 3).
//!
//! Sectors 1 and 2, of 16 KB each, hold a slot of [`echoloop_sensor::store`] each and nothing else
//! (`link/stm32f405.x`). An erase takes 250 ms, at most 500 ms; in a sector of 128 KB it would take
//! one or two seconds. A sector withstands 10,000 erases (DS8626), so 20,000 saves of settings that
//! differ; saving the same settings again erases nothing.
//!
//! While the flash is erased or written the processor waits for its next instruction, interrupts
//! included, so bytes that come on the link are lost. The host waits for the answer to its save, or
//! asks again.
//!
//! The HAL's driver is not used: it panics when the flash stays locked, never clears an error, so
//! that one error makes all later operations fail, and leaves old bytes in the data cache. Words of
//! 32 bits need at least 2.7 V at the part.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};

/// Size of each sector in bytes.
pub const SECTOR: u32 = 16 << 10;
/// Number of the first sector.
pub const FIRST_SECTOR: u32 = 1;
/// Number of sectors.
pub const SECTORS: u32 = 2;
/// Offset of the first sector from the beginning of the flash.
pub const OFFSET: u32 = FIRST_SECTOR * SECTOR;
/// Number of erases that a sector withstands.
pub const ENDURANCE: u32 = 10_000;

/// Size of a word in bytes.
const WORD: usize = 4;

/// Register of the flash interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Register {
    /// Access control: wait states, caches.
    Acr,
    /// Key.
    Keyr,
    /// Status.
    Sr,
    /// Control.
    Cr,
}

/// Flash interface, and the array behind it.
pub trait Interface {
    /// Reads a register.
    fn get(&self, register: Register) -> u32;
    /// Sets a register.
    fn set(&mut self, register: Register, value: u32);
    /// Reads a word of the array at an offset in bytes, a multiple of 4.
    fn word(&self, offset: u32) -> u32;
    /// Writes a word of the array.
    fn set_word(&mut self, offset: u32, word: u32);
}

/// Bits of [`Register::Acr`].
pub mod acr {
    /// Switches the data cache on.
    pub const DCEN: u32 = 1 << 10;
    /// Empties the data cache while it is off.
    pub const DCRST: u32 = 1 << 12;
}

/// Keys that unlock the flash, written to [`Register::Keyr`] one after the other.
pub const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Bits of [`Register::Sr`].
pub mod sr {
    /// End of an operation, and errors: operation, protection, alignment, parallelism, sequence.
    /// Writing a one clears a flag.
    pub const FLAGS: u32 = 0b1111_0011;
    /// Flags that are errors.
    pub const ERRORS: u32 = 0b1111_0010;
    /// An operation is under way.
    pub const BSY: u32 = 1 << 16;
}

/// Bits of [`Register::Cr`].
pub mod cr {
    /// Allows writing of words.
    pub const PG: u32 = 1 << 0;
    /// Selects the erase of a sector.
    pub const SER: u32 = 1 << 1;
    /// Position of the sector's number.
    pub const SNB: u32 = 3;
    /// Writes 32 bits at a time.
    pub const PSIZE_32: u32 = 0b10 << 8;
    /// Starts the erase.
    pub const STRT: u32 = 1 << 16;
    /// Locks the register until the keys are written.
    pub const LOCK: u32 = 1 << 31;
}

/// Error of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Address out of range, or length not a multiple of the word.
    Place(NorFlashErrorKind),
    /// The keys did not unlock the flash.
    Locked,
    /// Error flags of the status register.
    Status(u32),
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Place(kind) => *kind,
            _ => NorFlashErrorKind::Other,
        }
    }
}

/// Flash of the settings: both sectors.
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

    /// Unlocks the flash, runs an operation, locks it again, and empties the data cache.
    fn open<T>(
        &mut self,
        run: impl FnOnce(&mut Self) -> Result<T, FlashError>,
    ) -> Result<T, FlashError> {
        self.wait();
        if self.is_locked() {
            KEYS.into_iter().for_each(|key| self.0.set(Register::Keyr, key));
        }
        if self.is_locked() {
            return Err(FlashError::Locked);
        }
        self.0.set(Register::Sr, sr::FLAGS); // clears the flags of earlier operations
        let done = run(self);
        self.0.set(Register::Cr, cr::LOCK);
        self.empty_cache();
        done
    }

    fn is_locked(&self) -> bool {
        self.0.get(Register::Cr) & cr::LOCK != 0
    }

    /// Waits for the end of an operation. The part ends each by itself; if it does not, the
    /// watchdog restarts the board.
    fn wait(&self) {
        while self.0.get(Register::Sr) & sr::BSY != 0 {}
    }

    /// Waits for the end of an operation and returns its errors.
    fn done(&self) -> Result<(), FlashError> {
        self.wait();
        match self.0.get(Register::Sr) & sr::ERRORS {
            0 => Ok(()),
            errors => Err(FlashError::Status(errors)),
        }
    }

    /// Empties the data cache, which would otherwise return old bytes. This works only while it is
    /// off.
    fn empty_cache(&mut self) {
        let acr = self.0.get(Register::Acr);
        self.0.set(Register::Acr, acr & !acr::DCEN);
        self.0.set(Register::Acr, acr & !acr::DCEN | acr::DCRST);
        self.0.set(Register::Acr, acr & !acr::DCEN);
        self.0.set(Register::Acr, acr);
    }

    fn erase_sector(&mut self, number: u32) -> Result<(), FlashError> {
        let chosen = cr::PSIZE_32 | cr::SER | number << cr::SNB;
        self.0.set(Register::Cr, chosen);
        self.0.set(Register::Cr, chosen | cr::STRT);
        self.done()
    }

    fn write_word(&mut self, offset: u32, word: u32) -> Result<(), FlashError> {
        self.0.set(Register::Cr, cr::PSIZE_32 | cr::PG);
        self.0.set_word(offset, word);
        self.done()
    }
}

impl<I> ErrorType for Flash<I> {
    type Error = FlashError;
}

impl<I: Interface> ReadNorFlash for Flash<I> {
    const READ_SIZE: usize = WORD;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        check_read(self, offset, bytes.len()).map_err(FlashError::Place)?;
        let words = (OFFSET.saturating_add(offset)..).step_by(WORD);
        for (word, at) in bytes.as_chunks_mut::<WORD>().0.iter_mut().zip(words) {
            *word = self.0.word(at).to_le_bytes();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        (SECTORS * SECTOR) as usize
    }
}

impl<I: Interface> NorFlash for Flash<I> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        check_erase(self, from, to).map_err(FlashError::Place)?;
        let [first, end] = [from, to].map(|at| FIRST_SECTOR.saturating_add(at / SECTOR));
        self.open(|flash| (first..end).try_for_each(|number| flash.erase_sector(number)))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        check_write(self, offset, bytes.len()).map_err(FlashError::Place)?;
        let words = bytes.as_chunks::<WORD>().0.iter().map(|word| u32::from_le_bytes(*word));
        let places = (OFFSET.saturating_add(offset)..).step_by(WORD);
        self.open(|flash| places.zip(words).try_for_each(|(at, word)| flash.write_word(at, word)))
    }
}
