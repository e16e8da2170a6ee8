//! The methods.

use serde::{Deserialize, Serialize};

use super::choice::choice;

choice! {
    /// A registration method.
    Method {
        #[default]
        Icp "icp" "Point-to-plane ICP: local, starts at an initial guess"
        Gicp "gicp" "Generalised ICP: local, plane to plane"
        Fgr "fgr" "Fast global registration on FPFH features: needs no initial guess"
        Mac "mac" "Maximal cliques of compatible FPFH matches: needs no initial guess"
        Auto "auto" "Candidates of several scales, judged on the points of both clouds, then GICP"
    }
}

impl Method {
    /// Whether it takes no initial guess and leaves the last decimetres to a local method.
    pub fn is_rough(self) -> bool {
        matches!(self, Self::Fgr | Self::Mac)
    }

    /// Whether it searches all motions, and so needs no initial guess.
    pub fn is_global(self) -> bool {
        matches!(self, Self::Fgr | Self::Mac | Self::Auto)
    }
}
