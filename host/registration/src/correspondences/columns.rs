//! Matches as columns of `f32`, for loops over all pairs of them.

use echoloop_dispatch::dispatch;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::length_bounds::{LengthBounds, SquaredBounds};
use crate::bits::WORD;
use crate::features::PointPair;

/// Matches a thread takes at a time.
const CHUNK: usize = 128;

/// Rounding of a length in `f32`, in units of the largest coordinate times 2⁻²⁴: some seven for the
/// coordinates' own rounding, thirty for the arithmetic, and room.
const ROUNDING_UNITS: f32 = 64.0;

/// Largest coordinate, m: the fourth powers of larger ones come near the end of `f32`.
const WIDEST_M: f32 = 1e9;

/// A target that no motion reaches: its square is infinite, so that padding scores nothing.
const NOWHERE: f32 = 1e30;

/// Centroids of the matches in both clouds, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Centroids {
    pub(crate) source: Vector3<f64>,
    pub(crate) target: Vector3<f64>,
}

impl Centroids {
    fn new(pairs: &[PointPair]) -> Self {
        let share = 1.0 / pairs.len().max(1) as f64;
        Self {
            source: pairs.iter().map(|pair| pair.source.coords * share).sum(),
            target: pairs.iter().map(|pair| pair.target.coords * share).sum(),
        }
    }
}

/// Matches as six columns of coordinates about their centroids, m, padded to whole words.
#[derive(Clone, Debug)]
pub(crate) struct Columns {
    /// Source x y z, then target x y z.
    coordinates: [Vec<f32>; 6],
    len: usize,
}

impl Columns {
    /// All matches in their order, and their centroids.
    pub(crate) fn new(pairs: &[PointPair]) -> (Self, Centroids) {
        let centroids = Centroids::new(pairs);
        let source = |axis: usize| {
            pairs.iter().map(|p| (p.source[axis] - centroids.source[axis]) as f32).collect()
        };
        let target = |axis: usize| {
            pairs.iter().map(|p| (p.target[axis] - centroids.target[axis]) as f32).collect()
        };
        let columns = [source(0), source(1), source(2), target(0), target(1), target(2)];
        (Self::padded(columns, pairs.len()), centroids)
    }

    /// Some of the matches, in the order given; indices beyond the last are left out.
    pub(crate) fn select(&self, indices: &[usize]) -> Self {
        let kept: Vec<usize> = indices.iter().copied().filter(|&i| i < self.len).collect();
        let pick = |column: &Vec<f32>| kept.iter().map(|&i| column[i]).collect();
        Self::padded(self.coordinates.each_ref().map(pick), kept.len())
    }

    fn padded(mut coordinates: [Vec<f32>; 6], len: usize) -> Self {
        for (axis, column) in coordinates.iter_mut().enumerate() {
            column.resize(len.next_multiple_of(WORD), if axis == 3 { NOWHERE } else { 0.0 });
        }
        Self { coordinates, len }
    }

    /// Count of the matches.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Words of a row of bits over them.
    pub(crate) fn words(&self) -> usize {
        self.len.div_ceil(WORD)
    }

    /// The columns and their padding, `N` numbers at a time; `N` divides 64.
    #[inline(always)]
    pub(crate) fn chunks<const N: usize>(&self) -> [&[[f32; N]]; 6] {
        self.coordinates.each_ref().map(|column| column.as_chunks().0)
    }

    /// Both positions of a match: source x y z, target x y z.
    fn row(&self, i: usize) -> [f32; 6] {
        self.coordinates.each_ref().map(|column| column[i])
    }

