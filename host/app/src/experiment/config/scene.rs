//! `[scene]`: where to scan.

use echoloop_files::shown;
use echoloop_keys::{Must, Refused, section};
use echoloop_sim::import::{Ground, ImportOptions, Libraries, Plane};
use serde::{Deserialize, Serialize};

use super::error::RunConfigError;

section! {
    /// Where to scan.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct SceneConfig in "scene" {
        source: String, "", Must::Read("structured, semi-structured, unstructured, or a mesh"),
            "What is scanned: a kind of town that is generated, or a mesh: PLY or OBJ, metres, \
             z up.";
        towns: Vec<u64>, "", Must::count(1.0, 100.0, "seeds"),
            "Seeds of the generated towns; the pairs are shared out among them. There are no more \
             towns than `train_pairs` or `test_pairs`, whichever is less: the others are left out.";
        ground: String, "", Must::Read("auto, none, or a plane as a,b,c"),
            "Ground below a mesh: `auto` (fitted when the mesh has none), `none`, or the plane \
             z = a·x + b·y + c as `a,b,c`.";
        libraries: String, "", Must::Name(&["beside", "anywhere", "none"]),
            "Material libraries that an OBJ may name: `beside` (in its own folder and below), \
             `anywhere` or `none`.";
    }
}

impl Default for SceneConfig {
    fn default() -> Self {
        Self {
            source: "structured".into(),
            towns: vec![1, 2, 3],
            ground: "auto".into(),
            libraries: "beside".into(),
        }
    }
}

impl SceneConfig {
    /// How to read a mesh.
    ///
    /// # Errors
    ///
    /// [`RunConfigError`] names `scene.ground` or `scene.libraries`.
    pub fn import(&self) -> Result<ImportOptions, RunConfigError> {
        let usual = ImportOptions::default();
        Ok(ImportOptions {
            ground: self.ground(usual.max_reach_m)?,
            libraries: self.libraries()?,
            ..usual
        })
    }

    pub(super) fn check(&self) -> Result<(), RunConfigError> {
        self.import()?;
        Ok(self.check_keys()?)
    }

    fn ground(&self, max_reach_m: f32) -> Result<Ground, Refused> {
        let numbers = || -> Option<[f64; 3]> {
            let numbers = self.ground.split(',').map(|part| part.trim().parse().ok());
            numbers.collect::<Option<Vec<f64>>>()?.try_into().ok()
        };
        let [_, _, key, _] = Self::KEYS else { return Ok(Ground::Auto) };
        let refused = || {
            let expected = format!(
                "{} (z = a·x + b·y + c) with a and b within ±1 and c within ±{max_reach_m} m",
                key.must
            );
            key.refused(format_args!("{:?}", shown(&self.ground)), expected)
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
        let [.., key] = Self::KEYS else { return Ok(Libraries::None) };
        match &*self.libraries {
            "beside" => Ok(Libraries::Beside),
            "anywhere" => Ok(Libraries::Anywhere),
            "none" => Ok(Libraries::None),
            other => Err(key.refused(format_args!("{:?}", shown(other)), key.must)),
        }
    }
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
}
