//! Four tables whose sum is nearly normal.
//!
//! Each byte of a word says a number of 256, and the four add up: 2³² sums, equally likely.
//!
//! ```text
//! T_j[b] = W_j · s · FINE[b mod 16] + V_j · COARSE[⌊b/16⌋ mod 8],     s = −1 where b ≥ 128, else 1
//! ```
//!
//! So eight independent parts, which a vector unit looks up 32 or 64 at a time (`vpshufb`). Sums of
//! few parts are near a normal when the parts have its higher cumulants. `FINE`, `COARSE` and the
//! weights were searched for by us so that the sums have its distribution: theirs differs from it
//! by less than 2 × 10⁻⁵, and the tails beyond z by less than 2 % up to 4.5 σ, 8 % up to 5 σ.
//! Farther out they are lighter, by up to 40 % at 5.5 σ, and none is beyond 6.31 σ. A test adds all
//! 2³² up. A sum is a multiple of 10⁻⁴ σ.

/// Magnitudes of a part that has a sign of its own.
pub(super) const FINE: [i8; 16] = [3, 7, 7, 8, 8, 14, 20, 22, 23, 24, 29, 31, 39, 42, 58, 123];

/// The other part.
pub(super) const COARSE: [i8; 8] = [-123, -44, -38, -35, 35, 38, 44, 123];

/// W and V, by byte. All alike, sums would fall on few values.
pub(super) const WEIGHTS: [[u8; 4]; 2] = [[70, 68, 69, 69], [56, 62, 58, 60]];

/// 1/σ of a sum.
pub(super) const PER_SIGMA: f32 = 1.001_290_1e-4;

/// T.
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

    /// How often each sum of two tables comes, from the least on; the least.
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

    /// Of all 2³² sums, how many are beyond each of some bounds, those that are equal counted half;
    /// twice that.
    fn twice_beyond(bounds: &[i32]) -> Vec<u64> {
        let ((first, least), (second, second_least)) =
            (pairs(&SUMMANDS[..2]), pairs(&SUMMANDS[2..]));
        // Of the second pairs, how many are as great or greater, by sum.
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
    fn all_sums_together_are_as_near_to_a_normal_as_they_say() {
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
    fn as_many_sums_are_below_zero_as_above() {
        let bounds = [-30_000, -9_999, -1, 1, 9_999, 30_000];
        let beyond = twice_beyond(&bounds);
        for (below, above) in beyond[..3].iter().zip(beyond[3..].iter().rev()) {
            assert_eq!(below + above, 1 << 33);
        }
    }

    #[test]
    fn their_variance_is_one() {
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
