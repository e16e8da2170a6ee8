//! Four tables whose sum is nearly normal.
//!
//! Each byte of a word picks one number of a table of 256, and the four numbers add up: 2³² sums,
//! equally likely.
//!
//! ```text
//! T_j[b] = W_j · s · FINE[b mod 16] + V_j · COARSE[⌊b/16⌋ mod 8],     s = −1 where b ≥ 128, else 1
//! ```
//!
//! Thus a sum has eight independent parts, which a vector unit looks up 32 or 64 at a time
//! (`vpshufb`). `FINE`, `COARSE` and the weights are the result of a search for sums that are
//! nearly normal. Their distribution function differs from the normal one by less than 2 × 10⁻⁵;
//! their tails beyond z differ by less than 2 % up to 4.5 σ and 8 % up to 5 σ. Farther out the
//! tails are lighter, by up to 40 % at 5.5 σ, and no sum is beyond 6.31 σ. A test evaluates all 2³²
//! sums. Sums are multiples of 10⁻⁴ σ.

/// Magnitudes of the part with a separate sign.
pub(super) const FINE: [i8; 16] = [3, 7, 7, 8, 8, 14, 20, 22, 23, 24, 29, 31, 39, 42, 58, 123];

/// Values of the part with its sign included.
pub(super) const COARSE: [i8; 8] = [-123, -44, -38, -35, 35, 38, 44, 123];

/// W and V, by byte. With equal weights, sums would take few values.
pub(super) const WEIGHTS: [[u8; 4]; 2] = [[70, 68, 69, 69], [56, 62, 58, 60]];

/// 1/σ, σ being the standard deviation of a sum.
pub(super) const PER_SIGMA: f32 = 1.001_290_1e-4;

/// T, the four tables.
pub(super) static SUMMANDS: [[i16; 256]; 4] = summands();

const fn summands() -> [[i16; 256]; 4] {
    let mut tables = [[0; 256]; 4];
    let mut i = 0;
    while i < 4 * 256 {
        let (j, b) = (i / 256, i % 256);
        let sign = if b >= 128 { -1 } else { 1 };
        let fine = WEIGHTS[0][j] as i16 * FINE[b % 16] as i16;
        tables[j][b] = sign * fine + WEIGHTS[1][j] as i16 * COARSE[b / 16 % 8] as i16;
        i += 1;
    }
    tables
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of occurrences of each sum of two tables, from the least sum on, and the least sum.
    fn pairs(tables: &[[i16; 256]]) -> (Vec<u64>, i32) {
        let sums = || {
            let [a, b] = [0, 1].map(|i| tables[i].iter().map(|&value| i32::from(value)));
            a.flat_map(move |a| b.clone().map(move |b| a + b))
        };
        let (least, most) = (sums().min().unwrap(), sums().max().unwrap());
        let mut counts = vec![0; (most - least + 1) as usize];
        sums().for_each(|sum| counts[(sum - least) as usize] += 1);
        (counts, least)
    }

    /// Twice the number of sums, of all 2³², beyond each bound; sums at a bound count half.
    fn twice_beyond(bounds: &[i32]) -> Vec<u64> {
        let ((first, least), (second, second_least)) =
            (pairs(&SUMMANDS[..2]), pairs(&SUMMANDS[2..]));
        // Number of second pairs whose sum is at least each sum.
        let mut rest = second.clone();
        (1..rest.len()).rev().for_each(|i| rest[i - 1] += rest[i]);
        let from = |bound: i32| {
            let of = |(sum, often): (i32, &u64)| {
                let at = (bound - sum - second_least).max(0) as usize;
                often * rest.get(at).copied().unwrap_or(0)
            };
            (least..).zip(&first).map(of).sum::<u64>()
        };
        bounds.iter().map(|&bound| from(bound) + from(bound + 1)).collect()
    }

    /// Φ(−z).
    fn beyond(z: f64) -> f64 {
        0.5 * libm::erfc(z * std::f64::consts::FRAC_1_SQRT_2)
    }

    #[test]
    fn the_sums_are_as_near_to_a_normal_as_documented() {
        let all = 2.0 * 4_294_967_296.0;
        let bounds: Vec<i32> = (0..=550).map(|k| 100 * k).collect();
        for (bound, twice) in bounds.iter().zip(twice_beyond(&bounds)) {
            let (z, tail) = (f64::from(*bound) * f64::from(PER_SIGMA), twice as f64 / all);
            let expected = beyond(z);
            assert!((tail - expected).abs() < 2e-5, "{z}: {tail}");
            let ratio = tail / expected;
            let (least, most) = match z {
                ..4.5 => (0.98, 1.02),
                ..5.0 => (0.92, 1.02),
                _ => (0.6, 1.0),
            };
            assert!((least..most).contains(&ratio), "{z}: {ratio}");
        }
        let farthest = (6.31 / PER_SIGMA) as i32;
        assert_eq!(twice_beyond(&[-farthest, farthest]), [all as u64, 0]);
    }

    #[test]
    fn the_distribution_of_the_sums_is_symmetric() {
        let bounds = [-30_000, -9_999, -1, 1, 9_999, 30_000];
        let beyond = twice_beyond(&bounds);
        for (below, above) in beyond[..3].iter().zip(beyond[3..].iter().rev()) {
            assert_eq!(below + above, 1 << 33);
        }
    }

    #[test]
    fn the_variance_of_the_sums_is_one() {
        let square = |table: &[i16; 256]| {
            table.iter().map(|&value| f64::from(value).powi(2)).sum::<f64>() / 256.0
        };
        let variance: f64 = SUMMANDS.iter().map(square).sum();
        assert!((variance * f64::from(PER_SIGMA).powi(2) - 1.0).abs() < 1e-6, "{variance}");
    }

    #[test]
    fn two_summands_of_each_part_fit_sixteen_bits() {
        let [fine, coarse] = [FINE.iter().max().unwrap(), COARSE.iter().max().unwrap()];
        for pair in [0, 2] {
            let sum =
                |row: usize| i32::from(WEIGHTS[row][pair]) + i32::from(WEIGHTS[row][pair + 1]);
            assert!(sum(0) * i32::from(*fine) + sum(1) * i32::from(*coarse) <= 32_767);
        }
    }
}
