//! Whose fast global registration.

use serde::{Deserialize, Serialize};

/// Whose fast global registration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FgrMode {
    /// As the paper of Zhou, Park and Koltun (ECCV 2016) has it, μ falling from the squared size of
    /// the matches to δ²; with triples counted instead of drawn, by an absolute bound, and a last
    /// fit to all matches.
    #[default]
    Annealed,
    /// As Open3D 0.20 runs it from Python with its defaults: μ starts at the clouds' radius in
    /// metres on points scaled to radius 1, and never falls. The paper's baseline; poor on outdoor
    /// scans.
    Open3d,
}

impl FgrMode {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Annealed, Self::Open3d];

    /// Name on the command line, in files and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Annealed => "annealed",
            Self::Open3d => "open3d",
        }
    }

    /// What it is, in a line of help.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Annealed => {
                "As the paper of Zhou, Park and Koltun (ECCV 2016) has it, μ falling from the \
                 squared size of the matches to δ²; with triples counted instead of drawn, by an \
                 absolute bound, and a last fit to all matches"
            }
            Self::Open3d => {
                "As Open3D 0.20 runs it from Python with its defaults: μ starts at the clouds' \
                 radius in metres on points scaled to radius 1, and never falls. The paper's \
                 baseline; poor on outdoor scans"
            }
        }
    }
}
