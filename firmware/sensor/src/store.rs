//! Store of the saved settings: two slots in flash, one of which is whole at any moment.
//!
//! A slot takes as many erase blocks as a record needs; the first slot is at the beginning of the
//! flash, the second follows. Numbers are little endian.
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 4 | magic "EsET" |
//! | 4 | 8 | hash of the layout of [`Settings`], [`SETTINGS_SCHEMA`] |
//! | 12 | 4 | revision: one more than that of the other slot, modulo 2³² |
//! | 16 | 4 | n, length of the settings |
//! | 20 | n | settings, postcard |
//! | 20 + n | 4 | CRC-32C of all before it |
//! | 24 + n | … | ones, up to 256 bytes |
//!
//! The *newest* slot is the one with the greater revision (modulo 2³²) of those whose magic, hash
//! and checksum hold and whose settings pass [`Settings::check`] on this hardware. [`save`] writes
//! the other slot: it erases it, writes all but the words of the magic, then those words, and reads
//! all of it back. If power fails before the last word, there is no magic, so a start finds the old
//! settings or the new. A slot that cannot be read counts as empty, such as one with a torn word
//! under error correction.

use core::fmt;
use core::marker::PhantomData;

use echoloop_dsp::{Hardware, Settings};
use echoloop_link::{SETTINGS_SCHEMA, checksum};
use embedded_storage::nor_flash::NorFlash;

/// First bytes of a record.
pub const MAGIC: [u8; 4] = *b"EsET";

/// Bytes of a record, padding included: they are written and read at once.
pub const RECORD: usize = 256;

/// Number of bytes before the settings.
const HEADER: usize = 20;

/// Content of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Saved {
    /// Number of saves since the store was last empty, modulo 2³².
    pub revision: u32,
    /// Settings, which pass the check on the hardware that they were read for.
    pub settings: Settings,
}

/// Reason why settings were not saved. Those saved before are still there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StoreError {
    /// The flash has no room for two slots. Both in bytes.
    TooSmall {
        /// Size of the flash.
        capacity: usize,
        /// Size of two slots.
        needed: usize,
    },
    /// The flash failed to erase, write or read.
    Flash,
    /// The flash does not hold the bytes that were written.
    Verify,
}

impl fmt::Display for StoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooSmall { capacity, needed } => {
                write!(f, "two slots take {needed} bytes of the flash's {capacity}")
            }
            Self::Flash => f.write_str("the flash does not work"),
            Self::Verify => f.write_str("the flash does not hold what was written"),
        }
    }
}

impl core::error::Error for StoreError {}

/// Reads the saved settings, if there are any.
pub fn load<S: NorFlash>(flash: &mut S, hardware: &Hardware) -> Option<Saved> {
    newest(flash, hardware).map(|(_, saved)| saved)
}

/// Saves settings for the next start and returns their revision. Settings that are saved already
/// are not written again: flash wears.
///
/// # Errors
///
/// [`StoreError`]. The next start then has the settings saved before, or these if only the check of
/// the flash failed.
pub fn save<S: NorFlash>(
    flash: &mut S,
    hardware: &Hardware,
    settings: &Settings,
) -> Result<u32, StoreError> {
    let newest = newest(flash, hardware);
    if let Some((_, saved)) = newest
        && saved.settings == *settings
    {
        return Ok(saved.revision);
    }
    let (slot, revision) =
        newest.map_or((Slot::First, 1), |(slot, old)| (slot.other(), old.revision.wrapping_add(1)));
    // 149 bytes of settings at most: they fit
    let bytes = record(revision, settings).ok_or(StoreError::Verify)?;
    slot.write(flash, &bytes)?;
    Ok(revision)
}

/// Erases the saved settings. The older slot is erased first, so that a power failure in between
/// leaves the newest settings, not the ones before.
///
/// # Errors
///
/// [`StoreError`].
pub fn forget<S: NorFlash>(flash: &mut S, hardware: &Hardware) -> Result<(), StoreError> {
    let last = newest(flash, hardware).map_or(Slot::Second, |(slot, _)| slot);
    for slot in [last.other(), last] {
        if slot.read(flash) != Some([0xFF; RECORD]) {
            slot.erase(flash)?;
        }
    }
    Ok(())
}

/// Newest slot and its content.
fn newest<S: NorFlash>(flash: &mut S, hardware: &Hardware) -> Option<(Slot, Saved)> {
    let mut read = |slot: Slot| Some((slot, parse(&slot.read(flash)?, hardware)?));
    match (read(Slot::First), read(Slot::Second)) {
        (Some(first), Some(second)) => {
            let ahead = second.1.revision.wrapping_sub(first.1.revision).cast_signed();
            Some(if ahead > 0 { second } else { first })
        }
        (first, second) => first.or(second),
    }
}

