//! Memory-mapped registers and shared memory: the only place where addresses become accesses.

use core::ptr;

/// Block of 32-bit registers, or of memory shared with the emulator's host.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    base: usize,
    bytes: usize,
}

impl Block {
    /// Block at an address.
    ///
    /// # Safety
    ///
    /// All of `base..base + bytes` must be such memory, word aligned and without any Rust object,
    /// as long as the program runs.
    pub const unsafe fn new(base: usize, bytes: usize) -> Self {
        Self { base, bytes }
    }

    /// Part of the block; empty when it would not lie within.
    pub const fn part(&self, offset: usize, bytes: usize) -> Self {
        let within = offset <= self.bytes && bytes <= self.bytes.wrapping_sub(offset);
        Self { base: self.base.wrapping_add(offset), bytes: if within { bytes } else { 0 } }
    }

    /// Length in bytes.
    pub const fn bytes(&self) -> usize {
        self.bytes
    }

    /// Reads a word; 0 outside and where misaligned.
    #[inline(always)]
    pub fn read(&self, offset: usize) -> u32 {
        match self.address(offset, 4) {
            // SAFETY: aligned and within the block, which is readable by the promise to `new`.
            Some(address) => unsafe { ptr::read_volatile(address as *const u32) },
            None => 0,
        }
    }

    /// Sets a word; does nothing outside and where misaligned.
    #[inline(always)]
    pub fn write(&self, offset: usize, value: u32) {
        if let Some(address) = self.address(offset, 4) {
            // SAFETY: aligned and within the block, which is writable and holds no Rust object by
            // the promise to `new`.
            unsafe { ptr::write_volatile(address as *mut u32, value) };
        }
    }

    /// Reads a byte; 0 outside.
    #[inline(always)]
    pub fn read_byte(&self, offset: usize) -> u8 {
        match self.address(offset, 1) {
            // SAFETY: within the block, which is readable by the promise to `new`.
            Some(address) => unsafe { ptr::read_volatile(address as *const u8) },
            None => 0,
        }
    }

    /// Sets a byte; does nothing outside.
    #[inline(always)]
    pub fn write_byte(&self, offset: usize, value: u8) {
        if let Some(address) = self.address(offset, 1) {
            // SAFETY: within the block, which is writable and holds no Rust object by the promise
            // to `new`.
            unsafe { ptr::write_volatile(address as *mut u8, value) };
        }
    }

    /// Copies the halfwords that lie within.
    pub fn copy_halfwords(&self, to: &mut [u16]) {
        for (pair, offset) in to.chunks_mut(2).zip((0..self.bytes).step_by(4)) {
            let word = self.read(offset);
            for (halfword, shift) in pair.iter_mut().zip([0, 16]) {
                *halfword = (word >> shift) as u16;
            }
        }
    }

    /// Address of `size` bytes at an offset, if they lie within and are aligned. `size` is a power
    /// of two.
    #[inline(always)]
    const fn address(&self, offset: usize, size: usize) -> Option<usize> {
        let within = size <= self.bytes && offset <= self.bytes.wrapping_sub(size);
        let address = self.base.wrapping_add(offset);
        if within && address & size.wrapping_sub(1) == 0 { Some(address) } else { None }
    }
}
