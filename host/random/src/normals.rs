//! Standard normals by index, sixteen pairs at a time.
//!
//! A library's generator would be called once a number; this one fills vectors.

/// What a row of numbers hangs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key([u32; 2]);

impl Key {
    /// The key of 64 well-mixed bits, as [`crate::derive`] gives them.
    pub const fn new(bits: u64) -> Self {
        Self([(bits >> 32) as u32, bits as u32])
    }

    /// The bits that it was made of.
    pub const fn bits(self) -> u64 {
        let Self([high, low]) = self;
        (high as u64) << 32 | low as u64
    }
}

/// A 32-bit mixing function of low bias (two multiplications, found by exhaustive search: C.
/// Wellons, "prospecting for hash functions").
#[inline(always)]
const fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x21f0_aaad);
    x ^= x >> 15;
    x = x.wrapping_mul(0xd35a_2d97);
    x ^ (x >> 15)
}

/// Pairs computed at a time.
const LANES: usize = 16;

/// Fills `z` with independent standard normals, |z| < 6.6: Box–Muller, sixteen pairs at a time. A
/// rest shorter than 32 is filled too.
#[inline(always)]
pub fn normals(key: Key, z: &mut [f32]) {
    let (blocks, rest) = z.as_chunks_mut();
    let mut counter = 0u32;
    for block in blocks {
        pairs(key, counter, block);
        counter = counter.wrapping_add(LANES as u32);
    }
    if !rest.is_empty() {
        let mut last = [0.0; 2 * LANES];
        pairs(key, counter, &mut last);
        rest.copy_from_slice(&last[..rest.len()]);
    }
}

/// `√(−2 ln u) · cos 2πv`, then `· sin 2πv`, for sixteen consecutive counters.
#[inline(always)]
fn pairs(key: Key, first: u32, out: &mut [f32; 2 * LANES]) {
    let Key([k0, k1]) = key;
    for i in 0..LANES {
        let counter = first.wrapping_add(i as u32);
        let u = mix(counter.wrapping_mul(0x9e37_79b9) ^ k0);
        let v = mix(counter.wrapping_mul(0x85eb_ca6b).wrapping_add(k1));
        let radius = minus_two_ln((u >> 1) | 1).max(0.0).sqrt();
        let (sine, cosine) = sin_cos_turn(v as i32 as f32 * (1.0 / 4_294_967_296.0));
        out[i] = radius * cosine;
        out[i + LANES] = radius * sine;
    }
}

/// `−2 ln(u / 2³¹)` of 1 ≤ u < 2³¹ to 3 × 10⁻⁶, which at 0 may be below it: the exponent by its
/// bits, `−2 ln m` of the mantissa 1 ≤ m < 2 by the polynomial of degree 6 in m − 1.5 whose largest
/// error is least (Remez).
#[inline(always)]
fn minus_two_ln(u: u32) -> f32 {
    let bits = (u as i32 as f32).to_bits();
    let octaves = (127 + 31 - (bits >> 23) as i32) as f32;
    let t = f32::from_bits((bits & 0x007f_ffff) | 1.0f32.to_bits()) - 1.5;
    let series = -0.810_930_97
        + t * (-1.333_367_3
            + t * (0.444_518_47
                + t * (-0.196_462_94
                    + t * (0.097_562_86 + t * (-0.060_898_485 + t * 0.035_615_41)))));
    octaves * (2.0 * std::f32::consts::LN_2) + series
}

/// Sine and cosine of |x| ≤ ½ turns to 3 × 10⁻⁶: those of half the angle by the odd and even
/// polynomials of degree 7 and 8 whose largest error is least, then doubled.
#[inline(always)]
fn sin_cos_turn(x: f32) -> (f32, f32) {
    let q = x * x;
    let sine = x * (3.141_582 + q * (-5.167_143 + q * (2.541_899 + q * -0.554_636_2)));
    let cosine =
        0.999_999_96 + q * (-4.934_793 + q * (4.058_414_5 + q * (-1.331_893_8 + q * 0.219_721_06)));
    (2.0 * sine * cosine, 1.0 - 2.0 * sine * sine)
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
    fn the_tails_are_as_heavy_as_they_should_be() {
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

    #[test]
    fn radii_reach_beyond_six_sigma_and_stay_below_the_bound() {
        let (longest, shortest) =
            (minus_two_ln(1).sqrt(), minus_two_ln(0x7fff_ffff).max(0.0).sqrt());
        assert!((6.5..6.6).contains(&longest), "{longest}");
        assert!(shortest < 2e-3, "{shortest}");
    }

    #[test]
    fn the_polynomials_are_as_exact_as_they_say() {
        for i in 0..200_000u32 {
            let u = ((mix(i) >> 1) >> (i % 31)).max(1);
            let exact = -2.0 * (f64::from(u) / f64::from(1u32 << 31)).ln();
            assert!((f64::from(minus_two_ln(u)) - exact).abs() < 3e-6 + 1e-7 * exact, "{u}");
            let x = mix(!i) as i32 as f32 / 4_294_967_296.0;
            let (sine, cosine) = sin_cos_turn(x);
            let (exact_sine, exact_cosine) = (std::f64::consts::TAU * f64::from(x)).sin_cos();
            assert!(
                (f64::from(sine) - exact_sine).abs() < 3e-6
                    && (f64::from(cosine) - exact_cosine).abs() < 3e-6,
                "{x}"
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
