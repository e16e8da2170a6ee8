//! NOR flash in the mailbox: writes turn bits to zero, an erase turns a block to ones.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

use crate::mmio::Block;

/// Flash in memory that behaves as flash: a write can only turn ones to zeros.
pub struct Flash(Block);

/// Bytes of a word.
const WORD: usize = 4;

impl Flash {
    /// Flash in a block of memory.
    pub fn new(block: Block) -> Self {
        Self(block)
    }
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        for (byte, at) in bytes.iter_mut().zip(offset as usize..) {
            *byte = self.0.read_byte(at);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.bytes()
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = echoloop_sensor::mailbox::FLASH_BLOCK;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        for at in (from..to).step_by(WORD) {
            self.0.write(at as usize, u32::MAX);
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        for (word, at) in bytes.as_chunks::<WORD>().0.iter().zip((offset as usize..).step_by(WORD))
        {
            self.0.write(at, self.0.read(at) & u32::from_le_bytes(*word));
        }
        Ok(())
    }
}
