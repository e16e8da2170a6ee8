//! Rounding in `f64`, and exact products of integers that `f64` does not hold.

/// Rounds to the nearest integer, ties up.
pub fn nearest(value: f64) -> f64 {
    (value + 0.5).floor()
}

/// `numerator / denominator` to the nearest integer, ties up; 0 when the denominator is 0.
///
/// For integers below 2⁵² the rounding of the division never reaches the next integer.
pub fn nearest_ratio(numerator: f64, denominator: f64) -> f64 {
    if denominator == 0.0 {
        return 0.0;
    }
    let sign = denominator.signum();
    ((2.0 * sign * numerator + denominator.abs()) / (2.0 * denominator.abs())).floor()
}

/// Saturates to the range of Q1.15.
pub fn saturated(value: f64) -> f64 {
    value.clamp(-32_768.0, 32_767.0)
}

/// 2ⁿ.
pub fn two_to(n: i32) -> f64 {
    f64::powi(2.0, n)
}

/// Exact product of two integers of at least 0.
pub fn product(a: f64, b: f64) -> u128 {
    a as u128 * b as u128
}

/// `a · b / divisor`, rounded down. All are integers; a and b at least 0, the divisor at least 1.
pub fn floor_of(a: f64, b: f64, divisor: f64) -> f64 {
    (product(a, b) / divisor as u128) as f64
}

/// The largest integer whose square is at most `square`.
pub fn floor_root(square: u128) -> f64 {
    let mut root = (square as f64).sqrt() as u128;
    while root * root > square {
        root -= 1;
    }
    while (root + 1) * (root + 1) <= square {
        root += 1;
    }
    root as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_round_up_in_every_helper() {
        assert_eq!([nearest(1.5), nearest(-1.5), nearest(-0.5)], [2.0, -1.0, 0.0]);
        assert_eq!(
            [nearest_ratio(3.0, 2.0), nearest_ratio(-3.0, 2.0), nearest_ratio(3.0, -2.0)],
            [2.0, -1.0, -1.0]
        );
        assert_eq!(nearest_ratio(3.0, 0.0), 0.0);
    }

    #[test]
    fn roots_are_exact_beyond_what_f64_holds() {
        let root = (1u128 << 32) - 1;
        assert_eq!(
            [floor_root(root * root), floor_root(root * root - 1)],
            [root as f64, (root - 1) as f64]
        );
    }
}
