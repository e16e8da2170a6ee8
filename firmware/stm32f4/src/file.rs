//! Settings' sectors in the emulator: a file beside its log, by semihosting.
//!
//! The file exists before the emulator starts, filled with ones where nothing was saved. Words are
//! written as in flash: a write can only turn ones to zeros.

use cortex_m_semihosting::{nr, syscall};
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

use crate::flash::{SECTOR, SECTORS};

/// Name of the file, in the folder that the emulator runs in.
const NAME: &[u8] = b"flash.bin\0";
/// Mode "r+b": reads and writes an existing file as bytes.
const MODE: usize = 3;
/// Size of a word in bytes.
const WORD: usize = 4;
/// Ones of an erase, written at a time.
const ERASED: [u8; 1024] = [0xFF; 1024];

/// Open file.
pub struct File(usize);

impl File {
    /// Opens the file; `None` where there is none. Must be called only under semihosting: elsewhere
    /// it faults.
    pub(crate) fn open() -> Option<Self> {
        let length = NAME.len().saturating_sub(1);
        // SAFETY: the call reads a name of that length, which ends in a zero.
        let handle = unsafe { syscall(nr::OPEN, &[NAME.as_ptr() as usize, MODE, length]) };
        (handle != usize::MAX).then_some(Self(handle))
    }

    fn seek(&self, at: u32) -> Result<(), NorFlashErrorKind> {
        // SAFETY: the call changes nothing here.
        done(unsafe { syscall(nr::SEEK, &[self.0, at as usize]) })
    }

    fn read_at(&self, at: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        self.seek(at)?;
        // SAFETY: the call writes as many bytes as the slice has.
        done(unsafe { syscall(nr::READ, &[self.0, bytes.as_mut_ptr() as usize, bytes.len()]) })
    }

    fn write_at(&self, at: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        self.seek(at)?;
        // SAFETY: the call reads as many bytes as the slice has.
        done(unsafe { syscall(nr::WRITE, &[self.0, bytes.as_ptr() as usize, bytes.len()]) })
    }
}

/// Result of a call, which answers 0 when it has done all.
fn done(answer: usize) -> Result<(), NorFlashErrorKind> {
    if answer == 0 { Ok(()) } else { Err(NorFlashErrorKind::Other) }
}

impl ErrorType for File {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for File {
    const READ_SIZE: usize = WORD;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        self.read_at(offset, bytes)
    }

    fn capacity(&self) -> usize {
        (SECTORS * SECTOR) as usize
    }
}

impl NorFlash for File {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        (from..to).step_by(ERASED.len()).try_for_each(|at| self.write_at(at, &ERASED))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        for (word, at) in bytes.as_chunks::<WORD>().0.iter().zip((offset..).step_by(WORD)) {
            let mut old = [0; WORD];
            self.read_at(at, &mut old)?;
            let left = u32::from_le_bytes(old) & u32::from_le_bytes(*word);
            self.write_at(at, &left.to_le_bytes())?;
        }
        Ok(())
    }
}
