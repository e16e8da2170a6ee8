//! Normals by counter: candidate i of generation g is a function of (seed, g, i).

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// `n` independent standard normals: ChaCha8 on a stream of their own, Box–Muller in `libm`, so
/// that neither a thread, nor a platform, nor another version of a distribution crate changes them.
pub(super) fn normals(seed: u64, generation: u64, candidate: u64, n: usize) -> Vec<f64> {
    let mut key = [0; 32];
    for (slot, word) in
        key.chunks_exact_mut(8).zip([seed, generation, candidate, 0x0043_4d41_2d45_5300])
    {
        slot.copy_from_slice(&word.to_le_bytes());
    }
    let mut rng = ChaCha8Rng::from_seed(key);
    let mut uniform = || (rng.next_u64() >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0);
    let mut z = Vec::with_capacity(n + 1);
    while z.len() < n {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - uniform()));
        let (sine, cosine) = libm::sincos(2.0 * std::f64::consts::PI * uniform());
        z.extend([radius * cosine, radius * sine]);
    }
    z.truncate(n);
    z
}