    /// For each match, the count of `others` consistent with it. Both have the same centroids.
    pub(crate) fn counts(&self, others: &Self, bounds: &LengthBounds) -> Vec<u32> {
        let bounds = bounds.squared(0.0);
        let mut counts = vec![0; self.len];
        counts.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, counts)| {
            for (i, value) in (chunk * CHUNK..).zip(counts) {
                *value = count(&self.row(i), others, &bounds);
            }
        });
        counts
    }

    /// Consistent pairs of matches, a row of bits for each, to the rounding of `f32`.
    pub(crate) fn graph(&self, bounds: &LengthBounds) -> Vec<Vec<u64>> {
        let bounds = bounds.squared(0.0);
        let row = |i: usize| {
            let mut row = vec![0; self.words()];
            self.mark_from(i, 0, &bounds, &mut row);
            row
        };
        (0..self.len).into_par_iter().map(row).collect()
    }

    /// The slack that [`Self::screen`] adds to the bound, m; None if `f32` could overflow.
    pub(crate) fn slack_m(&self) -> Option<f32> {
        let matches = self.coordinates.iter().flat_map(|column| &column[..self.len]);
        let largest = matches.fold(0.0f32, |largest, v| largest.max(v.abs()));
        (largest <= WIDEST_M).then_some(largest * f32::EPSILON / 2.0 * ROUNDING_UNITS)
    }

    /// Writes, from word `first` of row `i`, which matches may be consistent with match `i`: all
    /// that are, and few that are not, as the bound is wider by `slack_m`, from
    /// [`Self::slack_m`]. Bits past the last match are 0.
    pub(crate) fn screen(
        &self,
        i: usize,
        first: usize,
        (bounds, slack_m): (&LengthBounds, Option<f32>),
        row: &mut [u64],
    ) {
        match slack_m {
            Some(slack_m) => self.mark_from(i, first, &bounds.squared(slack_m), row),
            None => {
                row.fill(u64::MAX);
                self.trim(row);
            }
        }
    }

    fn mark_from(&self, i: usize, first: usize, bounds: &SquaredBounds, row: &mut [u64]) {
        mark(&self.row(i), self, first, bounds, row);
        self.trim(row);
    }

    /// Clears the bits of the padding in a row's last word.
    fn trim(&self, row: &mut [u64]) {
        if let (Some(last), rest @ 1..) = (row.last_mut(), self.len % WORD) {
            *last &= (1 << rest) - 1;
        }
    }
}

dispatch! {
    /// Count of `others` that are consistent with a match.
    fn count(row: &[f32; 6], others: &Columns, bounds: &SquaredBounds) -> u32 = count_inline;

    /// Sets the bits of the `others` that a match is consistent with, from word `first` on.
    fn mark(
        row: &[f32; 6],
        others: &Columns,
        first: usize,
        bounds: &SquaredBounds,
        bits: &mut [u64],
    ) = mark_inline;
}

#[inline(always)]
fn count_inline(row: &[f32; 6], others: &Columns, bounds: &SquaredBounds) -> u32 {
    let n = others.len;
    let [x, y, z, u, v, w] = others.coordinates.each_ref().map(|column| &column[..n]);
    (0..n).map(|j| u32::from(!bounds.broken(row, &[x[j], y[j], z[j], u[j], v[j], w[j]]))).sum()
}

#[inline(always)]
fn mark_inline(
    row: &[f32; 6],
    others: &Columns,
    first: usize,
    bounds: &SquaredBounds,
    bits: &mut [u64],
) {
    let words = others.chunks::<WORD>();
    for (word, bits) in (first..).zip(bits) {
        *bits = word_of(row, words.map(|column| &column[word]), bounds);
    }
}

#[inline(always)]
fn word_of(row: &[f32; 6], [x, y, z, u, v, w]: [&[f32; WORD]; 6], bounds: &SquaredBounds) -> u64 {
    let mut broken = [0u8; WORD];
    for k in 0..WORD {
        broken[k] = u8::from(bounds.broken(row, &[x[k], y[k], z[k], u[k], v[k], w[k]]));
    }
    let bytes = broken.as_chunks::<8>().0;
    (0..8).fold(0, |bits, byte| bits | packed(bytes[byte]) << (8 * byte)) ^ u64::MAX
}

