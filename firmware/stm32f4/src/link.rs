//! Link on USART1, whose interrupt fills the ring of [`echoloop_part::link`].
//!
//! At 921,600 baud a byte comes every 10.9 µs, and the USART holds one beside the one being
//! received. The interrupt takes some 50 of the 1,800 cycles in between. Only the waits for the
//! flash ([`crate::flash`]) and the few instructions with interrupts masked before a sleep delay
//! it.

use core::cell::UnsafeCell;

use cortex_m::peripheral::NVIC;
use echoloop_part::link::{Link, Port, Received};
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::{Interrupt, USART1, interrupt};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Instance, Rx, Serial, Tx};

/// Bits per second.
pub(crate) const BAUD: u32 = 921_600;

/// Bytes on their way from the interrupt to the program.
static RECEIVED: Received = Received::new();

/// Receiver of the port, which the interrupt owns.
struct Cell(UnsafeCell<Option<Rx<USART1>>>);

// SAFETY: written once, before the interrupt is enabled; from then on only the interrupt uses it.
unsafe impl Sync for Cell {}

static RECEIVER: Cell = Cell(UnsafeCell::new(None));

/// Sending side of a USART.
pub struct Sender<U: Instance>(pub(crate) Tx<U>);

impl<U: Instance> Port for Sender<U> {
    fn send(&mut self, byte: u8) {
        while let Err(nb::Error::WouldBlock) = self.0.write(byte) {}
    }
}

/// Starts the link over the port.
pub(crate) fn start(port: Serial<USART1>) -> Link<Sender<USART1>> {
    let (sender, mut receiver) = port.split();
    receiver.listen();
    // SAFETY: the port's interrupt is still masked, so its handler touches nothing yet.
    unsafe { *RECEIVER.0.get() = Some(receiver) };
    // SAFETY: the receiver is set, so the handler may run.
    unsafe { NVIC::unmask(Interrupt::USART1) };
    Link::new(Sender(sender), &RECEIVED)
}

#[interrupt]
fn USART1() {
    // SAFETY: set before this could run, and used by nothing else since; a handler does not
    // interrupt itself.
    let Some(port) = (unsafe { &mut *RECEIVER.0.get() }) else { return };
    match port.read() {
        Ok(byte) => RECEIVED.push(byte),
        Err(nb::Error::WouldBlock) => {}
        Err(nb::Error::Other(_)) => RECEIVED.lose(),
    }
}
