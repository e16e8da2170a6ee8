//! Value noise over the plane.
//!
//! Written here instead of by a crate, because the pinned bytes of the scenes depend on every bit
//! of it.

use echoloop_random::mix_64;

/// Value noise over the plane, summed over octaves that halve in size and height.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Noise {
    pub(crate) seed: u64,
    /// Size of the largest bumps, metres.
    pub(crate) scale_m: f64,
    pub(crate) octaves: u32,
}

impl Noise {
    /// Value at a point, about −1 to 1.
    pub(crate) fn at(&self, x: f64, y: f64) -> f64 {
        let (mut x, mut y) = (x / self.scale_m, y / self.scale_m);
        let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
        for octave in 0..self.octaves {
            sum += weight * value_noise(self.seed.wrapping_add(u64::from(octave)), x, y);
            total += weight;
            weight *= 0.5;
            // Doubled and turned by the 3-4-5 angle, so that no lattice direction shows.
            (x, y) = (2.0 * (0.8 * x - 0.6 * y), 2.0 * (0.6 * x + 0.8 * y));
        }
        sum / total
    }
}

fn value_noise(seed: u64, x: f64, y: f64) -> f64 {
    let (i, j) = (x.floor(), y.floor());
    let (u, v) = (ease(x - i), ease(y - j));
    let corner = |di: i64, dj: i64| lattice(seed, i as i64 + di, j as i64 + dj);
    let low = corner(0, 0) * (1.0 - u) + corner(1, 0) * u;
    let high = corner(0, 1) * (1.0 - u) + corner(1, 1) * u;
    low * (1.0 - v) + high * v
}

/// Smoothstep: 0 below `from`, 1 above `to`.
pub(crate) fn ramp(x: f64, from: f64, to: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn ease(t: f64) -> f64 {
    t * t * t * (t * (6.0 * t - 15.0) + 10.0)
}

/// Hash of the arguments in [-1, 1) (finalizer of SplitMix64).
fn lattice(seed: u64, i: i64, j: i64) -> f64 {
    let spread = seed
        .wrapping_add((i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15))
        .wrapping_add((j as u64).wrapping_mul(0xD1B5_4A32_D192_ED03));
    (mix_64(spread) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_smooth_and_stays_within_one() {
        let noise = Noise { seed: 3, scale_m: 10.0, octaves: 4 };
        for k in 0..2000 {
            let x = f64::from(k) * 0.37 - 300.0;
            assert!(noise.at(x, 2.0 * x).abs() <= 1.0);
            assert!((noise.at(x + 1e-4, x) - noise.at(x, x)).abs() < 1e-3);
        }
    }
}