/// Eight bytes of 0 or 1 as eight bits: the product moves byte `k` to bit `56 + k`.
#[inline(always)]
fn packed(bytes: [u8; 8]) -> u64 {
    u64::from_le_bytes(bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::*;
    use crate::bits;

    fn pairs(rows: &[[f64; 6]], shift_m: f64) -> Vec<PointPair> {
        let pair = |v: &[f64; 6]| PointPair {
            source: Point3::new(v[0] + shift_m, v[1], v[2]),
            target: Point3::new(v[3], v[4] - shift_m, v[5]),
        };
        rows.iter().map(pair).collect()
    }

    /// By the plain builds: the count of each, and its row.
    fn plain(columns: &Columns, bounds: &SquaredBounds) -> (Vec<u32>, Vec<Vec<u64>>) {
        let count = |i| count_inline(&columns.row(i), columns, bounds);
        let row = |i| {
            let mut row = vec![0; columns.words()];
            mark_inline(&columns.row(i), columns, 0, bounds, &mut row);
            columns.trim(&mut row);
            row
        };
        ((0..columns.len()).map(count).collect(), (0..columns.len()).map(row).collect())
    }

    proptest! {
        #[test]
        fn the_counts_are_those_of_lengths_in_f64_on_any_processor(
            rows in prop::collection::vec(prop::array::uniform6(-60.0f64..60.0), 1..150),
        ) {
            let bounds = LengthBounds { tolerance_m: 6.0, least_length_m: 10.0 };
            let pairs = pairs(&rows, 0.0);
            let (columns, _) = Columns::new(&pairs);
            let (counts, graph) = (columns.counts(&columns, &bounds), columns.graph(&bounds));
            prop_assert_eq!((&counts, &graph), {
                let (counts, graph) = &plain(&columns, &bounds.squared(0.0));
                (&counts.clone(), &graph.clone())
            });
            for (i, p) in pairs.iter().enumerate() {
                prop_assert_eq!(bits::count(&graph[i]), counts[i] as usize);
                let bit = |i: usize, j: usize| graph[i][j / WORD] >> (j % WORD) & 1;
                prop_assert!((0..pairs.len()).all(|j| bit(i, j) == bit(j, i)));
                let slack = |q: &PointPair| {
                    let (a, b) = ((p.source - q.source).norm(), (p.target - q.target).norm());
                    (6.0 - (a - b).abs()).min(a - 10.0).min(b - 10.0)
                };
                let least = pairs.iter().filter(|q| slack(q) > 1e-3).count();
                let most = pairs.iter().filter(|q| slack(q) > -1e-3).count();
                prop_assert!((least..=most).contains(&(counts[i] as usize)));
            }
        }

        #[test]
        fn the_screen_is_the_same_in_both_builds_and_misses_none(
            rows in prop::collection::vec(prop::array::uniform6(-9.0f64..9.0), 1..200),
            tolerance_m in 1e-3f64..3.0,
            shift_m in prop_oneof![Just(0.0), Just(1e5)],
            scale in prop_oneof![Just(1.0), Just(1e-3), Just(1e12)],
        ) {
            let bounds = LengthBounds { tolerance_m: tolerance_m * scale, least_length_m: 0.0 };
            let rows: Vec<_> = rows.iter().map(|row| row.map(|v| v * scale)).collect();
            let pairs = pairs(&rows, shift_m);
            let (columns, _) = Columns::new(&pairs);
            let slack_m = columns.slack_m();
            let plain = slack_m.map(|slack_m| plain(&columns, &bounds.squared(slack_m)).1);
            for i in 0..pairs.len() {
                let mut row = vec![0; columns.words()];
                columns.screen(i, 0, (&bounds, slack_m), &mut row);
                prop_assert!(plain.as_ref().is_none_or(|plain| plain[i] == row));
                for j in 0..pairs.len() {
                    let found = row[j / WORD] >> (j % WORD) & 1 == 1;
                    prop_assert!(found || !bounds.hold(&pairs[i], &pairs[j]), "{} {}", i, j);
                }
                prop_assert!(bits::members(&row).all(|j| j < pairs.len()));
            }
        }
    }

    #[test]
    fn edges_shorter_than_the_difference_are_consistent_unless_they_are_too_short() {
        // 1 cm long in the source, 5 cm in the target, and the same place twice.
        let pairs = pairs(&[[0.0; 6], [0.01, 0.0, 0.0, 0.0, 0.05, 0.0], [0.0; 6]], 0.0);
        let (columns, _) = Columns::new(&pairs);
        let rows = |least_length_m| {
            let bounds = LengthBounds { tolerance_m: 0.2, least_length_m };
            let exact = |i: usize| {
                (0..3).filter(|&j| bounds.hold(&pairs[i], &pairs[j])).fold(0, |row, j| row | 1 << j)
            };
            assert_eq!(columns.graph(&bounds), [0, 1, 2].map(|i| vec![exact(i)]));
            [0, 1, 2].map(exact)
        };
        assert_eq!(rows(0.0), [0b111; 3]);
        assert_eq!(rows(0.005), [0b010, 0b101, 0b010]);
        assert_eq!(rows(0.02), [0; 3]);
    }
}
