//! Settings that outlive the power: two slots in flash, one of which is whole at every moment.
//!
//! Each slot is as many erase blocks as a record takes; the first begins where the flash does, the
//! second follows. Numbers are little endian.
//!
//! | offset | bytes | what |
//! |---|---|---|
//! | 0 | 4 | magic "EsET" |
//! | 4 | 8 | hash of the layout of [`Settings`], [`SETTINGS_SCHEMA`] |
//! | 12 | 4 | revision: one more than that of the other slot, modulo 2³² |
//! | 16 | 4 | n, length of the settings |
//! | 20 | n | settings, postcard |
//! | 20 + n | 4 | CRC-32C of all before it |
//! | 24 + n | … | ones, up to 128 bytes |
//!
//! The *newest* slot is the one with the greater revision (modulo 2³²) of those whose magic, hash
//! and checksum hold and whose settings pass [`Settings::check`] on this hardware. [`save`] writes
//! the other: erase, everything but the words of the magic, those words, and then reads all of it
//! back. Where the power goes before the last word, there is no magic; so a start finds the old
//! settings or the new. A slot that cannot be read, as torn words with error correction cannot,
//! counts as empty.

use core::fmt;
use core::marker::PhantomData;

use echoloop_dsp::{Hardware, Settings};
use echoloop_link::{SETTINGS_SCHEMA, checksum};
use embedded_storage::nor_flash::NorFlash;

/// First bytes of a record.
pub const MAGIC: [u8; 4] = *b"EsET";

/// Bytes of a record, with all that may follow it: what is written and read at once.
pub const RECORD: usize = 128;

/// Bytes before the settings.
const HEADER: usize = 20;

/// What a slot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Saved {
    /// How many sets have been saved since there were none, modulo 2³².
    pub revision: u32,
    /// They pass the check on the hardware they were read for.
    pub settings: Settings,
}

/// Why settings were not saved. What was saved before still is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StoreError {
    /// There is no room for two slots. Both in bytes.
    TooSmall {
        /// What the flash has.
        capacity: usize,
        /// What two slots take.
        needed: usize,
    },
    /// The flash refused to be erased, written or read.
    Flash,
    /// The flash does not hold what was written.
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

/// What the next start begins with, if anything.
pub fn load<S: NorFlash>(flash: &mut S, hardware: &Hardware) -> Option<Saved> {
    newest(flash, hardware).map(|(_, saved)| saved)
}

/// Makes these settings what the next start begins with; their revision. What is saved already is
/// not written again: flash wears.
///
/// # Errors
///
/// [`StoreError`]; the next start then begins with what it would have begun with before, or, when
/// all but the check of the flash succeeded, with these.
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
    // 76 bytes of settings at most: they fit
    let bytes = record(revision, settings).ok_or(StoreError::Verify)?;
    slot.write(flash, &bytes)?;
    Ok(revision)
}

/// Makes the next start begin with nothing. The older slot goes first, so that the power going
/// between leaves the newest, not the one before it.
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

/// The newest slot and what it holds.
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

/// The bytes of a record; ones follow it.
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

/// What a record says, if all of it holds.
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

/// One of the two places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Slot {
    First,
    Second,
}

/// Sizes that follow from those of the flash.
struct Geometry<S>(PhantomData<S>);

impl<S: NorFlash> Geometry<S> {
    /// Bytes of a slot: whole erase blocks.
    const SLOT: usize = RECORD.next_multiple_of(S::ERASE_SIZE);
    /// Bytes of the words that hold the magic.
    const HEAD: usize = MAGIC.len().next_multiple_of(S::WRITE_SIZE);
    /// Both offsets and both ends, for flashes whose words a record is whole ones of.
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

    /// Where it begins and ends.
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

    /// The words of the magic last: a record without them is none.
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
