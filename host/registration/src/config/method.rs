//! The methods.

use serde::{Deserialize, Serialize};

/// A registration method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Point-to-plane ICP: local, starts at an initial guess.
    #[default]
    Icp,
    /// Generalised ICP: local, plane to plane.
    Gicp,
    /// Fast global registration on FPFH features: needs no initial guess.
    Fgr,
    /// Maximal cliques of compatible FPFH matches: needs no initial guess.
    Mac,
}

impl Method {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Icp, Self::Gicp, Self::Fgr, Self::Mac];

    /// What it is, in a line of help.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Icp => "Point-to-plane ICP: local, starts at an initial guess",
            Self::Gicp => "Generalised ICP: local, plane to plane",
            Self::Fgr => "Fast global registration on FPFH features: needs no initial guess",
            Self::Mac => "Maximal cliques of compatible FPFH matches: needs no initial guess",
        }
    }

    /// Name on the command line, in files and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Icp => "icp",
            Self::Gicp => "gicp",
            Self::Fgr => "fgr",
            Self::Mac => "mac",
        }
    }

    /// Whether it searches all motions, and so needs no initial guess.
    pub fn is_global(self) -> bool {
        matches!(self, Self::Fgr | Self::Mac)
    }
}
