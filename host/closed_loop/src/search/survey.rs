//! The survey: aims of a steered sensor spread over their ranges, where a search may begin.
//!
//! The error has several minima over rows, elevation span and tilt. A search in small steps of all
//! axes ends in the one it begins near, wherever that is: on four seeds at a quarter of the budget
//! its ends differed by a factor of two (`benches/record/proof.md`).

use crate::parameters::{Parameters, Space};

/// Axes of the survey, with the radix of each coordinate's sequence.
const AXES: [(&str, u32); 3] = [("lidar.rows", 2), ("lidar.elevation_span", 3), ("lidar.tilt", 5)];

/// Narrowest span, as a share of the start's place in the range of spans. A narrow view registers
/// most pairs better and loses a few that a wide one does not, too few for the pairs of a search to
/// show: a sensor of 23°, where the start has 40°, lost two of 40 held-out pairs and none of 120
/// that its search saw.
const NARROWEST: f64 = 0.75;

/// The first `count` points of the Halton sequence (Halton, Numer. Math. 2, 1960) over those axes
/// of the survey that are searched, all else as in `base`: rows evenly by their logarithm, the
/// others by their value. None where no such axis is searched.
pub(super) fn survey(space: &Space, base: &Parameters, count: usize) -> Vec<Parameters> {
    let axes = space.axes();
    let place = |(name, radix): (&str, u32)| {
        axes.iter().position(|axis| axis.name == name).map(|place| (place, radix))
    };
    let own: Vec<(usize, u32)> = AXES.into_iter().filter_map(place).collect();
    if own.is_empty() {
        return Vec::new();
    }
    let point = |number: u32| {
        let mut point = space.point(base);
        for &(place, radix) in &own {
            let (axis, share) = (&axes[place], radical_inverse(number, radix));
            point[place] = match axis.name {
                "lidar.rows" => axis.to_cube(axis.min * libm::pow(axis.max / axis.min, share)),
                "lidar.elevation_span" => {
                    let least = NARROWEST * point[place];
                    least + share * (1.0 - least)
                }
                _ => share,
            };
        }
        space.parameters(&point).0
    };
    (1..).take(count).map(point).collect()
}

/// The number's digits by a radix, mirrored at the point: 0 to 1.
fn radical_inverse(mut number: u32, radix: u32) -> f64 {
    let (mut share, mut inverse) = (1.0, 0.0);
    while number > 0 {
        share /= f64::from(radix);
        inverse += share * f64::from(number % radix);
        number /= radix;
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_mirrored_at_the_point() {
        let first = |base| [1, 2, 3, 4, 5].map(|number| radical_inverse(number, base));
        assert_eq!(first(2), [0.5, 0.25, 0.75, 0.125, 0.625]);
        let thirds =
            [1.0, 2.0, 1.0 / 3.0, 4.0 / 3.0, 7.0 / 3.0].map(|of_three: f64| of_three / 3.0);
        assert!(first(3).iter().zip(thirds).all(|(a, b)| (a - b).abs() < 1e-15), "{:?}", first(3));
    }
}
