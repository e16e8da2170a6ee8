//! Beams that somebody listed.

use super::{Fields, short};

/// The name of a list of beams. The list itself stays with whoever made it: what a sensor and a
/// host have to agree on is its hash.
///
/// The hash is the CRC-32C of the beams one after the other, each 18 bytes, little endian: azimuth
/// i32 and elevation i32 in 10⁻⁶ degrees, time u64 in ns, channel u16.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BeamTable {
    /// Beams of a scan, 131,072 at most.
    pub beams: u32,
    /// One more than the highest channel.
    pub channels: u16,
    /// Hash of the list.
    pub hash: u32,
}

impl BeamTable {
    pub(super) fn to_words(self) -> Fields {
        [self.beams, self.channels.into(), self.hash, 0, 0, 0]
    }

    pub(super) fn from_words([beams, channels, hash, ..]: Fields) -> Option<Self> {
        Some(Self { beams, channels: short(channels)?, hash })
    }
}
