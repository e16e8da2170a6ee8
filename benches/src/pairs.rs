//! Scan pairs of a folder that `echoloop pairs` made.

use std::path::Path;

use echoloop_clouds::pose::{Pose, read_pose};
use echoloop_clouds::{Cloud, read_cloud};

/// Two scans, and their true motion.
pub struct Pair {
    /// The first scan.
    pub target: Cloud,
    /// The second.
    pub source: Cloud,
    /// `target_from_source`.
    pub truth: Pose,
}

/// The pairs that a folder's `pairs.json` lists.
///
/// # Errors
///
/// A file that is missing or cannot be read.
pub fn read_pairs(folder: &Path) -> crate::Result<Vec<Pair>> {
    let text = std::fs::read_to_string(folder.join("pairs.json"))?;
    let document: serde_json::Value = serde_json::from_str(&text)?;
    let entries = document["pairs"].as_array().ok_or("pairs.json lists no pairs")?;
    let pair = |entry: &serde_json::Value| -> crate::Result<Pair> {
        let name = entry["name"].as_str().ok_or("a pair has no name")?;
        let cloud = |end: &str| read_cloud(&folder.join(format!("{name}_{end}.ply")));
        let truth = read_pose(&folder.join(format!("{name}_target_from_source.txt")))?;
        Ok(Pair { target: cloud("target")?.0, source: cloud("source")?.0, truth })
    };
    entries.iter().map(pair).collect()
}
