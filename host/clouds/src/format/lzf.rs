//! LZF, the compression of PCD: literal bytes, and copies from up to 8 kB back.
//!
//! ```text
//! 000nnnnn                         n + 1 bytes follow
//! nnnooooo oooooooo                n + 2 bytes from o + 1 back, n = 1 to 6
//! 111ooooo nnnnnnnn oooooooo       n + 9 bytes from o + 1 back
//! ```
//!
//! Unpacked piece by piece, because 3 bytes may become 264 and a cloud needs few of the columns.

/// Farthest a copy reaches back, bytes.
const REACH: usize = 8192;
/// Bytes of a piece, about.
const PIECE: usize = 64 << 10;

/// Unpacks `length` bytes. `take` gets them in order, each piece with the index of its first byte.
///
/// # Errors
///
/// A message, when the data are not LZF or unpack to another length.
pub(crate) fn unpack(
    packed: &[u8],
    length: u64,
    mut take: impl FnMut(u64, &[u8]),
) -> Result<(), String> {
    let (mut rest, mut window, mut gone) = (packed, Vec::with_capacity(2 * PIECE), 0_u64);
    while let Some((&control, after)) = rest.split_first() {
        rest = run(control, after, &mut window).ok_or("expected LZF in compressed PCD data")?;
        if window.len() > PIECE + REACH {
            let ready = window.len() - REACH;
            take(gone, &window[..ready]);
            window.drain(..ready);
            gone += ready as u64;
        }
    }
    take(gone, &window);
    match gone + window.len() as u64 {
        found if found == length => Ok(()),
        found => Err(format!("expected compressed PCD data of {length} bytes, found {found}")),
    }
}

/// Carries out one control byte; returns the input after it, or None if it is not LZF.
fn run<'a>(control: u8, rest: &'a [u8], out: &mut Vec<u8>) -> Option<&'a [u8]> {
    if control < 32 {
        let (literal, rest) = rest.split_at_checked(usize::from(control) + 1)?;
        out.extend(literal);
        return Some(rest);
    }
    let (mut length, mut rest) = (usize::from(control >> 5) + 2, rest);
    if length == 9 {
        let (&more, after) = rest.split_first()?;
        (length, rest) = (length + usize::from(more), after);
    }
    let (&low, rest) = rest.split_first()?;
    let back = (usize::from(control & 0x1f) << 8) + usize::from(low) + 1;
    let from = out.len().checked_sub(back)?;
    // Byte by byte: a copy may overlap its own output.
    for i in from..from + length {
        out.push(out[i]);
    }
    Some(rest)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn unpacked(packed: &[u8], length: u64) -> Result<Vec<u8>, String> {
        let mut all = Vec::new();
        unpack(packed, length, |at, piece| {
            assert_eq!(at, all.len() as u64);
            all.extend(piece);
        })?;
        Ok(all)
    }

    #[test]
    fn runs_and_copies_come_out_in_order() {
        let packed = [1, b'a', b'b', 0b0010_0000, 1, 0, b'c', 0b1110_0000, 0, 0];
        assert_eq!(unpacked(&packed, 15).unwrap(), b"ababaccccccccccc"[..15]);
        assert!(unpacked(&packed, 16).is_err() && unpacked(&packed[..9], 15).is_err());
        assert!(unpacked(&[0b0010_0000, 0], 3).is_err());
        assert!(unpacked(&[], 0).unwrap().is_empty());
    }

    #[test]
    fn a_copy_reaches_over_the_border_of_pieces() {
        let mut packed = Vec::new();
        let mut wanted = Vec::new();
        for i in 0..20_000_u32 {
            let bytes = i.to_le_bytes();
            packed.push(3);
            packed.extend(bytes);
            wanted.extend(bytes);
            if wanted.len() > REACH {
                packed.extend([0b0011_1111, 0xff]); // three bytes from 8192 back
                let from = wanted.len() - REACH;
                wanted.extend_from_within(from..from + 3);
            }
        }
        assert_eq!(unpacked(&packed, wanted.len() as u64).unwrap(), wanted);
    }
}
