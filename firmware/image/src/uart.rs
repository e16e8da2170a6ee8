//! Serial ports, polled.

use core::convert::Infallible;

use embedded_io::{ErrorType, Read, ReadReady, Write};

use crate::mmio::Block;

/// Serial port that receives and sends single bytes.
pub trait Port {
    /// Returns a received byte, if there is one.
    fn receive(&mut self) -> Option<u8>;
    /// True when a byte has been received.
    fn has_received(&mut self) -> bool;
    /// Waits for room and sends a byte.
    fn send(&mut self, byte: u8);
    /// Clears the interrupt that a received byte has raised.
    fn clear_interrupt(&mut self) {}
}

/// Port with the traits of `embedded-io`. A real board would receive by interrupt or DMA; the
/// emulator holds bytes back instead.
pub struct Uart<P>(pub P);

impl<P> ErrorType for Uart<P> {
    type Error = Infallible;
}

impl<P: Port> ReadReady for Uart<P> {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.0.has_received())
    }
}

impl<P: Port> Read for Uart<P> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let bytes = core::iter::from_fn(|| self.0.receive());
        Ok(buffer.iter_mut().zip(bytes).map(|(slot, byte)| *slot = byte).count())
    }
}

impl<P: Port> Write for Uart<P> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        for &byte in bytes {
            self.0.send(byte);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Serial port of Arm's Cortex-M system design kit.
#[derive(Clone, Copy)]
pub struct Cmsdk(Block);

impl Cmsdk {
    const DATA: usize = 0x00;
    const STATE: usize = 0x04;
    const CONTROL: usize = 0x08;
    const INTERRUPT_CLEAR: usize = 0x0C;
    const DIVIDER: usize = 0x10;
    const RECEIVED: u32 = 0b10;

    /// Switches the port on, at the fastest rate.
    pub fn new(block: Block) -> Self {
        block.write(Self::DIVIDER, 16);
        block.write(Self::CONTROL, 0b1011); // transmitter, receiver and its interrupt
        Self(block)
    }
}

impl Port for Cmsdk {
    fn receive(&mut self) -> Option<u8> {
        self.has_received().then(|| self.0.read(Self::DATA) as u8)
    }

    fn has_received(&mut self) -> bool {
        self.0.read(Self::STATE) & 0b10 != 0
    }

    fn send(&mut self, byte: u8) {
        while self.0.read(Self::STATE) & 0b01 != 0 {}
        self.0.write(Self::DATA, byte.into());
    }

    fn clear_interrupt(&mut self) {
        self.0.write(Self::INTERRUPT_CLEAR, Self::RECEIVED);
    }
}

/// 16550, with byte-wide registers.
#[derive(Clone, Copy)]
pub struct Ns16550(Block);

impl Ns16550 {
    const LINE_STATUS: usize = 5;

    /// Port as the emulator starts it.
    pub fn new(block: Block) -> Self {
        Self(block)
    }
}

impl Port for Ns16550 {
    fn receive(&mut self) -> Option<u8> {
        self.has_received().then(|| self.0.read_byte(0))
    }

    fn has_received(&mut self) -> bool {
        self.0.read_byte(Self::LINE_STATUS) & 0x01 != 0
    }

    fn send(&mut self, byte: u8) {
        while self.0.read_byte(Self::LINE_STATUS) & 0x20 == 0 {}
        self.0.write_byte(0, byte);
    }
}

/// Port to which nothing is connected.
#[derive(Clone, Copy)]
pub struct Void;

impl Void {
    /// Port without a device; the block is not used.
    pub fn new(_: Block) -> Self {
        Self
    }
}

impl Port for Void {
    fn receive(&mut self) -> Option<u8> {
        None
    }

    fn has_received(&mut self) -> bool {
        false
    }

    fn send(&mut self, _byte: u8) {}
}
