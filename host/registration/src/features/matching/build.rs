//! The build of the inner loops, chosen by the processor.

use super::kernel::Portable;
use super::rotation::{Rotated, Rotation, rotate, rotate_plain};
use super::row::Row;
use super::search::{Group, TreeSearch, search};

/// The loops that are compiled more than once; all builds give the same bytes.
#[derive(Clone, Copy)]
pub(super) struct Build {
    pub(super) rotate: fn(&Rotation, &[Row]) -> Vec<Rotated>,
    pub(super) search: fn(&mut Group, &TreeSearch),
}

impl Build {
    /// The fastest build for this processor.
    pub(super) const FASTEST: Self = Self { rotate, search };

    /// The build for any processor.
    pub(super) const PLAIN: Self =
        Self { rotate: rotate_plain, search: |group, down| group.search_with(down, Portable) };
}
