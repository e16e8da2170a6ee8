//! Random numbers of a candidate.

use echoloop_random::Generator;

/// "CMA-ES" as a number: keeps these keys apart from those of other uses.
const PURPOSE: u64 = 0x0043_4d41_2d45_5300;

/// Generator of candidate i of generation g, a function of (seed, g, i). It draws the normals
/// first, then a number of 0 to 1 for each choice.
pub(super) fn candidate_generator(seed: u64, generation: u64, candidate: u64) -> Generator {
    Generator::from_key([seed, generation, candidate, PURPOSE])
}
