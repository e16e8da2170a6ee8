//! Key of a row of normals, and its words.

/// Key of a row of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key(pub(super) [u32; 2]);

impl Key {
    /// The key of 64 well-mixed bits, as [`crate::derive`] gives them.
    pub const fn new(bits: u64) -> Self {
        Self([(bits >> 32) as u32, bits as u32])
    }

    /// The bits of [`Self::new`].
    pub const fn bits(self) -> u64 {
        let Self([high, low]) = self;
        (high as u64) << 32 | low as u64
    }

    /// Random word of a counter. Different counters have different words.
    ///
    /// A 32-bit mixing function of low bias (two multiplications, found by exhaustive search: C.
    /// Wellons, "prospecting for hash functions"). Half of the key enters before its first shift
    /// and half after it, so that rows that share one half have nothing in common.
    #[inline(always)]
    pub(super) const fn word(self, counter: u32) -> u32 {
        let Self([outer, inner]) = self;
        let mut x = counter.wrapping_mul(STEP) ^ outer;
        x = (x ^ (x >> 16)).wrapping_add(inner);
        x = x.wrapping_mul(MIX[0]);
        x ^= x >> 15;
        x = x.wrapping_mul(MIX[1]);
        x ^ (x >> 15)
    }
}

/// 2³² over the golden ratio, odd: spreads counters.
pub(super) const STEP: u32 = 0x9e37_79b9;

/// Wellons's multipliers.
pub(super) const MIX: [u32; 2] = [0x21f0_aaad, 0xd35a_2d97];
