//! Packed codes: those of a converter, without gaps between them.
//!
//! ```text
//! byte[j]  = bits 8j to 8j + 7 of the row;  code[k] = bits k·b to k·b + b − 1, the lowest first
//! b = 12:    c0 & ff,   c0 >> 8 | (c1 & f) << 4,   c1 >> 4
//! ```
//!
//! | name | meaning | shape |
//! |---|---|---|
//! | `b` | bits of a code, 8 to 14: those of the converter | scalar |
//! | `code` | as the converter gives it; higher bits are cut off | `[N]` |
//! | `byte` | the last one is filled up with zeros | `[⌈N·b/8⌉]` |
//!
//! The padding of the last byte is shorter than a code, so the number of bytes gives the number of
//! codes. A width outside of 8 to 14 counts as the nearest.

use core::slice;

/// Number of codes that this many bytes hold.
pub fn codes_in(bytes: usize, bits: u32) -> usize {
    bytes.saturating_mul(8).checked_div(width(bits) as usize).unwrap_or(0)
}

/// Packs codes into the first bytes of `target` and returns the number of bytes; `None` when they
/// do not fit.
pub fn pack(codes: &[u16], bits: u32, target: &mut [u8]) -> Option<usize> {
    let (room, bits) = (target.len(), width(bits));
    let mut target = target.iter_mut();
    let (mut word, mut held) = (0u32, 0u32); // below 8 bits are held: with 16 more they fit
    for &code in codes {
        word |= (u32::from(code) & mask(bits)).wrapping_shl(held);
        held = held.wrapping_add(bits);
        while held >= 8 {
            *target.next()? = word as u8;
            (word, held) = (word >> 8, held.wrapping_sub(8));
        }
    }
    if held > 0 {
        *target.next()? = word as u8;
    }
    Some(room.wrapping_sub(target.len()))
}

/// Iterates over the codes that bytes hold.
pub fn unpack(bytes: &[u8], bits: u32) -> Codes<'_> {
    Codes { bytes: bytes.iter(), bits: width(bits), word: 0, held: 0 }
}

/// Iterator of [`unpack`].
#[derive(Clone, Debug)]
pub struct Codes<'a> {
    bytes: slice::Iter<'a, u8>,
    bits: u32,
    word: u32,
    held: u32,
}

impl Codes<'_> {
    /// Fills `places` with the next codes in order and returns their number, which is smaller than
    /// that of `places` only when the bytes are used up.
    pub fn fill(&mut self, places: &mut [u16]) -> usize {
        let mut filled = 0;
        // Half a byte of the last code may be held: one code later, none is.
        if self.held > 0 {
            filled = self.fill_one_by_one(places, 1);
        }
        if self.bits == 12 && self.held == 0 {
            filled =
                filled.saturating_add(self.fill_pairs(places.get_mut(filled..).unwrap_or(&mut [])));
        }
        let rest = places.get_mut(filled..).unwrap_or(&mut []);
        filled.saturating_add(self.fill_one_by_one(rest, rest.len()))
    }

    /// Unpacks two codes of twelve bits from three bytes, as long as there are both: it takes a
    /// sixth of the time.
    fn fill_pairs(&mut self, places: &mut [u16]) -> usize {
        let (pairs, _) = places.as_chunks_mut::<2>();
        let (threes, _) = self.bytes.as_slice().as_chunks::<3>();
        for ([first, second], [a, b, c]) in pairs.iter_mut().zip(threes) {
            let [a, b, c] = [*a, *b, *c].map(u16::from);
            *first = a | (b & 0xf) << 8;
            *second = b >> 4 | c << 4;
        }
        let done = pairs.len().min(threes.len());
        let used = done.saturating_mul(3);
        self.bytes = self.bytes.as_slice().get(used..).unwrap_or_default().iter();
        done.saturating_mul(2)
    }

    fn fill_one_by_one(&mut self, places: &mut [u16], most: usize) -> usize {
        let codes = places.iter_mut().take(most).zip(self);
        codes.map(|(place, code)| *place = code).count()
    }
}

impl Iterator for Codes<'_> {
    type Item = u16;

    #[inline]
    fn next(&mut self) -> Option<u16> {
        while self.held < self.bits {
            // Below 16 bits are held: with 8 more they fit.
            self.word |= u32::from(*self.bytes.next()?).wrapping_shl(self.held);
            self.held = self.held.wrapping_add(8);
        }
        let code = self.word & mask(self.bits);
        self.word = self.word.wrapping_shr(self.bits);
        self.held = self.held.wrapping_sub(self.bits);
        Some(code as u16)
    }
}

fn width(bits: u32) -> u32 {
    bits.clamp(8, 14)
}

fn mask(bits: u32) -> u32 {
    !(u32::MAX.wrapping_shl(bits))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_codes_of_twelve_bits_are_three_bytes_the_lowest_bit_first() {
        let mut bytes = [0; 3];
        assert_eq!(pack(&[0xABC, 0x123], 12, &mut bytes), Some(3));
        assert_eq!(bytes, [0xBC, 0x3A, 0x12]);
    }

    #[test]
    fn codes_of_every_width_and_number_come_back() {
        for bits in 8..=14 {
            for length in 0..40 {
                let code = |k: usize| ((k * 40_503 + 977) as u32 & mask(bits)) as u16;
                let codes: [u16; 40] = core::array::from_fn(code);
                let mut bytes = [0xFF; 70];
                let used = pack(&codes[..length], bits, &mut bytes).unwrap_or(usize::MAX);
                assert_eq!(used, (length * bits as usize).div_ceil(8), "{bits} bits");
                assert_eq!(codes_in(used, bits), length, "{length} codes of {bits} bits");
                assert!(unpack(&bytes[..used], bits).eq(codes[..length].iter().copied()));
            }
        }
    }

    #[test]
    fn filling_in_pieces_gives_the_same_codes_as_one_by_one() {
        let bytes: [u8; 40] = core::array::from_fn(|k| (k * 151 + 7) as u8);
        for bits in 8..=14 {
            for length in 0..bytes.len() {
                for cut in 0..12 {
                    let mut places = [0; 64];
                    let mut codes = unpack(&bytes[..length], bits);
                    let mut filled = codes.fill(&mut places[..cut]);
                    if filled == cut {
                        filled += codes.fill(&mut places[cut..]);
                    }
                    assert_eq!(filled, codes_in(length, bits), "{bits} bits, {length}, {cut}");
                    let expected = unpack(&bytes[..length], bits);
                    assert!(expected.eq(places[..filled].iter().copied()), "{bits} bits");
                }
            }
        }
    }

    #[test]
    fn codes_that_do_not_fit_are_not_packed() {
        assert_eq!(pack(&[1, 2, 3], 12, &mut [0; 4]), None);
        assert_eq!(pack(&[1, 2, 3], 12, &mut [0; 5]), Some(5));
    }

    #[test]
    fn bits_beyond_a_code_do_not_reach_its_neighbour() {
        let mut bytes = [0; 3];
        pack(&[0xFABC, 0x0123], 12, &mut bytes);
        assert!(unpack(&bytes, 12).eq([0xABC, 0x123]));
    }
}