/// Bytes of a record, followed by ones.
fn record(revision: u32, settings: &Settings) -> Option<[u8; RECORD]> {
    let mut bytes = [0xFF; RECORD];
    let (header, room) = bytes.split_first_chunk_mut::<HEADER>()?;
    let length = postcard::to_slice(settings, room).ok()?.len();
    let numbers = [revision.to_le_bytes(), (length as u32).to_le_bytes()];
    let fields =
        MAGIC.into_iter().chain(SETTINGS_SCHEMA.to_le_bytes()).chain(numbers.into_iter().flatten());
    header.iter_mut().zip(fields).for_each(|(slot, byte)| *slot = byte);
    let end = length.checked_add(HEADER)?;
    let sum = checksum(bytes.get(..end)?);
    *bytes.get_mut(end..)?.first_chunk_mut()? = sum.to_le_bytes();
    Some(bytes)
}

/// Content of a record, if magic, hash, checksum and settings are valid.
fn parse(bytes: &[u8; RECORD], hardware: &Hardware) -> Option<Saved> {
    let (magic, rest) = bytes.split_first_chunk::<4>()?;
    let (schema, rest) = rest.split_first_chunk::<8>()?;
    let (revision, rest) = rest.split_first_chunk::<4>()?;
    let (length, _) = rest.split_first_chunk::<4>()?;
    let end = (u32::from_le_bytes(*length) as usize).checked_add(HEADER)?;
    let (content, tail) = bytes.split_at_checked(end)?;
    let whole = checksum(content) == u32::from_le_bytes(*tail.first_chunk()?);
    if !whole || *magic != MAGIC || u64::from_le_bytes(*schema) != SETTINGS_SCHEMA {
        return None;
    }
    match postcard::take_from_bytes::<Settings>(content.get(HEADER..)?) {
        Ok((settings, [])) if settings.check(hardware).is_ok() => {
            Some(Saved { revision: u32::from_le_bytes(*revision), settings })
        }
        _ => None,
    }
}

/// One of the two slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Slot {
    First,
    Second,
}

/// Sizes of slots, derived from the flash.
struct Geometry<S>(PhantomData<S>);

impl<S: NorFlash> Geometry<S> {
    /// Size of a slot: whole erase blocks.
    const SLOT: usize = RECORD.next_multiple_of(S::ERASE_SIZE);
    /// Size of the words that hold the magic.
    const HEAD: usize = MAGIC.len().next_multiple_of(S::WRITE_SIZE);
    /// Offsets of both slots, and the end. A record must be whole words of the flash.
    const OFFSETS: [u32; 3] = {
        assert!(RECORD.is_multiple_of(S::WRITE_SIZE) && RECORD.is_multiple_of(S::READ_SIZE));
        assert!(Self::SLOT <= 1 << 30);
        [0, Self::SLOT as u32, 2 * Self::SLOT as u32]
    };
}

impl Slot {
    fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }

    /// Offsets at which the slot begins and ends.
    fn place<S: NorFlash>(self) -> (u32, u32) {
        let [first, second, end] = Geometry::<S>::OFFSETS;
        match self {
            Self::First => (first, second),
            Self::Second => (second, end),
        }
    }

    fn read<S: NorFlash>(self, flash: &mut S) -> Option<[u8; RECORD]> {
        let mut bytes = [0; RECORD];
        flash.read(self.place::<S>().0, &mut bytes).ok().map(|()| bytes)
    }

    fn erase<S: NorFlash>(self, flash: &mut S) -> Result<(), StoreError> {
        let [.., needed] = Geometry::<S>::OFFSETS.map(|offset| offset as usize);
        let capacity = flash.capacity();
        if capacity < needed {
            return Err(StoreError::TooSmall { capacity, needed });
        }
        let (from, to) = self.place::<S>();
        flash.erase(from, to).map_err(|_| StoreError::Flash)?;
        self.verify(flash, &[0xFF; RECORD])
    }

    /// Writes a record, the words of the magic last: without them it is no record.
    fn write<S: NorFlash>(self, flash: &mut S, bytes: &[u8; RECORD]) -> Result<(), StoreError> {
        self.erase(flash)?;
        let (from, _) = self.place::<S>();
        let (head, body) = bytes.split_at_checked(Geometry::<S>::HEAD).ok_or(StoreError::Verify)?;
        flash.write(from.saturating_add(head.len() as u32), body).map_err(|_| StoreError::Flash)?;
        flash.write(from, head).map_err(|_| StoreError::Flash)?;
        self.verify(flash, bytes)
    }

    fn verify<S: NorFlash>(self, flash: &mut S, expected: &[u8; RECORD]) -> Result<(), StoreError> {
        let bytes = self.read(flash).ok_or(StoreError::Flash)?;
        if bytes == *expected { Ok(()) } else { Err(StoreError::Verify) }
    }
}
