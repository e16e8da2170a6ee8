//! Frames: COBS, CRC-32C, sequence numbers, and which way they go.

use core::fmt;

use crc::{CRC_32_ISCSI, Crc, Table};
use serde::{Deserialize, Serialize};

use crate::cobs;

/// Bytes that are summed at a time, each by a table of 1 kB: one on a microcontroller. The sum is
/// the same.
const AT_A_TIME: usize = if cfg!(target_os = "none") { 1 } else { 16 };

static CRC: Crc<u32, Table<AT_A_TIME>> = Crc::<u32, Table<AT_A_TIME>>::new(&CRC_32_ISCSI);

/// Bytes a frame carries at most: sequence, body and checksum.
pub const MAX_PAYLOAD: usize = 2816;

/// Bytes a frame takes on the wire at most: COBS adds one in 254, zeros stand at both ends.
pub const MAX_FRAME: usize = MAX_PAYLOAD + MAX_PAYLOAD.div_ceil(254) + 2;

/// Which way a frame goes.
///
/// It costs no byte: the checksum of what goes to the host is complemented. So an end that hears
/// itself, on a line that echoes, knows its own frames and takes none of them for the other's;
/// damage turns one into the other as seldom as it passes the checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Way {
    /// Commands.
    ToSensor,
    /// Reports.
    ToHost,
}

impl Way {
    /// What the checksum is exclusively or-ed with.
    const fn mark(self) -> u32 {
        match self {
            Self::ToSensor => 0,
            Self::ToHost => u32::MAX,
        }
    }
}

/// What a frame may hold.
pub trait Message: Serialize {
    /// The way it goes.
    const WAY: Way;
}

/// What is wrong with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FrameError {
    /// Longer than [`MAX_PAYLOAD`].
    TooLong,
    /// Not COBS.
    Cobs,
    /// The checksum does not match, or there is no room for one.
    Crc,
    /// Not a message of this schema, or bytes are left over.
    Body {
        /// The sequence number, which the checksum vouches for.
        sequence: u16,
    },
    /// Whole, and on its way to the other end: the line gives back what was sent.
    Echo {
        /// Its sequence number.
        sequence: u16,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooLong => write!(f, "the frame is longer than {MAX_PAYLOAD} bytes"),
            Self::Cobs => f.write_str("the frame is not COBS"),
            Self::Crc => f.write_str("the frame's CRC-32C does not match"),
            Self::Body { sequence } => {
                write!(f, "frame {sequence} holds no message of this schema")
            }
            Self::Echo { sequence } => {
                write!(f, "frame {sequence} goes the other way: the line echoes")
            }
        }
    }
}

impl core::error::Error for FrameError {}

/// CRC-32C (Castagnoli): over everything a frame carries, before any of it is believed.
pub fn checksum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// Writes one frame, delimiters included, and returns it.
///
/// # Errors
///
/// [`FrameError::TooLong`] when the body does not fit.
pub fn encode<'a, T: Message>(
    sequence: u16,
    body: &T,
    frame: &'a mut [u8; MAX_FRAME],
) -> Result<&'a [u8], FrameError> {
    encode_for(T::WAY, sequence, body, frame)
}

/// As [`encode`], marked as going another way than its message does: so a sensor answers a hello
/// that is not its own, which sensors and hosts before protocol 10 can read.
///
/// # Errors
///
/// As [`encode`].
pub fn encode_for<'a>(
    way: Way,
    sequence: u16,
    body: &impl Serialize,
    frame: &'a mut [u8; MAX_FRAME],
) -> Result<&'a [u8], FrameError> {
    let mut payload = [0; MAX_PAYLOAD];
    let payload = fill(way, sequence, body, &mut payload).ok_or(FrameError::TooLong)?;
    let (first, rest) = frame.split_first_mut().ok_or(FrameError::TooLong)?;
    *first = 0;
    let inner = cobs::encode(payload, rest).ok_or(FrameError::TooLong)?;
    *rest.get_mut(inner).ok_or(FrameError::TooLong)? = 0;
    frame.get(..inner.saturating_add(2)).ok_or(FrameError::TooLong)
}

