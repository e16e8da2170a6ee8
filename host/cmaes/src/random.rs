//! Normals by counter: candidate i of generation g is a function of (seed, g, i).

use echoloop_random::Generator;

/// "CMA-ES" as a number: keeps these keys apart from those of other uses.
const PURPOSE: u64 = 0x0043_4d41_2d45_5300;

/// `n` independent standard normals on a stream of their own.
pub(super) fn normals(seed: u64, generation: u64, candidate: u64, n: usize) -> Vec<f64> {
    Generator::from_key([seed, generation, candidate, PURPOSE]).normals(n)
}
