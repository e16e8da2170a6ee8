//! Standard normals by index.
//!
//! A library's generator is called once a number; this one fills slices with vector instructions.

mod atoms;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "x86_64")]
mod blocks;
mod key;

use echoloop_dispatch::dispatch;

use atoms::{PER_SIGMA, SUMMANDS};

pub use key::Key;

dispatch! {
    /// Fills `z` with independent standard normals, |z| < 6.4.
    ///
    /// ```text
    /// z[n] = (T₀[b₀] + T₁[b₁] + T₂[b₂] + T₃[b₃]) / σ       b: the bytes of word n of the key
    /// ```
    ///
    /// The four tables are in `atoms.rs`, with the accuracy of their sum.
    pub fn normals(key: Key, z: &mut [f32])
        = normals_baseline, v3: avx2::normals, avx512: avx512::normals;
}

/// [`normals()`] as compiled for the target's baseline.
pub fn normals_baseline(key: Key, z: &mut [f32]) {
    for (z, counter) in z.iter_mut().zip(0..) {
        let bytes = key.word(counter).to_le_bytes();
        let sum: i32 =
            SUMMANDS.iter().zip(bytes).map(|(table, b)| i32::from(table[usize::from(b)])).sum();
        *z = sum as f32 * PER_SIGMA;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derive;

    fn key(row: u64) -> Key {
        Key::new(derive(7, 1, row))
    }

    fn many() -> Vec<f32> {
        (0..1000)
            .flat_map(|row| {
                let mut z = vec![0.0; 1000];
                normals(key(row), &mut z);
                z
            })
            .collect()
    }

    #[test]
    fn a_million_samples_have_the_moments_of_a_standard_normal() {
        let z = many();
        let moment = |p| z.iter().map(|&v| f64::from(v).powi(p)).sum::<f64>() / z.len() as f64;
        // Standard errors: 0.001, 0.0014, 0.0039, 0.0098.
        for (p, expected, bound) in
            [(1, 0.0, 0.004), (2, 1.0, 0.006), (3, 0.0, 0.016), (4, 3.0, 0.04)]
        {
            assert!((moment(p) - expected).abs() < bound, "moment {p}: {}", moment(p));
        }
    }

    #[test]
    fn the_tails_are_as_heavy_as_those_of_a_normal() {
        let z = many();
        for (bound, expected) in [(2.0f32, 45_500.0f64), (3.0, 2_700.0), (4.0, 63.3)] {
            let beyond = z.iter().filter(|v| v.abs() > bound).count() as f64;
            assert!((beyond - expected).abs() < 5.0 * expected.sqrt(), "beyond {bound}: {beyond}");
        }
    }

    #[test]
    fn a_million_samples_follow_the_normal_distribution_throughout() {
        let mut z = many();
        z.sort_by(f32::total_cmp);
        let cumulative = |v: f32| 0.5 * libm::erfc(-f64::from(v) * std::f64::consts::FRAC_1_SQRT_2);
        let n = z.len() as f64;
        let gap = |(i, &v): (usize, &f32)| (cumulative(v) - (i as f64 + 0.5) / n).abs();
        let largest = z.iter().enumerate().map(gap).fold(0.0, f64::max);
        // Kolmogorov and Smirnov: beyond 1.95/√n once in a thousand.
        assert!(largest < 1.95 / n.sqrt(), "{largest}");
    }

    dispatch! {
        /// [`normals`] on a processor without AVX-512.
        fn by_avx2(key: Key, z: &mut [f32]) = normals_baseline, v3: avx2::normals;
    }

    #[test]
    fn all_builds_give_the_same_numbers() {
        for row in 0..200 {
            let length = (row % 78) as usize;
            let mut plain = [0.0; 77];
            normals_baseline(key(row), &mut plain[..length]);
            for build in [normals, by_avx2] {
                let mut fast = [0.0; 77];
                build(key(row), &mut fast[..length]);
                assert_eq!(plain, fast, "{length} numbers");
            }
        }
    }

    #[test]
    fn counters_have_different_words_and_each_half_of_the_key_changes_them() {
        let words = |key: Key| (0..100_000).map(move |counter| key.word(counter));
        let first = key(1);
        let mut sorted: Vec<u32> = words(first).collect();
        sorted.sort_unstable();
        assert!(sorted.windows(2).all(|pair| pair[0] != pair[1]));
        for other in [first.bits() ^ 1, first.bits() ^ 1 << 32] {
            let alike = |(a, b): (u32, u32)| (a ^ b).count_ones();
            let bits: u32 = words(first).zip(words(Key::new(other))).map(alike).sum();
            assert!(
                (f64::from(bits) / 1.6e6 - 1.0).abs() < 0.01,
                "half of the bits differ: {bits}"
            );
        }
    }

    #[test]
    fn neighbouring_numbers_and_rows_are_uncorrelated() {
        let z = many();
        for lag in [1, 2, 15, 16, 31, 32, 1000, 2000] {
            let sum: f64 =
                z.iter().zip(&z[lag..]).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
            let correlation = sum / (z.len() - lag) as f64;
            assert!(correlation.abs() < 0.005, "lag {lag}: {correlation}");
        }
    }

    #[test]
    fn a_longer_row_begins_with_the_shorter_one() {
        let key = key(3);
        let (mut short, mut long) = (vec![0.0; 800], vec![0.0; 2400]);
        normals(key, &mut short);
        normals(key, &mut long);
        assert_eq!(short[..], long[..800]);
    }
}
