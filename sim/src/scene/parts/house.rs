//! Description of a house: its dimensions, its surfaces, the shape of its roof.

use super::Surface;

/// Shape of a roof.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Roof {
    /// Two slopes, ridge along the width; rise over run.
    Gable(f64),
    /// Four slopes; rise over run.
    Hip(f64),
    /// Flat with a parapet.
    Flat,
}

/// House; x runs along its front, which faces −y; lengths in metres.
#[derive(Clone, Debug)]
pub(crate) struct House {
    pub(crate) width_m: f64,
    pub(crate) depth_m: f64,
    pub(crate) floors: usize,
    pub(crate) floor_m: f64,
    /// Distance from window to window.
    pub(crate) bay_m: f64,
    pub(crate) roof: Roof,
    pub(crate) wall: Surface,
    pub(crate) roof_surface: Surface,
    /// True for each side with windows: front, right, back, left.
    pub(crate) open: [bool; 4],
    pub(crate) balconies: bool,
    pub(crate) shop: bool,
}

impl House {
    pub(crate) fn height_m(&self) -> f64 {
        self.floors as f64 * self.floor_m
    }
}
