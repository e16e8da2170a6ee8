//! `[scene]`: scene to scan.

use std::fmt::Display;

use echoloop_files::one_line;
use echoloop_parameters::{Bounds, Refused, choice, section};
use echoloop_sim::import::{Ground, ImportOptions, Libraries, Plane, Tags};
use echoloop_sim::scene::SceneKind;
use serde::{Deserialize, Serialize};

const GROUND: Bounds = Bounds::Words("auto, none, or a plane as a,b,c");
const TAGS: Bounds = Bounds::OneOf(&Tags::NAMES);
const LIBRARIES: Bounds = Bounds::OneOf(&["beside", "anywhere", "none"]);
const DRESSING: Bounds = Bounds::OneOf(&["structured", "semi-structured"]);

section! {
    /// Scene to scan.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, expecting = "a table, [scene]")]
    pub struct SceneConfig in "scene" {
        source: String, "",
            Bounds::Words("structured, semi-structured, unstructured, a town's name, or a file"),
            "What is scanned: a kind of small town that is generated; `town01`, `town10hd`, \
             `old-town`, `town07`, `garden-suburb`, `hillside`, `forest-hills`, `rocky-valley` or \
             `lake-shore`, or the three of a kind as `structured-towns`; the roads of an \
             OpenDRIVE file (`.xodr`); or a mesh: PLY, OBJ, glTF or STL, metres, z up; or a folder \
             of recorded scans.";
        towns: Vec<u64>, "", Bounds::count(1.0, 100.0, "seeds"),
            "Seeds of the generated towns, and of what stands on the roads of a file; the pairs \
             are shared out among them. There are no more towns than `train_pairs` or \
             `test_pairs`, whichever is less: the others are left out.";
        ground: String, "", GROUND,
            "Ground below a mesh: `auto` (fitted when the mesh has none), `none`, or the plane \
             z = a·x + b·y + c as `a,b,c`.";
        tags: String, "", TAGS,
            "What the numbers of classes in recorded scans mean: those of CARLA 0.9.14 and later, \
             or of 0.9.11 to 0.9.13.";
        libraries: String, "", LIBRARIES,
            "Files that a mesh may name, an OBJ's material libraries or a glTF's buffers: `beside` \
             (in its own folder and below), `anywhere` or `none`.";
        stored: String, "", Bounds::Words("a file that `echoloop store` wrote, or empty"),
            "Pairs to read instead of tracing them (`--stored FILE`). They must be those of this \
             configuration. Empty: none.";
        mirrors: Mirrors, "", Mirrors::BOUNDS,
            "Surfaces that mirror others: `none`, `glass`, or `wet`, glass and wet streets, which \
             are darker as well. Not with recorded scans.";
        retroreflectors: Retroreflectors, "", Retroreflectors::BOUNDS,
            "Signs and plates: `dim`, 50 times white, or `bright`, 1,131 times, as sheeting is, \
             with ghosts at twice the range, and glare in beams that are fired at one moment. \
             Not with recorded scans.";
        interference: Interference, "", Interference::BOUNDS,
            "Another LiDAR: `none`, or `flash`, that of a vehicle 5 to 25 m away, which fires into \
             one shot in twelve at any moment. Not with `receiver.mode` = `litl-compat`, nor with \
             recorded scans.";
        dressing: String, "", DRESSING,
            "What stands along the roads of an OpenDRIVE file: `structured` (houses wall to wall) \
             or `semi-structured` (houses in gardens).";
    }
}

choice! {
    /// Surfaces in which others are seen.
    pub enum Mirrors by default None {
        /// None.
        None = "none",
        /// Panes of glass.
        Glass = "glass",
        /// Glass, and streets under a film of water.
        Wet = "wet",
    }
}

choice! {
    /// Other LiDARs.
    pub enum Interference by default None {
        /// None.
        None = "none",
        /// A flash LiDAR of another vehicle.
        Flash = "flash",
    }
}

choice! {
    /// Brightness of signs and plates.
    pub enum Retroreflectors by default Dim {
        /// As far as the receiver is not dazzled.
        Dim = "dim",
        /// As sheeting is, with what it does to the receiver.
        Bright = "bright",
    }
}

impl Default for SceneConfig {
    fn default() -> Self {
        Self {
            source: "semi-structured".into(),
            towns: vec![1, 2, 3],
            ground: "auto".into(),
            tags: Tags::NAMES[0].into(),
            libraries: "beside".into(),
            stored: String::new(),
            mirrors: Mirrors::None,
            retroreflectors: Retroreflectors::Dim,
            interference: Interference::None,
            dressing: "structured".into(),
        }
    }
}

