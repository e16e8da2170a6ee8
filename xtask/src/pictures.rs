//! `cargo xtask pictures`: pictures of scenes for `docs/scenes.md`. Those on CARLA's roads need its
//! files, which `ECHOLOOP_DATA` names.

use anyhow::Result;

use crate::shell::{cargo, workspace};

/// Scenes of `echoloop scene`, and the width of each picture, pixels, so that none has more than
/// 150 kB. A picture has its scene's name.
#[rustfmt::skip]
const SCENES: [(&str, &str); 12] = [
    ("structured", "768"), ("semi-structured", "768"), ("unstructured", "768"),
    ("town01", "768"), ("town10hd", "768"), ("old-town", "768"),
    ("town07", "768"), ("garden-suburb", "768"), ("hillside", "768"),
    ("forest-hills", "640"), ("rocky-valley", "640"), ("lake-shore", "640"),
];

const FOLDER: &str = "docs/pictures";

pub(crate) fn run() -> Result<()> {
    std::fs::create_dir_all(workspace()?.join(FOLDER))?;
    for (scene, width) in SCENES {
        let file = format!("{FOLDER}/{scene}.png");
        let build = ["run", "--quiet", "--package", "echoloop-app", "--bin", "echoloop", "--"];
        let draw = ["scene", scene, "--quiet", "--picture", &file, "--width", width];
        cargo([&build[..], &draw].concat())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_picture_is_there_is_shown_and_has_at_most_150_kb() {
        let root = workspace().unwrap();
        let page = std::fs::read_to_string(root.join("docs/scenes.md")).unwrap();
        for (scene, _) in SCENES {
            let size = root.join(format!("{FOLDER}/{scene}.png")).metadata().unwrap().len();
            assert!((10_000..=150_000).contains(&size), "{scene}: {size} bytes");
            assert!(page.contains(&format!("](pictures/{scene}.png)")), "{scene} is not shown");
        }
        let files = std::fs::read_dir(root.join(FOLDER)).unwrap().count();
        assert_eq!(files, SCENES.len(), "a picture of something else");
    }
}
