//! Frames: COBS, CRC-32C, sequence numbers and direction.

use core::fmt;

use crc::{CRC_32_ISCSI, Crc, Table};
use serde::{Deserialize, Serialize};

use crate::cobs;

/// Bytes that the checksum takes per step, with a table of 1 kB each: 16 on a PC, 1 on a
/// microcontroller. The checksum is the same.
const AT_A_TIME: usize = if cfg!(target_os = "none") { 1 } else { 16 };

static CRC: Crc<u32, Table<AT_A_TIME>> = Crc::<u32, Table<AT_A_TIME>>::new(&CRC_32_ISCSI);

/// Most bytes that a frame carries: sequence, body and checksum. A report of the most beams with
/// the most echoes fits.
pub const MAX_PAYLOAD: usize = 2816;

/// Most bytes of a frame on the wire: COBS adds one in 254, and there is a zero at both ends.
pub const MAX_FRAME: usize = MAX_PAYLOAD + MAX_PAYLOAD.div_ceil(254) + 2;

/// Direction of a frame.
///
/// It costs no byte: the checksum of a frame to the host is complemented. An end that hears itself,
/// on a line that echoes, thus recognises its own frames. Damage turns one way into the other as
/// rarely as it passes the checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Way {
    /// Commands.
    ToSensor,
    /// Reports.
    ToHost,
}

impl Way {
    /// Mask of this way, by which the checksum is exclusive-ored.
    const fn mark(self) -> u32 {
        match self {
            Self::ToSensor => 0,
            Self::ToHost => u32::MAX,
        }
    }
}

/// Message that a frame may hold.
pub trait Message: Serialize {
    /// Way that the message goes.
    const WAY: Way;
}

/// Error of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FrameError {
    /// The frame is longer than [`MAX_PAYLOAD`].
    TooLong,
    /// The bytes are not COBS.
    Cobs,
    /// The checksum does not match, or there is no room for one.
    Crc,
    /// The body is no message of this schema, or bytes are left over.
    Body {
        /// Sequence number, which the checksum covers.
        sequence: u16,
    },
    /// The frame is whole but goes to the other end: the line returned it.
    Echo {
        /// Sequence number of the frame.
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

/// CRC-32C (Castagnoli) over sequence and body, checked before either is used.
pub fn checksum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// Writes a frame, delimiters included, and returns it.
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

/// As [`encode`], but marked with a given way. A sensor marks its answer to a hello of another
/// protocol as going to the sensor, because hosts before protocol 10 can read only that.
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

/// Writes sequence, body and checksum one after the other.
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

/// Decodes the bytes between two delimiters in place: sequence number and message.
///
/// # Errors
///
/// [`FrameError`]. The checksum is verified before sequence or body is read, and no byte may be
/// left over after the body.
pub fn decode<'a, T: Message + Deserialize<'a>>(
    frame: &'a mut [u8],
) -> Result<(u16, T), FrameError> {
    let (way, sequence, body) = open(frame)?;
    if way != T::WAY {
        return Err(FrameError::Echo { sequence });
    }
    message(body).map(|message| (sequence, message)).ok_or(FrameError::Body { sequence })
}

/// Message that a body holds; `None` when bytes are left over.
pub fn message<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Option<T> {
    postcard::take_from_bytes(body)
        .ok()
        .filter(|(_, rest)| rest.is_empty())
        .map(|(message, _)| message)
}

/// Opens the bytes between two delimiters in place: way, sequence number, and body of any schema.
///
/// # Errors
///
/// [`FrameError`]. The checksum is verified before sequence or body is read.
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
/// A frame ends at a zero. After an overflow all bytes up to the next zero are dropped, so that the
/// tail of a frame that is too long is never taken for a frame of its own.
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
    /// Decoder that has collected nothing yet.
    pub const fn new() -> Self {
        Self { buffer: [0; MAX_FRAME], length: 0, skipping: false }
    }

    /// Takes one byte. At the end of a frame it returns the bytes, for [`decode`]; two zeros in a
    /// row are no frame.
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