impl SceneConfig {
    /// Options for reading a mesh.
    ///
    /// # Errors
    ///
    /// [`Refused`] names `scene.ground` or `scene.libraries`.
    pub fn import(&self) -> Result<ImportOptions, Refused> {
        let usual = ImportOptions::default();
        Ok(ImportOptions {
            ground: self.ground(usual.max_reach_m)?,
            libraries: self.libraries()?,
            ..usual
        })
    }

    /// Buildings along the roads of a file.
    ///
    /// # Errors
    ///
    /// [`Refused`] names `scene.dressing`.
    pub fn dressing(&self) -> Result<SceneKind, Refused> {
        match &*self.dressing {
            "structured" => Ok(SceneKind::Structured),
            "semi-structured" => Ok(SceneKind::SemiStructured),
            other => Err(refused("scene.dressing", other, DRESSING)),
        }
    }

    /// Meaning of the class numbers in recorded scans.
    ///
    /// # Errors
    ///
    /// [`Refused`] names `scene.tags`.
    pub fn tags(&self) -> Result<Tags, Refused> {
        Tags::named(&self.tags).ok_or_else(|| refused("scene.tags", &self.tags, TAGS))
    }

    pub(super) fn check(&self) -> Result<(), Refused> {
        self.import()?;
        self.dressing()?;
        self.tags()?;
        self.check_keys()
    }

    fn ground(&self, max_reach_m: f32) -> Result<Ground, Refused> {
        let numbers = || -> Option<[f64; 3]> {
            let numbers = self.ground.split(',').map(|part| part.trim().parse().ok());
            numbers.collect::<Option<Vec<f64>>>()?.try_into().ok()
        };
        let refused = || {
            let expected = format!(
                "{GROUND} (z = a·x + b·y + c) with a and b within ±1 and c within ±{max_reach_m} m"
            );
            refused("scene.ground", &self.ground, expected)
        };
        match &*self.ground {
            "auto" => Ok(Ground::Auto),
            "none" => Ok(Ground::None),
            _ => {
                let plane = numbers().map(|[a, b, c]| Plane { a, b, c });
                plane.filter(|p| p.is_ground(max_reach_m)).map(Ground::Plane).ok_or_else(refused)
            }
        }
    }

    fn libraries(&self) -> Result<Libraries, Refused> {
        match &*self.libraries {
            "beside" => Ok(Libraries::Beside),
            "anywhere" => Ok(Libraries::Anywhere),
            "none" => Ok(Libraries::None),
            other => Err(refused("scene.libraries", other, LIBRARIES)),
        }
    }
}

/// Refusal of a text.
fn refused(key: &'static str, value: &str, expected: impl Display) -> Refused {
    Refused::new(key, format_args!("{:?}", one_line(value)), expected)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(ground: &str, libraries: &str) -> Result<ImportOptions, String> {
        let (ground, libraries) = (ground.to_owned(), libraries.to_owned());
        let config = SceneConfig { ground, libraries, ..SceneConfig::default() };
        config.import().map_err(|error| error.to_string())
    }

    #[test]
    fn the_defaults_are_those_of_the_importer() {
        assert_eq!(SceneConfig::default().import(), Ok(ImportOptions::default()));
    }

    #[test]
    fn a_ground_is_a_word_or_a_plane_of_three_numbers_in_bounds() {
        let ground = of("0.1, -0.2,3", "none").map(|options| (options.ground, options.libraries));
        let plane = Plane { a: 0.1, b: -0.2, c: 3.0 };
        assert_eq!(ground, Ok((Ground::Plane(plane), Libraries::None)));
        for bad in
            ["", "lawn", "0,0", "0,0,0,0", "nan,0,0", "inf,0,0", "1e38,0,0", "0,-2,0", "0,0,5001"]
        {
            let said = of(bad, "beside").unwrap_err();
            assert!(said.starts_with(&format!("scene.ground = {bad:?} must be auto")), "{said}");
        }
        let said = of("auto", "here").unwrap_err();
        assert_eq!(said, "scene.libraries = \"here\" must be one of beside, anywhere, none");
    }

    #[test]
    fn roads_are_dressed_as_one_of_two_kinds() {
        let of = |dressing: &str| {
            let config = SceneConfig { dressing: dressing.into(), ..SceneConfig::default() };
            config.dressing().map_err(|error| error.to_string())
        };
        assert_eq!(of("semi-structured"), Ok(SceneKind::SemiStructured));
        let said = of("unstructured").unwrap_err();
        let bad = "scene.dressing = \"unstructured\" must be one of structured, semi-structured";
        assert_eq!(said, bad);
    }
}
