//! The link: a port whose interrupt puts each byte that comes into a ring.
//!
//! The program empties the ring between commands. What may come meanwhile is bounded by the
//! protocol, not by time: a host has as many frames under way as the board says, and these say two.
//! So the ring takes the longest frame twice, even if the program takes nothing out.

use core::convert::Infallible;
use core::sync::atomic::{AtomicU32, Ordering};

use echoloop_link::MAX_FRAME;
use embedded_io::{ErrorType, Read, ReadReady, Write};

use crate::ring::Ring;

/// Bytes of the ring.
pub const RING: usize = (2 * MAX_FRAME).next_power_of_two();

/// Bytes that are kept while the program works on a frame of the longest.
pub const HELD: usize = RING - MAX_FRAME;

/// The sending side of a serial port.
pub trait Port {
    /// Sends a byte; waits for room before, or until it is out afterwards.
    fn send(&mut self, byte: u8);
}

/// A port that there is not.
impl Port for Infallible {
    fn send(&mut self, _: u8) {
        match *self {}
    }
}

/// From a port's interrupt to the program.
pub struct Received {
    ring: Ring<RING>,
    /// How often bytes were lost: one while the ring was full, or any the port was not asked for.
    lost: AtomicU32,
}

impl Received {
    /// Nothing yet.
    pub const fn new() -> Self {
        Self { ring: Ring::new(), lost: AtomicU32::new(0) }
    }

    /// Takes a byte that has come. For the interrupt alone.
    pub fn push(&self, byte: u8) {
        if !self.ring.push(byte) {
            self.lose();
        }
    }

    /// Counts that the port lost bytes; how many it does not say. For the interrupt alone.
    pub fn lose(&self) {
        // Only the interrupt writes it.
        self.lost.store(self.lost.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }
}

impl Default for Received {
    fn default() -> Self {
        Self::new()
    }
}

/// The link's two directions.
pub struct Link<P> {
    port: P,
    received: &'static Received,
    /// Of the losses, those that the log has told.
    told: u32,
}

impl<P> Link<P> {
    /// The link over a port, and what its interrupt receives.
    pub fn new(port: P, received: &'static Received) -> Self {
        Self { port, received, told: 0 }
    }

    /// Whether a byte waits.
    pub fn has_received(&self) -> bool {
        !self.received.ring.is_empty()
    }

    /// How often bytes were lost since this was last asked.
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
