//! The link: USART1, whose interrupt fills [`echoloop_part::link`]'s ring.
//!
//! At 921,600 baud a byte comes every 10.9 µs, and the USART holds one beside the one under way.
//! Its interrupt takes some 50 of the 1,800 cycles between. Nothing keeps it from that but the
//! flash's waits ([`crate::flash`]) and the few instructions with interrupts masked before a sleep.

use core::cell::UnsafeCell;

use cortex_m::peripheral::NVIC;
use echoloop_part::link::{Link, Port, Received};
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::{Interrupt, USART1, interrupt};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Instance, Rx, Serial, Tx};

/// Bits per second.
pub(crate) const BAUD: u32 = 921_600;

/// From the interrupt to the program.
static RECEIVED: Received = Received::new();

/// What the interrupt has.
struct Cell(UnsafeCell<Option<Rx<USART1>>>);

// SAFETY: written once, before the interrupt is let through, and from then on the interrupt's own.
unsafe impl Sync for Cell {}

static RECEIVER: Cell = Cell(UnsafeCell::new(None));

/// The sending side of a USART.
pub struct Sender<U: Instance>(pub(crate) Tx<U>);

impl<U: Instance> Port for Sender<U> {
    fn send(&mut self, byte: u8) {
        while let Err(nb::Error::WouldBlock) = self.0.write(byte) {}
    }
}

/// The link over the port, of which there is one.
pub(crate) fn start(port: Serial<USART1>) -> Link<Sender<USART1>> {
    let (sender, mut receiver) = port.split();
    receiver.listen();
    // SAFETY: the port's interrupt is still masked, so its handler touches nothing yet.
    unsafe { *RECEIVER.0.get() = Some(receiver) };
    // SAFETY: what the handler touches is whole.
    unsafe { NVIC::unmask(Interrupt::USART1) };
    Link::new(Sender(sender), &RECEIVED)
}

#[interrupt]
fn USART1() {
    // SAFETY: set before this could run, and nobody else's since; a handler does not interrupt
    // itself.
    let Some(port) = (unsafe { &mut *RECEIVER.0.get() }) else { return };
    match port.read() {
        Ok(byte) => RECEIVED.push(byte),
        Err(nb::Error::WouldBlock) => {}
        Err(nb::Error::Other(_)) => RECEIVED.lose(),
    }
}
