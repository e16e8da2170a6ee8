//! Which matches keep their distance from which others.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::features::PointPair;

/// Matches a thread takes at a time.
const CHUNK: usize = 128;

/// When two matches agree: a rigid motion keeps every length.
///
/// ```text
/// a = |p_i - p_j|    b = |q_i - q_j|    agree:  |a - b| < stretch   and   a, b > shortest     (all m)
/// ```
///
/// An absolute bound: the ratio of the published tuple test, 0.95, asks for 5 cm at 1 m, less than
/// a voxel, and grants 2.5 m at 50 m. Edges not longer than `shortest` agree among neighbours of
/// any two surfaces, so they say nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rule {
    /// Most difference of the lengths, m.
    pub(super) stretch_m: f32,
    /// Shorter edges say nothing, m.
    pub(super) shortest_m: f32,
}

/// Matches as columns of coordinates about their centroids, m.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    source: [Vec<f32>; 3],
    target: [Vec<f32>; 3],
}

impl Columns {
    /// Of all matches, in their order.
    pub(super) fn of(pairs: &[PointPair]) -> Self {
        let scale = 1.0 / pairs.len().max(1) as f64;
        let source =
            pairs.iter().fold(Vector3::zeros(), |sum, pair| sum + pair.source.coords * scale);
        let target =
            pairs.iter().fold(Vector3::zeros(), |sum, pair| sum + pair.target.coords * scale);
        let column = |value: &dyn Fn(&PointPair) -> f64| {
            pairs.iter().map(|pair| value(pair) as f32).collect()
        };
        Self {
            source: [0, 1, 2].map(|axis| column(&|pair| pair.source[axis] - source[axis])),
            target: [0, 1, 2].map(|axis| column(&|pair| pair.target[axis] - target[axis])),
        }
    }

    /// Some of them, in the order given; indices beyond the last are left out.
    pub(super) fn select(&self, indices: &[usize]) -> Self {
        let pick =
            |column: &Vec<f32>| indices.iter().filter_map(|&i| column.get(i).copied()).collect();
        Self { source: self.source.each_ref().map(pick), target: self.target.each_ref().map(pick) }
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.source[0].len()
    }

    /// Both positions of a match: source x y z, target x y z.
    fn row(&self, i: usize) -> [f32; 6] {
        let [[x, y, z], [u, v, w]] = [&self.source, &self.target];
        [x[i], y[i], z[i], u[i], v[i], w[i]]
    }

    /// How many of `others` each match agrees with.
    pub(super) fn counts(&self, others: &Self, rule: Rule) -> Vec<u32> {
        let v3 = echoloop_dispatch::has_v3();
        self.counts_with(others, rule, if v3 { count } else { count_inline })
    }

    fn counts_with(&self, others: &Self, rule: Rule, count: Kernel) -> Vec<u32> {
        let mut counts = vec![0; self.len()];
        counts.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, counts)| {
            for (k, value) in counts.iter_mut().enumerate() {
                *value = count(&self.row(chunk * CHUNK + k), others, rule);
            }
        });
        counts
    }

    /// Which of them agree: a row of bits each, the lowest bit of the first word first.
    pub(super) fn graph(&self, rule: Rule) -> Vec<Vec<u64>> {
        let v3 = echoloop_dispatch::has_v3();
        self.graph_with(rule, if v3 { mark } else { mark_inline })
    }

    fn graph_with(&self, rule: Rule, mark: Marker) -> Vec<Vec<u64>> {
        let row = |i: usize| {
            let mut hits = vec![0; self.len().next_multiple_of(8)];
            mark(&self.row(i), self, rule, &mut hits);
            packed(&hits)
        };
        (0..self.len()).into_par_iter().map(row).collect()
    }
}

