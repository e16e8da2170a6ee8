//! Counter-based Gaussian noise.
//!
//! Sample n of beam b of scan f is a pure function of (seed, f, b, n): the same on any number of threads, in any order, and
//! for every candidate that asks. A library's generator would be called once a sample; this one is eight lanes wide.

/// What the noise of one waveform hangs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoiseKey([u32; 2]);

impl NoiseKey {
    /// The key of a beam of a scan.
    pub fn new(seed: u64, frame: u32, beam: u32) -> Self {
        let key = splitmix64(splitmix64(seed) ^ (u64::from(frame) << 32 | u64::from(beam)));
        Self([(key >> 32) as u32, key as u32])
    }
}

/// SplitMix64's output function (Steele, Lea and Flood 2014).
pub const fn splitmix64(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A 32-bit mixing function of low bias (two multiplications, found by exhaustive search: C. Wellons, "prospecting for hash
/// functions").
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

/// Fills `z` with independent standard normals, |z| < 6.6: Box–Muller, sixteen pairs at a time. A rest shorter than 32 is
/// filled too.
#[inline(always)]
pub fn normals(key: NoiseKey, z: &mut [f32]) {
    for (block, out) in z.chunks_mut(2 * LANES).enumerate() {
        let (cosines, sines) = pairs(key, (block * LANES) as u32);
        for (out, value) in out.iter_mut().zip(cosines.iter().chain(&sines)) {
            *out = *value;
        }
    }
}

/// `√(−2 ln u) · (cos 2πv, sin 2πv)` for sixteen consecutive counters.
#[inline(always)]
fn pairs(key: NoiseKey, first: u32) -> ([f32; LANES], [f32; LANES]) {
    let (mut cosines, mut sines) = ([0.0; LANES], [0.0; LANES]);
    let NoiseKey([k0, k1]) = key;
    for i in 0..LANES {
        let counter = first.wrapping_add(i as u32);
        let u = mix(counter.wrapping_mul(0x9e37_79b9) ^ k0);
        let v = mix(counter.wrapping_mul(0x85eb_ca6b).wrapping_add(k1));
        // (0, 1] from 31 bits; [−½, ½) from 32.
        let uniform = ((u >> 1) as i32 as f32 + 1.0) * (1.0 / 2_147_483_648.0);
        let half_turns = v as i32 as f32 * (1.0 / 4_294_967_296.0);
        let radius = (-2.0 * ln(uniform)).max(0.0).sqrt();
        let (sine, cosine) = sin_cos_half_turn(half_turns * std::f32::consts::PI);
        cosines[i] = radius * (1.0 - 2.0 * sine * sine);
        sines[i] = radius * (2.0 * sine * cosine);
    }
    (cosines, sines)
}

/// ln x of a positive normal float to 2 × 10⁻⁷: exponent by its bits, mantissa by ln((1+s)/(1−s)) = 2(s + s³/3 + …).
#[inline(always)]
fn ln(x: f32) -> f32 {
    // Shift the mantissa's range to [√½, √2).
    let bits = x.to_bits().wrapping_sub(0x3f35_04f3);
    let exponent = (bits as i32 >> 23) as f32;
    let mantissa = f32::from_bits((bits & 0x007f_ffff) + 0x3f35_04f3);
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let q = s * s;
    let series = 2.0 * s * (1.0 + q * (1.0 / 3.0 + q * (0.2 + q * (1.0 / 7.0 + q * (1.0 / 9.0)))));
    exponent * std::f32::consts::LN_2 + series
}

/// Sine and cosine of |x| ≤ π/2 to 2 × 10⁻⁷: Taylor to x¹¹ and x¹².
#[inline(always)]
fn sin_cos_half_turn(x: f32) -> (f32, f32) {
    let q = x * x;
    let sine = x
        * (1.0
            + q * (-1.0 / 6.0
                + q * (1.0 / 120.0 + q * (-1.0 / 5_040.0 + q * (1.0 / 362_880.0 + q * (-1.0 / 39_916_800.0))))));
    let cosine = 1.0
        + q * (-0.5
            + q * (1.0 / 24.0
                + q * (-1.0 / 720.0 + q * (1.0 / 40_320.0 + q * (-1.0 / 3_628_800.0 + q * (1.0 / 479_001_600.0))))));
    (sine, cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn many() -> Vec<f32> {
        (0..1000)
            .flat_map(|beam| {
                let mut z = vec![0.0; 1000];
                normals(NoiseKey::new(7, 1, beam), &mut z);
                z
            })
            .collect()
    }

    #[test]
    fn a_million_samples_have_the_moments_of_a_standard_normal() {
        let z = many();
        let moment = |p| z.iter().map(|&v| f64::from(v).powi(p)).sum::<f64>() / z.len() as f64;
        // Standard errors: 0.001, 0.0014, 0.0039, 0.0098.
        for (p, expected, bound) in [(1, 0.0, 0.004), (2, 1.0, 0.006), (3, 0.0, 0.016), (4, 3.0, 0.04)] {
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
    fn neighbouring_samples_and_beams_are_uncorrelated() {
        let z = many();
        for lag in [1, 2, 15, 16, 31, 32, 1000, 2000] {
            let sum: f64 = z.iter().zip(&z[lag..]).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
            let correlation = sum / (z.len() - lag) as f64;
            assert!(correlation.abs() < 0.005, "lag {lag}: {correlation}");
        }
    }

    #[test]
    fn a_longer_waveform_begins_with_the_shorter_one() {
        let key = NoiseKey::new(1, 2, 3);
        let (mut short, mut long) = (vec![0.0; 800], vec![0.0; 2400]);
        normals(key, &mut short);
        normals(key, &mut long);
        assert_eq!(short[..], long[..800]);
    }
}