/// Sequence, body and checksum, one after the other.
fn fill<'a>(
    way: Way,
    sequence: u16,
    body: &impl Serialize,
    payload: &'a mut [u8; MAX_PAYLOAD],
) -> Option<&'a [u8]> {
    let (head, room) = payload.split_first_chunk_mut::<2>()?;
    *head = sequence.to_le_bytes();
    let end = postcard::to_slice(body, room).ok()?.len().checked_add(2)?;
    let checksum = checksum(payload.get(..end)?) ^ way.mark();
    *payload.get_mut(end..)?.first_chunk_mut::<4>()? = checksum.to_le_bytes();
    payload.get(..end.checked_add(4)?)
}

/// Reads what stood between two delimiters, in place: sequence number and message.
///
/// # Errors
///
/// [`FrameError`]; nothing of a frame is looked at before its checksum holds, and nothing may be
/// left over after its body.
pub fn decode<'a, T: Message + Deserialize<'a>>(
    frame: &'a mut [u8],
) -> Result<(u16, T), FrameError> {
    let (way, sequence, body) = open(frame)?;
    if way != T::WAY {
        return Err(FrameError::Echo { sequence });
    }
    message(body).map(|message| (sequence, message)).ok_or(FrameError::Body { sequence })
}

/// The message that a body is, and nothing more.
pub fn message<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Option<T> {
    postcard::take_from_bytes(body)
        .ok()
        .filter(|(_, rest)| rest.is_empty())
        .map(|(message, _)| message)
}

/// Reads what stood between two delimiters, in place: the way it goes, sequence number and body, of
/// whatever schema.
///
/// # Errors
///
/// [`FrameError`]; nothing of a frame is looked at before its checksum holds.
pub fn open(frame: &mut [u8]) -> Result<(Way, u16, &[u8]), FrameError> {
    let length = cobs::decode_in_place(frame).ok_or(FrameError::Cobs)?;
    let payload = frame.get(..length).ok_or(FrameError::Cobs)?;
    let (content, expected) = payload.split_last_chunk::<4>().ok_or(FrameError::Crc)?;
    let (sequence, body) = content.split_first_chunk::<2>().ok_or(FrameError::Crc)?;
    let difference = checksum(content) ^ u32::from_le_bytes(*expected);
    let way = [Way::ToSensor, Way::ToHost].into_iter().find(|way| way.mark() == difference);
    Ok((way.ok_or(FrameError::Crc)?, u16::from_le_bytes(*sequence), body))
}

/// Collects bytes into frames.
///
/// A frame ends at a zero. After an overflow everything up to the next zero is thrown away, so that
/// the tail of an over-long frame is never taken for a frame of its own.
#[derive(Clone, Debug)]
pub struct Decoder {
    buffer: [u8; MAX_FRAME],
    length: usize,
    skipping: bool,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// Nothing collected yet.
    pub const fn new() -> Self {
        Self { buffer: [0; MAX_FRAME], length: 0, skipping: false }
    }

    /// Takes one byte. At the end of a frame, gives its bytes to be [`decode`]d; an empty frame
    /// (two zeros in a row) is none.
    pub fn push(&mut self, byte: u8) -> Option<Result<&mut [u8], FrameError>> {
        if byte == 0 {
            return self.finish();
        }
        match self.buffer.get_mut(self.length) {
            Some(slot) => {
                *slot = byte;
                self.length = self.length.wrapping_add(1); // at most MAX_FRAME
            }
            None => self.skipping = true,
        }
        None
    }

    fn finish(&mut self) -> Option<Result<&mut [u8], FrameError>> {
        let length = core::mem::take(&mut self.length);
        if core::mem::take(&mut self.skipping) {
            return Some(Err(FrameError::TooLong));
        }
        if length == 0 { None } else { self.buffer.get_mut(..length).map(Ok) }
    }
}
