//! Which matches keep their distance: the test that a graph of `n` matches runs `n²/2` times.

use echoloop_dispatch::has_v3;
use nalgebra::Point3;

use crate::features::PointPair;

/// Matches to a word of a row.
pub(super) const WORD: usize = u64::BITS as usize;

/// Rounding of a distance in `f32`, in units of the largest coordinate times 2⁻²⁴: six for the
/// coordinates' own rounding, some twenty for the arithmetic, and room.
const ROUNDING_UNITS: f32 = 64.0;

/// How much two matches disagree about the distance between their points, m.
///
/// ```text
/// d = | |xᵢ - xⱼ| - |yᵢ - yⱼ| |      x in the source, y in the target
/// ```
///
/// A rigid motion that lays both matches within ε keeps d below 2ε.
pub(super) fn stretch_m(a: &PointPair, b: &PointPair) -> f64 {
    ((a.source - b.source).norm() - (a.target - b.target).norm()).abs()
}

/// One end of a match.
type Side = fn(&PointPair) -> Point3<f64>;

/// Matches as six arrays of `f32` about their centroids, padded to whole words.
#[derive(Clone, Debug)]
pub(super) struct Lanes {
    coordinates: [Vec<f32>; 6],
    len: usize,
    /// What `f32` may add to or take from a stretch, m.
    rounding_m: f32,
}

impl Lanes {
    /// Of finite pairs.
    pub(super) fn of(pairs: &[PointPair]) -> Self {
        let padded = pairs.len().next_multiple_of(WORD);
        let centre = |point: Side, axis: usize| {
            pairs.iter().map(|pair| point(pair)[axis] / pairs.len() as f64).sum::<f64>()
        };
        let lane = |point: Side, axis: usize| {
            let centre = centre(point, axis);
            let mut lane: Vec<f32> =
                pairs.iter().map(|pair| (point(pair)[axis] - centre) as f32).collect();
            lane.resize(padded, 0.0);
            lane
        };
        let (x, y): (Side, Side) = (|pair| pair.source, |pair| pair.target);
        let coordinates = [lane(x, 0), lane(x, 1), lane(x, 2), lane(y, 0), lane(y, 1), lane(y, 2)];
        let largest = coordinates.iter().flatten().fold(0.0f32, |largest, v| largest.max(v.abs()));
        Self {
            coordinates,
            len: pairs.len(),
            rounding_m: largest * f32::EPSILON / 2.0 * ROUNDING_UNITS,
        }
    }

    /// Words of a row.
    pub(super) fn words(&self) -> usize {
        self.len.div_ceil(WORD)
    }

    /// Writes, from word `first` of row `i`, which matches may disagree with match `i` by less than
    /// `max_m`: all that do, and few that do not, as the test is in `f32` and wider by its
    /// rounding. Bits past the last match are 0.
    pub(super) fn candidates(&self, i: usize, first: usize, max_m: f32, row: &mut [u64]) {
        let bound_m = max_m + self.rounding_m;
        #[cfg(target_arch = "x86_64")]
        if has_v3() {
            // SAFETY: the features that it is compiled for have just been found on this processor.
            unsafe { candidates_v3(self, i, first, bound_m, row) };
            return self.trim(row);
        }
        candidates(self, i, first, bound_m, row);
        self.trim(row);
    }

    /// [`Self::candidates`] as compiled for the target's baseline.
    #[cfg(test)]
    pub(super) fn candidates_baseline(&self, i: usize, first: usize, max_m: f32, row: &mut [u64]) {
        candidates(self, i, first, max_m + self.rounding_m, row);
        self.trim(row);
    }

    /// Clears the bits of the padding.
    fn trim(&self, row: &mut [u64]) {
        if let (Some(last), rest @ 1..) = (row.last_mut(), self.len % WORD) {
            *last &= (1 << rest) - 1;
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn candidates_v3(lanes: &Lanes, i: usize, first: usize, bound_m: f32, row: &mut [u64]) {
    candidates(lanes, i, first, bound_m, row);
}

#[inline(always)]
fn candidates(lanes: &Lanes, i: usize, first: usize, bound_m: f32, row: &mut [u64]) {
    let words = lanes.coordinates.each_ref().map(|lane| lane.as_chunks::<WORD>().0);
    let here = lanes.coordinates.each_ref().map(|lane| lane[i]);
    for (word, bits) in (first..).zip(row) {
        *bits = word_of(words.map(|lane| &lane[word]), here, bound_m);
    }
}

#[inline(always)]
fn word_of(lanes: [&[f32; WORD]; 6], here: [f32; 6], bound_m: f32) -> u64 {
    let mut outside = [0u8; WORD];
    for k in 0..WORD {
        let d = |lane: usize| lanes[lane][k] - here[lane];
        let x = (d(0) * d(0) + d(1) * d(1) + d(2) * d(2)).sqrt();
        let y = (d(3) * d(3) + d(4) * d(4) + d(5) * d(5)).sqrt();
        // What is not a number may be anything: the exact test decides.
        outside[k] = u8::from((x - y).abs() >= bound_m);
    }
    let bytes = outside.as_chunks::<8>().0;
    (0..8).fold(0, |bits, byte| bits | inside(bytes[byte]) << (8 * byte))
}

/// Eight bytes of 0 or 1 as eight bits, inverted: the multiplication moves byte `k` to bit
/// `56 + k`.
#[inline(always)]
fn inside(outside: [u8; 8]) -> u64 {
    (u64::from_le_bytes(outside).wrapping_mul(0x0102_0408_1020_4080) >> 56) ^ 0xff
}
