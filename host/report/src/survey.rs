//! A surveyed scene: its facts, its picture and its document.

use std::path::Path;

use echoloop_closed_loop::checksum::Checksum;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::survey::{Survey, SurveyedPair};
use echoloop_closed_loop::dataset::{Overlaps, towns};
use echoloop_clouds::pose::{Pose, to_rows};
use echoloop_sim::picture::{Picture, draw};
use echoloop_sim::scene::Material;
use echoloop_sim::viewpoint::Split;
use serde_json::{Value, json};

use super::format::{fixed, grouped};
use super::picture::picture_png;

/// Pixels across of the still picture in a page.
pub const STILL_PX: usize = 960;

/// Pixels across of the picture whose checksum a picture has.
const SMALL_PX: usize = 96;

/// A town of a configuration, with the viewpoints of its pairs.
#[derive(Clone, Copy)]
pub struct SceneReport<'a> {
    /// The configuration.
    pub config: &'a RunConfig,
    /// The town and its pairs.
    pub survey: &'a Survey,
}

impl SceneReport<'_> {
    /// Still picture as PNG. Its `Source` has a checksum of the scene and one of a small picture of
    /// it: they tell that a picture is of this scene, drawn by this version.
    ///
    /// # Errors
    ///
    /// Errors of [`picture_png`].
    pub fn picture(&self, width: usize) -> Result<Vec<u8>, String> {
        let [scene, _] = self.survey.checksums();
        let small = Checksum::of(&[self.still(SMALL_PX).pixels.as_flattened()]);
        let source = format!("{scene} {small}");
        let entries = [("Title", &*self.survey.place.scene.name), ("Source", &*source)];
        picture_png(&self.still(width), &entries)
    }

    pub(super) fn still(&self, width: usize) -> Picture {
        let place = &self.survey.place;
        draw(&place.scene, &place.caster, [width, (width * 5).div_ceil(8)])
    }

    /// Names and values, as printed and at the head of the page.
    pub fn facts(&self) -> Vec<(String, String)> {
        let Self { config, survey } = self;
        let (low, high) = survey.place.scene.mesh.bounds().unwrap_or_default();
        let side = |k: usize| fixed(f64::from(high[k]) - f64::from(low[k]), 1);
        let count = |split: Split| survey.of_split(split).count();
        let (train, test) = (count(Split::Train), count(Split::Test));
        let overlap = |split: Split| {
            let Overlaps { overlap: [least, _, median, _, most], .. } = survey.overlaps(split);
            format!("{least:.2} to {most:.2}, median {median:.2}")
        };
        let [scene, pairs] = survey.checksums().map(|sum| sum.to_string());
        let town = survey.town.map(|town| {
            let all: Vec<String> = towns(config).iter().map(u64::to_string).collect();
            let all = all.join(", ");
            ("town", if survey.towns > 1 { format!("{town} of {all}") } else { town.to_string() })
        });
        let apart = survey.least_apart_m().map(|least_m| format!("{} m", fixed(least_m, 2)));
        let own = config.scanner.beams();
        let aimed = own.aimed(&config.lidar.0).ok();
        let facts = [
            Some(("scene", config.scene.source.clone())),
            town,
            Some(("triangles", grouped(survey.place.scene.mesh.triangles.len()))),
            Some(("extent", format!("{} × {} × {} m", side(0), side(1), side(2)))),
            aimed.map(|beams| ("beams", beams.pattern().to_string())),
            Some(("viewpoints", (2 * survey.pairs.len()).to_string())),
            Some(("pairs", format!("{train} training, {test} held-out"))),
            Some(("overlap, training", overlap(Split::Train))),
            Some(("overlap, held-out", overlap(Split::Test))),
            Some(("nearest training and held-out", apart.unwrap_or_else(|| "–".into()))),
            Some(("seed", config.seed.to_string())),
            Some(("checksum of the scene", scene)),
            Some(("checksum of the poses", pairs)),
        ];
        facts.into_iter().flatten().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// Document with every pair, and the files that were written.
    pub fn json(&self, page: Option<&Path>, picture: Option<&Path>) -> Value {
        let Self { config, survey } = self;
        let scene = &survey.place.scene;
        let [of_scene, of_poses] = survey.checksums().map(|sum| sum.to_string());
        let pair = |pair: &SurveyedPair| {
            let rows = |pose: &Pose| to_rows(pose).as_chunks::<4>().0.to_vec();
            let set = if pair.split == Split::Train { "train" } else { "test" };
            json!({
                "set": set, "number": pair.number,
                "viewpoints": pair.viewpoints, "baseline_m": pair.baseline_m(),
                "turn_deg": pair.turn_deg(), "overlap": pair.overlap,
                "nearest_other_m": survey.nearest_other_m(pair),
                "world_from_first": rows(&pair.world_from_sensor[0]),
                "world_from_second": rows(&pair.world_from_sensor[1]),
            })
        };
        json!({
            "format": 1, "scene": scene.name, "source": config.scene.source, "town": survey.town,
            "triangles": scene.mesh.triangles.len(),
            "bounds_m": scene.mesh.bounds().map(|(low, high)| [low, high]),
            "materials": materials(survey), "seed": config.seed,
            "scene_checksum": of_scene, "poses_checksum": of_poses,
            "least_apart_m": survey.least_apart_m(),
            "missing": survey.missing.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "page": page, "picture": picture,
            "pairs": survey.pairs.iter().map(pair).collect::<Vec<_>>(),
        })
    }
}

/// Materials of the scene's triangles.
fn materials(survey: &Survey) -> Vec<Value> {
    let scene = &survey.place.scene;
    let mut counts = vec![0_usize; scene.materials.len()];
    scene.mesh.materials.iter().for_each(|&material| counts[usize::from(material)] += 1);
    let listed = scene.materials.iter().zip(counts).filter(|(_, count)| *count > 0);
    let material = |(material, count): (&Material, usize)| {
        json!({
            "name": material.name, "reflectance_905nm": material.reflectance_905nm,
            "triangles": count,
        })
    };
    listed.map(material).collect()
}
