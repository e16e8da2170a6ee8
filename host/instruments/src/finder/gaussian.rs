//! A Gaussian in integers.

// No overflow: distances are Q8 within 2400 samples, below 2²⁰; 1/σ is below 2²³; table entries are
// Q1.15.

/// Least σ of a component, Q8 samples: 0.8. Narrower ones are spikes of one sample.
pub const MIN_SIGMA: i64 = 205;

/// Greatest σ of a component, Q8 samples: 64.
pub const MAX_SIGMA: i64 = 64 << 8;

/// `g(d) = e^(−d²/2σ²)`, with 1/σ prepared.
///
/// ```text
/// i    = round down(2²⁹ / σ)                        Q8 samples → Q21 per sample
/// z    = (|d|·i) >> 16                              Q13 σ
/// g    = E[j] + ((E[j + 1] − E[j])·f + 128) >> 8    j = z >> 8, f = z mod 2⁸; 0 from z = 4.5 on
/// E[j] = round(2¹⁵·e^(−(j/32)²/2))
/// ```
///
/// | name | format |
/// |---|---|
/// | `d`, `σ` | Q8 samples, σ from [`MIN_SIGMA`] to [`MAX_SIGMA`] |
/// | `g` | Q1.15, 2¹⁵ is one |
///
/// Within 2 × 10⁻⁴ of the function; it ends at 4 × 10⁻⁵.
#[derive(Clone, Copy, Debug)]
pub struct Gaussian {
    sigma: i64,
    inverse: i64,
}

impl Gaussian {
    /// Gaussian of σ, Q8 samples, clamped to its range.
    pub fn new(sigma: i64) -> Self {
        let sigma = sigma.clamp(MIN_SIGMA, MAX_SIGMA);
        Self { sigma, inverse: (1 << 29) / sigma }
    }

    /// σ, Q8 samples.
    pub fn sigma(&self) -> i64 {
        self.sigma
    }

    /// Distance where it ends: 4.5 σ, Q8 samples, rounded down.
    pub fn reach(&self) -> i64 {
        (9 * self.sigma) >> 1
    }

    /// g, Q1.15, at a distance d, Q8 samples.
    pub fn at(&self, distance: i64) -> i64 {
        let z = (distance.abs() * self.inverse) >> 16;
        let entry = usize::try_from(z >> 8).unwrap_or(usize::MAX);
        let Some(&[here, next]) = entry.checked_add(2).and_then(|end| TABLE.get(entry..end)) else {
            return 0;
        };
        let (here, next) = (i64::from(here), i64::from(next));
        here + (((next - here) * (z & 0xff) + 128) >> 8)
    }
}

/// E: 32 steps per σ up to 4.5 σ.
#[rustfmt::skip]
pub const TABLE: [u16; 145] = [
    32768, 32752, 32704, 32624, 32513, 32370, 32197, 31993, 31760, 31497, 31206, 30888, 30543,
    30173, 29777, 29359, 28918, 28455, 27973, 27472, 26954, 26420, 25871, 25309, 24735, 24150,
    23556, 22954, 22346, 21732, 21115, 20496, 19875, 19254, 18634, 18017, 17403, 16794, 16190,
    15592, 15002, 14421, 13848, 13285, 12732, 12191, 11661, 11143, 10638, 10146, 9667, 9202,
    8751, 8313, 7890, 7481, 7087, 6706, 6340, 5988, 5650, 5326, 5015, 4718, 4435, 4164, 3906,
    3660, 3427, 3205, 2995, 2796, 2607, 2429, 2261, 2102, 1953, 1812, 1680, 1556, 1440, 1331,
    1229, 1134, 1045, 962, 885, 814, 747, 685, 628, 575, 526, 480, 438, 400, 364, 331, 301, 274,
    248, 225, 204, 184, 167, 150, 136, 122, 110, 99, 89, 80, 72, 64, 57, 51, 46, 41, 37, 33, 29,
    26, 23, 20, 18, 16, 14, 12, 11, 10, 9, 8, 7, 6, 5, 4, 4, 3, 3, 3, 2, 2, 2, 2, 1,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gaussian_is_exact_within_two_ten_thousandths() {
        for sigma in [MIN_SIGMA, 256, 700, 2_560, MAX_SIGMA] {
            let gaussian = Gaussian::new(sigma);
            for distance in 0..5 * sigma {
                let z = distance as f64 / sigma as f64;
                let expected = (-z * z / 2.0).exp();
                let got = gaussian.at(-distance) as f64 / 32768.0;
                assert!(
                    (got - expected).abs() < 2e-4,
                    "{sigma} {distance}: {got} against {expected}"
                );
            }
        }
    }

    #[test]
    fn the_gaussian_is_zero_beyond_its_reach() {
        let gaussian = Gaussian::new(0);
        assert_eq!(gaussian.sigma(), MIN_SIGMA);
        assert_eq!(gaussian.at(1 << 20), 0);
        assert_eq!(gaussian.at(gaussian.reach() + 2), 0);
    }
}
