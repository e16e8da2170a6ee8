//! Fixed-point formats, and rounding in one place.
//!
//! | format | holds | one LSB |
//! |---|---|---|
//! | Q1.15 in `i16`/`i32` | fractions of ADC full scale, filter taps | 2⁻¹⁵ |
//! | Q9.23 in `i32` | interpolated filter output | 2⁻²³ |
//! | Q13.19 in `u32` | noise σ, fraction of full scale | 2⁻¹⁹ |
//! | Q16.16 in `i32` | time in samples | 2⁻¹⁶ |
//! | Q8.8 in `u16` | SNR, threshold multiples | 2⁻⁸ |
//! | 1/256 mm in `u32` | range | 3.9 µm |
//!
//! Every right shift and division rounds to nearest, ties towards +∞, unless its stage says
//! otherwise.

/// `round(value / 2^shift)`, ties up. `shift` is 1 to 62, `value` at most half the range of `i64`.
#[inline(always)]
#[expect(clippy::arithmetic_side_effects, reason = "half of i64's range and 2^61 fit in it")]
pub const fn shift_round(value: i64, shift: u32) -> i64 {
    (value + (1 << (shift - 1))) >> shift
}

/// `round(numerator / denominator)`, ties up; zero when the denominator is zero. Both are below
/// 2⁶¹.
#[inline]
#[expect(
    clippy::arithmetic_side_effects,
    reason = "2·2⁶¹ + 2⁶¹ fits in i64; the division is checked"
)]
pub const fn divide_round(numerator: i64, denominator: i64) -> i64 {
    let (n, d) =
        if denominator < 0 { (-numerator, -denominator) } else { (numerator, denominator) };
    match (2 * n + d).checked_div_euclid(2 * d) {
        Some(quotient) => quotient,
        None => 0,
    }
}

/// Saturates to `u16`.
#[inline(always)]
pub const fn saturate_u16(value: i64) -> u16 {
    if value < 0 {
        0
    } else if value > u16::MAX as i64 {
        u16::MAX
    } else {
        value as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_round_towards_plus_infinity() {
        assert_eq!(shift_round(3, 1), 2);
        assert_eq!(shift_round(-3, 1), -1);
        assert_eq!(divide_round(3, 2), 2);
        assert_eq!(divide_round(-3, 2), -1);
        assert_eq!(divide_round(3, -2), -1);
        assert_eq!(divide_round(7, 3), 2);
    }

    #[test]
    fn a_zero_denominator_yields_zero() {
        assert_eq!(divide_round(5, 0), 0);
    }
}
