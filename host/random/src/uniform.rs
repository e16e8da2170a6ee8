//! Uniform numbers from bits, and normal numbers from uniform ones.

/// 2⁵³, the number of steps that an `f64` resolves between 0 and 1.
const STEPS: f64 = 9_007_199_254_740_992.0;

/// Uniform in [0, 1), 53 bits.
pub(crate) fn half_open(bits: u64) -> f64 {
    (bits >> 11) as f64 / STEPS
}

/// Uniform in (0, 1), 53 bits, neither end included.
pub(crate) fn open(bits: u64) -> f64 {
    ((bits >> 11) as f64 + 0.5) / STEPS
}

/// A pair of independent standard normals (Box and Muller 1958), from an exponential of mean 1 and
/// a uniform number.
///
/// ```text
/// √(2e) · (cos 2πu, sin 2πu)
/// ```
pub fn box_muller(exponential: f64, uniform: f64) -> [f64; 2] {
    let radius = libm::sqrt(2.0 * exponential);
    let (sine, cosine) = libm::sincos(2.0 * std::f64::consts::PI * uniform);
    [radius * cosine, radius * sine]
}
