//! The pairs of a chunk, coordinate by coordinate, for loops over four of them.

use nalgebra::{Point3, Vector3};

use super::kernel::Kernel;
use super::lanes::{LANES, Lane, dot};

/// Points a thread takes at a time. Sums are per chunk and added in order: the same bytes on any
/// number of threads.
pub(crate) const CHUNK: usize = 256;

/// The pairs of a chunk, in the target's frame, coordinate by coordinate.
#[derive(Clone, PartialEq)]
pub(crate) struct Pairs {
    /// The source point, m.
    s: [[f64; CHUNK]; 3],
    /// From the target point to the source point, m.
    d: [[f64; CHUNK]; 3],
    /// The target's normal.
    n: [[f64; CHUNK]; 3],
    /// The source's normal, turned as the source is; zeros where the method does not want it.
    m: [[f64; CHUNK]; 3],
    /// Variance of the distance from the plane due to the errors of both ranges, m².
    noise_m2: [f64; CHUNK],
    len: usize,
}

impl Default for Pairs {
    fn default() -> Self {
        let zeros = [[0.0; CHUNK]; 3];
        Self { s: zeros, d: zeros, n: zeros, m: zeros, noise_m2: [0.0; CHUNK], len: 0 }
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
    /// From the target's plane to the source point, m: `n · d`.
    pub(crate) r: Lane,
    /// Weight of each pair; 0 in a lane without one.
    pub(crate) w: Lane,
}

impl Pairs {
    /// Adds a pair; beyond [`CHUNK`] there is no room, and no chunk has more points.
    #[inline(always)]
    pub(crate) fn push(
        &mut self,
        s: &Vector3<f64>,
        q: &Point3<f32>,
        n: &Vector3<f64>,
        m: &Vector3<f64>,
        noise_m2: f32,
    ) {
        if self.len >= CHUNK {
            return;
        }
        for axis in 0..3 {
            self.s[axis][self.len] = s[axis];
            self.d[axis][self.len] = s[axis] - f64::from(q[axis]);
            self.n[axis][self.len] = n[axis];
            self.m[axis][self.len] = m[axis];
        }
        self.noise_m2[self.len] = f64::from(noise_m2);
        self.len += 1;
    }

    /// Count of the pairs.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// All pairs, in groups of four, with the weights of their residuals.
    #[inline(always)]
    pub(crate) fn groups(&self, kernel: Kernel) -> impl Iterator<Item = Group> {
        (0..self.len.div_ceil(LANES)).map(move |group| {
            let (d, n) = (lanes(&self.d, group), lanes(&self.n, group));
            let r = dot(&n, &d);
            let left = self.len - group * LANES;
            let noise: Lane = self.noise_m2.as_chunks().0[group];
            let weight = |k: usize| kernel.weight(r[k], noise[k]);
            let w = std::array::from_fn(|k| if k < left { weight(k) } else { 0.0 });
            Group { s: lanes(&self.s, group), d, n, m: lanes(&self.m, group), r, w }
        })
    }

    /// Adds the distance of each source point from its target's plane, m.
    pub(crate) fn residuals(&self, to: &mut Vec<f32>) {
        let of = |i: usize| (0..3).map(|axis| self.n[axis][i] * self.d[axis][i]).sum::<f64>();
        to.extend((0..self.len).map(|i| of(i).abs() as f32));
    }
}

#[inline(always)]
fn lanes(axes: &[[f64; CHUNK]; 3], group: usize) -> [Lane; 3] {
    std::array::from_fn(|axis| axes[axis].as_chunks().0[group])
}
