//! Numbers of four pairs at a time.

/// Pairs summed side by side: as many `f64` as a vector of AVX2 holds. Written out, so that each
/// build adds in the same order.
pub(crate) const LANES: usize = 4;

/// One number of four pairs.
pub(crate) type Lane = [f64; LANES];

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
