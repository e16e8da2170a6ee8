//! A value as it was recorded and as it was measured now.

use super::book::Figure;

/// One value of a figure, measured again.
pub(super) struct Compared<'a> {
    pub(super) figure: &'a Figure,
    pub(super) value: &'a str,
    pub(super) recorded: &'a str,
    pub(super) measured: String,
}

impl Compared<'_> {
    /// Whether they are printed alike: same seed, same bytes.
    pub(super) fn same(&self) -> bool {
        self.recorded == self.measured
    }
}
