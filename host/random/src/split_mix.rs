//! SplitMix64, and seeds derived with it.

/// SplitMix64's output function (Steele, Lea and Flood 2014).
pub const fn split_mix_64(value: u64) -> u64 {
    mix_64(value.wrapping_add(0x9e37_79b9_7f4a_7c15))
}

/// The second part of [`split_mix_64`], for a number whose bits are already spread.
pub const fn mix_64(value: u64) -> u64 {
    let z = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Seed of one purpose and one index of it.
pub const fn derive(seed: u64, purpose: u64, index: u64) -> u64 {
    split_mix_64(split_mix_64(split_mix_64(seed) ^ purpose) ^ index)
}

#[cfg(test)]
mod tests {
    use super::derive;

    #[test]
    fn purposes_and_indices_give_different_seeds() {
        let seeds =
            [derive(1, 1, 0), derive(1, 2, 0), derive(1, 1, 1), derive(2, 1, 0), derive(0, 1, 0)];
        for (i, a) in seeds.iter().enumerate() {
            assert!(seeds[i + 1..].iter().all(|b| a != b));
        }
    }
}
