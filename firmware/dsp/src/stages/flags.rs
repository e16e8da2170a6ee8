//! Remarks on an echo, as flags.

use core::ops::{BitOr, BitOrAssign};

/// Set of remarks on an echo. Bits are only ever appended: they are on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "wire", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Flags(pub u8);

impl Flags {
    /// No remark.
    pub const NONE: Self = Self(0);
    /// A code of the echo reached the saturation level: the amplitude is a lower bound.
    pub const SATURATED: Self = Self(1);
    /// The valley to a neighbour is above half the height, or there is no valley: time and width
    /// are biased.
    pub const MERGED: Self = Self(2);
    /// The echo is less than a quarter above the threshold.
    pub const LOW_CONFIDENCE: Self = Self(4);
    /// The time comes from the two edges instead of the top.
    pub const WALK_CORRECTED: Self = Self(8);
    /// The echo runs over the end of the window.
    pub const TRUNCATED: Self = Self(16);

    /// Names of the bits, lowest first.
    pub const NAMES: [&str; 5] =
        ["saturated", "merged", "low-confidence", "walk-corrected", "truncated"];

    /// True when every flag of `other` is set.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Names of the flags that are set.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES
            .into_iter()
            .enumerate()
            .filter(move |(bit, _)| self.0 >> bit & 1 == 1)
            .map(|(_, name)| name)
    }
}

impl BitOr for Flags {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for Flags {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}