/// Bytes of 0 or 1 as bits. The product moves the k-th byte of eight to the k-th bit of the highest
/// byte.
fn packed(hits: &[u8]) -> Vec<u64> {
    let eight =
        |bytes: &[u8; 8]| u64::from_le_bytes(*bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    let word = |bytes: &[u8]| {
        bytes.as_chunks().0.iter().rev().fold(0, |word, bytes| word << 8 | eight(bytes))
    };
    hits.chunks(64).map(word).collect()
}

type Marker = fn(&[f32; 6], &Columns, Rule, &mut [u8]);

type Kernel = fn(&[f32; 6], &Columns, Rule) -> u32;

/// The rule in squares, so that no root is drawn.
struct Bounds {
    stretch: f32,
    shortest: f32,
}

impl Bounds {
    fn of(rule: Rule) -> Self {
        Self {
            stretch: rule.stretch_m * rule.stretch_m,
            shortest: rule.shortest_m * rule.shortest_m,
        }
    }
}

/// `|a - b| < s` for `a + b > s`, from `A = a²` and `B = b²`: `(A - B)² < s² (2 (A + B) - s²)`.
/// Near the bound `A - B` is `2 a s`, so `f32` cancels nothing that matters; where `a + b < s` it
/// is false, as such short edges shall be.
#[inline(always)]
fn agrees(p: &[f32; 6], q: &[f32; 6], bounds: &Bounds) -> bool {
    let d: [f32; 6] = std::array::from_fn(|k| p[k] - q[k]);
    let a = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    let b = d[3] * d[3] + d[4] * d[4] + d[5] * d[5];
    let (sum, difference) = (a + b, a - b);
    let close = difference * difference < bounds.stretch * (2.0 * sum - bounds.stretch);
    close & (a > bounds.shortest) & (b > bounds.shortest)
}

#[cfg(target_arch = "x86_64")]
fn count(row: &[f32; 6], others: &Columns, rule: Rule) -> u32 {
    // SAFETY: called only where `has_v3` said so.
    unsafe { count_v3(row, others, rule) }
}

#[cfg(not(target_arch = "x86_64"))]
fn count(row: &[f32; 6], others: &Columns, rule: Rule) -> u32 {
    count_inline(row, others, rule)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn count_v3(row: &[f32; 6], others: &Columns, rule: Rule) -> u32 {
    count_inline(row, others, rule)
}

#[cfg(target_arch = "x86_64")]
fn mark(row: &[f32; 6], others: &Columns, rule: Rule, hits: &mut [u8]) {
    // SAFETY: called only where `has_v3` said so.
    unsafe { mark_v3(row, others, rule, hits) }
}

#[cfg(not(target_arch = "x86_64"))]
fn mark(row: &[f32; 6], others: &Columns, rule: Rule, hits: &mut [u8]) {
    mark_inline(row, others, rule, hits)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn mark_v3(row: &[f32; 6], others: &Columns, rule: Rule, hits: &mut [u8]) {
    mark_inline(row, others, rule, hits)
}

#[inline(always)]
fn mark_inline(row: &[f32; 6], others: &Columns, rule: Rule, hits: &mut [u8]) {
    let (bounds, n) = (Bounds::of(rule), others.len().min(hits.len()));
    let [x, y, z] = others.source.each_ref().map(|column| &column[..n]);
    let [u, v, w] = others.target.each_ref().map(|column| &column[..n]);
    let hits = &mut hits[..n];
    for j in 0..n {
        hits[j] = u8::from(agrees(row, &[x[j], y[j], z[j], u[j], v[j], w[j]], &bounds));
    }
}

#[inline(always)]
fn count_inline(row: &[f32; 6], others: &Columns, rule: Rule) -> u32 {
    let (bounds, n) = (Bounds::of(rule), others.len());
    let [x, y, z] = others.source.each_ref().map(|column| &column[..n]);
    let [u, v, w] = others.target.each_ref().map(|column| &column[..n]);
    (0..n).map(|j| u32::from(agrees(row, &[x[j], y[j], z[j], u[j], v[j], w[j]], &bounds))).sum()
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_counts_are_those_of_lengths_in_f64_on_any_processor(
            rows in prop::collection::vec(prop::array::uniform6(-60.0f64..60.0), 1..150),
        ) {
            let rule = Rule { stretch_m: 6.0, shortest_m: 10.0 };
            let pair = |v: &[f64; 6]| PointPair {
                source: Point3::new(v[0], v[1], v[2]), target: Point3::new(v[3], v[4], v[5]),
            };
            let pairs: Vec<PointPair> = rows.iter().map(pair).collect();
            let columns = Columns::of(&pairs);
            let counts = columns.counts_with(&columns, rule, count_inline);
            if echoloop_dispatch::has_v3() {
                prop_assert_eq!(&counts, &columns.counts_with(&columns, rule, count));
            }
            let graph = columns.graph_with(rule, mark_inline);
            prop_assert_eq!(&graph, &columns.graph(rule));
            for (i, p) in pairs.iter().enumerate() {
                let ones: u32 = graph[i].iter().map(|word| word.count_ones()).sum();
                prop_assert_eq!(ones, counts[i]);
                prop_assert!((0..pairs.len()).all(|j| graph[i][j / 64] >> (j % 64) & 1 == graph[j][i / 64] >> (i % 64) & 1));
                let slack = |q: &PointPair| {
                    let (a, b) = ((p.source - q.source).norm(), (p.target - q.target).norm());
                    (6.0 - (a - b).abs()).min(a - 10.0).min(b - 10.0)
                };
                let least = pairs.iter().filter(|q| slack(q) > 1e-3).count();
                let most = pairs.iter().filter(|q| slack(q) > -1e-3).count();
                prop_assert!((least..=most).contains(&(counts[i] as usize)));
            }
        }
    }
}
