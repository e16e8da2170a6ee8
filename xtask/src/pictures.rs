//! `cargo xtask pictures`: pictures of scenes for `docs/scenes.md`. Those on CARLA's roads need its
//! files, which `ECHOLOOP_DATA` names.

use anyhow::{Context, Result};

use crate::shell::{build_release, built, cargo, echoloop, succeed, workspace};

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

/// Kinds of scene, and their names in the picture.
const KINDS: [(&str, &str); 3] =
    [("semi-structured", "Suburbs"), ("unstructured", "Woods"), ("structured", "Streets")];

/// `cargo xtask beams`: the default run in each kind of scene, two minutes each, and its beams
/// before and after, one below the other.
pub(crate) fn beams() -> Result<()> {
    build_release()?;
    let folder = built(&workspace()?).join("beams");
    std::fs::create_dir_all(&folder)?;
    let (mut drawings, mut top) = (String::new(), 0.0);
    for (kind, name) in KINDS {
        succeed(echoloop()?.args(["tune", "--scene", kind, "--runs"]).arg(folder.join(kind)))?;
        let (run, charts) = (folder.join(kind).join("latest"), folder.join(kind).join("charts"));
        let page = folder.join(kind).join("report.html");
        let mut report = echoloop()?;
        report.arg("report").arg(run).arg("--figures").arg(&charts).arg("-o").arg(page);
        succeed(&mut report)?;
        for (which, title) in [("default", "by default"), ("tuned", "tuned")] {
            let svg = std::fs::read_to_string(charts.join(format!("beams-{which}.svg")))?;
            let (drawing, height) = placed(&svg, &format!("{name}, {title}"), top)?;
            drawings += &drawing;
            top += height;
        }
    }
    let page = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {top}\" role=\"img\">\
         <title>Beams by default and tuned</title>{drawings}</svg>\n"
    );
    std::fs::write(workspace()?.join("docs/figures/beams.svg"), page)?;
    Ok(())
}

/// Width of a chart of the beams, pixels.
const WIDTH: f64 = 740.0;

/// A chart at this distance from the top under another title, and its height, pixels.
fn placed(svg: &str, title: &str, top: f64) -> Result<(String, f64)> {
    let height = svg.split("height=\"").nth(1).and_then(|rest| rest.split('"').next());
    let height: f64 = height.context("a chart without a height")?.parse()?;
    let own = ["Beams: default", "Beams: tuned"];
    let titled = own.iter().fold(svg.to_owned(), |svg, own| svg.replace(own, title));
    Ok((titled.replacen("<svg ", &format!("<svg y=\"{top}\" "), 1), height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_is_placed_below_those_before_it_under_its_own_title() {
        let svg = "<svg width=\"740\" height=\"12.5\"><text>Beams: tuned</text></svg>";
        let (placed, height) = placed(svg, "Woods, tuned", 30.0).unwrap();
        let expected =
            "<svg y=\"30\" width=\"740\" height=\"12.5\"><text>Woods, tuned</text></svg>";
        assert_eq!((placed.as_str(), height), (expected, 12.5));
    }

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
