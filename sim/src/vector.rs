//! Arithmetic on three coordinates, in a fixed order of operations: the pinned bytes of scenes and
//! scans depend on every bit of it.

use std::ops::{Add, Mul, Sub};

/// Coordinates: `f32` in meshes and rays, `f64` while a scene is built.
pub(crate) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
}

impl Real for f32 {}
impl Real for f64 {}

/// `a − b`.
#[inline(always)]
pub(crate) fn sub<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a · b`.
#[inline(always)]
pub(crate) fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a × b`.
#[inline(always)]
pub(crate) fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `a + (b − a) t`.
pub(crate) fn mix<T: Real>(a: [T; 3], b: [T; 3], t: T) -> [T; 3] {
    [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * t)
}
