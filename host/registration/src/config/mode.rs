//! The two modes of fast global registration.

use serde::{Deserialize, Serialize};

use super::choice::choice;

choice! {
    /// Mode of fast global registration.
    FgrMode {
        #[default]
        Annealed "annealed"
            "As the paper of Zhou, Park and Koltun (ECCV 2016) has it, μ falling from the squared \
             size of the matches to δ²; with triples counted instead of drawn, by an absolute \
             bound, and a last fit to all matches"
        Open3d "open3d"
            "As Open3D 0.20 runs it from Python with its defaults: μ starts at the clouds' radius \
             in metres on points scaled to radius 1, and never falls. The paper's baseline; poor \
             on outdoor scans"
    }
}
