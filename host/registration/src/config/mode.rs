//! The two modes of fast global registration.

use echoloop_parameters::choice;

choice! {
    /// Mode of fast global registration.
    pub enum FgrMode by default Annealed {
        /// As the paper of Zhou, Park and Koltun (ECCV 2016) has it, μ falling from the squared
        /// size of the matches to δ²; with triples counted instead of drawn, by an absolute bound,
        /// and a last fit to all matches.
        Annealed = "annealed",
        /// As Open3D 0.20 runs it from Python with its defaults: μ starts at the clouds' radius in
        /// metres on points scaled to radius 1, and never falls. The paper's baseline; poor on
        /// outdoor scans.
        Open3d = "open3d",
    }
}
