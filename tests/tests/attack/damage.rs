//! Damage to bytes: flips, cuts, swaps, repetitions, holes, foreign pieces.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Number of kinds of [`accident`].
const WAYS: u32 = 8;

/// `bytes` after one to three accidents; foreign pieces come from `other`.
pub(crate) fn damaged(rng: &mut ChaCha8Rng, bytes: &[u8], other: &[u8]) -> Vec<u8> {
    let accidents = rng.random_range(1..=3);
    (0..accidents).fold(bytes.to_vec(), |bytes, _| accident(rng, &bytes, other))
}

/// `bytes` after one accident.
pub(crate) fn accident(rng: &mut ChaCha8Rng, bytes: &[u8], other: &[u8]) -> Vec<u8> {
    let (from, to) = piece(rng, bytes.len());
    let (before, inside, after) = (&bytes[..from], &bytes[from..to], &bytes[to..]);
    match rng.random_range(0..WAYS) {
        0 => flipped(rng, bytes),
        1 => before.to_vec(),                               // the end is lost
        2 => [before, after].concat(),                      // a piece is lost
        3 => [before, inside, inside, after].concat(),      // a piece comes twice
        4 => [before, after, inside].concat(),              // pieces change places
        5 => [before, &vec![0; to - from], after].concat(), // a page was never written
        6 => {
            let (from, to) = piece(rng, other.len());
            [before, &other[from..to], after].concat()
        }
        _ => [before, &(0..to - from).map(|_| rng.random()).collect::<Vec<u8>>(), after].concat(),
    }
}

/// `bytes` with one bit flipped.
pub(crate) fn flipped(rng: &mut ChaCha8Rng, bytes: &[u8]) -> Vec<u8> {
    let mut flipped = bytes.to_vec();
    if !bytes.is_empty() {
        flipped[rng.random_range(0..bytes.len())] ^= 1 << rng.random_range(0..8);
    }
    flipped
}

/// Begin and end of a random piece.
fn piece(rng: &mut ChaCha8Rng, length: usize) -> (usize, usize) {
    let [a, b] = [0, 1].map(|_| rng.random_range(0..=length));
    (a.min(b), a.max(b))
}
