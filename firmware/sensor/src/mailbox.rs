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
//! | 0x040 | straps: [`Hardware`], [`ScanPattern`]: 13 words | world, before the sensor starts |
//! | 0x080 | laser driver, sixteen registers | sensor; register 0 by the world |
//! | 0x0C0 | amplifier and converter, sixteen registers | sensor; register 0 by the world |
//! | 0x1000 | DMA buffer: codes, u16 | world |
//! | 0x4000 | flash, [`FLASH_BYTES`] | sensor |
//!
//! For a shot the sensor writes the registers, then the doorbell; the world fills the buffer, then
//! answers with the doorbell's number. Each side writes its own words only, so no lock is needed.

use echoloop_dsp::{Hardware, ScanPattern, scan_pattern};
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

/// Number of words of the straps: those of the hardware, then those of the pattern.
pub const STRAP_WORDS: usize = 6 + scan_pattern::WORDS;

/// Straps, which the board's maker sets once: the words at [`STRAPS`].
pub fn straps(hardware: &Hardware, pattern: &ScanPattern) -> [u32; STRAP_WORDS] {
    let [kind, a, b, c, d, e, f] = pattern.to_words();
    [
        hardware.adc_bits,
        hardware.range_min_mm,
        hardware.range_max_mm,
        hardware.energy_limit_pj,
        hardware.unit_echo_milli,
        hardware.shot_noise_ppm,
        kind,
        a,
        b,
        c,
        d,
        e,
        f,
    ]
}

/// Reads the straps; `None` when they describe no possible sensor.
pub fn read_straps(words: [u32; STRAP_WORDS]) -> Option<(Hardware, ScanPattern)> {
    let [
        adc_bits,
        range_min_mm,
        range_max_mm,
        energy_limit_pj,
        unit_echo_milli,
        shot_noise_ppm,
        pattern @ ..,
    ] = words;
    let hardware = Hardware {
        adc_bits,
        range_min_mm,
        range_max_mm,
        energy_limit_pj,
        unit_echo_milli,
        shot_noise_ppm,
    };
    let pattern = ScanPattern::from_words(pattern)?;
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
    use echoloop_dsp::{BeamTable, Grid, Rosette, Spinning, SpinningModel};

    use super::*;

    #[test]
    fn straps_come_back_as_they_were_set() {
        let grid = Grid { columns: 7, rows: 5, azimuth_cdeg: 18_000, elevation_cdeg: 9_000 };
        let spinning =
            SpinningModel::ALL.map(|model| ScanPattern::Spinning(Spinning { model, columns: 9 }));
        let others = [
            ScanPattern::Grid(grid),
            ScanPattern::Raster(grid),
            ScanPattern::Rosette(Rosette::MID_40),
            ScanPattern::Table(BeamTable { beams: 131_072, channels: 300, hash: u32::MAX }),
        ];
        for pattern in spinning.into_iter().chain(others) {
            let words = straps(&Hardware::REFERENCE, &pattern);
            assert_eq!(read_straps(words), Some((Hardware::REFERENCE, pattern)));
        }
    }

    #[test]
    fn straps_of_no_pattern_make_no_sensor() {
        let hardware = Hardware::REFERENCE;
        let words = straps(&hardware, &ScanPattern::default());
        for (at, wrong) in [(6, 5), (7, 65_536), (6, u32::MAX)] {
            let other = core::array::from_fn(|i| match words.get(i) {
                Some(word) if i != at => *word,
                _ => wrong,
            });
            assert_eq!(read_straps(other), None, "word {at} is {wrong}");
        }
    }

    #[test]
    fn memory_without_straps_makes_no_sensor() {
        assert_eq!(read_straps([0; STRAP_WORDS]), None);
        assert_eq!(read_straps([u32::MAX; STRAP_WORDS]), None);
    }
}
