//! Ring buffer for bytes from an interrupt to the program: one writer, one reader, no waiting.
//!
//! heapless has such a queue too. Its two ends do not know its length at compile time, so each byte
//! would cost a division in the interrupt, and there would be a panic for length zero.

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

/// Ring of `N` bytes, a power of two.
///
/// ```
/// use echoloop_part::ring::Ring;
///
/// static RING: Ring<4> = Ring::new();
/// assert!(RING.push(7));
/// assert_eq!((RING.pop(), RING.pop()), (Some(7), None));
/// ```
pub struct Ring<const N: usize> {
    bytes: [AtomicU8; N],
    /// Number of bytes that ever went in and out, wrapping. Only one side writes each.
    pushed: AtomicUsize,
    popped: AtomicUsize,
}

impl<const N: usize> Ring<N> {
    /// Mask of the bits of a count that are an index.
    const PLACE: usize = N.wrapping_sub(1);

    /// Empty ring.
    pub const fn new() -> Self {
        const { assert!(N.is_power_of_two(), "so that counts wrap where places do") };
        Self {
            bytes: [const { AtomicU8::new(0) }; N],
            pushed: AtomicUsize::new(0),
            popped: AtomicUsize::new(0),
        }
    }

    /// Adds a byte; false when there is no room. Only the writing side may call it.
    pub fn push(&self, byte: u8) -> bool {
        let pushed = self.pushed.load(Ordering::Relaxed);
        let waiting = pushed.wrapping_sub(self.popped.load(Ordering::Acquire));
        match self.bytes.get(pushed & Self::PLACE) {
            Some(place) if waiting < N => place.store(byte, Ordering::Relaxed),
            _ => return false,
        }
        self.pushed.store(pushed.wrapping_add(1), Ordering::Release);
        true
    }

    /// Removes and returns the oldest byte. Only the reading side may call it.
    pub fn pop(&self) -> Option<u8> {
        let popped = self.popped.load(Ordering::Relaxed);
        if self.is_empty() {
            return None;
        }
        let byte = self.bytes.get(popped & Self::PLACE)?.load(Ordering::Relaxed);
        self.popped.store(popped.wrapping_add(1), Ordering::Release);
        Some(byte)
    }

    /// True when no byte waits.
    pub fn is_empty(&self) -> bool {
        self.pushed.load(Ordering::Acquire) == self.popped.load(Ordering::Relaxed)
    }
}

impl<const N: usize> Default for Ring<N> {
    fn default() -> Self {
        Self::new()
    }
}
