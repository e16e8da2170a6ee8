//! Mailbox: page of memory that an emulated board shares with its world, in place of a front end.
//!
//! A real board has a laser driver and a converter behind SPI, a DMA buffer of the converter and a
//! flash chip. For an emulated board, the emulator maps one file into the sensor's memory, with
//! this layout; all words are little endian.
//!
//! | offset | content | written by |
//! |---|---|---|
//! | 0x000 | [`MAGIC`] | world, before the sensor starts |
//! | 0x004 | doorbell: shots fired so far, wrapping | sensor |
//! | 0x008 | shots whose samples are in the buffer | world |
//! | 0x00C | run: command of the world to a measuring image | world |
//! | 0x040 | straps: [`Hardware`], [`ScanPattern`], postcard | world, before the sensor starts |
//! | 0x080 | laser driver, sixteen registers | sensor; register 0 by the world |
//! | 0x0C0 | amplifier and converter, sixteen registers | sensor; register 0 by the world |
//! | 0x1000 | DMA buffer: codes, u16 | world |
//! | 0x4000 | flash, [`FLASH_BYTES`] | sensor |
//!
//! For a shot the sensor writes the registers, then the doorbell; the world fills the buffer, then
//! answers with the doorbell's number. Each side writes its own words only, so no lock is needed.

use echoloop_dsp::{Hardware, ScanPattern};
use embedded_hal::spi::{ErrorKind, Operation};

use crate::afe::WRITE;

/// First word: "ECMB".
pub const MAGIC: u32 = u32::from_le_bytes(*b"ECMB");
/// Offset of the doorbell.
pub const DOORBELL: usize = 0x004;
/// Offset of the answer to the doorbell.
pub const ANSWER: usize = 0x008;
/// Offset of the command to a measuring image.
pub const RUN: usize = 0x00C;
/// Offset of the straps.
pub const STRAPS: usize = 0x040;
/// Offset of the laser driver's registers.
pub const EMITTER: usize = 0x080;
/// Offset of the amplifier's and converter's registers.
pub const ADC: usize = 0x0C0;
/// Number of registers of a device.
pub const REGISTERS: usize = 16;
/// Offset of the DMA buffer.
pub const CODES: usize = 0x1000;
/// Offset of the flash.
pub const FLASH: usize = 0x4000;
/// Size of the flash in bytes: two blocks.
pub const FLASH_BYTES: usize = 2 * FLASH_BLOCK;
/// Size of a block, which is erased at a time, in bytes.
pub const FLASH_BLOCK: usize = 4096;
/// Size of the mailbox in bytes.
pub const BYTES: usize = 0x8000;

/// Number of words of the straps: room for the longest hardware and pattern, and zeros.
pub const STRAP_WORDS: usize = (EMITTER - STRAPS) / 4;

/// Straps, which the board's maker sets once: the words at [`STRAPS`].
pub fn straps(hardware: &Hardware, pattern: &ScanPattern) -> [u32; STRAP_WORDS] {
    let mut words = [[0; 4]; STRAP_WORDS];
    // They fit: a number takes at most five bytes, and a test writes the longest.
    let _ = postcard::to_slice(&(hardware, pattern), words.as_flattened_mut());
    words.map(u32::from_le_bytes)
}

/// Reads the straps; `None` when they describe no possible sensor.
pub fn read_straps(words: [u32; STRAP_WORDS]) -> Option<(Hardware, ScanPattern)> {
    let bytes = words.map(u32::to_le_bytes);
    let ((hardware, pattern), _): ((Hardware, ScanPattern), _) =
        postcard::take_from_bytes(bytes.as_flattened()).ok()?;
    let Hardware { adc_bits, range_min_mm, range_max_mm, .. } = hardware;
    let works =
        (8..=14).contains(&adc_bits) && range_min_mm < range_max_mm && range_max_mm < 1_000_000;
    works.then_some((hardware, pattern))
}

/// Registers of an emulated SPI device.
pub trait Registers {
    /// Value of a register; 0 where there is none.
    fn get(&self, register: u8) -> u32;
    /// Sets a register; does nothing where there is none. Register 0, the device's identity, is
    /// never set.
    fn set(&mut self, register: u8, value: u32);
}

/// Performs a transaction of [`crate::afe`] on a device: one byte of address (bit 7: write), four
/// of value.
///
/// # Errors
///
/// [`ErrorKind::Other`] for a transaction that the driver never makes.
pub fn serve(
    device: &mut impl Registers,
    operations: &mut [Operation<'_, u8>],
) -> Result<(), ErrorKind> {
    let mut register = 0;
    for operation in operations {
        match operation {
            Operation::Write([address]) => register = *address,
            Operation::Write([address, a, b, c, d]) if address & WRITE != 0 => {
                match address & !WRITE {
                    0 => {}
                    register => device.set(register, u32::from_be_bytes([*a, *b, *c, *d])),
                }
            }
            Operation::Read(bytes) => {
                let Ok(bytes) = <&mut [u8; 4]>::try_from(&mut **bytes) else {
                    return Err(ErrorKind::Other);
                };
                *bytes = device.get(register).to_be_bytes();
            }
            _ => return Err(ErrorKind::Other),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::{Spinning, SpinningModel};

    use super::*;

    #[test]
    fn straps_come_back_as_they_were_set() {
        let spinning =
            SpinningModel::ALL.map(|model| ScanPattern::Spinning(Spinning { model, columns: 9 }));
        for pattern in spinning.into_iter().chain(ScanPattern::EXAMPLES) {
            let words = straps(&Hardware::REFERENCE, &pattern);
            assert_eq!(read_straps(words), Some((Hardware::REFERENCE, pattern)));
        }
    }

    #[test]
    fn the_longest_straps_fit() {
        let longest = Hardware {
            adc_bits: u32::MAX,
            range_min_mm: u32::MAX,
            range_max_mm: u32::MAX,
            energy_limit_pj: u32::MAX,
            unit_echo_milli: u32::MAX,
            shot_noise_ppm: u32::MAX,
        };
        for pattern in ScanPattern::EXAMPLES {
            let words = straps(&longest, &pattern).map(u32::to_le_bytes);
            let read = postcard::take_from_bytes(words.as_flattened()).map(|(all, _)| all);
            assert_eq!(read, Ok((longest, pattern)));
        }
    }

    #[test]
    fn straps_of_no_pattern_make_no_sensor() {
        // The number of no pattern, and a grid of more columns than 16 bits hold.
        for wrong in [(99, 0), (u32::MAX, 0), (0, 65_536)] {
            let mut words = [[0; 4]; STRAP_WORDS];
            let written =
                postcard::to_slice(&(Hardware::REFERENCE, wrong), words.as_flattened_mut());
            assert!(written.is_ok());
            assert_eq!(read_straps(words.map(u32::from_le_bytes)), None, "{wrong:?}");
        }
    }

    #[test]
    fn memory_without_straps_makes_no_sensor() {
        assert_eq!(read_straps([0; STRAP_WORDS]), None);
        assert_eq!(read_straps([u32::MAX; STRAP_WORDS]), None);
    }
}
