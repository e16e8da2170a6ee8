//! Saturation and baseline: codes become fractions of full scale around the ambient light.

/// Clips codes at the saturation level and removes the ambient light.
///
/// ```text
/// x[n] = (min(code[n], S) << (15 − b)) − a
/// ```
///
/// | name | meaning | format | shape |
/// |---|---|---|---|
/// | `code` | ADC codes, b bits | integers | `[N]` |
/// | `S` | saturation level | code | scalar |
/// | `a` | ambient | Q1.15, saturating | scalar |
/// | `x` | fraction of full scale | Q1.15, saturating | `[N]` |
///
/// Exact: nothing is rounded, and with b ≤ 14 and S within full scale nothing saturates. A shifted
/// code beyond full scale wraps. The portable form of
/// [`SampleLoops::remove_baseline`](crate::SampleLoops::remove_baseline).
#[inline(always)]
pub fn remove(codes: &[u16], clip_code: u16, shift: u32, ambient: i16, x: &mut [i16]) {
    for (x, &code) in x.iter_mut().zip(codes) {
        *x = of(code, clip_code, shift, ambient);
    }
}

/// One sample of [`remove`].
#[inline(always)]
pub fn of(code: u16, clip_code: u16, shift: u32, ambient: i16) -> i16 {
    ((code.min(clip_code) << shift) as i16).saturating_sub(ambient)
}
