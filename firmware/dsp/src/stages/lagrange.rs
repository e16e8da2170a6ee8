//! Interpolation between samples.
#![expect(clippy::arithmetic_side_effects, reason = "`log2` is at most 3: phases are below 8")]

/// Weights of samples −3..=4 that interpolate at `j / 2^log2` after a sample; `None` on a sample.
/// `log2` is at most 3.
pub fn interpolation(j: i64, log2: u32) -> Option<&'static [i16; 8]> {
    let phase = (j & ((1 << log2) - 1)) << (3 - log2);
    (phase as usize).checked_sub(1).and_then(|row| LAGRANGE.get(row))
}

/// Row p − 1 interpolates at p/8 after a sample, taps at −3..=4: the Lagrange polynomial of degree
/// 7 in Q1.15, nearest, the tap nearest to the point adjusted so that a row adds up to 2¹⁵ exactly.
///
/// Maximally flat at low frequencies, where the output of a matched filter lies: a windowed sinc of
/// this length was 30 times worse there.
pub const LAGRANGE: [[i16; 8]; 7] = [
    [-36, 366, -2071, 31072, 4439, -1243, 270, -29],
    [-62, 626, -3378, 28153, 9384, -2413, 512, -54],
    [-77, 765, -3966, 24238, 14543, -3356, 693, -72],
    [-80, 784, -3920, 19600, 19600, -3920, 784, -80],
    [-72, 693, -3356, 14543, 24238, -3966, 765, -77],
    [-54, 512, -2413, 9384, 28153, -3378, 626, -62],
    [-29, 270, -1243, 4439, 31072, -2071, 366, -36],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_interpolation_row_adds_up_to_one_and_mirrors_its_partner() {
        for (row, taps) in LAGRANGE.iter().enumerate() {
            assert_eq!(taps.iter().map(|&t| i32::from(t)).sum::<i32>(), 1 << 15);
            let partner = &LAGRANGE[6 - row];
            assert!(
                taps.iter().zip(partner.iter().rev()).all(|(a, b)| a.abs_diff(*b) <= 2),
                "row {row}"
            );
        }
    }
}
