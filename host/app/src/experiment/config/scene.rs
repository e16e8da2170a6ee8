//! `[scene]`: where to scan.

use serde::{Deserialize, Serialize};

/// Where to scan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SceneConfig {
    /// `structured`, `semi-structured`, `unstructured`, or a mesh: PLY or OBJ, metres, z up.
    pub source: String,
    /// Seeds of the generated towns; the pairs are shared out among them. There are no more towns
    /// than `train_pairs` or `test_pairs`, whichever is less: the others are left out.
    pub towns: Vec<u64>,
    /// Ground below a mesh: `auto` (fitted when the mesh has none), `none`, or the plane z = a·x +
    /// b·y + c as `a,b,c`.
    pub ground: String,
}

impl Default for SceneConfig {
    fn default() -> Self {
        Self { source: "structured".into(), towns: vec![1, 2, 3], ground: "auto".into() }
    }
}
