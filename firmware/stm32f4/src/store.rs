//! Store of the settings: the part's flash, or the emulator's file.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use crate::file::File;
use crate::flash::{Flash, SECTOR, SECTORS};
use crate::registers::Registers;

/// Two sectors that keep their content without power.
pub enum Store {
    /// Flash, on the part.
    Flash(Flash<Registers>),
    /// File, in the emulator.
    File(File),
}

impl ErrorType for Store {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Store {
    const READ_SIZE: usize = 4;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        match self {
            Self::Flash(flash) => flash.read(offset, bytes).map_err(|error| error.kind()),
            Self::File(file) => file.read(offset, bytes),
        }
    }

    fn capacity(&self) -> usize {
        (SECTORS * SECTOR) as usize
    }
}

impl NorFlash for Store {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        match self {
            Self::Flash(flash) => flash.erase(from, to).map_err(|error| error.kind()),
            Self::File(file) => file.erase(from, to),
        }
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        match self {
            Self::Flash(flash) => flash.write(offset, bytes).map_err(|error| error.kind()),
            Self::File(file) => file.write(offset, bytes),
        }
    }
}
