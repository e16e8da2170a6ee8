//! Samples that a file does not have: empty cells, and numbers that stand for none.

use super::response::robust::median;
use super::rows::Rows;

/// Numbers that instruments and archives write where a sample is missing: the greatest and least of
/// 16 and 32 bits, and the fill values of geodata.
const FILLS: [f64; 12] = [
    65_535.0,
    32_767.0,
    -32_768.0,
    4_294_967_295.0,
    2_147_483_647.0,
    -2_147_483_648.0,
    -999.0,
    9_999.0,
    -9_999.0,
    99_999.0,
    -99_999.0,
    -32_767.0,
];

/// The numbers that stand for a missing sample, and how often each does.
///
/// Each is one of [`FILLS`], and farther from all other samples than these are from each other, or
/// stands between samples at rest wherever it is. So it is no echo that was cut off: the flanks of
/// one reach up to it.
pub(super) fn fill_values(rows: &Rows) -> Vec<(f64, usize)> {
    let mut seen = [0; FILLS.len()];
    let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
    each(rows, |value| match FILLS.iter().position(|fill| *fill == value) {
        Some(fill) => seen[fill] += 1,
        None => (least, greatest) = (least.min(value), greatest.max(value)),
    });
    let is_apart = |fill: f64| {
        let apart = (fill - greatest).max(least - fill);
        least <= greatest && (apart > greatest - least || apart > 0.0 && is_lone(rows, fill))
    };
    let present = FILLS.into_iter().zip(seen).filter(|(_, count)| *count > 0);
    present.filter(|(fill, _)| is_apart(*fill)).collect()
}

/// Greatest distance from the rest of a sample beside a missing one, over that of the fill value.
const AT_REST: f64 = 0.1;

/// True when the samples beside a number are at rest in every row: near its median.
fn is_lone(rows: &Rows, fill: f64) -> bool {
    (0..rows.len()).all(|row| {
        let row = rows.row(row);
        if !row.contains(&fill) {
            return true;
        }
        let mut present: Vec<f64> =
            row.iter().copied().filter(|value| !value.is_nan() && *value != fill).collect();
        if present.is_empty() {
            return false;
        }
        let rest = median(&mut present);
        let is_near = |value: f64| (value - rest).abs() <= AT_REST * (fill - rest).abs();
        let mut pairs = row.windows(2).filter(|pair| pair.contains(&fill));
        pairs
            .all(|pair| pair.iter().all(|&value| value == fill || value.is_nan() || is_near(value)))
    })
}

/// Every sample that the file has.
fn each(rows: &Rows, mut see: impl FnMut(f64)) {
    for row in 0..rows.len() {
        rows.row(row).iter().filter(|value| !value.is_nan()).for_each(|&value| see(value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(rows: &[&[f64]]) -> Vec<(f64, usize)> {
        fill_values(&Rows::of_rows(rows.iter().map(|row| row.to_vec())))
    }

    #[test]
    fn a_number_far_from_all_others_stands_for_missing_samples() {
        assert_eq!(found(&[&[200.0, 201.0, 65_535.0], &[65_535.0, 900.0]]), [(65_535.0, 2)]);
        assert_eq!(found(&[&[0.2, -9_999.0, 0.3, 0.9]]), [(-9_999.0, 1)]);
        assert_eq!(found(&[&[4_000.0, -32_768.0, -4_095.0]]), [(-32_768.0, 1)]);
        let both = found(&[&[200.0, 201.0, 65_535.0], &[-9_999.0, -9_999.0, 900.0]]);
        assert_eq!(both, [(65_535.0, 1), (-9_999.0, 2)]);
        assert_eq!(found(&[&[200.0, f64::NAN, 201.0]]), []);
    }

    #[test]
    fn the_top_of_a_clipped_echo_is_no_missing_sample() {
        assert_eq!(found(&[&[200.0, 30_000.0, 61_000.0, 65_535.0, 65_535.0, 42_000.0, 210.0]]), []);
        let echo = [500.0, 510.0, 45_000.0, 9_000.0, 490.0, 500.0];
        assert_eq!(found(&[&[&[500.0, 65_535.0, 505.0], &echo[..]].concat()]), [(65_535.0, 1)]);
        assert_eq!(found(&[&echo, &[500.0, 500.0, 65_535.0, 30_000.0, 500.0]]), []);
        assert_eq!(found(&[&[-999.0, -998.0, -400.0, 20.0, -990.0]]), []);
        assert_eq!(found(&[&[65_535.0, 65_535.0]]), [], "nothing else");
        assert_eq!(found(&[]), []);
    }
}
