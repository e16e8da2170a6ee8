//! Table of beams, known by its hash.

use core::fmt;

/// Name of a list of beams. The list itself stays with its maker: sensor and host agree on its
/// hash.
///
/// The hash is the CRC-32C of the beams one after the other, each 18 bytes, little endian: azimuth
/// i32 and elevation i32 in 10⁻⁶ degrees, time u64 in ns, channel u16.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BeamTable {
    /// Number of beams of a scan, at most 131,072.
    pub beams: u32,
    /// One more than the highest channel.
    pub channels: u16,
    /// Hash of the list.
    pub hash: u32,
}

impl fmt::Display for BeamTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { beams, channels, hash } = self;
        write!(f, "{beams} of a table ({channels} channels, hash {hash:#010x})")
    }
}
