//! Two sectors of the flash as the settings' store (RM0090, chapter 3).
//!
//! Sectors 1 and 2, of 16 KB each: a slot of [`echoloop_sensor::store`] each, and nobody else's
//! (`link/stm32f405.x`). An erase takes 250 ms, at most 500 ms; of a sector of 128 KB it would take
//! a second or two. A sector stands 10,000 erases (DS8626), so 20,000 saves of settings that
//! differ; saving what is saved already erases nothing.
//!
//! While the flash is erased or written the processor waits for its next instruction, interrupts
//! included: what comes on the link then is lost. The host waits for the answer to its save, or
//! asks again.
//!
//! This is not the HAL's driver: that one panics where the flash stays locked, never clears an
//! error, so that one spoils all that follows, and leaves old bytes in the data cache. Words of 32
//! bits want 2.7 V or more at the part.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read,
    check_write,
};

/// Bytes of each of the sectors.
pub const SECTOR: u32 = 16 << 10;
/// Number of the first one.
pub const FIRST_SECTOR: u32 = 1;
/// How many there are.
pub const SECTORS: u32 = 2;
/// Where the first one begins, from the flash's beginning.
pub const OFFSET: u32 = FIRST_SECTOR * SECTOR;
/// Erases that a sector stands.
pub const ENDURANCE: u32 = 10_000;

/// Bytes of a word.
const WORD: usize = 4;

/// A register of the flash interface.
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

/// The interface, and the array behind it.
pub trait Interface {
    /// What a register holds.
    fn get(&self, register: Register) -> u32;
    /// Sets a register.
    fn set(&mut self, register: Register, value: u32);
    /// A word of the array, by its distance in bytes from the array's beginning: a multiple of 4.
    fn word(&self, offset: u32) -> u32;
    /// Writes one.
    fn set_word(&mut self, offset: u32, word: u32);
}

/// Bits of [`Register::Acr`].
pub mod acr {
    /// The data cache is on.
    pub const DCEN: u32 = 1 << 10;
    /// Empties it while it is off.
    pub const DCRST: u32 = 1 << 12;
}

/// What [`Register::Keyr`] takes, one after the other.
pub const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Bits of [`Register::Sr`].
pub mod sr {
    /// The end of an operation, and what may have gone wrong: operation, protection, alignment,
    /// parallelism, sequence. A one written takes each back.
    pub const FLAGS: u32 = 0b1111_0011;
    /// Those that are errors.
    pub const ERRORS: u32 = 0b1111_0010;
    /// An operation is under way.
    pub const BSY: u32 = 1 << 16;
}

/// Bits of [`Register::Cr`].
pub mod cr {
    /// Words may be written.
    pub const PG: u32 = 1 << 0;
    /// A sector is to be erased.
    pub const SER: u32 = 1 << 1;
    /// The sector's number goes here.
    pub const SNB: u32 = 3;
    /// 32 bits at a time.
    pub const PSIZE_32: u32 = 0b10 << 8;
    /// Begins to erase.
    pub const STRT: u32 = 1 << 16;
    /// Nothing above can be changed until the keys were written.
    pub const LOCK: u32 = 1 << 31;
}

/// Why the flash did not do what it was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Not these places, or not so many bytes.
    Place(NorFlashErrorKind),
    /// The keys did not open it.
    Locked,
    /// The status register's errors.
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

/// The settings' sectors.
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

    /// Opens the flash, does something, closes it, and forgets what the data cache held.
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
        self.0.set(Register::Sr, sr::FLAGS); // of those before
        let done = run(self);
        self.0.set(Register::Cr, cr::LOCK);
        self.empty_cache();
        done
    }

    fn is_locked(&self) -> bool {
        self.0.get(Register::Cr) & cr::LOCK != 0
    }

    /// The part ends each operation by itself, and the watchdog runs.
    fn wait(&self) {
        while self.0.get(Register::Sr) & sr::BSY != 0 {}
    }

    /// Waits, and says what the operation before came to.
    fn done(&self) -> Result<(), FlashError> {
        self.wait();
        match self.0.get(Register::Sr) & sr::ERRORS {
            0 => Ok(()),
            errors => Err(FlashError::Status(errors)),
        }
    }

    /// The cache goes on with old bytes otherwise. It empties only while it is off.
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
