//! Groups of outputs of a filter, of the length that registers hold.

/// Calls `group` for each `length` outputs that `padded` and `y` hold, with a pointer to the
/// `taps.len() + length` samples that they depend on and one to room for them; returns the number
/// of outputs.
#[inline(always)]
pub(super) fn in_groups(
    length: usize,
    taps: &[i16],
    padded: &[i16],
    y: &mut [i16],
    mut group: impl FnMut(*const i16, *mut i16),
) -> usize {
    let mut done = 0;
    let windows = padded.windows(taps.len() + length).step_by(length);
    for (y, window) in y.chunks_exact_mut(length).zip(windows) {
        group(window.as_ptr(), y.as_mut_ptr());
        done += length;
    }
    done
}
