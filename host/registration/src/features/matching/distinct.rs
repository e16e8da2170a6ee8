//! Duplicate rows.

use super::row::Row;
use crate::features::DIMENSIONS;

/// The rows with duplicates of an earlier row replaced by zeros, which match nothing.
///
/// A row's mutual nearest is the first of its equals: they are all as far from anything, and the
/// lower index wins.
pub(super) fn distinct(rows: &[Row]) -> Vec<Row> {
    let mut keys: Vec<(u64, u32)> = rows.iter().map(key).zip(0..).collect();
    keys.sort_unstable();
    let mut kept = rows.to_vec();
    for alike in keys.chunk_by(|a, b| a.0 == b.0) {
        let mut firsts: Vec<usize> = Vec::with_capacity(1);
        for &(_, index) in alike {
            let index = index as usize;
            if firsts.iter().any(|&first| rows[first] == rows[index]) {
                kept[index] = [0.0; DIMENSIONS];
            } else {
                firsts.push(index);
            }
        }
    }
    kept
}

/// Equal for equal rows, and seldom for others (FNV-1a by words).
fn key(row: &Row) -> u64 {
    row.iter().fold(0xcbf2_9ce4_8422_2325, |key, value| {
        // -0 equals 0, and becomes it by this.
        (key ^ u64::from((value + 0.0).to_bits())).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_equal_rows_stays_and_the_others_become_zero() {
        let row = |v: f32| [v; DIMENSIONS];
        let mut nearly = row(2.0);
        nearly[32] = 2.5;
        let rows = [row(1.0), row(2.0), row(1.0), nearly, row(1.0), row(0.0), row(-0.0)];
        let zero = row(0.0);
        assert_eq!(distinct(&rows), [row(1.0), row(2.0), zero, nearly, zero, zero, zero]);
    }
}
