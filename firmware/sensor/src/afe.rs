//! Drivers of the analog front end: laser driver and converter, each behind SPI.
//!
//! Both speak registers: one byte of address (bit 7: write), four bytes of value, most significant
//! first. Settings are written and read back; a register that reads another value is a fault.

use echoloop_dsp::ScanPattern;
use echoloop_dsp::hardware::{Hardware, SPEED_OF_LIGHT_M_S, sample_period_fs};
use echoloop_dsp::settings::Settings;
use echoloop_link::Noise;
use embedded_hal::spi::{Operation, SpiDevice};

use crate::board::Board;

/// Address bit of a write.
pub const WRITE: u8 = 0x80;

/// Registers of the laser driver.
pub mod emitter {
    /// Reads [`ID_VALUE`].
    pub const ID: u8 = 0;
    /// Peak power, µW.
    pub const POWER: u8 = 1;
    /// Full width at half maximum, ps.
    pub const PULSE_WIDTH: u8 = 2;
    /// Number of the scan.
    pub const FRAME: u8 = 3;
    /// Beam to fire at; writing it fires.
    pub const FIRE: u8 = 4;
    /// Index, among the shots added up for the beam, of the shot that fires next, from 0.
    pub const SHOT: u8 = 5;
    /// Range from which the receiver sees the whole beam, mm; the tilt of the emitter towards the
    /// receiver sets it.
    pub const OVERLAP: u8 = 6;
    /// Number of the scan that, with the seed, decides the noise of a simulated front end; 0: FRAME
    /// decides it, with a seed of the front end's own.
    pub const NOISE_SCAN: u8 = 7;
    /// Lower half of the seed of that noise.
    pub const NOISE_SEED_LOW: u8 = 8;
    /// Upper half of the seed of that noise.
    pub const NOISE_SEED_HIGH: u8 = 9;
    /// Cell of the raster that a steered beam points to: column in the upper half, row in the
    /// lower.
    pub const CELL: u8 = 10;
    /// Value that [`ID`] reads.
    pub const ID_VALUE: u32 = 0xEC40_0001;
}

/// Registers of the amplifier and converter.
pub mod adc {
    /// Reads [`ID_VALUE`].
    pub const ID: u8 = 0;
    /// Analog gain, 0.01 dB, two's complement.
    pub const GAIN: u8 = 1;
    /// Clock divider: sample period, fs.
    pub const SAMPLE_PERIOD: u8 = 2;
    /// Time from the trigger to sample 0, fs.
    pub const DELAY: u8 = 3;
    /// Number of samples of the window.
    pub const SAMPLES: u8 = 4;
    /// Number of samples just before the trigger, which come before the window's.
    pub const PRE_TRIGGER: u8 = 5;
    /// Level added before conversion, ppm of full scale.
    pub const BLACK_LEVEL: u8 = 6;
    /// Slope of the gain after a shot, up to full gain, 10⁻⁶ dB/ns.
    pub const GAIN_SLOPE: u8 = 7;
    /// Time from the trigger to full gain, fs. Before the trigger the gain is full.
    pub const GAIN_FULL: u8 = 8;
    /// Value that [`ID`] reads.
    pub const ID_VALUE: u32 = 0xEC41_0001;
}

/// Error of the front end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum AfeError {
    /// The bus failed.
    Bus,
    /// Another device answers, or none.
    WrongDevice {
        /// Content of the ID register.
        id: u32,
    },
    /// A register reads another value than was written.
    Verify {
        /// Address of the register.
        register: u8,
    },
}

/// Time from the trigger to sample 0, fs.
pub fn delay_fs(settings: &Settings, hardware: &Hardware) -> u32 {
    echo_fs(settings, hardware.range_min_mm)
}

/// Time from the trigger to the echo from a range, fs: there and back, and half a pulse, because
/// the time of an echo is its middle.
fn echo_fs(settings: &Settings, range_mm: u32) -> u32 {
    // mm / (m/s) is ms, and one is 10¹² fs. The register holds it up to 600 m; sums saturate far
    // beyond.
    let there_and_back = u64::from(range_mm).saturating_mul(2_000_000_000_000);
    let flight = there_and_back.saturating_add(SPEED_OF_LIGHT_M_S / 2) / SPEED_OF_LIGHT_M_S;
    let echo = flight.saturating_add((settings.pulse_width_ps as u64).saturating_mul(1000));
    echo.min(u32::MAX.into()) as u32
}

/// Slope of the gain in time, 10⁻⁶ dB/ns, to the nearest: 0.001 dB/m · c/2.
pub fn gain_slope(settings: &Settings) -> u32 {
    let slope = (settings.gain_slope_mdb_m.max(0) as u64).saturating_mul(SPEED_OF_LIGHT_M_S);
    (slope.saturating_add(1_000_000) / 2_000_000) as u32
}

/// Time from the trigger to full gain, fs.
pub fn gain_full_fs(settings: &Settings) -> u32 {
    echo_fs(settings, settings.gain_range_mm.max(0) as u32)
}

