//! Loops of a rising gain, compiled for AVX2: baseline removal, and samples brought to one gain.

use core::ops::Range;

use echoloop_dsp::near::Near;

/// [`Near::remove_baseline`].
#[inline(never)]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(super) fn remove_baseline(
    near: &Near<'_>,
    codes: &[u16],
    samples: Range<usize>,
    x: &mut [i16],
) {
    near.remove_baseline(codes, samples, x);
}

/// [`Near::level`].
#[inline(never)]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
pub(super) fn level(near: &Near<'_>, at: usize, samples: Range<usize>, x: &mut [i16]) {
    near.level(at, samples, x);
}
