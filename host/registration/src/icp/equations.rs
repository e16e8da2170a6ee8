//! What a chunk of pairs gives to a least squares, four pairs at a time.

use nalgebra::{Point3, Vector3};

use super::super::Observability;
use super::super::normal_equations::Step;
use super::pairing::CHUNK;

/// Pairs summed side by side: as many `f64` as a vector of AVX2 holds. Written out, so that each
/// build adds in the same order.
pub(crate) const LANES: usize = 4;

/// One number of four pairs.
pub(crate) type Lane = [f64; LANES];

/// Sums over pairs that a step is solved from.
pub(crate) trait Equations: Default + Send + Sync {
    /// Whether it wants the normals of source points.
    const SOURCE_NORMALS: bool;

    /// Adds pairs. Empty lanes hold zeros.
    fn add_all(&mut self, pairs: &Pairs);

    /// Adds the sums of other pairs.
    fn merge(self, other: &Self) -> Self;

    /// The step to the least squares, and which of its directions the pairs determine.
    fn solve(&self, degeneracy_threshold: f64) -> (Step, Observability);

    /// How many pairs.
    fn pairs(&self) -> usize;

    /// Root mean square distance of the pairs, m.
    fn rmse_m(&self) -> f64;

    /// Root mean square distance to the target's planes, m.
    fn plane_rmse_m(&self) -> f64;
}

/// The pairs of a chunk, in the target's frame, coordinate by coordinate.
pub(crate) struct Pairs {
    /// Where the source point is, m.
    s: [[f64; CHUNK]; 3],
    /// From the target point to the source point, m.
    d: [[f64; CHUNK]; 3],
    /// The target's normal.
    n: [[f64; CHUNK]; 3],
    /// The source's normal, turned as the source is; zeros where the method does not want it.
    m: [[f64; CHUNK]; 3],
    len: usize,
}

impl Default for Pairs {
    fn default() -> Self {
        let zeros = [[0.0; CHUNK]; 3];
        Self { s: zeros, d: zeros, n: zeros, m: zeros, len: 0 }
    }
}

/// Four pairs, or fewer and zeros.
#[derive(Clone, Copy)]
pub(crate) struct Group {
    /// As in [`Pairs`].
    pub(crate) s: [Lane; 3],
    /// As in [`Pairs`].
    pub(crate) d: [Lane; 3],
    /// As in [`Pairs`].
    pub(crate) n: [Lane; 3],
    /// As in [`Pairs`].
    pub(crate) m: [Lane; 3],
}

impl Pairs {
    /// Adds a pair; beyond [`CHUNK`] there is no room, and no chunk has more points.
    #[inline(always)]
    pub(crate) fn push(
        &mut self,
        s: &Vector3<f64>,
        q: &Point3<f32>,
        n: &Vector3<f32>,
        m: &Vector3<f64>,
    ) {
        if self.len >= CHUNK {
            return;
        }
        for axis in 0..3 {
            self.s[axis][self.len] = s[axis];
            self.d[axis][self.len] = s[axis] - f64::from(q[axis]);
            self.n[axis][self.len] = f64::from(n[axis]);
            self.m[axis][self.len] = m[axis];
        }
        self.len += 1;
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// All pairs, in groups of four.
    #[inline(always)]
    pub(crate) fn groups(&self) -> impl Iterator<Item = Group> {
        (0..self.len.div_ceil(LANES)).map(|group| Group {
            s: lanes(&self.s, group),
            d: lanes(&self.d, group),
            n: lanes(&self.n, group),
            m: lanes(&self.m, group),
        })
    }
}

#[inline(always)]
fn lanes(axes: &[[f64; CHUNK]; 3], group: usize) -> [Lane; 3] {
    std::array::from_fn(|axis| axes[axis].as_chunks().0[group])
}

/// `a · b` of each lane.
#[inline(always)]
pub(crate) fn dot(a: &[Lane; 3], b: &[Lane; 3]) -> Lane {
    std::array::from_fn(|k| a[0][k] * b[0][k] + a[1][k] * b[1][k] + a[2][k] * b[2][k])
}

/// `a × b` of each lane.
#[inline(always)]
pub(crate) fn cross(a: &[Lane; 3], b: &[Lane; 3]) -> [Lane; 3] {
    let part = |i: usize, j: usize| std::array::from_fn(|k| a[i][k] * b[j][k] - a[j][k] * b[i][k]);
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// Adds `a b`, lane by lane.
#[inline(always)]
pub(crate) fn add_product(sum: &mut Lane, a: &Lane, b: &Lane) {
    for k in 0..LANES {
        sum[k] += a[k] * b[k];
    }
}

/// The sum of the lanes.
pub(crate) fn total(lane: &Lane) -> f64 {
    (lane[0] + lane[1]) + (lane[2] + lane[3])
}
