//! Link on UART0, whose interrupt fills the ring of [`echoloop_part::link`].
//!
//! At 1,000,000 baud a byte comes every 10 µs, and the port holds six. The rate is the part's
//! fastest, and exact; its setting "921,600" is 941,176. The part's other serial port, UARTE, would
//! write bytes to memory by itself; but it reports a full buffer, not a quiet line, so a short
//! command would wait for the next one.
//!
//! The HAL has no driver of this port for this part; the registers are those of chapter 6.33 of the
//! Product Specification.

use cortex_m::peripheral::NVIC;
use echoloop_part::link::{Link, Port, Received};
use nrf52840_hal::gpio::p0::{P0_06, P0_08};
use nrf52840_hal::gpio::{Disconnected, Level};
use nrf52840_hal::pac::{Interrupt, UART0, interrupt};

/// Bytes on their way from the interrupt to the program.
static RECEIVED: Received = Received::new();

/// Sending side of the port, for the program.
pub struct Sender(UART0);

impl Port for Sender {
    fn send(&mut self, byte: u8) {
        self.0.events_txdrdy.reset();
        // SAFETY: any byte may be sent.
        self.0.txd.write(|w| unsafe { w.txd().bits(byte) });
        while self.0.events_txdrdy.read().bits() == 0 {}
    }
}

/// Starts the link over the port and the pins that send and receive.
pub(crate) fn start(
    port: UART0,
    sends: P0_06<Disconnected>,
    receives: P0_08<Disconnected>,
) -> Link<Sender> {
    let sends = sends.into_push_pull_output(Level::High).degrade();
    let receives = receives.into_pullup_input().degrade();
    // SAFETY: pins that the part has and nothing else uses; they stay as they were set.
    port.psel.txd.write(|w| unsafe { w.bits(sends.psel_bits()) });
    // SAFETY: as above.
    port.psel.rxd.write(|w| unsafe { w.bits(receives.psel_bits()) });
    port.baudrate.write(|w| w.baudrate().baud1m());
    port.config.reset(); // eight bits, no parity, no flow control
    port.enable.write(|w| w.enable().enabled());
    port.intenset.write(|w| w.rxdrdy().set().error().set());
    // SAFETY: writing one begins the task.
    port.tasks_starttx.write(|w| unsafe { w.bits(1) });
    // SAFETY: as above.
    port.tasks_startrx.write(|w| unsafe { w.bits(1) });
    // SAFETY: the handler uses the registers of the receiving side, the sender the others.
    unsafe { NVIC::unmask(Interrupt::UARTE0_UART0) };
    Link::new(Sender(port), &RECEIVED)
}

#[interrupt]
fn UARTE0_UART0() {
    // SAFETY: only events and data of the receiving side, which nothing else uses.
    let port = unsafe { &*UART0::ptr() };
    // The event comes again with each byte that moves up in the FIFO, so it is cleared before the
    // byte is read.
    while port.events_rxdrdy.read().bits() != 0 {
        port.events_rxdrdy.reset();
        RECEIVED.push(port.rxd.read().rxd().bits());
    }
    if port.events_error.read().bits() != 0 {
        port.events_error.reset();
        let causes = port.errorsrc.read().bits();
        // SAFETY: ones clear the causes that were read.
        port.errorsrc.write(|w| unsafe { w.bits(causes) });
        RECEIVED.lose();
    }
}
