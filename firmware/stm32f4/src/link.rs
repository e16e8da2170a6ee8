//! The link: USART1, whose interrupt puts each byte that comes into a ring.
//!
//! At 921,600 baud a byte comes every 10.9 µs, and the USART holds one beside the one under way.
//! Its interrupt takes some 50 of the 1,800 cycles between. Nothing keeps it from that but the
//! flash's waits ([`crate::flash`]) and the few instructions with interrupts masked before a sleep.
//!
//! The program empties the ring between commands. What may come meanwhile is bounded by the
//! protocol, not by time: a host has as many frames under way as the board says, and this one says
//! two. So the ring takes the longest frame twice, even if the program takes nothing out.

use core::cell::UnsafeCell;
use core::convert::Infallible;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use echoloop_link::MAX_FRAME;
use embedded_io::{ErrorType, Read, ReadReady, Write};
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::{Interrupt, USART1, interrupt};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Instance, Rx, Serial, Tx};

use crate::ring::Ring;

/// Bits per second.
pub const BAUD: u32 = 921_600;

/// Bytes of the ring.
pub const RING: usize = (2 * MAX_FRAME).next_power_of_two();

/// Bytes that are kept while the program works on a frame of the longest.
pub const HELD: usize = RING - MAX_FRAME;

/// From the interrupt to the program.
static RECEIVED: Ring<RING> = Ring::new();

/// What the interrupt has.
struct Cell(UnsafeCell<Option<Rx<USART1>>>);

// SAFETY: written once, before the interrupt is let through, and from then on the interrupt's own.
unsafe impl Sync for Cell {}

static RECEIVER: Cell = Cell(UnsafeCell::new(None));

/// Bytes that came while the ring was full, or that the port lost.
static LOST: AtomicU32 = AtomicU32::new(0);

/// The link's two directions.
pub struct Link {
    port: Tx<USART1>,
    /// Of [`LOST`], those that the log has told.
    told: u32,
}

impl Link {
    /// The link over the port, of which there is one.
    pub fn new(port: Serial<USART1>) -> Self {
        let (sender, mut receiver) = port.split();
        receiver.listen();
        // SAFETY: the port's interrupt is still masked, so its handler touches nothing yet.
        unsafe { *RECEIVER.0.get() = Some(receiver) };
        // SAFETY: what the handler touches is whole.
        unsafe { NVIC::unmask(Interrupt::USART1) };
        Self { port: sender, told: 0 }
    }

    /// Whether a byte waits.
    pub fn has_received(&self) -> bool {
        !RECEIVED.is_empty()
    }

    /// Bytes lost since this was last asked.
    pub fn lost(&mut self) -> u32 {
        let lost = LOST.load(Ordering::Relaxed);
        lost.wrapping_sub(core::mem::replace(&mut self.told, lost))
    }
}

#[interrupt]
fn USART1() {
    // SAFETY: set before this could run, and nobody else's since; a handler does not interrupt
    // itself.
    let Some(port) = (unsafe { &mut *RECEIVER.0.get() }) else { return };
    let taken = match port.read() {
        Ok(byte) => RECEIVED.push(byte),
        Err(nb::Error::WouldBlock) => true,
        Err(nb::Error::Other(_)) => false,
    };
    if !taken {
        // Only this writes it.
        LOST.store(LOST.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    }
}

impl ErrorType for Link {
    type Error = Infallible;
}

impl ReadReady for Link {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.has_received())
    }
}

impl Read for Link {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let bytes = core::iter::from_fn(|| RECEIVED.pop());
        Ok(buffer.iter_mut().zip(bytes).map(|(slot, byte)| *slot = byte).count())
    }
}

impl Write for Link {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        bytes.iter().for_each(|&byte| send(&mut self.port, byte));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Waits for room and sends a byte.
pub(crate) fn send<U: Instance>(port: &mut Tx<U>, byte: u8) {
    while let Err(nb::Error::WouldBlock) = port.write(byte) {}
}
