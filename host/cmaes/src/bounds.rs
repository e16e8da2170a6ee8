//! Bounds of the unit cube, by reflection.

/// Folds a genotype coordinate into 0 to 1: identity inside, mirrored at both walls, period 2.
pub fn reflect(x: f64) -> f64 {
    let t = x.rem_euclid(2.0);
    if t > 1.0 { 2.0 - t } else { t }
}

/// True when [`reflect`] decreases around `x`.
pub(super) fn is_mirrored(x: f64) -> bool {
    x.rem_euclid(2.0) > 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflection_is_the_identity_inside_and_mirrors_outside() {
        for (x, expected) in
            [(0.0, 0.0), (0.3, 0.3), (1.0, 1.0), (1.2, 0.8), (-0.2, 0.2), (2.3, 0.3), (-1.4, 0.6)]
        {
            assert!((reflect(x) - expected).abs() < 1e-12, "{x}");
        }
        assert!(is_mirrored(1.2) && is_mirrored(-0.2) && !is_mirrored(0.3) && !is_mirrored(2.3));
    }
}