/// Writes a whole set of settings to both devices of a board.
///
/// # Errors
///
/// [`AfeError`]. Registers written before it keep their new values, so the devices match neither
/// the old settings nor the new.
pub fn apply(settings: &Settings, board: &mut impl Board) -> Result<(), AfeError> {
    let hardware = board.hardware();
    let spi = board.emitter();
    identify(spi, emitter::ID, emitter::ID_VALUE)?;
    write_verified(spi, emitter::POWER, settings.power_uw as u32)?;
    write_verified(spi, emitter::PULSE_WIDTH, settings.pulse_width_ps as u32)?;
    write_verified(spi, emitter::OVERLAP, settings.overlap_mm as u32)?;
    write_verified(spi, emitter::SHOT, 0)?;
    let spi = board.adc();
    identify(spi, adc::ID, adc::ID_VALUE)?;
    write_verified(spi, adc::GAIN, settings.gain_cdb as u32)?;
    write_verified(spi, adc::GAIN_SLOPE, gain_slope(settings))?;
    write_verified(spi, adc::GAIN_FULL, gain_full_fs(settings))?;
    write_verified(spi, adc::SAMPLE_PERIOD, sample_period_fs(settings.bins as u32, &hardware))?;
    write_verified(spi, adc::DELAY, delay_fs(settings, &hardware))?;
    write_verified(spi, adc::BLACK_LEVEL, settings.black_level_ppm as u32)?;
    write_verified(spi, adc::PRE_TRIGGER, settings.pre_trigger_samples())?;
    write_verified(spi, adc::SAMPLES, settings.bins as u32)
}

/// Tells the emitter the number of the scan that begins.
///
/// # Errors
///
/// [`AfeError`] when the bus fails or the register does not hold the number.
pub fn begin_frame(emitter_spi: &mut impl SpiDevice, frame: u32) -> Result<(), AfeError> {
    write_verified(emitter_spi, emitter::FRAME, frame)
}

/// Tells the emitter the scan and the seed that decide the noise. Only a simulated front end uses
/// them: they are not read back, because a real one need not have these registers.
///
/// # Errors
///
/// [`AfeError::Bus`].
pub fn name_noise(emitter_spi: &mut impl SpiDevice, noise: Option<Noise>) -> Result<(), AfeError> {
    let Some(Noise { scan, seed }) = noise else {
        return write(emitter_spi, emitter::NOISE_SCAN, 0);
    };
    write(emitter_spi, emitter::NOISE_SCAN, scan)?;
    write(emitter_spi, emitter::NOISE_SEED_LOW, seed as u32)?;
    write(emitter_spi, emitter::NOISE_SEED_HIGH, (seed >> 32) as u32)
}

/// Fires a shot of a beam: steers the beam before its first shot where the pattern does, numbers
/// the shot where there are several, and delays its window where shots are dithered. `pattern` has
/// the aim of the settings.
///
/// # Errors
///
/// [`AfeError::Bus`].
pub fn fire(
    board: &mut impl Board,
    settings: &Settings,
    pattern: &ScanPattern,
    beam: u32,
    shot: u32,
) -> Result<(), AfeError> {
    if let (0, Some([column, row])) = (shot, pattern.cell(beam)) {
        write(board.emitter(), emitter::CELL, (column << 16) | (row & 0xffff))?;
    }
    if settings.shots > 1 {
        write(board.emitter(), emitter::SHOT, shot)?;
    }
    if settings.phases() > 1 {
        let hardware = board.hardware();
        let offset = settings.offset_fs(shot, sample_period_fs(settings.bins as u32, &hardware));
        let delay = delay_fs(settings, &hardware).saturating_add_signed(offset);
        write(board.adc(), adc::DELAY, delay)?;
    }
    write(board.emitter(), emitter::FIRE, beam)
}

fn identify(spi: &mut impl SpiDevice, register: u8, expected: u32) -> Result<(), AfeError> {
    let id = read(spi, register)?;
    if id == expected { Ok(()) } else { Err(AfeError::WrongDevice { id }) }
}

fn write_verified(spi: &mut impl SpiDevice, register: u8, value: u32) -> Result<(), AfeError> {
    write(spi, register, value)?;
    if read(spi, register)? == value { Ok(()) } else { Err(AfeError::Verify { register }) }
}

fn write(spi: &mut impl SpiDevice, register: u8, value: u32) -> Result<(), AfeError> {
    let [a, b, c, d] = value.to_be_bytes();
    spi.write(&[register | WRITE, a, b, c, d]).map_err(|_| AfeError::Bus)
}

fn read(spi: &mut impl SpiDevice, register: u8) -> Result<u32, AfeError> {
    let mut value = [0; 4];
    spi.transaction(&mut [Operation::Write(&[register]), Operation::Read(&mut value)])
        .map_err(|_| AfeError::Bus)?;
    Ok(u32::from_be_bytes(value))
}
