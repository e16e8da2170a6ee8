//! Fast point feature histograms.

mod pair;

use echoloop_dispatch::dispatch;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::{DIMENSIONS, Features};
use crate::geometry::neighbours::Neighbours;
use pair::{BINS, Facing, LANES, PairBins, PairLanes};

/// Sum of the numbers of a histogram.
const WHOLE: f32 = 100.0;

/// Numbers of a row in memory: whole vectors of eight.
const STRIDE: usize = DIMENSIONS.next_multiple_of(8);

/// Points that a thread takes at a time.
const CHUNK: usize = 256;

/// A point's own histograms: SPFH, padded with zeros.
type Row = [f32; STRIDE];

/// Input of all chunks.
struct OrientedCloud<'a> {
    /// Points and normals side by side.
    facing: Vec<Facing>,
    neighbours: &'a Neighbours,
}

/// The features of points with normals: FPFH (Rusu, Blodow and Beetz 2009) as in Open3D 0.20.
///
/// ```text
/// SPFH(p) = 100 / (k - 1) · Σ bins(p, q)      over the other k - 1 neighbours q
/// FPFH(p) = SPFH(p) + 100 · S / Σ_bins S      S = Σ SPFH(q) / |p - q|², over those not at p
/// ```
///
/// Both are three histograms of eleven bins, and the second line is by histogram. So each adds up
/// to 200 where a neighbour lies apart. A point with a zero normal has no feature, all zero, and is
/// nobody's neighbour. Histograms are counts and so exact; sums are in `f32`, in the order of the
/// neighbours. The same bytes in both builds and on any number of threads.
pub fn describe(
    points: &[Point3<f32>],
    normals: &[Vector3<f32>],
    neighbours: &Neighbours,
) -> Features {
    describe_by(points, normals, neighbours, simple_chunk, fast_chunk)
}

/// [`describe`] as compiled for the target's baseline.
pub fn describe_baseline(
    points: &[Point3<f32>],
    normals: &[Vector3<f32>],
    neighbours: &Neighbours,
) -> Features {
    describe_by(points, normals, neighbours, simple_chunk_inline, fast_chunk_inline)
}

fn describe_by(
    points: &[Point3<f32>],
    normals: &[Vector3<f32>],
    neighbours: &Neighbours,
    simple_chunk: impl Fn(&OrientedCloud, usize, &mut [Row]) + Sync,
    fast_chunk: impl Fn(&Neighbours, &[Row], usize, &mut [[f32; DIMENSIONS]]) + Sync,
) -> Features {
    let facing = |(p, n): (&Point3<f32>, &Vector3<f32>)| [p.x, p.y, p.z, n.x, n.y, n.z, 0.0, 0.0];
    let surface =
        OrientedCloud { facing: points.iter().zip(normals).map(facing).collect(), neighbours };
    let mut simple = vec![[0.0; STRIDE]; surface.facing.len()];
    let chunks = simple.par_chunks_mut(CHUNK).enumerate();
    chunks.for_each(|(chunk, rows)| simple_chunk(&surface, chunk * CHUNK, rows));
    let mut rows = vec![[0.0; DIMENSIONS]; simple.len()];
    let chunks = rows.par_chunks_mut(CHUNK).enumerate();
    chunks.for_each(|(chunk, rows)| fast_chunk(neighbours, &simple, chunk * CHUNK, rows));
    Features { rows }
}

dispatch! {
    /// The SPFH of the points from `first`.
    fn simple_chunk(surface: &OrientedCloud, first: usize, rows: &mut [Row]) = simple_chunk_inline;

    /// The FPFH of the points from `first`.
    fn fast_chunk(
        neighbours: &Neighbours,
        simple: &[Row],
        first: usize,
        rows: &mut [[f32; DIMENSIONS]],
    ) = fast_chunk_inline;
}

#[inline(always)]
fn simple_chunk_inline(surface: &OrientedCloud, first: usize, rows: &mut [Row]) {
    let (mut lanes, mut bins) = (PairLanes::EMPTY, [[0; LANES]; 3]);
    for (index, row) in (first..).zip(rows) {
        let point = &surface.facing[index];
        if has_normal(point) {
            let (counts, pairs) = count(surface, index, point, &mut lanes, &mut bins);
            let share = WHOLE / pairs.max(1) as f32;
            for (value, count) in row.iter_mut().zip(counts) {
                *value = share * count as f32;
            }
        }
    }
}

/// Counts of the pairs of a point in each bin, and of all.
#[inline(always)]
fn count(
    surface: &OrientedCloud,
    index: usize,
    point: &Facing,
    lanes: &mut PairLanes,
    bins: &mut PairBins,
) -> ([u32; DIMENSIONS], u32) {
    let (mut counts, mut pairs) = ([0; DIMENSIONS], 0);
    for block in surface.neighbours.row(index).0.chunks(LANES) {
        let mut filled = 0;
        for &other in block {
            let other = other as usize;
            let neighbour = &surface.facing[other];
            lanes.set(filled, point, neighbour);
            filled += usize::from(other != index && has_normal(neighbour));
        }
        lanes.bins([point[3], point[4], point[5]], bins);
        for lane in 0..filled {
            for (histogram, bins) in bins.iter().enumerate() {
                counts[histogram * BINS + usize::from(bins[lane])] += 1;
            }
        }
        pairs += filled as u32;
    }
    (counts, pairs)
}

#[inline(always)]
fn has_normal(facing: &Facing) -> bool {
    facing[3] != 0.0 || facing[4] != 0.0 || facing[5] != 0.0
}

#[inline(always)]
fn fast_chunk_inline(
    neighbours: &Neighbours,
    simple: &[Row],
    first: usize,
    rows: &mut [[f32; DIMENSIONS]],
) {
    for (index, row) in (first..).zip(rows) {
        let own = &simple[index];
        // A histogram that counted anything adds up to 100; else the point has no normal, or nobody
        // near.
        if own.iter().any(|value| *value > 0.0) {
            let sum = weighted_sum(neighbours.row(index), simple);
            finish(own, &sum, row);
        }
    }
}

/// Σ SPFH(q) r² / |p - q|², r the distance of the nearest apart: the shares are the same, and
/// nothing can overflow.
#[inline(always)]
fn weighted_sum((indices, squares): (&[u32], &[f32]), simple: &[Row]) -> Row {
    let mut sum = [0.0; STRIDE];
    let apart = squares.iter().copied().filter(|squared| *squared > 0.0);
    let nearest = apart.fold(f32::INFINITY, f32::min);
    for (&other, &squared) in indices.iter().zip(squares) {
        // The point itself and its duplicates have no weight.
        if squared > 0.0 {
            let weight = nearest / squared;
            for (sum, value) in sum.iter_mut().zip(&simple[other as usize]) {
                *sum += weight * value;
            }
        }
    }
    sum
}

#[inline(always)]
fn finish(own: &Row, sum: &Row, row: &mut [f32; DIMENSIONS]) {
    for histogram in 0..3 {
        let bins = histogram * BINS..(histogram + 1) * BINS;
        let total: f32 = sum[bins.clone()].iter().sum();
        // Less comes of neighbours without a normal that are nearer than all others by orders.
        let scale = if total > 1e-30 { WHOLE / total } else { 0.0 };
        for bin in bins {
            row[bin] = sum[bin] * scale + own[bin];
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
