//! Link: a port whose interrupt puts each received byte into a ring.
//!
//! The program empties the ring between commands. The protocol, not time, bounds the number of
//! bytes that come meanwhile: a host has at most as many frames under way as the board allows,
//! which is two here. So the ring holds two of the longest frames.

use core::convert::Infallible;
use core::sync::atomic::{AtomicU32, Ordering};

use echoloop_link::MAX_FRAME;
use embedded_io::{ErrorType, Read, ReadReady, Write};

use crate::ring::Ring;

/// Size of the ring in bytes.
pub const RING: usize = (2 * MAX_FRAME).next_power_of_two();

/// Number of bytes that are buffered while the program works on one of the longest frames.
pub const HELD: usize = RING - MAX_FRAME;

/// Sending side of a serial port.
pub trait Port {
    /// Sends a byte; waits for room before it, or until it is out after it.
    fn send(&mut self, byte: u8);
}

/// Port that does not exist.
impl Port for Infallible {
    fn send(&mut self, _: u8) {
        match *self {}
    }
}

/// Bytes on their way from a port's interrupt to the program.
pub struct Received {
    ring: Ring<RING>,
    /// Number of losses: a byte while the ring was full, or bytes that the port lost itself.
    lost: AtomicU32,
}

impl Received {
    /// Empty ring.
    pub const fn new() -> Self {
        Self { ring: Ring::new(), lost: AtomicU32::new(0) }
    }

    /// Takes a received byte. Only the interrupt may call it.
    pub fn push(&self, byte: u8) {
        if !self.ring.push(byte) {
            self.lose();
        }
    }

    /// Counts a loss of bytes by the port, which does not say how many. Only the interrupt may call
    /// it.
    pub fn lose(&self) {
        // No swap is needed: only the interrupt writes it.
        self.lost.store(self.lost.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }
}

impl Default for Received {
    fn default() -> Self {
        Self::new()
    }
}

/// Link: both directions of a port.
pub struct Link<P> {
    port: P,
    received: &'static Received,
    /// Number of losses that have been logged.
    told: u32,
}

impl<P> Link<P> {
    /// Link over a port and the bytes that its interrupt receives.
    pub fn new(port: P, received: &'static Received) -> Self {
        Self { port, received, told: 0 }
    }

    /// True when a byte waits.
    pub fn has_received(&self) -> bool {
        !self.received.ring.is_empty()
    }

    /// Number of losses since the last call.
    pub fn lost(&mut self) -> u32 {
        let lost = self.received.lost.load(Ordering::Relaxed);
        lost.wrapping_sub(core::mem::replace(&mut self.told, lost))
    }
}

impl<P> ErrorType for Link<P> {
    type Error = Infallible;
}

impl<P> ReadReady for Link<P> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.has_received())
    }
}

impl<P> Read for Link<P> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let bytes = core::iter::from_fn(|| self.received.ring.pop());
        Ok(buffer.iter_mut().zip(bytes).map(|(slot, byte)| *slot = byte).count())
    }
}

impl<P: Port> Write for Link<P> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        bytes.iter().for_each(|&byte| self.port.send(byte));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
