//! Which of the builds of the inner loops runs.

/// The fastest code that this processor runs; all give the same bytes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Build {
    /// The target's baseline.
    Baseline,
    /// x86-64-v3, found on this processor.
    #[cfg(target_arch = "x86_64")]
    V3(V3),
}

/// Exists only where x86-64-v3 has been found.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub(super) struct V3(());

impl Build {
    pub(super) fn found() -> Self {
        #[cfg(target_arch = "x86_64")]
        if echoloop_dispatch::has_v3() {
            return Self::V3(V3(()));
        }
        Self::Baseline
    }
}
