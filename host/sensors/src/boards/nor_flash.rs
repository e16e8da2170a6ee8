//! NOR flash in memory: bits go from one to zero until they are erased, and the power may be cut at
//! any moment.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Flash of two erase blocks of `ERASE` bytes, written in words of `WRITE` bytes.
///
/// A word is written once between erasures; writing it again is refused, as by flash with error
/// correction. When the power is cut, each bit of the word or block under way has its old or its
/// new value; what was done before stays, and nothing works until [`RamNorFlash::switch_on`].
#[derive(Clone, Debug)]
pub struct RamNorFlash<const WRITE: usize = 4, const ERASE: usize = 256> {
    bytes: Vec<u8>,
    written: Vec<bool>,
    /// Words and blocks until the power is cut.
    left: Option<usize>,
    tear: ChaCha8Rng,
    /// Number of blocks erased, and below of words written.
    erased: usize,
    programmed: usize,
}

impl<const WRITE: usize, const ERASE: usize> Default for RamNorFlash<WRITE, ERASE> {
    fn default() -> Self {
        Self::from_bytes(vec![0xFF; 2 * ERASE])
    }
}

impl<const WRITE: usize, const ERASE: usize> RamNorFlash<WRITE, ERASE> {
    /// Flash with these bytes, whole blocks.
    pub fn from_bytes(bytes: Vec<u8>) -> Self {
        let written =
            bytes.chunks(WRITE).map(|word| word.iter().any(|&byte| byte != 0xFF)).collect();
        Self {
            bytes,
            written,
            left: None,
            tear: ChaCha8Rng::seed_from_u64(0),
            erased: 0,
            programmed: 0,
        }
    }

    /// Content.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Content, to flip bits of.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.bytes
    }

    /// Number of blocks erased since it was new.
    pub fn blocks_erased(&self) -> usize {
        self.erased
    }

    /// Number of words written since it was new.
    pub fn words_written(&self) -> usize {
        self.programmed
    }

    /// Cuts the power after `steps` more words and blocks, in the middle of the next; `seed` draws
    /// that one's bits.
    pub fn cut_after(&mut self, steps: usize, seed: u64) {
        self.left = Some(steps);
        self.tear = ChaCha8Rng::seed_from_u64(seed);
    }

    /// Restores the power, without a further cut.
    pub fn switch_on(&mut self) {
        self.left = None;
    }

    /// True after the power was cut.
    pub fn is_off(&self) -> bool {
        self.left == Some(usize::MAX)
    }

    /// Counts a word or block. True when it is done whole, false when torn.
    fn step(&mut self) -> bool {
        match &mut self.left {
            None => true,
            Some(0) => {
                self.left = Some(usize::MAX);
                false
            }
            Some(left) => {
                *left -= 1;
                true
            }
        }
    }

    fn check_power(&self) -> Result<(), NorFlashErrorKind> {
        if self.is_off() { Err(NorFlashErrorKind::Other) } else { Ok(()) }
    }

    fn erase_block(&mut self, from: usize) -> Result<(), NorFlashErrorKind> {
        self.check_power()?;
        let whole = self.step();
        for byte in &mut self.bytes[from..from + ERASE] {
            *byte |= if whole { 0xFF } else { self.tear.random::<u8>() };
        }
        let written = if whole { false } else { self.tear.random() };
        self.written[from / WRITE..(from + ERASE) / WRITE].fill(written);
        self.erased += 1;
        if whole { Ok(()) } else { Err(NorFlashErrorKind::Other) }
    }

    fn write_word(&mut self, at: usize, word: &[u8]) -> Result<(), NorFlashErrorKind> {
        self.check_power()?;
        if std::mem::replace(&mut self.written[at / WRITE], true) {
            return Err(NorFlashErrorKind::Other);
        }
        let whole = self.step();
        for (byte, new) in self.bytes[at..at + WRITE].iter_mut().zip(word) {
            *byte &= if whole { *new } else { *new | self.tear.next_u32() as u8 };
        }
        self.programmed += 1;
        if whole { Ok(()) } else { Err(NorFlashErrorKind::Other) }
    }
}

impl<const WRITE: usize, const ERASE: usize> ErrorType for RamNorFlash<WRITE, ERASE> {
    type Error = NorFlashErrorKind;
}

impl<const WRITE: usize, const ERASE: usize> ReadNorFlash for RamNorFlash<WRITE, ERASE> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        self.check_power()?;
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const WRITE: usize, const ERASE: usize> NorFlash for RamNorFlash<WRITE, ERASE> {
    const WRITE_SIZE: usize = WRITE;
    const ERASE_SIZE: usize = ERASE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        (from as usize..to as usize).step_by(ERASE).try_for_each(|block| self.erase_block(block))
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        bytes
            .chunks(WRITE)
            .enumerate()
            .try_for_each(|(i, word)| self.write_word(offset as usize + i * WRITE, word))
    }
}
