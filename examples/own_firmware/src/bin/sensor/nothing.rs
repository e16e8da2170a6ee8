//! Placeholder for a part of the board: every access fails, no byte ever arrives.

use echoloop_own_firmware::{Buffer, Watchdog};
use embedded_hal::spi::{ErrorKind, Operation, SpiDevice};
use embedded_storage::nor_flash::{NorFlash, NorFlashErrorKind, ReadNorFlash};

/// Placeholder for any part of the board.
pub(crate) struct Nothing;

/// Always false, but not known at compile time, or the linker would remove all code that needs a
/// part.
fn is_there() -> bool {
    core::hint::black_box(false)
}

/// Error of every access.
fn answer<E>(error: E) -> Result<(), E> {
    if is_there() { Ok(()) } else { Err(error) }
}

impl embedded_hal::spi::ErrorType for Nothing {
    type Error = ErrorKind;
}

impl SpiDevice for Nothing {
    fn transaction(&mut self, _: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        answer(ErrorKind::Other)
    }
}

impl embedded_io::ErrorType for Nothing {
    type Error = embedded_io::ErrorKind;
}

impl embedded_io::Read for Nothing {
    fn read(&mut self, _: &mut [u8]) -> Result<usize, Self::Error> {
        Ok(usize::from(is_there()))
    }
}

impl embedded_io::ReadReady for Nothing {
    fn read_ready(&mut self) -> Result<bool, Self::Error> {
        Ok(is_there())
    }
}

impl embedded_io::Write for Nothing {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
        answer(embedded_io::ErrorKind::NotConnected).map(|()| bytes.len())
    }

    fn flush(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

impl embedded_storage::nor_flash::ErrorType for Nothing {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Nothing {
    const READ_SIZE: usize = 4;

    fn read(&mut self, _: u32, _: &mut [u8]) -> Result<(), Self::Error> {
        answer(NorFlashErrorKind::Other)
    }

    fn capacity(&self) -> usize {
        8_192
    }
}

impl NorFlash for Nothing {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 4_096;

    fn erase(&mut self, _: u32, _: u32) -> Result<(), Self::Error> {
        answer(NorFlashErrorKind::Other)
    }

    fn write(&mut self, _: u32, _: &[u8]) -> Result<(), Self::Error> {
        answer(NorFlashErrorKind::Other)
    }
}

impl Buffer for Nothing {
    fn finished(&mut self) -> Option<&[u16]> {
        is_there().then_some(&[])
    }

    fn arm(&mut self) {}
}

impl Watchdog for Nothing {
    fn feed(&mut self) {}
}
